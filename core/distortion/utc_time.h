// Points in time as files hold them: ISO 8601 in UTC to the second, "2026-03-01T09:30:00Z".
#pragma once

#include <optional>
#include <string_view>

namespace fluorocut {

// Days since 1970, with their fraction. Nothing for another form or a date that does not exist.
std::optional<double> daysFromUtc(std::string_view text);

}  // namespace fluorocut
