#include "core/procedure/pose_fusion.h"

#include <algorithm>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "core/base/chi_square.h"

namespace fluorocut {
namespace {

constexpr int kMostIterations = 20;
constexpr double kStill = 1e-12;  // mm, rad
constexpr double kMostTurn_rad = 0.5;

Result<void> requireCovariance(const std::string& of, const Matrix6& covariance, bool definite) {
    const bool symmetric = covariance.allFinite() && (covariance - covariance.transpose()).cwiseAbs().maxCoeff() <=
                                                         1e-6 * covariance.cwiseAbs().maxCoeff();
    if (symmetric) {
        // mm and rad side by side: judged on equal terms.
        const Vector6 sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt();
        const Vector6 scale = (sigma.array() > 0).select(sigma, 1).cwiseInverse();
        const double least = Eigen::SelfAdjointEigenSolver<Matrix6>(
                                 scale.asDiagonal() * covariance * scale.asDiagonal(), Eigen::EigenvaluesOnly)
                                 .eigenvalues()
                                 .minCoeff();
        if (covariance.diagonal().minCoeff() >= 0 && (definite ? least > 1e-12 : least >= -1e-9)) return {};
    }
    return invalidInput(of, "a covariance that is none",
                        definite ? "a symmetric, positive definite matrix" : "a symmetric, positive semidefinite one");
}

}  // namespace

Result<FusedPose> fusePoses(const MeasuredPose& prior, const std::vector<MeasuredPose>& measurements,
                            const Matrix6& common_covariance) {
    if (auto good = requireCovariance("prior", prior.covariance, true); !good) return good.error();
    if (auto good = requireCovariance("common error", common_covariance, false); !good) return good.error();
    for (std::size_t k = 0; k < measurements.size(); ++k) {
        const std::string of = fmt::format("measurement {}", k + 1);
        if (auto good = requireCovariance(of, measurements[k].covariance, true); !good) return good.error();
    }
    const auto n = static_cast<Eigen::Index>(measurements.size());
    Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(6 * (n + 1), 6 * (n + 1));
    spread.topLeftCorner<6, 6>() = prior.covariance;
    for (Eigen::Index i = 1; i <= n; ++i) {
        spread.block<6, 6>(6 * i, 6 * i) = measurements[static_cast<std::size_t>(i - 1)].covariance;
        for (Eigen::Index j = 1; j <= n; ++j)
            spread.block<6, 6>(6 * i, 6 * j) += common_covariance;
    }
    // Rotations and translations in units of their own: condition.
    const Eigen::VectorXd scale = spread.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::LDLT<Eigen::MatrixXd> factor(scale.asDiagonal() * spread * scale.asDiagonal());
    const auto whitened = [&](const Eigen::MatrixXd& rows) -> Eigen::MatrixXd {  // S^-1 rows
        return scale.asDiagonal() * factor.solve(scale.asDiagonal() * rows);
    };
    const Eigen::MatrixXd each = Matrix6::Identity().replicate(n + 1, 1);  // H
    const Eigen::MatrixXd pull = whitened(each);                           // S^-1 H
    const Matrix6 information = each.transpose() * pull;

    FusedPose fused;
    fused.covariance = information.ldlt().solve(Matrix6::Identity());
    fused.covariance = (0.5 * (fused.covariance + fused.covariance.transpose())).eval();
    const Eigen::MatrixXd weights = fused.covariance * pull.transpose();  // 6 x 6 (n + 1)
    fused.prior_weight = weights.leftCols<6>();
    for (Eigen::Index k = 1; k <= n; ++k)
        fused.weights.emplace_back(weights.middleCols<6>(6 * k));

    fused.pose = n > 0 ? measurements.back().pose : prior.pose;
    Eigen::VectorXd differences(6 * (n + 1));
    for (int iteration = 0;; ++iteration) {
        differences.head<6>() = prior.pose.deltaFrom(fused.pose);
        for (Eigen::Index k = 1; k <= n; ++k)
            differences.segment<6>(6 * k) = measurements[static_cast<std::size_t>(k - 1)].pose.deltaFrom(fused.pose);
        for (Eigen::Index k = 0; k <= n; ++k) {
            const double turn = differences.segment<3>(6 * k + 3).norm();
            if (!(turn <= kMostTurn_rad)) {
                return noSolution("measured poses", fmt::format("two that are {:.2f} rad apart", turn),
                                  fmt::format("at most {:g} rad", kMostTurn_rad), "register again");
            }
        }
        const Vector6 step = weights * differences;
        if (step.cwiseAbs().maxCoeff() <= kStill || iteration == kMostIterations) break;
        fused.pose = fused.pose.perturbed(step);
    }
    fused.chi_square = differences.dot(whitened(differences).col(0));
    fused.degrees_of_freedom = static_cast<int>(6 * n);
    if (n > 0) fused.probability = chiSquareTail(std::max(0.0, fused.chi_square), fused.degrees_of_freedom);
    return fused;
}

}  // namespace fluorocut
