#include "core/cutting/tool_path_file.h"

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/io/atomic_file.h"
#include "core/io/json_file.h"

namespace fluorocut {
namespace {

constexpr std::string_view kSchema = "fluorocut/tool-path/1";
const std::vector<std::string_view> kMotions{"rapid", "entry", "cut", "retract"};  // as in ToolMotion

nlohmann::ordered_json list(const Vector3& v) {
    return {v.x(), v.y(), v.z()};
}

nlohmann::ordered_json orNull(double value) {
    return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

}  // namespace

Result<void> writeToolPath(const std::filesystem::path& file, const ToolPath& path) {
    nlohmann::ordered_json head;
    head["schema"] = kSchema;
    head["frame"] = "cavity";
    head["cutter"] = {{"radius_mm", path.cutter.radius_mm}, {"length_mm", path.cutter.length_mm}};
    head["most_cusp_mm"] = orNull(path.most_cusp_mm);
    head["layers"] = path.layers;
    head["cutting_mm"] = orNull(path.cutting_mm);
    head["time_s"] = orNull(path.time_s);
    head["unreached"] = orNull(path.unreached);
    head["warnings"] = path.warnings;
    // A line for each move.
    std::string text = head.dump();
    text.back() = ',';
    text += "\n\"moves\": [";
    for (std::size_t i = 0; i < path.moves.size(); ++i) {
        const ToolMove& move = path.moves[i];
        nlohmann::ordered_json line;
        line["motion"] = kMotions[static_cast<std::size_t>(move.motion)];
        line["from_mm"] = list(move.segment.from_mm);
        line["to_mm"] = list(move.segment.to_mm);
        line["spindle"] = list(move.segment.spindle);
        line["feed_mm_s"] = move.feed_mm_s;
        text += (i ? ",\n" : "\n") + line.dump();
    }
    text += "\n]}\n";
    return writeWhole(file, text);
}

Result<ToolPath> readToolPath(const std::filesystem::path& path) {
    Result<JsonObject> file = readJson(path, kSchema);
    if (!file) return file.error();
    ToolPath result;
    file->choice("frame", {"cavity"});
    JsonObject cutter = file->object("cutter");
    result.cutter.radius_mm = cutter.number("radius_mm", 0.1, 50);
    result.cutter.length_mm = cutter.number("length_mm", 0.1, 1000);
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    result.most_cusp_mm = file->numberOr("most_cusp_mm", kNaN);
    result.layers = file->integer("layers", 0);
    result.cutting_mm = file->numberOr("cutting_mm", kNaN);
    result.time_s = file->numberOr("time_s", kNaN);
    result.unreached = file->numberOr("unreached", kNaN);
    result.warnings = file->texts("warnings");
    double cutting = 0, time = 0;
    for (JsonObject line : file->objects("moves")) {
        ToolMove move;
        move.motion = static_cast<ToolMotion>(line.choice("motion", kMotions));
        move.segment.from_mm = line.vector<3>("from_mm");
        move.segment.to_mm = line.vector<3>("to_mm");
        move.segment.spindle = line.vector<3>("spindle");
        move.feed_mm_s = line.number("feed_mm_s");
        if (line.failed()) break;
        if (!(std::abs(move.segment.spindle.norm() - 1) <= 1e-6)) {
            line.fail("spindle", fmt::format("a vector of length {:g}", move.segment.spindle.norm()), "a unit vector");
        }
        if (!(move.feed_mm_s > 0)) line.fail("feed_mm_s", fmt::format("{:g}", move.feed_mm_s), "more than 0 mm/s");
        const double length = (move.segment.to_mm - move.segment.from_mm).norm();
        cutting += move.motion == ToolMotion::cut ? length : 0;
        time += length / move.feed_mm_s;
        result.moves.push_back(move);
    }
    const auto compare = [&](std::string_view field, double told, double found) {
        if (file->failed() || std::isnan(told) || std::abs(told - found) <= 1e-6 * (1 + std::abs(found))) return;
        file->fail(field, fmt::format("{:g}", told), fmt::format("{:g}, as its moves add up to", found),
                   "Moves were lost or changed; write the file anew.");
    };
    compare("cutting_mm", result.cutting_mm, cutting);
    compare("time_s", result.time_s, time);
    if (Result<void> read = file->finish(); !read) return read.error();
    if (Result<void> ok = result.cutter.validate(); !ok)
        return invalidInput(path.string(), ok.error().found, ok.error().expected);
    return result;
}

}  // namespace fluorocut
