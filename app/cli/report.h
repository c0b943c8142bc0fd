// What a command has to say when it is done: one JSON object for programs, a few aligned lines for people.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/base/acceptance.h"

namespace fluorocut::cli {

struct Report {
    nlohmann::ordered_json json = nlohmann::ordered_json::object();
    std::vector<std::pair<std::string, std::string>> lines;  // label, text with its unit
    std::string raw;       // printed as it is, instead of the lines: a table for other programs
    bool accepted = true;  // false: done, but an acceptance limit failed (exit code 1)

    // Every limit into both, and the verdict.
    void judge(const Acceptance& acceptance);
    void line(std::string label, std::string text) { lines.emplace_back(std::move(label), std::move(text)); }
    // The labels in one column, the texts in the next.
    std::string text() const;
};

}  // namespace fluorocut::cli
