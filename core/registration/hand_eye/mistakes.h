// Poses of robot and corkscrew that do not go together, and the simple mistakes that explain it.
#pragma once

#include <vector>

#include "core/registration/hand_eye/problem.h"

namespace fluorocut::hand_eye {

// The answer does not explain most of the images.
bool contradictory(const Fit& fit);

// Tries what people get wrong: inverted poses, another unit, another order. invalidInput when one explains the images,
// else noSolution.
Error explainContradiction(const std::vector<HandEyeObservation>& observations, const HandEyeOptions& options,
                           const Fit& fit);

}  // namespace fluorocut::hand_eye
