#include "core/geometry/point_error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/Eigenvalues>

namespace fluorocut {
namespace {

constexpr double kFar = 8;  // standard deviations: beyond them lies 1e-15
constexpr int kNodes = 32;
constexpr double kNegligible = 1e-3;  // axes shorter than this part of the next add less than 1e-6 to the radius

// Integral over t in [-1, 1]: nodes t = sin a, so that the square roots at the ends do no harm.
template <class F>
double integrate(double half, const F& f) {
    double sum = 0;
    for (int i = 0; i < kNodes; ++i) {
        const double angle = M_PI * ((i + 0.5) / kNodes - 0.5);
        sum += std::cos(angle) * f(half * std::sin(angle));
    }
    return half * sum * M_PI / kNodes;
}

double density(double z) {
    return std::exp(-0.5 * z * z) / std::sqrt(2 * M_PI);
}

// P(s0^2 x^2 + s1^2 y^2 + s2^2 z^2 <= q), s falling.
double inside(const std::array<double, 3>& s, double q, int axis = 0) {
    if (!(q > 0)) return 0;
    const double root = std::sqrt(q), sigma = s[static_cast<std::size_t>(axis)];
    if (axis == 2 || !(s[static_cast<std::size_t>(axis) + 1] > kNegligible * sigma))
        return sigma > 0 ? std::erf(root / (sigma * std::sqrt(2.0))) : 1;
    return integrate(std::min(root / sigma, kFar),
                     [&](double z) { return density(z) * inside(s, q - sigma * sigma * z * z, axis + 1); });
}

}  // namespace

double errorRadius(const Matrix3& covariance_mm2, double probability) {
    if (!(probability > 0 && probability < 1)) throw std::logic_error("errorRadius: a probability outside of (0, 1)");
    if (!covariance_mm2.allFinite()) return std::numeric_limits<double>::quiet_NaN();
    const Vector3 values =
        Eigen::SelfAdjointEigenSolver<Matrix3>(covariance_mm2, Eigen::EigenvaluesOnly).eigenvalues().cwiseMax(0);
    const std::array<double, 3> s{std::sqrt(values[2]), std::sqrt(values[1]), std::sqrt(values[0])};
    if (!(s[0] > 0)) return 0;
    double low = 0, high = 10 * std::sqrt(values.sum());
    while (high - low > 1e-6 * high) {
        const double middle = 0.5 * (low + high);
        (inside(s, middle * middle) < probability ? low : high) = middle;
    }
    return high;
}

WorstDirection worstDirection(const Matrix3& covariance_mm2) {
    const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(covariance_mm2);
    return {std::sqrt(std::max(0.0, eigen.eigenvalues()[2])), eigen.eigenvectors().col(2)};
}

}  // namespace fluorocut
