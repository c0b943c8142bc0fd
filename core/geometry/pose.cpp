#include "core/geometry/pose.h"

#include <stdexcept>
#include <string>

namespace fluorocut {

Matrix6 productByLeft(const Rigid3& a, const Rigid3& b) {
    Matrix6 jacobian = Matrix6::Identity();
    jacobian.topRightCorner<3, 3>() = -skew(a.rotate(b.translation()));
    return jacobian;
}

Matrix6 productByRight(const Rigid3& a) {
    const Matrix3 r = a.rotationMatrix();
    Matrix6 jacobian = Matrix6::Zero();
    jacobian.topLeftCorner<3, 3>() = r;
    jacobian.bottomRightCorner<3, 3>() = r;
    return jacobian;
}

Matrix6 inverseByPose(const Rigid3& target_from_source) {
    const Matrix3 rt = target_from_source.rotationMatrix().transpose();
    Matrix6 jacobian = Matrix6::Zero();
    jacobian.topLeftCorner<3, 3>() = -rt;
    jacobian.topRightCorner<3, 3>() = -rt * skew(target_from_source.translation());
    jacobian.bottomRightCorner<3, 3>() = -rt;
    return jacobian;
}

Eigen::Matrix<double, 3, 6> pointByPose(const Rigid3& target_from_source, const Vector3& point_in_source) {
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian.leftCols<3>() = Matrix3::Identity();
    jacobian.rightCols<3>() = -skew(target_from_source.rotate(point_in_source));
    return jacobian;
}

Pose Pose::inverse() const {
    Pose result{source, target, target_from_source.inverse(), std::nullopt};
    if (covariance) {
        const Matrix6 jacobian = inverseByPose(target_from_source);
        result.covariance = jacobian * *covariance * jacobian.transpose();
    }
    return result;
}

Pose operator*(const Pose& a, const Pose& b) {
    if (a.source != b.target) {
        throw std::logic_error("frames do not cancel: " + std::string(name(a.target)) + "_from_" +
                               std::string(name(a.source)) + " * " + std::string(name(b.target)) + "_from_" +
                               std::string(name(b.source)));
    }
    Pose result{a.target, b.source, a.target_from_source * b.target_from_source, std::nullopt};
    if (a.covariance && b.covariance) {
        const Matrix6 by_a = productByLeft(a.target_from_source, b.target_from_source);
        const Matrix6 by_b = productByRight(a.target_from_source);
        result.covariance = by_a * *a.covariance * by_a.transpose() + by_b * *b.covariance * by_b.transpose();
    }
    return result;
}

Eigen::Matrix3d pointCovariance(const Pose& pose, const Vector3& point_in_source) {
    if (!pose.covariance) throw std::logic_error("pointCovariance: the pose has no covariance");
    const auto jacobian = pointByPose(pose.target_from_source, point_in_source);
    return jacobian * *pose.covariance * jacobian.transpose();
}

}  // namespace fluorocut
