#include "app/cli/point_table.h"

#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <string>

#include <fmt/format.h>

namespace fluorocut::cli {
namespace {

constexpr std::string_view kBetween = ",; \t\r";

std::optional<Vector2> pointOf(std::string_view line) {
    Vector2 point;
    for (int axis = 0; axis < 2; ++axis) {
        const std::size_t start = line.find_first_not_of(kBetween);
        if (start == std::string_view::npos) return std::nullopt;
        line.remove_prefix(start);
        const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), point[axis]);
        if (error != std::errc() || !std::isfinite(point[axis])) return std::nullopt;
        line.remove_prefix(static_cast<std::size_t>(end - line.data()));
        if (!line.empty() && kBetween.find(line.front()) == std::string_view::npos) return std::nullopt;
    }
    return point;
}

}  // namespace

Result<std::vector<Vector2>> readPointTable(const std::filesystem::path& path) {
    std::ifstream stream(path);
    if (!stream || std::filesystem::is_directory(path))
        return invalidInput(path.string(), "no such file", "a table of points, two numbers a row");
    std::vector<Vector2> points;
    std::string line;
    bool header_allowed = true;
    for (int number = 1; std::getline(stream, line); ++number) {
        if (number == 1 && line.starts_with("\xef\xbb\xbf")) line.erase(0, 3);  // UTF-8's mark, as some programs write
        const std::size_t start = line.find_first_not_of(kBetween);
        if (start == std::string::npos || line[start] == '#') continue;
        if (const auto point = pointOf(line)) {
            points.push_back(*point);
        } else if (!header_allowed || std::string_view("+-.0123456789").find(line[start]) != std::string_view::npos) {
            return invalidInput(fmt::format("{}, line {}", path.string(), number), fmt::format("\"{:.60}\"", line),
                                "two numbers, as 255.5,255.5");
        }
        header_allowed = false;
    }
    if (points.empty()) return invalidInput(path.string(), "no points", "a table of points, two numbers a row");
    return points;
}

}  // namespace fluorocut::cli
