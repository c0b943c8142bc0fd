#include "app/cli/report.h"

#include <algorithm>

namespace fluorocut::cli {

std::string Report::text() const {
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
