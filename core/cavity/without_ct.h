// Method `full` without a CT: from the images before and after alone, all views at once, six degrees of freedom of the
// cavity. In each view (logarithms of levels, ideal pixels x around the cavity's shadow)
//
//     after(x) = before(S x + parallax(x)) + slow(x) + density(x) blurred L(x; view, cavity)
//
//     S          the shift, turn and scale that lays the bone's contours upon each other (plane_images.h)
//     parallax   what that cannot: bone in front of and behind the cavity moves differently between the two poses. A
//                displacement that is smooth over the image (a polynomial, each of its coefficients small)
//     slow       dose, scatter: a polynomial
//     L          way through the cavity; density, what was there and is gone: smooth over the image, and in proportion
//                to how much bone the image before shows there
//
// All but the cavity's pose and the views' pose errors are linear and fitted along with them (Gauss-Newton, robust
// weights). Bone at depths that no smooth displacement fits leaves structure where the image before is steep: a
// pixel's variance is sigma^2 + (tau |grad before|)^2, both taken from the residual away from the cavity. The
// covariance is that of the score over blocks of pixels, as structure is alike in neighbours.
//
// No solution, in words: an image before that cannot be laid upon the one after; no convergence.
#pragma once

#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/cavity/cavity_location.h"

namespace fluorocut::cavity {

Result<CavityLocation> locateWithoutCt(const std::vector<CavityView>& views, const TriangleMesh& mesh,
                                       const Rigid3& planned_femur_from_cavity, const CavityLocationOptions& options,
                                       Progress& progress);

}  // namespace fluorocut::cavity
