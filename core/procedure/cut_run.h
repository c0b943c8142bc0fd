// A checked motion, run through the supervisor from beginning to end, or to where something spoke against it.
//
// The supervisor is asked again at every heartbeat, kHeartbeat_s apart; ages grow with the robot's time. Cancelling
// holds the robot within one of them. However the run ends, the robot is not left moving, and a motion that was not
// finished is forgotten: nothing resumes.
//
// noSolution: the supervisor's or the robot's reasons, a pause of the robot's own (the bone moved, no heartbeat came
// through), a fault, silence.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/robot/supervisor.h"

namespace fluorocut {

inline constexpr double kHeartbeat_s = 0.006;

struct CutSample {
    double time_s = 0;  // since the motion began
    Rigid3 robot_from_cutter;
    double force_n = 0;
};

struct CutRun {
    double time_s = std::numeric_limits<double>::quiet_NaN();
    double length_mm = std::numeric_limits<double>::quiet_NaN();
    double greatest_force_n = std::numeric_limits<double>::quiet_NaN();
    // Of the bone since its reference, while the cutter moved: root mean square, and most.
    double bone_rms_mm = std::numeric_limits<double>::quiet_NaN(), bone_most_mm = bone_rms_mm;
    double bone_rms_rad = std::numeric_limits<double>::quiet_NaN();
    double done = 0;  // share of the motion
    std::vector<CutSample> trace;
};

// Where the robot's encoders have the cutter now. Connects a robot that is disconnected.
Result<RobotFeedback> whereItStands(Supervisor& robot);

// Puts what it knows into `run` also when it fails.
Result<void> runCut(Supervisor& robot, MotionRequest request, CutRun& run, Progress& progress = Progress::none());

}  // namespace fluorocut
