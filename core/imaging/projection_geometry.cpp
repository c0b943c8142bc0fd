#include "core/imaging/projection_geometry.h"

#include "core/base/parallel.h"

namespace fluorocut {
namespace {

std::shared_ptr<const IdealPixels> idealPixels(const CArm& carm) {
    const std::size_t columns = static_cast<std::size_t>(carm.columns), rows = static_cast<std::size_t>(carm.rows);
    auto ideal = std::make_shared<IdealPixels>();
    ideal->pixels.resize(columns * rows);
    parallelFor(rows, 8, [&](std::size_t begin, std::size_t end) {
        std::vector<Vector2> row(columns);
        for (std::size_t y = begin; y < end; ++y) {
            carm.idealRow(static_cast<int>(y), row);
            for (std::size_t x = 0; x < columns; ++x)
                ideal->pixels[y * columns + x] = row[x].cast<float>();
        }
    });
    Eigen::Vector2f low = Eigen::Vector2f::Constant(1e30F), high = -low;
    for (const Eigen::Vector2f& p : ideal->pixels) {
        if (!p.allFinite()) continue;
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
    }
    ideal->low = low.cast<double>();
    ideal->high = high.cast<double>();
    return ideal;
}

}  // namespace

ProjectionGeometry projectionGeometry(const CArm& carm, const Rigid3& imager_from_volume, const VolumeGrid& grid) {
    const Rigid3 volume_from_imager = imager_from_volume.inverse();
    const auto index = [&](const Vector3& in_imager) { return grid.indexFromPoint(volume_from_imager * in_imager); };
    const CArm ideal = carm.ideal();

    ProjectionGeometry geometry;
    geometry.columns = carm.columns;
    geometry.rows = carm.rows;
    geometry.spacing_mm = grid.spacing_mm;
    geometry.source = index(Vector3::Zero());
    geometry.corner = index(ideal.detectorPoint({0, 0}));
    geometry.step_column = index(ideal.detectorPoint({1, 0})) - geometry.corner;
    geometry.step_row = index(ideal.detectorPoint({0, 1})) - geometry.corner;
    geometry.central = geometry.detectorPoint(0.5 * (carm.columns - 1), 0.5 * (carm.rows - 1));

    if (carm.distortion) {
        const std::size_t pixels = static_cast<std::size_t>(carm.columns) * static_cast<std::size_t>(carm.rows);
        geometry.ideal_pixels = carm.distortion->cache().get<IdealPixels>(
            carm.pixelGrid(), pixels * sizeof(Eigen::Vector2f), [&] { return idealPixels(carm); });
    }
    return geometry;
}

}  // namespace fluorocut
