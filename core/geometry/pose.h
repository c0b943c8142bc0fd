// Pose: a Rigid3 that knows its two frames and its uncertainty. It is what stages hand to each other and what files
// hold.
//
// Composition checks that the inner frames cancel (a mismatch is our bug and throws std::logic_error) and transports
// the covariances to first order, taking the two factors' errors as independent:
//     c = a * b:   dt_c = dt_a + dr_a x (R_a t_b) + R_a dt_b,   dr_c = dr_a + R_a dr_b
//     c = a^-1:    dt_c = R^T (dr x t - dt),                    dr_c = -R^T dr
// Covariance: (tx ty tz) mm, (rx ry rz) rad, in the target frame, rotation about the source's origin, as
// Rigid3::perturbed has it. An exact pose has a zero covariance; one of which nothing is known has none.
#pragma once

#include <optional>

#include "core/geometry/frames.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

struct Pose {
    Frame target = Frame::imager;
    Frame source = Frame::femur;
    Rigid3 target_from_source;
    std::optional<Matrix6> covariance;

    Pose inverse() const;
};

// Unknown covariance in a factor makes the product's covariance unknown.
Pose operator*(const Pose& a, const Pose& b);

// How errors travel to first order: a perturbation of a, of b, of the inverted pose, to one of the result.
Matrix6 productByLeft(const Rigid3& a, const Rigid3& b);  // d(a b) / da
Matrix6 productByRight(const Rigid3& a);                  // d(a b) / db
Matrix6 inverseByPose(const Rigid3& target_from_source);  // d(a^-1) / da
// Of a point fixed in the source frame, in the target frame.
Eigen::Matrix<double, 3, 6> pointByPose(const Rigid3& target_from_source, const Vector3& point_in_source);

// The covariance (mm^2, target frame) of a point fixed in the source frame, pushed through the pose.
Eigen::Matrix3d pointCovariance(const Pose& pose, const Vector3& point_in_source);

}  // namespace fluorocut
