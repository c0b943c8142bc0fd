#include "core/distortion/plate_solid.h"

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/geometry/mesh_tools.h"

namespace fluorocut {
namespace {

constexpr double kDefaultFieldMm = 304.8;
constexpr int kMostCrossings = 100000;  // 1.6 million triangles

// Rim, groove edges in pairs, rim.
std::vector<double> breakLines(const PlateExtent& extent, int axis, const GroovedPlate& plate) {
    const auto a = static_cast<std::size_t>(axis);
    std::vector<double> lines{extent.low[axis]};
    for (int n = 0; n < extent.grooves[a]; ++n) {
        const double middle = (extent.first_groove[a] + n) * plate.pitch_mm;
        lines.push_back(middle - 0.5 * plate.groove_width_mm);
        lines.push_back(middle + 0.5 * plate.groove_width_mm);
    }
    lines.push_back(extent.high[axis]);
    return lines;
}

// The vertices: every crossing of break lines at the level of the lands and at that of the grooves' floors, then the
// four corners of the smooth side.
class Vertices {
  public:
    Vertices(const PlateExtent& extent, const std::vector<double>& x, const std::vector<double>& y)
        : columns_(static_cast<std::int32_t>(x.size())), rows_(static_cast<std::int32_t>(y.size())) {
        points_.reserve(2 * x.size() * y.size() + 4);
        for (const double z : {extent.z_land, extent.z_floor})
            for (const double v : y)
                for (const double u : x)
                    points_.emplace_back(u, v, z);
        for (const double v : {y.front(), y.back()})
            for (const double u : {x.front(), x.back()})
                points_.emplace_back(u, v, extent.z_back);
    }
    std::int32_t land(std::int32_t i, std::int32_t j) const { return j * columns_ + i; }
    std::int32_t floor(std::int32_t i, std::int32_t j) const { return columns_ * rows_ + land(i, j); }
    std::int32_t back(std::int32_t right, std::int32_t lower) const { return 2 * columns_ * rows_ + 2 * lower + right; }
    std::int32_t columns() const { return columns_; }
    std::int32_t rows() const { return rows_; }
    std::vector<Vector3> take() { return std::move(points_); }

  private:
    std::int32_t columns_, rows_;
    std::vector<Vector3> points_;
};

}  // namespace

PlateExtent plateExtent(const GroovedPlate& plate, PlateFacing facing) {
    PlateExtent extent;
    // Odd, so that a crossing is in the middle.
    const int covering = 2 * static_cast<int>(std::ceil(0.5 * (kDefaultFieldMm / plate.pitch_mm - 1))) + 1;
    extent.grooves = plate.grooves.value_or(std::array{covering, covering});
    for (std::size_t axis = 0; axis < 2; ++axis) {
        extent.first_groove[axis] = -(extent.grooves[axis] - 1) / 2;
        const auto a = static_cast<Eigen::Index>(axis);
        extent.low[a] = (extent.first_groove[axis] - 0.5) * plate.pitch_mm;
        extent.high[a] = extent.low[a] + extent.grooves[axis] * plate.pitch_mm;
    }
    const double toward_source = facing == PlateFacing::source ? -1 : 1;
    extent.z_land = 0.5 * toward_source * plate.groove_depth_mm;
    extent.z_floor = -extent.z_land;
    extent.z_back = extent.z_land - toward_source * plate.thickness_mm;
    return extent;
}

Result<TriangleMesh> plateSolid(const GroovedPlate& plate, PlateFacing facing) {
    if (const Result<void> good = plate.validate(); !good) return good.error();
    if (!(plate.groove_depth_mm < plate.thickness_mm)) {
        return invalidOption("groove_depth_mm", fmt::format("{}", plate.groove_depth_mm),
                             fmt::format("less than thickness_mm ({})", plate.thickness_mm),
                             "leave a floor under the grooves, or the plate falls to pieces");
    }
    const PlateExtent extent = plateExtent(plate, facing);
    if (extent.grooves[0] * extent.grooves[1] > kMostCrossings) {
        return invalidOption("grooves", fmt::format("{} x {}", extent.grooves[0], extent.grooves[1]),
                             fmt::format("at most {} crossings in a solid", kMostCrossings));
    }
    Vertices at(extent, breakLines(extent, 0, plate), breakLines(extent, 1, plate));
    TriangleMesh mesh;
    // Counter-clockwise seen from +z: right for lands that open toward +z, turned at the end for the others.
    const auto quad = [&](std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t d) {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({a, c, d});
    };
    const std::int32_t last_i = at.columns() - 1, last_j = at.rows() - 1;
    for (std::int32_t j = 0; j < last_j; ++j) {
        for (std::int32_t i = 0; i < last_i; ++i) {
            if (i % 2 == 1 || j % 2 == 1) {  // in a groove
                quad(at.floor(i, j), at.floor(i + 1, j), at.floor(i + 1, j + 1), at.floor(i, j + 1));
                continue;
            }
            quad(at.land(i, j), at.land(i + 1, j), at.land(i + 1, j + 1), at.land(i, j + 1));
            const auto wall = [&](std::int32_t i0, std::int32_t j0, std::int32_t i1, std::int32_t j1) {
                quad(at.floor(i0, j0), at.floor(i1, j1), at.land(i1, j1), at.land(i0, j0));
            };
            wall(i, j, i + 1, j);
            wall(i + 1, j, i + 1, j + 1);
            wall(i + 1, j + 1, i, j + 1);
            wall(i, j + 1, i, j);
        }
    }
    // Below the floor the four sides are plane: one corner of the smooth side sees all of a side's upper edge.
    for (std::int32_t i = 0; i < last_i; ++i) {
        mesh.triangles.push_back({at.back(0, 0), at.floor(i + 1, 0), at.floor(i, 0)});
        mesh.triangles.push_back({at.back(0, 1), at.floor(i, last_j), at.floor(i + 1, last_j)});
    }
    for (std::int32_t j = 0; j < last_j; ++j) {
        mesh.triangles.push_back({at.back(0, 0), at.floor(0, j), at.floor(0, j + 1)});
        mesh.triangles.push_back({at.back(1, 0), at.floor(last_i, j + 1), at.floor(last_i, j)});
    }
    mesh.triangles.push_back({at.back(0, 0), at.back(1, 0), at.floor(last_i, 0)});
    mesh.triangles.push_back({at.back(0, 1), at.floor(last_i, last_j), at.back(1, 1)});
    mesh.triangles.push_back({at.back(0, 0), at.floor(0, last_j), at.back(0, 1)});
    mesh.triangles.push_back({at.back(1, 0), at.back(1, 1), at.floor(last_i, last_j)});
    quad(at.back(0, 0), at.back(0, 1), at.back(1, 1), at.back(1, 0));
    mesh.vertices = at.take();
    return facing == PlateFacing::detector ? mesh : flipped(std::move(mesh));
}

}  // namespace fluorocut
