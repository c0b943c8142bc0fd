// The median of some numbers: of an even number of them the larger of the two in the middle. None: NaN.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace fluorocut {

template <class Number>
Number median(std::vector<Number> values) {
    if (values.empty()) return std::numeric_limits<Number>::quiet_NaN();
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace fluorocut
