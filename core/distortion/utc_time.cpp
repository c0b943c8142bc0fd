#include "core/distortion/utc_time.h"

#include <chrono>

namespace fluorocut {

std::optional<double> daysFromUtc(std::string_view text) {
    constexpr std::string_view kForm = "dddd-dd-ddTdd:dd:ddZ";
    if (text.size() != kForm.size()) return {};
    for (std::size_t i = 0; i < text.size(); ++i) {
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
    return std::chrono::sys_days(date).time_since_epoch().count() + ((hour * 60.0 + minute) * 60 + second) / 86400;
}

}  // namespace fluorocut
