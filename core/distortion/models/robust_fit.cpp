#include "core/distortion/models/robust_fit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/QR>

#include "core/base/median.h"

namespace fluorocut {
namespace {

constexpr double kTukey = kTukeyLimit, kHuber = 1.345;
constexpr int kHuberIterations = 4, kTukeyIterations = 30;

}  // namespace

RobustFit fitRobustly(const Eigen::MatrixXd& design, const Eigen::VectorXd& values, const Eigen::VectorXd& sigmas) {
    const Eigen::Index count = design.rows(), unknowns = design.cols();
    // In an orthonormal basis of the scaled design the normal equations are harmless.
    const Eigen::VectorXd y = values.cwiseQuotient(sigmas);
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(sigmas.cwiseInverse().asDiagonal() * design);
    const Eigen::MatrixXd q = qr.householderQ() * Eigen::MatrixXd::Identity(count, unknowns);

    RobustFit fit;
    Eigen::VectorXd z = q.transpose() * y, residuals = y - q * z, weights(count);
    const auto rescale = [&] {
        std::vector<double> sizes(static_cast<std::size_t>(count));
        for (Eigen::Index i = 0; i < count; ++i)
            sizes[static_cast<std::size_t>(i)] = std::abs(residuals[i]);
        // The residuals are smaller than the noise by the share of it that the unknowns took.
        const double freedom = static_cast<double>(std::max<Eigen::Index>(count - unknowns, 1));
        fit.scale = std::max(1.4826 * median(std::move(sizes)) * std::sqrt(static_cast<double>(count) / freedom),
                             1e-9);  // for values without noise
    };
    for (int iteration = 0; iteration < kHuberIterations + kTukeyIterations; ++iteration) {
        rescale();
        for (Eigen::Index i = 0; i < count; ++i) {
            const double size = std::abs(residuals[i]) / fit.scale;
            const double tukey = 1 - size * size / (kTukey * kTukey);
            if (iteration < kHuberIterations) {
                weights[i] = size <= kHuber ? 1 : kHuber / size;
            } else {
                weights[i] = tukey > 0 ? tukey * tukey : 0;
            }
        }
        const Eigen::LLT<Eigen::MatrixXd> normal(q.transpose() * weights.asDiagonal() * q);
        const Eigen::VectorXd next = normal.solve(q.transpose() * weights.cwiseProduct(y));
        if (!next.allFinite()) {
            z = next;
            break;
        }
        const double change = (next - z).norm();
        z = next;
        residuals = y - q * z;
        // In units of sigma, over all points together: far below what the noise leaves undecided.
        if (!(change > 1e-6 * fit.scale) && iteration > kHuberIterations) break;
    }
    fit.coefficients = qr.matrixQR().topRows(unknowns).triangularView<Eigen::Upper>().solve(z);
    fit.residuals = residuals.cwiseProduct(sigmas);
    fit.used.resize(static_cast<std::size_t>(count));
    double psi_squared = 0, slope = 0;
    for (Eigen::Index i = 0; i < count; ++i) {
        const double t = residuals[i] / fit.scale, u = t * t / (kTukey * kTukey);
        fit.used[static_cast<std::size_t>(i)] = u < 1;
        if (!(u < 1)) continue;
        ++fit.used_count;
        psi_squared += t * t * std::pow(1 - u, 4);
        slope += (1 - u) * (1 - 5 * u);
    }
    const double n = fit.used_count, mean_slope = slope / n;
    fit.variance_factor = fit.scale * fit.scale * psi_squared /
                          (std::max(n - static_cast<double>(unknowns), 1.0) * mean_slope * mean_slope);
    return fit;
}

}  // namespace fluorocut
