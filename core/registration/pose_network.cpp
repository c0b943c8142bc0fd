#include "core/registration/pose_network.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Dense>

namespace fluorocut {
namespace {

// Directions that nothing determines get this many times the variance of a well-determined one.
constexpr double kUndetermined = 1e14;
constexpr double kStepTolerance = 1e-9;  // of a standard deviation; a hundredth would do

Rigid3 poseOf(const PoseStep& step, const std::vector<Rigid3>& poses) {
    const Rigid3& pose = step.variable < 0 ? step.known : poses.at(static_cast<std::size_t>(step.variable));
    return step.inverted ? pose.inverse() : pose;
}

// log(Exp(dr) R) = log(R) + J dr for small dr: the inverse of SO(3)'s left Jacobian.
Matrix3 logDerivative(const Vector3& rotation) {
    const double angle = rotation.norm();
    const Matrix3 cross = skew(rotation);
    if (angle < 1e-4) return Matrix3::Identity() - 0.5 * cross + cross * cross / 12;
    const double half = 0.5 * angle;
    return Matrix3::Identity() - 0.5 * cross + (1 - half / std::tan(half)) / (angle * angle) * cross * cross;
}

// One factor's quadratic as the network's normal equations see it, at some poses and parameters.
struct Linearised {
    Eigen::VectorXd gradient;     // by (pose, its shared)
    Eigen::MatrixXd information;  //
    Vector6 residual;             // seen, given the shared parameters, minus predicted
    double squared_distance = 0;
    double cost = 0;  // of the pose part, squared_distance / 2, plus the shared part
};

// What the image says, split in the pose given the parameters and the parameters alone (Schur):
//     d^T H d / 2 + g . d = (dp - m(ds))^T Hpp (dp - m(ds)) / 2 + ds^T S ds / 2 + h . ds + constant
// and with the known steps' covariance K (in the target frame) Hpp becomes (Hpp^-1 + K)^-1: the parameters' own part
// does not know of it.
struct Split {
    Vector6 at;               // m(0)
    Eigen::MatrixXd follows;  // m(ds) = m(0) + follows ds
    Matrix6 covariance;       // Hpp^-1
    Eigen::MatrixXd shared_information;
    Eigen::VectorXd shared_gradient;
};

Split split(const PoseEvidence& evidence) {
    const Eigen::Index n = evidence.shared.size();
    const Eigen::LDLT<Matrix6> pose(Matrix6(evidence.information.topLeftCorner<6, 6>()));
    Split result;
    result.at = -pose.solve(Vector6(evidence.gradient.head<6>()));
    result.covariance = pose.solve(Matrix6::Identity());
    result.covariance = 0.5 * (result.covariance + result.covariance.transpose()).eval();
    // Not by the decomposition: it may not solve for no columns at all.
    result.follows = -result.covariance * evidence.information.topRightCorner(6, n);
    result.shared_information =
        evidence.information.bottomRightCorner(n, n) + evidence.information.bottomLeftCorner(n, 6) * result.follows;
    result.shared_gradient = evidence.gradient.tail(n) + evidence.information.bottomLeftCorner(n, 6) * result.at;
    return result;
}

class Solver {
  public:
    Solver(const PoseNetwork& network, const PoseNetworkOptions& options)
        : network_(network), options_(options), poses_(network.poses), shared_(network.shared) {
        const Eigen::Index n = shared_.size();
        if (network.shared_information.rows() != n || network.shared_information.cols() != n)
            throw std::logic_error("PoseNetwork: the prior has another size than the shared parameters");
        for (const PoseFactor& factor : network.factors) {
            const Eigen::Index own = factor.evidence.shared.size(), all = 6 + own;
            if (factor.evidence.information.rows() != all || factor.evidence.information.cols() != all ||
                factor.evidence.gradient.size() != all || static_cast<Eigen::Index>(factor.shared.size()) != own)
                throw std::logic_error("PoseNetwork: a factor's sizes do not belong together");
            for (const int index : factor.shared)
                if (index < 0 || index >= n) throw std::logic_error("PoseNetwork: no such shared parameter");
            evidence_.push_back(factor.evidence);
            splits_.push_back(split(factor.evidence));
        }
    }

