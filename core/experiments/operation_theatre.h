// Where things are in a simulated operation: the room's options, how the robot stands while pictures are taken, where
// the corkscrew sits on it. What is nominal was planned and is known to everybody; what is true is drawn from the
// scenario's seed and known to nobody but the simulation.
//
// The robot's base frame is planned so that in the pose for pictures the cutter's frame has the robot's axes, spindle
// along the planned cavity's axis. The corkscrew takes the cutter's place in the spindle then: its middle lies on the
// cavity's axis, `above_mm` above the top, its shaft across the axis, as square to all views as can be.
//
// Frames as in core/geometry/frames.h and core/imaging/carm_position.h; mm, rad.
#pragma once

#include "core/experiments/planned_operation.h"
#include "core/experiments/scenario.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/robot/adaptors/simulated_robot.h"
#include "core/simulation/virtual_operating_room.h"

namespace fluorocut {

struct OperationTheatre {
    OperatingRoomOptions room;
    SimulatedRobotOptions robot;
    CorkscrewLayout layout;

    Rigid3 flange_from_cutter;             // exact, as robots are made
    Rigid3 flange_from_corkscrew_nominal;  // as it was designed
    Rigid3 flange_from_corkscrew_mounted;  // true, when it is calibrated
    Rigid3 flange_from_corkscrew;          // true, after the knock
    Rigid3 robot_from_cutter_imaging;      // where the robot begins
};

// The streams that a scenario's seed is divided into.
enum class ScenarioStream : std::uint64_t { beads = 1, mount, knock, calibration, robot, room };
Random streamOf(const Scenario& scenario, ScenarioStream stream);

Result<OperationTheatre> theatreOf(const Scenario& scenario, const PlannedOperation& plan);

}  // namespace fluorocut
