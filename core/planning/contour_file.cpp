#include "core/planning/contour_file.h"

#include <fmt/format.h>

#include "core/io/json_file.h"

namespace fluorocut {

Result<std::vector<DrawnWall>> readContours(const std::filesystem::path& path) {
    Result<JsonObject> file = readJson(path, "fluorocut/contours/1");
    if (!file) return file.error();
    std::vector<DrawnWall> walls;
    for (JsonObject entry : file->objects("walls")) {
        DrawnWall wall;
        wall.side = static_cast<WallSide>(entry.choice("side", {"medial", "lateral", "anterior", "posterior"}));
        wall.outer = entry.choice("surface", {"canal", "outer"}) == 1;
        const std::vector<double> u = entry.numbers("u_px"), v = entry.numbers("v_px");
        if (!entry.failed() && (u.size() != v.size() || u.size() < 2))
            entry.fail("v_px", fmt::format("{} and {} numbers", u.size(), v.size()),
                       "as many as u_px, and at least two");
        for (std::size_t i = 0; i < std::min(u.size(), v.size()); ++i)
            wall.pixels.emplace_back(u[i], v[i]);
        walls.push_back(std::move(wall));
    }
    if (!file->failed() && walls.empty()) file->fail("walls", "none", "both walls of the canal");
    if (auto read = file->finish(); !read) return read.error();
    return walls;
}

}  // namespace fluorocut
