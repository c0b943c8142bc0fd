#include "core/planning/containment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/Eigenvalues>

#include "core/base/random.h"

namespace fluorocut {

std::vector<SurfacePoint> surfacePoints(const TriangleMesh& mesh, std::size_t most) {
    if (most == 0) throw std::logic_error("surfacePoints: none asked for");
    const std::size_t count = std::min(most, mesh.triangles.size());
    std::vector<SurfacePoint> points;
    points.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
        const Triangle& t = mesh.triangles[i * mesh.triangles.size() / count];
        const Vector3& a = mesh.vertices[static_cast<std::size_t>(t[0])];
        const Vector3& b = mesh.vertices[static_cast<std::size_t>(t[1])];
        const Vector3& c = mesh.vertices[static_cast<std::size_t>(t[2])];
        const Vector3 normal = (b - a).cross(c - a);
        if (normal.norm() > 0) points.push_back({(a + b + c) / 3, normal.normalized()});
    }
    return points;
}

double containedInset(const std::vector<SurfacePoint>& surface, const Vector3& center, const Matrix6& covariance,
                      const ContainmentOptions& options) {
    if (surface.empty() || options.draws < 1 || !(options.probability > 0 && options.probability < 1))
        throw std::logic_error("containedInset: no surface, or options out of range");
    if (!covariance.allFinite()) return std::numeric_limits<double>::quiet_NaN();
    const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(covariance);
    if (!(eigen.eigenvalues().minCoeff() >= -1e-9 * std::max(eigen.eigenvalues().maxCoeff(), 1e-300)))
        return std::numeric_limits<double>::quiet_NaN();
    const Matrix6 root = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();

    // h(p) = w . (t, r) with w = (n, (p - center) x n).
    Eigen::Matrix<double, Eigen::Dynamic, 6> lever(static_cast<Eigen::Index>(surface.size()), 6);
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const Vector3& n = surface[i].normal;
        lever.row(static_cast<Eigen::Index>(i)) << n.transpose(), (surface[i].position - center).cross(n).transpose();
    }
    const Eigen::Matrix<double, Eigen::Dynamic, 6> scaled = lever * root;
    Random random(options.seed);
    std::vector<double> worst(static_cast<std::size_t>(options.draws));
    for (double& one : worst) {
        Vector6 draw;
        for (int i = 0; i < 6; ++i)
            draw[i] = random.normal();
        one = std::max(0.0, (scaled * draw).maxCoeff());
    }
    const auto place =
        worst.begin() + static_cast<std::ptrdiff_t>(std::min(
                            worst.size() - 1, static_cast<std::size_t>(
                                                  std::ceil(options.probability * static_cast<double>(worst.size())))));
    std::nth_element(worst.begin(), place, worst.end());
    return *place;
}

}  // namespace fluorocut
