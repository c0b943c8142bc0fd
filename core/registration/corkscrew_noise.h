// How well a corkscrew's pose is typically seen in one image, in the directions in which that differs: across the image
// and in depth, and about the three angles of R = Rz(pitch) Ry(roll) Rx(twist). For poses that come without a
// covariance, and to foresee what an image that has not been taken will tell.
#pragma once

#include "core/base/result.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

// Standard deviations.
struct CorkscrewNoise {
    double in_plane_mm = 0.01;  // x and y of the imager
    double depth_mm = 0.1;      // z
    double twist_rad = 0.1 * 0.017453292519943295;
    double roll_rad = 0.05 * 0.017453292519943295;
    double pitch_rad = 0.03 * 0.017453292519943295;

    Result<void> validate() const;
    // Of imager_from_corkscrew, as Pose has it.
    Matrix6 covarianceAt(const Rigid3& imager_from_corkscrew) const;
};

}  // namespace fluorocut
