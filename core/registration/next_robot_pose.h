// The next pose of the robot for a robot-corkscrew calibration: of those that are reachable and keep the corkscrew in
// view, the one that lowers the standard deviation of flange_from_corkscrew along its worst direction most.
//
// Candidates turn the flange about the corkscrew's middle, so that it stays where the imager sees it: every axis of a
// grid over the sphere, several angles up to the limit, from a reference pose (the last one taken). What an image will
// tell is foreseen from CorkscrewNoise, times the noise factor found so far; what the calibration knows is its joint
// covariance. Both are added as information; nothing is simulated.
//
// Millimetres and radians are compared as shares of the limits that the calibration is accepted by.
//
// Frames: robot, flange, corkscrew, imager. noSolution when no candidate keeps the corkscrew in view.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/registration/hand_eye.h"

namespace fluorocut {

struct NextPoseOptions {
    // The field, as seen from the source: the corkscrew's middle stays within this part of z of the axis. A C-arm of
    // 1000 mm and 512 pixels of 0.32 mm sees 0.082; a corkscrew of 100 mm at 700 mm takes 0.07 of it when it lies
    // across.
    double most_off_axis = 0.05;
    double most_roll_rad = 1.0471975511965976;  // 60 degrees
    double most_turn_rad = 0.6981317007977318;  // of the flange, from the reference: 40 degrees
    double most_travel_mm = 400;                // of the flange, from the reference
    CorkscrewNoise foreseen;
    std::vector<Rigid3> candidates;  // robot_from_flange; empty: made as above

    Result<void> validate() const;
};

struct NextPose {
    Rigid3 robot_from_flange;
    Rigid3 imager_from_corkscrew;  // as it will be seen
    std::string imager;            // position of the C-arm
    // Standard deviations of flange_from_corkscrew along the worst directions, now and as foreseen.
    double place_before_mm = std::numeric_limits<double>::quiet_NaN();
    double place_after_mm = std::numeric_limits<double>::quiet_NaN();
    double rotation_before_rad = std::numeric_limits<double>::quiet_NaN();
    double rotation_after_rad = std::numeric_limits<double>::quiet_NaN();
    std::string sentence;
};

// `reference`: robot_from_flange that the candidates start from; `imager`: index into calibration.imagers of the
// position the C-arm is in.
Result<NextPose> suggestNextPose(const HandEyeCalibration& calibration, const Rigid3& reference, std::size_t imager,
                                 const HandEyeOptions& calibrated_with = {}, const NextPoseOptions& options = {});

}  // namespace fluorocut
