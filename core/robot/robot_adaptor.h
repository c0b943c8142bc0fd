// RobotAdaptor: whatever holds the cutter. A robot that is not simulated has its controller, with its own watchdog;
// the adaptor speaks to it and keeps nothing moving of its own accord.
//
// What every adaptor must keep (tests/core/robot/robot_contract_test.cpp asks it of all):
//  * states and commands as in robot_state.h; a refused command changes nothing and says why in one sentence;
//  * it executes only a CheckedMotion, whole within its workspace and feeds, that begins where the cutter stands;
//  * feedback comes at least 100 times a second while connected;
//  * the robot's own side pauses within 50 ms when heartbeats stay away, be it the link or a client that hangs. It
//  stays
//    paused until it is told to resume, which it refuses while what made it pause persists;
//  * the same when the bone moves, or is not seen, by more than its limits;
//  * no exception leaves it but std::logic_error for a broken contract.
//
// To write a new one: one file pair in core/robot/adaptors/, and one line in core/robot/robot_registry.cpp.
//
// mm, s, rad, N; frames `robot` and `cutter`.
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"
#include "core/robot/checked_motion.h"
#include "core/robot/robot_state.h"

namespace fluorocut {

struct RobotFeedback {
    double time_s = std::numeric_limits<double>::quiet_NaN();  // of the robot's clock
    RobotState state = RobotState::disconnected;
    Rigid3 robot_from_cutter;  // as the robot's own encoders have it
    double speed_mm_s = std::numeric_limits<double>::quiet_NaN();
    double force_n = std::numeric_limits<double>::quiet_NaN();
    double done = std::numeric_limits<double>::quiet_NaN();  // of the motion's length, 0 to 1
    // Of the bone since its reference was set; NaN: not seen.
    double bone_displacement_mm = std::numeric_limits<double>::quiet_NaN();
    double bone_rotation_rad = std::numeric_limits<double>::quiet_NaN();
    std::string reason;  // of a pause or a fault, for people
};

class RobotAdaptor {
  public:
    virtual ~RobotAdaptor() = default;

    virtual std::string name() const = 0;
    // As the client last heard of it.
    virtual RobotState state() const = 0;

    virtual Result<void> connect() = 0;
    virtual Result<void> disconnect() = 0;
    virtual Result<void> enable() = 0;
    virtual Result<void> disable() = 0;  // drives off, brakes on
    virtual Result<void> execute(const CheckedMotion& motion) = 0;
    virtual Result<void> hold() = 0;    // comes to rest on its path
    virtual Result<void> resume() = 0;  // from there
    virtual Result<void> stop() = 0;    // comes to rest, and the rest of the motion is forgotten
    virtual Result<void> acknowledgeFault() = 0;

    // The bone is now where the registration has it. Refused while a motion is under way.
    virtual Result<void> setBoneReference() = 0;

    // The client lives: to be sent at least every 10 ms, by whoever could notice that something is wrong; never by a
    // thread that only does this.
    virtual void heartbeat() = 0;

    // What came since the last call, oldest first.
    virtual std::vector<RobotFeedback> takeFeedback() = 0;

    // Lets time pass: a real robot's adaptor waits, a simulated one goes on by as much.
    virtual void advance(double seconds) = 0;
};

}  // namespace fluorocut
