#include "core/imaging/projection_geometry.h"

#include "core/base/parallel.h"

namespace fluorocut {

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
        const std::size_t columns = static_cast<std::size_t>(carm.columns);
        geometry.ideal_pixels.resize(columns * static_cast<std::size_t>(carm.rows));
        parallelFor(static_cast<std::size_t>(carm.rows), 8, [&](std::size_t begin, std::size_t end) {
            for (std::size_t y = begin; y < end; ++y) {
                for (std::size_t x = 0; x < columns; ++x) {
                    const Vector2 pixel(static_cast<double>(x), static_cast<double>(y));
                    geometry.ideal_pixels[y * columns + x] = carm.idealPixel(pixel).cast<float>();
                }
            }
        });
    }
    return geometry;
}

}  // namespace fluorocut
