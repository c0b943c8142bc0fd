#include "app/cli/report.h"

#include <algorithm>
#include <cmath>

namespace fluorocut::cli {

void Report::judge(const Acceptance& acceptance) {
    accepted = fluorocut::accepted(acceptance);
    json["accepted"] = accepted;
    json["limits"] = nlohmann::ordered_json::array();
    for (const Judgement& one : acceptance) {
        nlohmann::ordered_json limit = {{"what", one.what}, {"value", one.value}, {"unit", one.unit}};
        if (std::isfinite(one.least)) limit["least"] = one.least;
        if (std::isfinite(one.most)) limit["most"] = one.most;
        limit["accepted"] = one.accepted();
        json["limits"].push_back(limit);
        if (!one.accepted()) line("not accepted", one.sentence());
    }
    if (accepted) line("accepted", "all limits are met");
}

std::string Report::text() const {
    if (!raw.empty()) return raw;
    std::size_t width = 0;
    for (const auto& [label, ignored] : lines)
        width = std::max(width, label.size());
    std::string text;
    for (const auto& [label, value] : lines) {
        text += label + std::string(width + 2 - label.size(), ' ') + value + "\n";
    }
    return text;
}

}  // namespace fluorocut::cli
