// The start of a robot-corkscrew calibration: A X = X B in closed form (hand_eye.h), and what the motions leave open.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

struct HandEyeMotion {
    Rigid3 flange_i_from_flange_j;        // A
    Rigid3 corkscrew_i_from_corkscrew_j;  // B
};

// A X = X B over all motions; nothing when they leave its rotation open.
std::optional<Rigid3> solveHandEye(const std::vector<HandEyeMotion>& motions);

// Turns of the flange between poses of one position of the C-arm.
struct MotionSpread {
    std::size_t motions = 0;
    double turn_rad = 0;                   // rms angle
    double second_turn_rad = 0;            // rms of the part that turns about anything but the main axis
    Vector3 main_axis = Vector3::UnitZ();  // in the flange
};
MotionSpread spreadOf(const std::vector<HandEyeMotion>& motions);

// noSolution, in words, when the motions do not determine the answer.
Result<void> requireSpread(const MotionSpread& spread, std::size_t poses, std::size_t positions, double least_turn_rad);

// "the flange's z axis", "the direction (0.48, 0.62, -0.62) of the flange"
std::string axisInWords(const Vector3& axis, const char* frame);

}  // namespace fluorocut
