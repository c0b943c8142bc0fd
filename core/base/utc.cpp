#include "core/base/utc.h"

#include <chrono>
#include <limits>

namespace fluorocut {

std::optional<double> daysFromUtc(std::string_view text) {
    constexpr std::string_view kForm = "dddd-dd-ddTdd:dd:dd";
    if (text.size() < kForm.size() + 1 || text.back() != 'Z') return {};
    const std::string_view fraction = text.substr(kForm.size(), text.size() - kForm.size() - 1);
    if (!fraction.empty() && (fraction.front() != '.' || fraction.size() < 2 || fraction.size() > 10)) return {};
    double part_s = 0, unit_s = 1;
    for (const char digit : fraction.substr(fraction.empty() ? 0 : 1)) {
        if (digit < '0' || digit > '9') return {};
        part_s += (unit_s /= 10) * (digit - '0');
    }
    for (std::size_t i = 0; i < kForm.size(); ++i) {
        if (kForm[i] == 'd' ? text[i] < '0' || text[i] > '9' : text[i] != kForm[i]) return {};
    }
    const auto number = [&](std::size_t first, std::size_t count) {
        int value = 0;
        for (const char digit : text.substr(first, count))
            value = 10 * value + (digit - '0');
        return value;
    };
    const std::chrono::year_month_day date{std::chrono::year(number(0, 4)),
                                           std::chrono::month(static_cast<unsigned>(number(5, 2))),
                                           std::chrono::day(static_cast<unsigned>(number(8, 2)))};
    const int hour = number(11, 2), minute = number(14, 2), second = number(17, 2);
    if (!date.ok() || hour > 23 || minute > 59 || second > 60) return {};  // 60: a leap second
    return std::chrono::sys_days(date).time_since_epoch().count() +
           ((hour * 60.0 + minute) * 60 + second + part_s) / 86400;
}

double secondsBetween(std::string_view from_utc, std::string_view to_utc) {
    const std::optional<double> from = daysFromUtc(from_utc), to = daysFromUtc(to_utc);
    if (!from || !to) return std::numeric_limits<double>::quiet_NaN();
    return (*to - *from) * 86400;
}

}  // namespace fluorocut