    PoseNetworkResult solve() {
        PoseNetworkResult result;
        double damping = 1e-6;
        double cost = totalCost(poses_, shared_);
        for (int i = 0; i < options_.iterations && !result.converged; ++i) {
            buildNormalEquations();
            bool better = false;
            for (int tries = 0; tries < 12 && !better; ++tries) {
                Eigen::MatrixXd damped = information_;
                damped.diagonal() +=
                    damping * information_.diagonal() + Eigen::VectorXd::Constant(information_.rows(), 1e-300);
                const Eigen::VectorXd step = -damped.ldlt().solve(gradient_);
                if (!step.allFinite()) {
                    damping *= 10;
                    continue;
                }
                std::vector<Rigid3> poses = poses_;
                for (std::size_t p = 0; p < poses.size(); ++p)
                    poses[p] = poses[p].perturbed(step.segment<6>(6 * static_cast<Eigen::Index>(p)));
                const Eigen::VectorXd shared = shared_ + step.tail(shared_.size());
                const double next = totalCost(poses, shared);
                const double promised = std::abs(gradient_.dot(step));
                if (next <= cost || promised < kStepTolerance) {
                    result.converged = promised < kStepTolerance;
                    poses_ = std::move(poses);
                    shared_ = shared;
                    cost = next;
                    damping = std::max(1e-12, 0.1 * damping);
                    better = true;
                } else {
                    damping = std::max(1e-9, 10 * damping);
                }
            }
            if (!better) break;
            if (options_.relinearise && result.converged && askAgain()) {
                cost = totalCost(poses_, shared_);
                result.converged = false;
            }
        }
        report(result);
        return result;
    }

  private:
    Linearised linearise(std::size_t i, const std::vector<Rigid3>& poses, const Eigen::VectorXd& shared) const {
        const PoseFactor& factor = network_.factors[i];
        const Split& parts = splits_[i];
        const Eigen::Index n = evidence_[i].shared.size();
        Eigen::VectorXd moved(n);
        for (Eigen::Index k = 0; k < n; ++k)
            moved[k] = shared[factor.shared[static_cast<std::size_t>(k)]] - evidence_[i].shared[k];
        const Vector6 from = product(factor.chain, poses).deltaFrom(evidence_[i].target_from_source);
        Linearised result;
        result.residual = parts.at + parts.follows * moved - from;
        Matrix6 covariance = parts.covariance;
        for (std::size_t s = 0; s < factor.chain.size(); ++s) {
            if (factor.chain[s].variable >= 0 || factor.chain[s].covariance.isZero(0)) continue;
            const Matrix6 carried = stepDerivative(factor.chain, s, poses);
            covariance += carried * factor.chain[s].covariance * carried.transpose();
        }
        const Matrix6 information = covariance.ldlt().solve(Matrix6::Identity());
        const Vector6 weighted = information * result.residual;
        result.squared_distance = result.residual.dot(weighted);
        result.cost = 0.5 * moved.dot(parts.shared_information * moved) + parts.shared_gradient.dot(moved);
        // residual = m(ds) - dp
        result.information.resize(6 + n, 6 + n);
        result.gradient.resize(6 + n);
        result.information.topLeftCorner<6, 6>() = information;
        result.information.topRightCorner(6, n) = -information * parts.follows;
        result.information.bottomLeftCorner(n, 6) = result.information.topRightCorner(6, n).transpose();
        result.information.bottomRightCorner(n, n) =
            parts.follows.transpose() * information * parts.follows + parts.shared_information;
        result.gradient.head<6>() = -weighted;
        result.gradient.tail(n) =
            parts.follows.transpose() * weighted + parts.shared_information * moved + parts.shared_gradient;
        return result;
    }

    double weight(std::size_t i, double squared_distance) const {
        const double c = options_.robust_scale;
        const double tail = std::isfinite(c) ? 1 + squared_distance / (c * c) : 1;
        return network_.factors[i].weight / (tail * tail);
    }

