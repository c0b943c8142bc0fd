#include "core/base/option_checks.h"

#include <fmt/format.h>

namespace fluorocut {

Result<void> requireRange(const char* field, double value, double low, double high, const char* unit) {
    if (value >= low && value <= high) return {};
    return invalidOption(field, fmt::format("{}", value),
                         fmt::format("{} to {}{}{}", low, high, *unit ? " " : "", unit));
}

Result<void> requireRanges(std::initializer_list<OptionRange> ranges) {
    for (const OptionRange& range : ranges) {
        if (auto ok = requireRange(range.field, range.value, range.low, range.high, range.unit); !ok) return ok;
    }
    return {};
}

}  // namespace fluorocut
