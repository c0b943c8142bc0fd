// How much smaller a cavity must be planned so that, wherever the uncertain registration puts it, it stays inside the
// final one: the inset that a progressive stage is given.
//
// A pose error (t, r) moves a surface point p by t + r x p and its surface outward by the normal part
//
//     h(p) = n . (t + r x p),      the worst place counts:  H = max over the surface of h(p)
//
// The cavity inset by d stays inside with probability P(H <= d). Its quantile is found by drawing pose errors from the
// covariance (seeded; the maximum of correlated normal values has no closed form); the bound of one place,
// max_p z_P sigma(p), is always less. First order in the angle: 1 mm of inset stands for 0.5 degrees on a 120 mm stem,
// where the second order is 0.005 mm.
//
// Frame: that of the points; the covariance is that of a pose with this target frame, in the order of
// Rigid3::perturbed (tx ty tz mm, rx ry rz rad; the rotation is about `center`).
#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry/rigid3.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

struct SurfacePoint {
    Vector3 position;
    Vector3 normal;  // unit, out of the solid
};

// The middle of every triangle, or of an even choice of `most` of them.
std::vector<SurfacePoint> surfacePoints(const TriangleMesh& mesh, std::size_t most = 4000);

struct ContainmentOptions {
    double probability = 0.99;
    int draws = 20000;
    std::uint64_t seed = 1;
};

// The inset (mm, >= 0). NaN for a covariance that is not finite or not positive semidefinite.
double containedInset(const std::vector<SurfacePoint>& surface, const Vector3& center, const Matrix6& covariance,
                      const ContainmentOptions& options = {});

}  // namespace fluorocut
