#include "core/base/acceptance.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace fluorocut {

std::string Judgement::sentence() const {
    const std::string space = unit.empty() ? "" : " ";
    const bool has_least = std::isfinite(least);
    const double limit = has_least && !(value >= least) ? least : std::isfinite(most) ? most : least;
    const std::string measured = fmt::format("{} {:.3g}{}{}", what, value, space, unit);
    const std::string bound = fmt::format("{:.3g}{}{}", limit, space, unit);
    if (accepted()) return fmt::format("{}, limit {}", measured, bound);
    if (std::isnan(value)) return fmt::format("{} was not measured, limit {}", what, bound);
    return fmt::format("{} is {} the limit of {}", measured, value < limit ? "under" : "over", bound);
}

Judgement atMost(std::string what, double value, double limit, std::string unit) {
    return {std::move(what), value, -std::numeric_limits<double>::infinity(), limit, std::move(unit)};
}

Judgement atLeast(std::string what, double value, double limit, std::string unit) {
    return {std::move(what), value, limit, std::numeric_limits<double>::infinity(), std::move(unit)};
}

bool accepted(const Acceptance& acceptance) {
    return !acceptance.empty() &&
           std::all_of(acceptance.begin(), acceptance.end(), [](const Judgement& one) { return one.accepted(); });
}

}  // namespace fluorocut
