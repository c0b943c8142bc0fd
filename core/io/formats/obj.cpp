// Wavefront OBJ: "v x y z" and "f a b c ..." with "vertex/texture/normal" corners, counted from 1, or backwards from
// the last vertex when negative. Everything else (materials, groups, normals, curves) is passed over.
#include <fmt/format.h>

#include "core/io/formats/mesh_formats.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

Result<RawMesh> parseObj(const std::filesystem::path& path, std::string_view content) {
    RawMesh raw;
    raw.format = "OBJ";
    int line_number = 0;
    bool polygons = false;
    std::vector<std::int32_t> corners;
    while (!content.empty()) {
        const std::size_t end = std::min(content.find('\n'), content.size());
        std::string_view line = content.substr(0, end);
        content.remove_prefix(std::min(end + 1, content.size()));
        ++line_number;
        const auto wrong = [&](std::string_view found, std::string expected) {
            return invalidInput(fmt::format("{}, line {}", path.string(), line_number), shown(found),
                                std::move(expected), "the file is damaged; export it again");
        };
        line = trimmed(line.substr(0, line.find('#')));
        if (!(line.starts_with("v ") || line.starts_with("v\t") || line.starts_with("f ") || line.starts_with("f\t"))) {
            continue;
        }
        if (line.ends_with('\\')) return wrong(line, "a line that is not continued on the next");
        const std::vector<std::string_view> parts = words(line);
        if (parts[0] == "v") {
            Vector3 point;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                if (parts.size() < 4 || !parseNumber(parts[axis + 1], point[static_cast<Eigen::Index>(axis)])) {
                    return wrong(line, "v and three finite coordinates");
                }
            }
            raw.mesh.vertices.push_back(point);
            continue;
        }
        corners.clear();
        for (std::size_t i = 1; i < parts.size(); ++i) {
            std::int64_t index = 0;
            if (!parseInteger(parts[i].substr(0, parts[i].find('/')), index)) return wrong(parts[i], "a vertex number");
            const auto count = static_cast<std::int64_t>(raw.mesh.vertices.size());
            const std::int64_t vertex = index > 0 ? index - 1 : count + index;
            if (index == 0 || vertex < 0 || vertex >= count) {
                return wrong(parts[i], fmt::format("a vertex number from 1 to {}", count));
            }
            corners.push_back(static_cast<std::int32_t>(vertex));
        }
        if (corners.size() < 3) return wrong(line, "a face of three corners or more");
        polygons = polygons || corners.size() > 3;
        addPolygon(corners, raw.mesh);
        if (raw.mesh.triangles.size() > kMaxTriangles) return tooManyTriangles(path);
    }
    if (polygons) raw.notes.push_back("polygons were split into triangles");
    return raw;
}

}  // namespace fluorocut
