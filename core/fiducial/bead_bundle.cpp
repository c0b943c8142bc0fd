#include "core/fiducial/bead_bundle.h"

#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Dense>
#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <fmt/format.h>

namespace fluorocut {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kIntrinsics = 4;
// Residuals of so many standard deviations begin to lose weight (Cauchy). For normal noise in two dimensions the
// weighted mean square is then this part of the unweighted one: with a = kLossScale^2 / 2 and E = a exp(a) E1(a), it is
// a (1 - E) / E.
constexpr double kLossScale = 3;
constexpr double kWeightedShare = 0.859;

// One shadow, in standard deviations. The pose is a perturbation of where it stood at the start.
struct ShadowResidual {
    Vector3 rotated;  // R0 * bead
    Vector3 translation;
    double radius;
    Vector2 seen;
    Eigen::Matrix2d whitening;

    template <class T>
    bool operator()(const T* intrinsics, const T* delta, T* residual) const {
        const T bead[3] = {T(rotated.x()), T(rotated.y()), T(rotated.z())};
        T turned[3];
        ceres::AngleAxisRotatePoint(delta + 3, bead, turned);
        const T x = turned[0] + translation.x() + delta[0], y = turned[1] + translation.y() + delta[1],
                z = turned[2] + translation.z() + delta[2];
        const T denominator = z * z - radius * radius;
        if (!(z > T(radius))) return false;
        const T scale = intrinsics[0] * z / denominator;
        const T u = seen.x() - (scale * x + intrinsics[1]), v = seen.y() - (intrinsics[3] * scale * y + intrinsics[2]);
        residual[0] = whitening(0, 0) * u + whitening(0, 1) * v;
        residual[1] = whitening(1, 0) * u + whitening(1, 1) * v;
        return true;
    }
};

struct PriorResidual {
    int index;
    double mean, sigma;

    template <class T>
    bool operator()(const T* intrinsics, T* residual) const {
        residual[0] = (intrinsics[index] - mean) / sigma;
        return true;
    }
};

struct State {
    std::array<double, kIntrinsics> intrinsics;
    std::vector<Rigid3> poses;
};

Eigen::Matrix2d whiteningOf(const Eigen::Matrix2d& covariance, double unexplained) {
    const Eigen::Matrix2d total = covariance + unexplained * unexplained * Eigen::Matrix2d::Identity();
    // total = L L^T, whitening = L^-1
    return total.llt().matrixL().solve(Eigen::Matrix2d::Identity());
}

PixelIntrinsics intrinsicsOf(const State& state) {
    return {state.intrinsics[0], {state.intrinsics[1], state.intrinsics[2]}, state.intrinsics[3]};
}

class Bundle {
  public:
    Bundle(const BeadLayout& layout, const std::vector<BundleView>& views, const PixelIntrinsics& start,
           const IntrinsicsPrior& prior, const BundleOptions& options)
        : layout_(layout),
          views_(views),
          options_(options),
          mean_{start.focal_px, start.principal_point_px.x(), start.principal_point_px.y(), start.aspect},
          sigma_{prior.focal_px, prior.principal_point_px, prior.principal_point_px, prior.aspect} {
        state_.intrinsics = mean_;
        for (const BundleView& view : views)
            state_.poses.push_back(view.imager_from_layout);
    }

    // One minimisation; afterwards the poses hold what was found.
    bool solve(double unexplained) {
        State next = state_;
        std::vector<std::array<double, 6>> deltas(views_.size(), std::array<double, 6>{});
        ceres::Problem problem;
        build(problem, next.intrinsics.data(), deltas, unexplained);
        ceres::Solver::Options solver;
        solver.linear_solver_type = ceres::DENSE_QR;
        solver.max_num_iterations = options_.iterations;
        solver.function_tolerance = 1e-12;
        solver.parameter_tolerance = 1e-12;
        solver.logging_type = ceres::SILENT;
        solver.num_threads = 1;
        ceres::Solver::Summary summary;
        ceres::Solve(solver, &problem, &summary);
        if (!summary.IsSolutionUsable()) return false;
        for (std::size_t i = 0; i < views_.size(); ++i)
            next.poses[i] = next.poses[i].perturbed(Eigen::Map<const Vector6>(deltas[i].data()));
        state_ = next;
        return summary.termination_type == ceres::CONVERGENCE;
    }

