// A whole operation on a table top: an acrylic block with beads, a C-arm, a robot that truly cuts it, all simulated,
// and the setup that a technician would write down for it. The truth stays in here.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/casestore/case_store.h"
#include "core/procedure/procedure.h"
#include "core/robot/adaptors/simulated_robot.h"
#include "core/simulation/virtual_operating_room.h"

namespace fluorocut::test {

struct RigOptions {
    std::uint64_t seed = 1;
    std::vector<double> insets_mm{1.5, 0};
    // Standard deviations, per axis, of how the corkscrew is mounted against what hand-eye calibration says.
    double mount_mm = 0.3, mount_rad = 0.004;
    bool honest_mount = true;  // otherwise calibration claims a hundredth of it
    int pixels = 420;
};

class Rig : public ImageSource {
  public:
    explicit Rig(const RigOptions& options = {});

    const ProcedureSetup& setup() const { return setup_; }
    ProcedureEquipment equipment() { return {this, supervisor_.get()}; }
    SimulatedRobot& robot() { return *robot_; }
    Supervisor& supervisor() { return *supervisor_; }
    // A new robot where the old one stood, as after a restart of everything.
    void restart();

    // Where the cavity of the last cut truly lies in the femur: as commanded, and as the robot truly went.
    Rigid3 trueFemurFromRobot() const { return femur_from_robot_; }

    // ImageSource
    std::string name() const override { return "rig"; }
    ImageSourceCapabilities capabilities() const override { return {.moves = true, .frames = 0}; }
    Result<AcquiredImage> acquire(const ImageRequest& request, Progress& progress) override;

    int images_taken = 0;
    bool repeat_last = false;     // hands out the last picture again
    bool exchange_views = false;  // the pictures of the views, the other way round

  private:
    void makeRoom();
    void cutWhatWasPassed();

    RigOptions options_;
    ProcedureSetup setup_;
    Volume block_;  // as it is now
    OperatingRoomOptions room_options_;
    std::optional<VirtualOperatingRoom> room_;
    Rigid3 room_from_robot_, femur_from_robot_, robot_from_corkscrew_;
    SimulatedRobot* robot_ = nullptr;
    std::unique_ptr<Supervisor> supervisor_;
    std::vector<Rigid3> passed_;  // true robot_from_cutter
    std::optional<AcquiredImage> last_;
};

// A new case in a folder.
CaseStore newCase(const std::filesystem::path& file);
CaseStore openCase(const std::filesystem::path& file);

}  // namespace fluorocut::test
