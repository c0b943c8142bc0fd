// The default robot: a cutter in a box, in simulated time. Nothing happens but in `advance`, which runs the robot's
// own control cycles, so a procedure of ten minutes takes a fraction of a second, the same on every machine.
//
// Error. The cutter stands at
//
//     robot_from_cutter_true = believed perturbed by calibration(place) + tremble(time)
//
//  calibration  the same whenever the cutter comes to the same place: of every component three plane waves through the
//               workspace, 200 to 600 mm long, with seeded phases. What a registration with this robot can take out.
//  tremble      first-order Markov noise of 20 ms. The encoders see it, and nothing of the calibration's error.
//
// Root mean square over places, times and seeds: sqrt(calibration^2 + tremble^2) = 20 um, 0.01 degree.
//
// Motion: trapezoids of speed (motion_profile.h); holding brakes along the path with the same acceleration. Disabling
// and faults put the brakes on at once.
//
// Force: `force_per_rate` times what the cutter removes in unit time (bite x feed), through a first-order filter of
// `force_time_s`, as sensors have and as material that comes in voxels needs. What it removes it asks of its
// surroundings, which never learn what the robot believes, only where the cutter truly goes. More than `most_force_n`
// is a fault.
//
// Watches, in every control cycle, on the robot's side. Heartbeats that stay away for `watchdog_s` and the bone's
// displacement, rotation or disappearance pause the motion. From the last heartbeat to rest it takes at most
//
//     watchdog + two cycles + feed / acceleration <= 50 ms,
//
// which the options are held to.
//
// Frames `robot` and `cutter`; mm, s, rad, N.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>

#include "core/base/random.h"
#include "core/robot/motion_profile.h"
#include "core/robot/robot_adaptor.h"

namespace fluorocut {

struct SimulatedRobotOptions {
    std::uint64_t seed = 1;
    Vector3 workspace_low_mm{-300, -300, -300}, workspace_high_mm{300, 300, 300};
    double most_feed_mm_s = 60;
    double acceleration_mm_s2 = 3000;
    double lever_mm = 100;  // by which turns count as ways (motion_profile.h)
    double cycle_s = 0.002;
    int cycles_per_feedback = 2;
    double watchdog_s = 0.025;

    double calibration_mm = 0.016, calibration_rad = 1.4e-4;  // root mean square of the error's length
    double tremble_mm = 0.012, tremble_rad = 1.05e-4;

    double force_per_rate = 0.5;  // N per mm^3/s
    double force_time_s = 0.02;
    double most_force_n = 80;

    double most_bone_mm = 0.3, most_bone_rad = 0.0035;
    Vector3 bone_point_mm = Vector3::Zero();  // whose displacement counts, in `robot`
    double bone_noise_mm = 0.01;              // of the monitor, per axis

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

// What the cutter is among: removes what it passes through on its true way and returns the volume, mm^3.
using RobotSurroundings =
    std::function<double(const Rigid3& robot_from_cutter_before, const Rigid3& robot_from_cutter)>;

class SimulatedRobot : public RobotAdaptor {
  public:
    // Options that are not valid throw std::logic_error. No surroundings: air.
    explicit SimulatedRobot(const SimulatedRobotOptions& options = {}, RobotSurroundings surroundings = {});

    std::string name() const override { return "simulated"; }
    RobotState state() const override { return heard_; }
    Result<void> connect() override;
    Result<void> disconnect() override;
    Result<void> enable() override;
    Result<void> disable() override;
    Result<void> execute(const CheckedMotion& motion) override;
    Result<void> hold() override;
    Result<void> resume() override;
    Result<void> stop() override;
    Result<void> acknowledgeFault() override;
    Result<void> setBoneReference() override;
    void heartbeat() override;
    std::vector<RobotFeedback> takeFeedback() override;
    void advance(double seconds) override;

    // What may go wrong in an operating room.
    void setLink(bool up);
    void moveBone(const Rigid3& robot_moved_from_robot);  // after what moved it before
    void setBoneSeen(bool seen) { bone_seen_ = seen; }
    void break_(const std::string& reason);  // a fault of the robot's own

    // The truth, for tests and reports of error: nothing that estimates may ask for it.
    const Rigid3& trueRobotFromCutter() const { return true_pose_; }
    RobotState trueState() const { return machine_.state(); }
    double trueSpeed() const { return speed_mm_s_; }
    Vector6 calibrationErrorAt(const Vector3& place_mm) const;

  private:
    struct Wave {
        Vector3 per_mm;
        double phase;
    };

    Result<void> command(RobotEvent event);
    Result<void> requireLink(RobotEvent event) const;
    std::string whyNoMotion() const;
    void pause(const std::string& reason);
    void fail(const std::string& reason);
    void brakeAtOnce();
    void cycle();
    void move();
    void tremble();
    void watch();
    void hear();
    double now() const { return static_cast<double>(cycles_) * options_.cycle_s; }
    Rigid3 believed() const;

    SimulatedRobotOptions options_;
    RobotSurroundings surroundings_;
    Random random_;
    std::array<std::array<Wave, 3>, 6> waves_;
    RobotStateMachine machine_;
    RobotState heard_ = RobotState::disconnected;
    std::string reason_;
    bool link_ = true;

    std::uint64_t cycles_ = 0;
    double left_over_s_ = 0;
    std::optional<double> last_heartbeat_s_;

    Rigid3 commanded_, true_pose_;
    Vector6 tremble_ = Vector6::Zero();
    std::optional<CheckedMotion> motion_;
    std::optional<MotionTrack> track_;
    std::optional<SpeedProfile> profile_;
    double profile_start_s_ = 0;
    double along_mm_ = 0, speed_mm_s_ = 0, force_n_ = 0;

    Rigid3 bone_, bone_reference_;
    bool bone_seen_ = true;
    double bone_displacement_mm_ = 0, bone_rotation_rad_ = 0;

    std::deque<RobotFeedback> feedback_;
};

}  // namespace fluorocut
