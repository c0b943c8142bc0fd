// What bends the picture between the ideal projection and the pixels (equation 3 of the paper: (x_d, y_d) = M(x_u,
// y_u)).
//
// Both coordinates are mm in the detector plane, relative to the principal point, x along columns and y down the rows.
// `distorted` and `undistorted` are inverses of each other to 1e-6 mm inside the field.
#pragma once

#include "core/geometry/rigid3.h"

namespace fluorocut {

class Distortion {
  public:
    virtual ~Distortion() = default;
    virtual Vector2 distorted(const Vector2& undistorted_mm) const = 0;
    virtual Vector2 undistorted(const Vector2& distorted_mm) const = 0;
};

}  // namespace fluorocut
