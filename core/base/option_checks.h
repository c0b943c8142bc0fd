// Checks of options: the sentence names the field, the value and the limits. Written so that NaN fails.
#pragma once

#include <initializer_list>

#include "core/base/result.h"

namespace fluorocut {

// "blur_px: found -1, expected 0 to 100 px."
Result<void> requireRange(const char* field, double value, double low, double high, const char* unit);

struct OptionRange {
    const char* field;
    double value;
    double low;
    double high;
    const char* unit;  // "" for a pure number
};

// The first that fails.
Result<void> requireRanges(std::initializer_list<OptionRange> ranges);

}  // namespace fluorocut
