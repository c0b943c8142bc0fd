#include "core/imaging/patient_direction.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace fluorocut {

std::string patientDirection(const Vector3& direction) {
    const double length = direction.norm();
    if (!(length > 0 && std::isfinite(length))) return {};
    std::array<int, 3> order{0, 1, 2};
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return std::abs(direction[a]) > std::abs(direction[b]); });
    constexpr const char* kLetters = "LPHRAF";  // along +x, +y, +z and against them
    const auto letter = [&](int axis) { return kLetters[direction[axis] > 0 ? axis : axis + 3]; };
    std::string letters(1, letter(order[0]));
    const double lean = std::sin(std::numbers::pi / 8);
    if (std::abs(direction[order[1]]) > lean * length) letters += letter(order[1]);
    return letters;
}

}  // namespace fluorocut