    // Geman and McClure's loss is d^2 / (1 + d^2 / c^2) / 2.
    double totalCost(const std::vector<Rigid3>& poses, const Eigen::VectorXd& shared) const {
        const Eigen::VectorXd moved = shared - network_.shared;
        double cost = 0.5 * moved.dot(network_.shared_information * moved);
        const double c = options_.robust_scale;
        for (std::size_t i = 0; i < network_.factors.size(); ++i) {
            if (network_.factors[i].weight <= 0) continue;
            const Linearised at = linearise(i, poses, shared);
            const double d = at.squared_distance;
            const double robust = std::isfinite(c) ? d / (1 + d / (c * c)) : d;
            cost += network_.factors[i].weight * (0.5 * robust + at.cost);
        }
        return cost;
    }

    void buildNormalEquations() {
        const Eigen::Index of_poses = 6 * static_cast<Eigen::Index>(poses_.size());
        const Eigen::Index all = of_poses + shared_.size();
        information_ = Eigen::MatrixXd::Zero(all, all);
        gradient_ = Eigen::VectorXd::Zero(all);
        information_.bottomRightCorner(shared_.size(), shared_.size()) = network_.shared_information;
        gradient_.tail(shared_.size()) = network_.shared_information * (shared_ - network_.shared);
        for (std::size_t i = 0; i < network_.factors.size(); ++i) {
            const PoseFactor& factor = network_.factors[i];
            if (factor.weight <= 0) continue;
            const Linearised at = linearise(i, poses_, shared_);
            const Vector3 turned = product(factor.chain, poses_).deltaFrom(evidence_[i].target_from_source).tail<3>();
            const Eigen::Index n = evidence_[i].shared.size();
            // (pose, its shared) by everything
            Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(6 + n, all);
            for (std::size_t s = 0; s < factor.chain.size(); ++s) {
                if (factor.chain[s].variable < 0) continue;
                Matrix6 carried = stepDerivative(factor.chain, s, poses_);
                carried.bottomRows<3>() = (logDerivative(turned) * carried.bottomRows<3>()).eval();
                jacobian.block<6, 6>(0, 6 * factor.chain[s].variable) += carried;
            }
            for (Eigen::Index k = 0; k < n; ++k)
                jacobian(6 + k, of_poses + factor.shared[static_cast<std::size_t>(k)]) += 1;
            const double w = weight(i, at.squared_distance);
            information_ += w * jacobian.transpose() * at.information * jacobian;
            gradient_ += w * jacobian.transpose() * at.gradient;
        }
    }

    // True when an image's new answer moves the solution.
    bool askAgain() {
        bool moved = false;
        for (std::size_t i = 0; i < evidence_.size(); ++i) {
            const PoseFactor& factor = network_.factors[i];
            if (factor.weight <= 0) continue;
            Eigen::VectorXd values(evidence_[i].shared.size());
            for (Eigen::Index k = 0; k < values.size(); ++k)
                values[k] = shared_[factor.shared[static_cast<std::size_t>(k)]];
            const Linearised before = linearise(i, poses_, shared_);
            PoseEvidence answer = options_.relinearise(i, product(factor.chain, poses_), values);
            if (answer.information.size() == 0) continue;
            if (answer.shared.size() != values.size())
                throw std::logic_error("PoseNetwork: an image answers with other parameters");
            evidence_[i] = std::move(answer);
            splits_[i] = split(evidence_[i]);
            const Vector6 change = linearise(i, poses_, shared_).residual - before.residual;
            moved |= change.dot(before.information.topLeftCorner<6, 6>() * change) > 1e-4;
        }
        return moved && ++times_asked_ < 5;
    }

