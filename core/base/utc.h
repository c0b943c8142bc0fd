// Points in time as files hold them: ISO 8601 in UTC, to the second or with a fraction of it:
// "2026-03-01T09:30:00Z", "2026-03-01T09:30:00.125Z".
#pragma once

#include <optional>
#include <string_view>

namespace fluorocut {

// Days since 1970, with their fraction. Nothing for another form or a date that does not exist.
std::optional<double> daysFromUtc(std::string_view text);

// Seconds from one to another, negative when it is earlier; NaN when either is no such text. To a microsecond.
double secondsBetween(std::string_view from_utc, std::string_view to_utc);

}  // namespace fluorocut
