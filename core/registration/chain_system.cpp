#include "core/registration/chain_system.h"

#include <cmath>

#include <Eigen/Cholesky>

namespace fluorocut::chain {
namespace {

// Rotations count as mm at this distance, so that numbers of both kinds are of one size.
constexpr double kLeverMm = 100;
// What is stated as exact is taken as known to this: the system stays solvable.
constexpr double kLeastSigmaMm = 1e-7;

// Of log(Exp(d) Exp(e)) by d, at d = 0.
Matrix3 leftJacobianInverse(const Vector3& e) {
    const Matrix3 cross = skew(e);
    const double angle = e.norm();
    const double second = angle < 1e-3 ? 1.0 / 12 : 1 / (angle * angle) - 0.5 / (angle * std::tan(0.5 * angle));
    return Matrix3::Identity() - 0.5 * cross + second * cross * cross;
}

Eigen::MatrixXd scaling(Eigen::Index size) {
    Eigen::VectorXd scale(size);
    for (Eigen::Index i = 0; i < size; ++i)
        scale[i] = i % 6 < 3 ? 1 : kLeverMm;
    return scale.asDiagonal();
}

// S^-1 D and the estimate's covariance for the design D (6 n x 6).
struct Weights {
    Matrix6 covariance;
    Eigen::MatrixXd gain;
};

Weights weightsFor(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& design) {
    const Eigen::MatrixXd scale = scaling(covariance.rows());
    Eigen::MatrixXd scaled = scale * covariance * scale;
    scaled.diagonal().array() += kLeastSigmaMm * kLeastSigmaMm;
    const Eigen::MatrixXd weighted = scale * scaled.ldlt().solve(scale * design);
    const Matrix6 scale6 = scaling(6);
    const Matrix6 unscaled = scale6.inverse();
    const Matrix6 information = design.transpose() * weighted;
    const Matrix6 inverse = unscaled * Matrix6(unscaled * information * unscaled).ldlt().solve(unscaled);
    Weights weights;
    weights.covariance = 0.5 * (inverse + inverse.transpose());
    weights.gain = weights.covariance * weighted.transpose();
    return weights;
}

Eigen::MatrixXd unitDesign(std::size_t views) {
    return Matrix6::Identity().replicate(static_cast<Eigen::Index>(views), 1);
}

}  // namespace

System buildSystem(const ChainProblem& problem, const std::vector<std::size_t>& views) {
    System system;
    const auto rows = static_cast<Eigen::Index>(6 * views.size());
    const auto shared = static_cast<Eigen::Index>(problem.parameters.size());
    Source hand_eye{Source::Kind::hand_eye, 0, Eigen::MatrixXd::Zero(rows, 6), Matrix6::Zero(), {}};
    if (problem.flange_from_corkscrew.covariance) hand_eye.covariance = *problem.flange_from_corkscrew.covariance;
    Eigen::MatrixXd by_parameters = Eigen::MatrixXd::Zero(rows, shared);
    for (std::size_t i = 0; i < views.size(); ++i) {
        const ChainView& view = problem.views[views[i]];
        const Rigid3& robot = view.robot_from_flange.target_from_source;
        const Rigid3& mount = problem.flange_from_corkscrew.target_from_source;
        const Rigid3& a = view.imager_from_corkscrew.pose.target_from_source;
        const Rigid3& b = view.imager_from_femur.pose.target_from_source;
        const Rigid3 corkscrew_from_imager = a.inverse(), corkscrew_from_femur = corkscrew_from_imager * b;
        const Rigid3 robot_from_corkscrew = robot * mount;
        system.answers.push_back(robot_from_corkscrew * corkscrew_from_femur);
        const Matrix6 by_robot = productByLeft(robot, mount * corkscrew_from_femur);
        const Matrix6 by_mount = productByRight(robot) * productByLeft(mount, corkscrew_from_femur);
        const Matrix6 by_a =
            productByRight(robot_from_corkscrew) * productByLeft(corkscrew_from_imager, b) * inverseByPose(a);
        const Matrix6 by_b = productByRight(robot_from_corkscrew * corkscrew_from_imager);
        const auto row = static_cast<Eigen::Index>(6 * i);
        const auto add = [&](Source::Kind kind, const Matrix6& effect, const std::optional<Matrix6>& covariance) {
            if (!covariance) return;
            Source source{kind, views[i], Eigen::MatrixXd::Zero(rows, 6), *covariance, {}};
            source.effect.middleRows<6>(row) = effect;
            system.sources.push_back(std::move(source));
        };
        add(Source::Kind::corkscrew, by_a, view.imager_from_corkscrew.pose.covariance);
        add(Source::Kind::beads, by_b, view.imager_from_femur.pose.covariance);
        add(Source::Kind::robot, by_robot, view.robot_from_flange.covariance);
        hand_eye.effect.middleRows<6>(row) = by_mount;
        const auto share = [&](const PoseMeasurement& measurement, const Matrix6& effect) {
            for (std::size_t k = 0; k < measurement.parameters.size(); ++k) {
                by_parameters.block<6, 1>(row, static_cast<Eigen::Index>(measurement.parameters[k])) +=
                    effect * measurement.sensitivity.col(static_cast<Eigen::Index>(k));
            }
        };
        share(view.imager_from_corkscrew, by_a);
        share(view.imager_from_femur, by_b);
    }
    system.sources.push_back(std::move(hand_eye));
    // One source for each group of parameters: the terms of the budget.
    std::vector<bool> done(problem.parameters.size(), false);
    for (std::size_t i = 0; i < problem.parameters.size(); ++i) {
        if (done[i]) continue;
        Source source{Source::Kind::parameters, 0, {}, {}, {}};
        for (std::size_t j = i; j < problem.parameters.size(); ++j) {
            if (problem.parameters[j].group != problem.parameters[i].group) continue;
            done[j] = true;
            source.parameters.push_back(j);
        }
        const auto count = static_cast<Eigen::Index>(source.parameters.size());
        source.effect.resize(rows, count);
        source.covariance = Eigen::MatrixXd::Zero(count, count);
        for (Eigen::Index j = 0; j < count; ++j) {
            const std::size_t index = source.parameters[static_cast<std::size_t>(j)];
            source.effect.col(j) = by_parameters.col(static_cast<Eigen::Index>(index));
            source.covariance(j, j) = problem.parameters[index].sigma * problem.parameters[index].sigma;
        }
        system.sources.push_back(std::move(source));
    }
    system.covariance = Eigen::MatrixXd::Zero(rows, rows);
    for (const Source& source : system.sources)
        system.covariance += source.effect * source.covariance * source.effect.transpose();
    return system;
}

Matrix6 predictedCovariance(const System& system) {
    return weightsFor(system.covariance, unitDesign(system.answers.size())).covariance;
}

Solution solve(const System& system) {
    const std::size_t count = system.answers.size();
    const auto rows = static_cast<Eigen::Index>(6 * count);
    Solution solution;
    // Start: the view that is known best.
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < count; ++i) {
        const auto row = static_cast<Eigen::Index>(6 * i);
        const double spread = (scaling(6) * system.covariance.block<6, 6>(row, row) * scaling(6)).trace();
        if (spread < least) {
            least = spread;
            best = i;
        }
    }
    solution.robot_from_femur = system.answers[best];
    const auto residual = [&](const Rigid3& estimate) {
        Eigen::VectorXd e(rows);
        for (std::size_t i = 0; i < count; ++i)
            e.segment<6>(static_cast<Eigen::Index>(6 * i)) = system.answers[i].deltaFrom(estimate);
        return e;
    };
    for (int round = 0; round < 30; ++round) {
        const Eigen::VectorXd e = residual(solution.robot_from_femur);
        // A step d of the estimate takes the residual (t, w) to (t - d_t, log(Exp(w) Exp(-d_w))).
        Eigen::MatrixXd design = unitDesign(count);
        for (std::size_t i = 0; i < count; ++i) {
            const auto row = static_cast<Eigen::Index>(6 * i);
            const Vector3 w = e.segment<3>(row + 3);
            design.block<3, 3>(row + 3, 3) = leftJacobianInverse(-w);
        }
        const Weights weights = weightsFor(system.covariance, design);
        const Vector6 step = weights.gain * e;
        solution.robot_from_femur = solution.robot_from_femur.perturbed(step);
        if (step.head<3>().norm() < 1e-10 && step.tail<3>().norm() < 1e-13) break;
    }
    const Weights weights = weightsFor(system.covariance, unitDesign(count));
    solution.covariance = weights.covariance;
    solution.gain = weights.gain;
    solution.residual = residual(solution.robot_from_femur);
    const Eigen::MatrixXd scale = scaling(rows);
    Eigen::MatrixXd scaled = scale * system.covariance * scale;
    scaled.diagonal().array() += kLeastSigmaMm * kLeastSigmaMm;
    const Eigen::VectorXd whitened = scale * solution.residual;
    solution.chi_square = whitened.dot(scaled.ldlt().solve(whitened));
    return solution;
}

}  // namespace fluorocut::chain
