#include "core/geometry/rigid3.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace fluorocut {

Rigid3::Rigid3(const Eigen::Quaterniond& rotation, const Vector3& translation_mm) : translation_(translation_mm) {
    const double norm = rotation.norm();
    if (!(norm > 1e-12 && std::isfinite(norm) && translation_mm.allFinite())) {
        throw std::logic_error("Rigid3: rotation or translation is not finite");
    }
    rotation_ = Eigen::Quaterniond(rotation.coeffs() / norm);
}

Rigid3::Rigid3(const Matrix3& rotation, const Vector3& translation_mm) {
    const double error = (rotation * rotation.transpose() - Matrix3::Identity()).cwiseAbs().maxCoeff();
    if (!(error < 1e-6 && rotation.determinant() > 0)) throw std::logic_error("Rigid3: matrix is not a rotation");
    *this = Rigid3(Eigen::Quaterniond(rotation), translation_mm);
}

Rigid3 Rigid3::fromTranslation(const Vector3& translation_mm) {
    return {Eigen::Quaterniond::Identity(), translation_mm};
}

Rigid3 Rigid3::fromRotationVector(const Vector3& rotation_rad) {
    return {expRotation(rotation_rad), Vector3::Zero()};
}

Rigid3 Rigid3::fromTwistRollPitch(double twist_rad, double roll_rad, double pitch_rad) {
    const Eigen::Quaterniond rotation = Eigen::AngleAxisd(pitch_rad, Vector3::UnitZ()) *
                                        Eigen::AngleAxisd(roll_rad, Vector3::UnitY()) *
                                        Eigen::AngleAxisd(twist_rad, Vector3::UnitX());
    return {rotation, Vector3::Zero()};
}

Matrix4 Rigid3::matrix() const {
    Matrix4 m = Matrix4::Identity();
    m.topLeftCorner<3, 3>() = rotationMatrix();
    m.topRightCorner<3, 1>() = translation_;
    return m;
}

Rigid3 Rigid3::inverse() const {
    const Eigen::Quaterniond inverse = rotation_.conjugate();
    return {inverse, -(inverse * translation_)};
}

Rigid3 Rigid3::operator*(const Rigid3& other) const {
    return {rotation_ * other.rotation_, rotation_ * other.translation_ + translation_};
}

Rigid3 Rigid3::perturbed(const Vector6& delta) const {
    return {expRotation(delta.tail<3>()) * rotation_, translation_ + delta.head<3>()};
}

Vector6 Rigid3::deltaFrom(const Rigid3& reference) const {
    Vector6 delta;
    delta.head<3>() = translation_ - reference.translation_;
    delta.tail<3>() = logRotation(rotation_ * reference.rotation_.conjugate());
    return delta;
}

Vector3 Rigid3::twistRollPitch() const {
    const Matrix3 r = rotationMatrix();
    const double roll = std::asin(std::clamp(-r(2, 0), -1.0, 1.0));
    if (std::hypot(r(2, 1), r(2, 2)) < 1e-12) {  // gimbal lock: only pitch -+ twist is defined; twist is set to zero
        return {0, roll, std::atan2(-r(0, 1), r(1, 1))};
    }
    return {std::atan2(r(2, 1), r(2, 2)), roll, std::atan2(r(1, 0), r(0, 0))};
}

double Rigid3::rotationAngle() const {
    return logRotation(rotation_).norm();
}

Eigen::Quaterniond expRotation(const Vector3& rotation_rad) {
    const double angle = rotation_rad.norm();
    // sin(a/2)/a by its series where the quotient would lose digits
    const double scale = angle < 1e-4 ? 0.5 - angle * angle / 48 : std::sin(angle / 2) / angle;
    const Vector3 axis = scale * rotation_rad;
    return Eigen::Quaterniond(std::cos(angle / 2), axis.x(), axis.y(), axis.z()).normalized();
}

Vector3 logRotation(const Eigen::Quaterniond& rotation) {
    Eigen::Quaterniond q = rotation.normalized();
    if (q.w() < 0) q.coeffs() = -q.coeffs();
    const double sine = q.vec().norm();
    if (sine < 1e-9) return 2 * q.vec();
    return (2 * std::atan2(sine, q.w()) / sine) * q.vec();
}

namespace {

// The left Jacobian of SO(3): exp(v, w) has the translation leftJacobian(w) * v.
Matrix3 leftJacobian(const Vector3& w) {
    const double a = w.norm();
    const Matrix3 k = skew(w);
    if (a < 1e-4) return Matrix3::Identity() + 0.5 * k + k * k / 6;
    return Matrix3::Identity() + (1 - std::cos(a)) / (a * a) * k + (a - std::sin(a)) / (a * a * a) * k * k;
}

}  // namespace

Rigid3 exp(const Vector6& twist) {
    const Vector3 w = twist.tail<3>();
    return {expRotation(w), leftJacobian(w) * twist.head<3>()};
}

Vector6 log(const Rigid3& motion) {
    Vector6 twist;
    const Vector3 w = logRotation(motion.rotation());
    twist.tail<3>() = w;
    twist.head<3>() = leftJacobian(w).partialPivLu().solve(motion.translation());
    return twist;
}

Matrix3 skew(const Vector3& a) {
    Matrix3 m;
    m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
    return m;
}

}  // namespace fluorocut
