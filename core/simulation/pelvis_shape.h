// A simple half pelvis around a femoral head: acetabulum with its joint space, ilium, ischium, pubic rami. It is there
// so that an image of the hip looks like one; nothing measures it. Frame `bone` (femur_shape.h), mm.
#pragma once

#include "core/geometry/rigid3.h"
#include "core/simulation/lattice_noise.h"

namespace fluorocut {

class PelvisShape {
  public:
    PelvisShape(const Vector3& head_center, double head_radius_mm, double scale);

    // Signed distance to the outer surface, approximately.
    double outer(const Vector3& p) const;
    // HU at a depth below the surface.
    double tissue(const Vector3& p, double depth_mm, const LatticeNoise& noise, double trabecular_hu) const;

  private:
    Vector3 center_;
    double socket_radius_, scale_;
    LatticeNoise bumps_;
};

}  // namespace fluorocut