    Eigen::MatrixXd covariance(double unexplained) {
        std::vector<std::array<double, 6>> deltas(views_.size(), std::array<double, 6>{});
        ceres::Problem problem;
        std::array<double, kIntrinsics> intrinsics = state_.intrinsics;
        build(problem, intrinsics.data(), deltas, unexplained);
        ceres::CRSMatrix sparse;
        ceres::Problem::EvaluateOptions evaluate;
        // For normal noise the Cauchy loss costs 2 % of the precision; its curvature at one sample says nothing of it.
        evaluate.apply_loss_function = false;
        evaluate.parameter_blocks.push_back(intrinsics.data());
        for (auto& delta : deltas)
            evaluate.parameter_blocks.push_back(delta.data());
        problem.Evaluate(evaluate, nullptr, nullptr, nullptr, &sparse);
        Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(sparse.num_rows, sparse.num_cols);
        for (int row = 0; row < sparse.num_rows; ++row) {
            for (int k = sparse.rows[static_cast<std::size_t>(row)]; k < sparse.rows[static_cast<std::size_t>(row) + 1];
                 ++k)
                jacobian(row, sparse.cols[static_cast<std::size_t>(k)]) = sparse.values[static_cast<std::size_t>(k)];
        }
        // Columns of the free parameters only: Ceres leaves out what is fixed.
        std::vector<int> free;
        for (int i = 0; i < kIntrinsics; ++i) {
            if (sigma_[static_cast<std::size_t>(i)] > 0) free.push_back(i);
        }
        const int all = kIntrinsics + 6 * static_cast<int>(views_.size());
        for (int i = kIntrinsics; i < all; ++i)
            free.push_back(i);
        if (jacobian.cols() == all) {  // evaluated with zero columns for what is fixed
            Eigen::MatrixXd kept(jacobian.rows(), static_cast<Eigen::Index>(free.size()));
            for (std::size_t i = 0; i < free.size(); ++i)
                kept.col(static_cast<Eigen::Index>(i)) = jacobian.col(free[i]);
            jacobian = kept;
        }
        const Eigen::MatrixXd inverse = pseudoInverse(jacobian);
        Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(all, all);
        for (std::size_t i = 0; i < free.size(); ++i) {
            for (std::size_t j = 0; j < free.size(); ++j)
                covariance(free[i], free[j]) = inverse(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
        }
        return covariance;
    }

    // Robustly weighted sum of squares over what is expected of it.
    double reducedChiSquared(double unexplained) const {
        double sum = 0, count = 0;
        for (std::size_t i = 0; i < views_.size(); ++i) {
            for (const BeadObservation& seen : views_[i].observations) {
                const Vector2 r = whiteningOf(seen.covariance_px2, unexplained) * residual(i, seen);
                const double s = r.squaredNorm(), weight = 1 / (1 + s / (kLossScale * kLossScale));
                sum += weight * s;
                count += 2 * weight;
            }
        }
        double parameters = 6.0 * static_cast<double>(views_.size());
        for (const double sigma : sigma_)
            parameters += sigma > 0 ? 1 : 0;
        return sum / kWeightedShare / std::max(1.0, count - parameters);
    }

    Vector2 residual(std::size_t view, const BeadObservation& seen) const {
        const Bead& bead = layout_.beads[seen.bead];
        return seen.ideal_px -
               predictedPixel(intrinsicsOf(state_), state_.poses[view] * bead.center_mm, 0.5 * bead.diameter_mm);
    }

    const State& state() const { return state_; }

  private:
    void build(ceres::Problem& problem, double* intrinsics, std::vector<std::array<double, 6>>& deltas,
               double unexplained) {
        problem.AddParameterBlock(intrinsics, kIntrinsics);
        std::vector<int> fixed;
        for (int i = 0; i < kIntrinsics; ++i) {
            const double sigma = sigma_[static_cast<std::size_t>(i)];
            if (sigma <= 0) {
                fixed.push_back(i);
            } else if (std::isfinite(sigma)) {
                problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PriorResidual, 1, kIntrinsics>(
                                             new PriorResidual{i, mean_[static_cast<std::size_t>(i)], sigma}),
                                         nullptr, intrinsics);
            }
        }
        if (static_cast<int>(fixed.size()) == kIntrinsics) {
            problem.SetParameterBlockConstant(intrinsics);
        } else if (!fixed.empty()) {
            problem.SetManifold(intrinsics, new ceres::SubsetManifold(kIntrinsics, fixed));
        }
        for (std::size_t i = 0; i < views_.size(); ++i) {
            problem.AddParameterBlock(deltas[i].data(), 6);
            for (const BeadObservation& seen : views_[i].observations) {
                const Bead& bead = layout_.beads[seen.bead];
                problem.AddResidualBlock(
                    new ceres::AutoDiffCostFunction<ShadowResidual, 2, kIntrinsics, 6>(new ShadowResidual{
                        state_.poses[i].rotate(bead.center_mm), state_.poses[i].translation(), 0.5 * bead.diameter_mm,
                        seen.ideal_px, whiteningOf(seen.covariance_px2, unexplained)}),
                    new ceres::CauchyLoss(kLossScale), intrinsics, deltas[i].data());
            }
        }
    }

