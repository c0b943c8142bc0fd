// Rigid3: a rigid motion of space, always named target_from_source, so that neighbours cancel in a chain:
//     robot_from_femur = robot_from_corkscrew * corkscrew_from_imager * imager_from_femur
//     tip_in_robot     = robot_from_cutter * tip_in_cutter
// Rotation is a unit quaternion, translation is in mm.
//
// Exponential map. Two parametrisations are used, each where it belongs:
//  * exp/log on SE(3): a twist (v, w), v in mm, w in rad, moved along a screw (Murray, Li, Sastry 1994, eq. 2.36).
//  * perturbed(delta): delta = (dt, dr), t' = t + dt, R' = Exp(dr) R, axes of the target frame, rotation about the
//    source's origin. This is the parametrisation of every 6x6 covariance in FluoroCut ("tx ty tz in mm, rx ry rz in
//    rad, in the target frame"): its translation block is the uncertainty of where the source's origin lies.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace fluorocut {

using Vector2 = Eigen::Vector2d;
using Vector3 = Eigen::Vector3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix2 = Eigen::Matrix2d;
using Matrix3 = Eigen::Matrix3d;
using Matrix4 = Eigen::Matrix4d;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

class Rigid3 {
  public:
    Rigid3() : rotation_(Eigen::Quaterniond::Identity()), translation_(Vector3::Zero()) {}
    // The rotation is normalised. Throws std::logic_error when anything is not finite or the quaternion is zero.
    Rigid3(const Eigen::Quaterniond& rotation, const Vector3& translation_mm);
    // `rotation` must be orthonormal with determinant +1 within 1e-6 (throws std::logic_error): files are checked
    // before.
    Rigid3(const Matrix3& rotation, const Vector3& translation_mm);

    static Rigid3 identity() { return {}; }
    static Rigid3 fromTranslation(const Vector3& translation_mm);
    static Rigid3 fromRotationVector(const Vector3& rotation_rad);
    // R = Rz(pitch) Ry(roll) Rx(twist): equation 6 of the paper (gamma, beta, alpha).
    static Rigid3 fromTwistRollPitch(double twist_rad, double roll_rad, double pitch_rad);

    const Eigen::Quaterniond& rotation() const { return rotation_; }
    const Vector3& translation() const { return translation_; }
    Matrix3 rotationMatrix() const { return rotation_.toRotationMatrix(); }
    Matrix4 matrix() const;  // p_target = matrix * p_source, homogeneous column vectors

    Rigid3 inverse() const;
    Rigid3 operator*(const Rigid3& other) const;
    Vector3 operator*(const Vector3& point) const { return rotation_ * point + translation_; }
    Vector3 rotate(const Vector3& direction) const { return rotation_ * direction; }

    Rigid3 perturbed(const Vector6& delta) const;
    // The delta with reference.perturbed(delta) == *this.
    Vector6 deltaFrom(const Rigid3& reference) const;

    // (twist, roll, pitch) in rad with R = Rz(pitch) Ry(roll) Rx(twist); roll in [-pi/2, pi/2].
    Vector3 twistRollPitch() const;
    double rotationAngle() const;  // rad, in [0, pi]

  private:
    Eigen::Quaterniond rotation_;
    Vector3 translation_;
};

// Rotation vector <-> quaternion, accurate for small angles; the logarithm's angle is in [0, pi].
Eigen::Quaterniond expRotation(const Vector3& rotation_rad);
Vector3 logRotation(const Eigen::Quaterniond& rotation);

// SE(3): twist = (v, w).
Rigid3 exp(const Vector6& twist);
Vector6 log(const Rigid3& motion);

// The cross-product matrix: skew(a) * b == a x b.
Matrix3 skew(const Vector3& a);

}  // namespace fluorocut
