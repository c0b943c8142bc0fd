// A distortion for tests: x_d = x_u (1 + k r_u^2), inverted by Newton on the radius. Beyond `field_mm` from the axis
// (distorted) nothing is known.
#pragma once

#include <limits>

#include "core/imaging/distortion.h"

namespace fluorocut::test {

class Pincushion final : public Distortion {
  public:
    explicit Pincushion(double k, double field_mm = 1e9) : k_(k), field_(field_mm) {}
    Vector2 distorted(const Vector2& u) const override { return u * (1 + k_ * u.squaredNorm()); }
    Vector2 undistorted(const Vector2& d) const override {
        if (d.norm() > field_) return Vector2::Constant(std::numeric_limits<double>::quiet_NaN());
        double r = d.norm();
        if (r == 0) return d;
        for (int i = 0; i < 20; ++i)
            r -= (r * (1 + k_ * r * r) - d.norm()) / (1 + 3 * k_ * r * r);
        return d * (r / d.norm());
    }

  private:
    double k_, field_;
};

}  // namespace fluorocut::test