    // (J^T J)^-1 with every column scaled to length one; directions without any information get an infinite variance.
    static Eigen::MatrixXd pseudoInverse(const Eigen::MatrixXd& jacobian) {
        const Eigen::VectorXd lengths = jacobian.colwise().norm().cwiseMax(1e-300);
        const Eigen::MatrixXd scaled = jacobian * lengths.cwiseInverse().asDiagonal();
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled.transpose() * scaled);
        const Eigen::Index count = eigen.eigenvalues().size();
        Eigen::VectorXd inverse(count);
        for (Eigen::Index i = 0; i < count; ++i) {
            const double value = eigen.eigenvalues()[i];
            inverse[i] = value > 1e-13 ? 1 / value : 1e13;
        }
        const Eigen::MatrixXd vectors = lengths.cwiseInverse().asDiagonal() * eigen.eigenvectors();
        return vectors * inverse.asDiagonal() * vectors.transpose();
    }

    const BeadLayout& layout_;
    const std::vector<BundleView>& views_;
    const BundleOptions& options_;
    std::array<double, kIntrinsics> mean_;
    std::array<double, kIntrinsics> sigma_;
    State state_;
};

}  // namespace

Vector2 predictedPixel(const PixelIntrinsics& intrinsics, const Vector3& center_in_imager, double radius_mm) {
    const double z = center_in_imager.z();
    if (!(z > radius_mm)) return Vector2::Constant(std::numeric_limits<double>::quiet_NaN());
    const double scale = intrinsics.focal_px * z / (z * z - radius_mm * radius_mm);
    return {scale * center_in_imager.x() + intrinsics.principal_point_px.x(),
            intrinsics.aspect * scale * center_in_imager.y() + intrinsics.principal_point_px.y()};
}

Result<BundleResult> solveBundle(const BeadLayout& layout, const std::vector<BundleView>& views,
                                 const PixelIntrinsics& start, const IntrinsicsPrior& prior,
                                 const BundleOptions& options) {
    for (const BundleView& view : views) {
        for (const BeadObservation& seen : view.observations) {
            if (seen.bead >= layout.beads.size()) throw std::logic_error("solveBundle: no such bead");
            const double z = (view.imager_from_layout * layout.beads[seen.bead].center_mm).z();
            if (!(z > layout.beads[seen.bead].diameter_mm)) {
                return noSolution("pose of the beads", "a bead behind the X-ray source at the start",
                                  "all beads in front of it");
            }
        }
    }
    Bundle bundle(layout, views, start, prior, options);
    double unexplained = options.least_unexplained_px;
    BundleResult result;
    // The poses are folded in and the left-over errors measured anew until they fit each other.
    for (int round = 0; round < 4; ++round) {
        result.converged = bundle.solve(unexplained);
        double low = options.least_unexplained_px, high = 100;
        if (bundle.reducedChiSquared(low) <= 1) {
            high = low;
        } else {
            for (int i = 0; i < 40; ++i) {
                const double middle = std::sqrt(low * high);
                (bundle.reducedChiSquared(middle) > 1 ? low : high) = middle;
            }
        }
        const bool settled = std::abs(high - unexplained) < 0.02 * unexplained;
        unexplained = high;
        if (settled && round > 0) break;
    }
    result.intrinsics = intrinsicsOf(bundle.state());
    result.views = views;
    result.unexplained_px = unexplained;
    double squares = 0, count = 0;
    for (std::size_t i = 0; i < views.size(); ++i) {
        result.views[i].imager_from_layout = bundle.state().poses[i];
        std::vector<Vector2> residuals;
        for (const BeadObservation& seen : views[i].observations) {
            residuals.push_back(bundle.residual(i, seen));
            squares += residuals.back().squaredNorm();
            count += 2;
        }
        result.residuals_px.push_back(std::move(residuals));
    }
    result.rms_px = count > 0 ? std::sqrt(squares / count) : kInfinity;
    if (!std::isfinite(result.rms_px)) {
        return noSolution("pose of the beads", "no convergence", "beads that lie where the layout has them");
    }
    result.covariance = bundle.covariance(unexplained);
    return result;
}

}  // namespace fluorocut
