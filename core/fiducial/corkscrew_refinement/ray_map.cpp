#include "core/fiducial/corkscrew_refinement/ray_map.h"

#include <cmath>
#include <vector>

#include "core/base/parallel.h"

namespace fluorocut::corkscrew {

RayMap::RayMap(const CArm& carm, const PixelRegion& region)
    : region_(region),
      focal_length_mm_(carm.focal_length_mm),
      pixel_mm_(carm.pixel_mm),
      origin_px_(carm.principal_point_px - Vector2(region.x, region.y)),
      distorted_(carm.distortion != nullptr) {
    const std::size_t width = static_cast<std::size_t>(region.width + 2);
    const std::size_t height = static_cast<std::size_t>(region.height + 2);
    x_.resize(width * height);
    y_.resize(width * height);
    parallelFor(height, 16, [&](std::size_t begin, std::size_t end) {
        std::vector<Vector2> places(width);
        for (std::size_t row = begin; row < end; ++row) {
            const Vector2 first = (Vector2(-1, static_cast<double>(row) - 1) - origin_px_).cwiseProduct(pixel_mm_);
            float* const x_row = x_.data() + row * width;
            float* const y_row = y_.data() + row * width;
            if (!distorted_) {
                for (std::size_t i = 0; i < width; ++i)
                    x_row[i] = static_cast<float>(first.x() + static_cast<double>(i) * pixel_mm_.x());
                std::fill(y_row, y_row + width, static_cast<float>(first.y()));
                continue;
            }
            carm.distortion->undistortedRow(first, pixel_mm_.x(), places);
            for (std::size_t i = 0; i < width; ++i) {
                x_row[i] = static_cast<float>(places[i].x());
                y_row[i] = static_cast<float>(places[i].y());
            }
        }
    });
}

Vector2 RayMap::pixel(const Vector2& place_mm) const {
    const Vector2 ideal = place_mm.cwiseQuotient(pixel_mm_) + origin_px_;
    if (!distorted_) return ideal;
    // The distortion hardly changes over a pixel: a few looks at where the guess's pixel looks.
    Vector2 pixel = ideal;
    for (int i = 0; i < 4; ++i) {
        const int column = std::clamp(static_cast<int>(std::lround(pixel.x())), -1, region_.width);
        const int row = std::clamp(static_cast<int>(std::lround(pixel.y())), -1, region_.height);
        const Vector2 seen = Vector2(x(column, row), y(column, row)).cwiseQuotient(pixel_mm_) + origin_px_;
        pixel = ideal + (Vector2(column, row) - seen);
    }
    return pixel;
}

}  // namespace fluorocut::corkscrew
