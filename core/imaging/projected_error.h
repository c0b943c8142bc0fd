// How well the place of a point in an image is known, when its own place and the view's pose are known with errors:
//
//     C_px = J_p C_point J_p^T + J_x C_pose J_x^T,   J_p = du/dpoint,  J_x = du/dpose (Rigid3::perturbed), distortion
//     included
//
// to first order, errors of point and pose independent of each other. The region that holds the truth with
// probability p is the ellipse  d^T C_px^-1 d = -2 ln(1 - p)  (chi-square with 2 degrees of freedom).
// Frames: imager_from_world; pixels of the image (distorted); mm, rad.
#pragma once

#include <vector>

#include "core/geometry/rigid3.h"
#include "core/imaging/carm.h"

namespace fluorocut {

// How a point's pixel moves with the point [px/mm] and with the pose [px/mm, px/rad].
struct ProjectionJacobian {
    Eigen::Matrix<double, 2, 3> point;
    Eigen::Matrix<double, 2, 6> pose;
};
ProjectionJacobian projectionJacobian(const CArm& carm, const Rigid3& imager_from_world, const Vector3& point_in_world);

// NaN for a point that is not in front of the source.
Matrix2 pixelCovariance(const CArm& carm, const Rigid3& imager_from_world, const Vector3& point_in_world,
                        const Matrix3& point_covariance, const Matrix6& pose_covariance);

// Corners of the ellipse, evenly in its own angle, not repeating the first; empty unless all is finite and the
// covariance has no negative variance. Throws std::logic_error unless 0 < probability < 1 and corners > 2.
std::vector<Vector2> errorEllipse(const Vector2& middle_px, const Matrix2& covariance_px2, double probability = 0.95,
                                  int corners = 48);

}  // namespace fluorocut
