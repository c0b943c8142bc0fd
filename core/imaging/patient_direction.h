// Which way of the patient a direction of an image runs: the letters at the borders of every X-ray.
#pragma once

#include <string>

#include "core/geometry/rigid3.h"

namespace fluorocut {

// R, L, A, P, H or F for a direction in `femur` (LPS: x to the left, y to the back, z to the head), of any length; a
// second letter ("LA") when the direction leans that way by more than 22.5 degrees. A third is never given. Empty for
// a direction that is not finite or zero.
std::string patientDirection(const Vector3& direction);

}  // namespace fluorocut
