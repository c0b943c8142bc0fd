// What bends the picture between the ideal projection and the pixels (equation 3 of the paper: (x_d, y_d) = M(x_u,
// y_u)).
//
// Both coordinates are mm in the detector plane, relative to the principal point, x along columns and y down the rows.
// `distorted` and `undistorted` are inverses of each other to 1e-6 mm inside the field.
#pragma once

#include <span>

#include "core/geometry/rigid3.h"
#include "core/imaging/imager_cache.h"

namespace fluorocut {

class Distortion {
  public:
    virtual ~Distortion() = default;
    virtual Vector2 distorted(const Vector2& undistorted_mm) const = 0;
    virtual Vector2 undistorted(const Vector2& distorted_mm) const = 0;
    // undistorted_mm[i] = undistorted(first + i * (step, 0)): rows of pixels, for those that can do it faster.
    virtual void undistortedRow(const Vector2& first_mm, double step_mm, std::span<Vector2> undistorted_mm) const {
        for (std::size_t i = 0; i < undistorted_mm.size(); ++i)
            undistorted_mm[i] = undistorted(first_mm + Vector2(step_mm * static_cast<double>(i), 0));
    }

    // What projectors have worked out for imagers with this distortion.
    ImagerCache& cache() const { return cache_; }

  private:
    mutable ImagerCache cache_;
};

}  // namespace fluorocut
