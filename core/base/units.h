// Inside core: mm, radians, doubles. Degrees exist in files and on screens only; these two functions are the border.
#pragma once

#include <numbers>

namespace fluorocut {

constexpr double radiansFromDegrees(double degrees) {
    return degrees * (std::numbers::pi / 180.0);
}

constexpr double degreesFromRadians(double radians) {
    return radians * (180.0 / std::numbers::pi);
}

}  // namespace fluorocut
