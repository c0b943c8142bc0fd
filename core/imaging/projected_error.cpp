#include "core/imaging/projected_error.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include <Eigen/Eigenvalues>

namespace fluorocut {

ProjectionJacobian projectionJacobian(const CArm& carm, const Rigid3& imager_from_world,
                                      const Vector3& point_in_world) {
    const Vector3 turned = imager_from_world.rotate(point_in_world);
    const Vector3 p = turned + imager_from_world.translation();
    Eigen::Matrix<double, 2, 3> perspective;
    perspective << 1, 0, -p.x() / p.z(), 0, 1, -p.y() / p.z();
    perspective *= carm.focal_length_mm / p.z();
    // Distortions are smooth over a pixel: differences over it serve.
    Matrix2 bend = Matrix2::Identity();
    if (carm.distortion) {
        const Vector2 ideal = carm.projectIdeal(p);
        for (int axis = 0; axis < 2; ++axis) {
            const Vector2 half = 0.5 * Vector2::Unit(axis);
            bend.col(axis) = carm.distortedPixel(ideal + half) - carm.distortedPixel(ideal - half);
        }
    }
    const Eigen::Matrix<double, 2, 3> by_imager_point = bend * carm.pixel_mm.cwiseInverse().asDiagonal() * perspective;
    ProjectionJacobian by;
    by.point = by_imager_point * imager_from_world.rotationMatrix();
    by.pose << by_imager_point, -by_imager_point * skew(turned);
    return by;
}

Matrix2 pixelCovariance(const CArm& carm, const Rigid3& imager_from_world, const Vector3& point_in_world,
                        const Matrix3& point_covariance, const Matrix6& pose_covariance) {
    if (!((imager_from_world * point_in_world).z() > 0))
        return Matrix2::Constant(std::numeric_limits<double>::quiet_NaN());
    const ProjectionJacobian by = projectionJacobian(carm, imager_from_world, point_in_world);
    return by.point * point_covariance * by.point.transpose() + by.pose * pose_covariance * by.pose.transpose();
}

std::vector<Vector2> errorEllipse(const Vector2& middle_px, const Matrix2& covariance_px2, double probability,
                                  int corners) {
    if (!(probability > 0 && probability < 1) || corners < 3)
        throw std::logic_error("errorEllipse: no such probability or number of corners");
    if (!middle_px.allFinite() || !covariance_px2.allFinite()) return {};
    const Eigen::SelfAdjointEigenSolver<Matrix2> axes(covariance_px2);
    // Rounding may leave a vanishing variance a little below zero.
    const double allowed = -1e-12 * std::abs(axes.eigenvalues()[1]);
    if (axes.eigenvalues()[0] < allowed) return {};
    const Vector2 half = (-2 * std::log1p(-probability) * axes.eigenvalues().cwiseMax(0)).cwiseSqrt();
    std::vector<Vector2> ellipse;
    for (int i = 0; i < corners; ++i) {
        const double angle = 2 * std::numbers::pi * i / corners;
        ellipse.push_back(middle_px +
                          axes.eigenvectors() * Vector2(half.x() * std::cos(angle), half.y() * std::sin(angle)));
    }
    return ellipse;
}

}  // namespace fluorocut
