#include "core/planning/line_fit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace fluorocut {

double LineFit::sigmaAt(const Vector3& place) const {
    return std::hypot(point_sigma_mm, direction.dot(place - point) * direction_sigma_rad);
}

LineFit fitLine(const std::vector<Vector3>& points) {
    LineFit line;
    const double n = static_cast<double>(points.size());
    if (points.size() < 3) return line;
    Vector3 mean = Vector3::Zero();
    for (const Vector3& p : points)
        mean += p / n;
    Matrix3 scatter = Matrix3::Zero();
    for (const Vector3& p : points)
        scatter += (p - mean) * (p - mean).transpose();
    const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(scatter);
    const double along = eigen.eigenvalues()[2], across = std::max(0.0, eigen.eigenvalues().head<2>().sum());
    if (!(along > 1e-12)) return line;
    line.point = mean;
    line.direction = eigen.eigenvectors().col(2);
    line.rms_mm = std::sqrt(across / n);
    line.sigma_mm = std::sqrt(across / (2 * n - 4));
    line.direction_sigma_rad = line.sigma_mm / std::sqrt(along);
    line.point_sigma_mm = line.sigma_mm / std::sqrt(n);
    return line;
}

}  // namespace fluorocut
