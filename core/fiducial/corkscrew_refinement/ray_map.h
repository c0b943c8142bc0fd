// RayMap: where the pixels of a part of the image look: the ray of a (distorted) pixel meets the detector plane of the
// ideal imager at this place, mm from the principal point; and back.
#pragma once

#include <algorithm>
#include <vector>

#include "core/imaging/carm.h"

namespace fluorocut::corkscrew {

// Pixels [x, x + width) x [y, y + height) of the image.
struct PixelRegion {
    int x = 0, y = 0, width = 0, height = 0;

    bool empty() const { return width <= 0 || height <= 0; }
    bool operator==(const PixelRegion&) const = default;
};

class RayMap {
  public:
    RayMap(const CArm& carm, const PixelRegion& region);

    const PixelRegion& region() const { return region_; }
    double focal_length_mm() const { return focal_length_mm_; }

    // Place of a pixel of the region; column and row from -1 to width or height: one pixel beyond each border.
    float x(int column, int row) const { return x_[index(column, row)]; }
    float y(int column, int row) const { return y_[index(column, row)]; }
    const float* rowX(int row) const { return x_.data() + index(0, row); }  // rowX(row)[-1] is valid
    const float* rowY(int row) const { return y_.data() + index(0, row); }

    // Pixel of the region (column, row; need not lie in it) that looks at a place, to some hundredths of a pixel inside
    // the region.
    Vector2 pixel(const Vector2& place_mm) const;

  private:
    std::size_t index(int column, int row) const {
        return static_cast<std::size_t>(row + 1) * static_cast<std::size_t>(region_.width + 2) +
               static_cast<std::size_t>(column + 1);
    }

    PixelRegion region_;
    double focal_length_mm_;
    Vector2 pixel_mm_, origin_px_;  // principal point, from the region's first pixel
    bool distorted_;
    std::vector<float> x_, y_;
};

}  // namespace fluorocut::corkscrew