    void report(PoseNetworkResult& result) {
        buildNormalEquations();
        // Scaled to a unit diagonal, so that mm and rad do not decide what counts as zero.
        const Eigen::VectorXd scale =
            information_.diagonal().unaryExpr([](double v) { return v > 0 ? 1 / std::sqrt(v) : 1; });
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * information_ *
                                                                   scale.asDiagonal());
        Eigen::VectorXd inverse(scale.size());
        for (Eigen::Index i = 0; i < inverse.size(); ++i) {
            const double value = eigen.eigenvalues()[i];
            inverse[i] = value > 1 / kUndetermined ? 1 / value : kUndetermined;
        }
        const Eigen::MatrixXd vectors = scale.asDiagonal() * eigen.eigenvectors();
        result.covariance = vectors * inverse.asDiagonal() * vectors.transpose();
        result.poses = poses_;
        result.shared = shared_;
        const Eigen::VectorXd moved = shared_ - network_.shared;
        result.prior_distance = moved.dot(network_.shared_information * moved);
        for (std::size_t i = 0; i < network_.factors.size(); ++i) {
            const Linearised at = linearise(i, poses_, shared_);
            result.residuals.push_back(at.residual);
            result.squared_distances.push_back(at.squared_distance);
            result.weights.push_back(weight(i, at.squared_distance));
        }
    }

    const PoseNetwork& network_;
    const PoseNetworkOptions& options_;
    std::vector<Rigid3> poses_;
    Eigen::VectorXd shared_;
    std::vector<PoseEvidence> evidence_;
    std::vector<Split> splits_;
    Eigen::MatrixXd information_;
    Eigen::VectorXd gradient_;
    int times_asked_ = 0;
};

}  // namespace

PoseEvidence evidenceOf(const Rigid3& target_from_source, const Matrix6& covariance) {
    const Eigen::LLT<Matrix6> factors(covariance);
    if (factors.info() != Eigen::Success) throw std::logic_error("evidenceOf: the covariance is not positive definite");
    PoseEvidence evidence;
    evidence.target_from_source = target_from_source;
    evidence.shared = Eigen::VectorXd(0);
    evidence.information = factors.solve(Matrix6::Identity());
    evidence.gradient = Eigen::VectorXd::Zero(6);
    return evidence;
}

PoseEvidence withNoise(PoseEvidence evidence, const Matrix6& own_covariance) {
    const double ratio = (evidence.information.topLeftCorner<6, 6>() * own_covariance).trace() / 6;
    if (!(ratio > 1)) return evidence;
    evidence.information /= ratio;
    evidence.gradient /= ratio;
    return evidence;
}

PoseEvidence posesOnly(PoseEvidence evidence) {
    const Eigen::Index n = evidence.shared.size();
    const Split parts = split(evidence);
    evidence.information.bottomRightCorner(n, n) -= parts.shared_information;
    evidence.gradient.tail(n) -= parts.shared_gradient;
    return evidence;
}

PoseNetworkResult solvePoseNetwork(const PoseNetwork& network, const PoseNetworkOptions& options) {
    return Solver(network, options).solve();
}

Rigid3 product(const std::vector<PoseStep>& chain, const std::vector<Rigid3>& poses) {
    Rigid3 result;
    for (const PoseStep& step : chain)
        result = result * poseOf(step, poses);
    return result;
}

Matrix6 stepDerivative(const std::vector<PoseStep>& chain, std::size_t step, const std::vector<Rigid3>& poses) {
    Rigid3 left, right;
    for (std::size_t i = 0; i < chain.size(); ++i) {
        if (i < step) left = left * poseOf(chain[i], poses);
        if (i > step) right = right * poseOf(chain[i], poses);
    }
    const PoseStep& one = chain.at(step);
    const Rigid3 pose = poseOf(one, poses);
    // of `pose` by its own perturbation; of an inverse (R^T, -R^T t): dt' = R^T (dr x t - dt), dr' = -R^T dr
    Matrix6 own = Matrix6::Identity();
    if (one.inverted) {
        const Matrix3 back = pose.rotationMatrix();
        const Vector3 t = pose.inverse().translation();
        own.topLeftCorner<3, 3>() = -back;
        own.topRightCorner<3, 3>() = -back * skew(t);
        own.bottomRightCorner<3, 3>() = -back;
    }
    // left * pose * right: dt = L (dt + dr x (R right)), dr = L dr
    const Matrix3 turn = left.rotationMatrix();
    Matrix6 carried = Matrix6::Zero();
    carried.topLeftCorner<3, 3>() = turn;
    carried.topRightCorner<3, 3>() = -turn * skew(pose.rotate(right.translation()));
    carried.bottomRightCorner<3, 3>() = turn;
    return carried * own;
}

}  // namespace fluorocut
