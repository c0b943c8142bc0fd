#include "core/geometry/pose_evidence.h"

#include <stdexcept>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "core/base/random.h"

namespace fluorocut {
namespace {

// Of a linear measurement y = A (pose; shared) + noise of unit variance, with residual r at the point taken.
struct Linear {
    Eigen::MatrixXd design;
    Eigen::VectorXd residual;
};

Linear linear(std::uint64_t seed, Eigen::Index shared) {
    Random random(seed);
    Linear problem{Eigen::MatrixXd(40, 6 + shared), Eigen::VectorXd(40)};
    for (auto& value : problem.design.reshaped())
        value = random.normal();
    for (auto& value : problem.residual)
        value = 1e-3 * random.normal();
    return problem;
}

PoseEvidence evidenceOf(const Linear& problem, Eigen::Index shared) {
    PoseEvidence evidence;
    evidence.target_from_source = Rigid3::fromTwistRollPitch(0.3, -0.4, 0.5);
    evidence.shared = Eigen::VectorXd::LinSpaced(shared, 1, 2);
    evidence.information = problem.design.transpose() * problem.design;
    evidence.gradient = -problem.design.transpose() * problem.residual;
    return evidence;
}

TEST(PoseEvidence, TheBestPoseIsThatOfTheLeastSquaresProblemWithTheParametersFixed) {
    const Linear problem = linear(1, 3);
    const PoseEvidence evidence = evidenceOf(problem, 3);
    const Eigen::Vector3d change(0.01, -0.02, 0.005);
    const Eigen::MatrixXd of_pose = problem.design.leftCols(6);
    const Eigen::VectorXd target = problem.residual - problem.design.rightCols(3) * change;
    const Vector6 expected = of_pose.colPivHouseholderQr().solve(target);
    const Vector6 found = evidence.poseGiven(evidence.shared + change).deltaFrom(evidence.target_from_source);
    EXPECT_LT((found - expected).norm(), 1e-12);  // rounding
    EXPECT_LT(
        (evidence.sensitivity() * change - (expected - Vector6(of_pose.colPivHouseholderQr().solve(problem.residual))))
            .norm(),
        1e-12);
}

TEST(PoseEvidence, UncertainParametersAddWhatThePoseFollowsThemBy) {
    const PoseEvidence evidence = evidenceOf(linear(2, 2), 2);
    const Matrix6 alone = evidence.covariance();
    EXPECT_LT((alone * evidence.information.topLeftCorner<6, 6>() - Matrix6::Identity()).norm(), 1e-12);
    EXPECT_EQ((evidence.covarianceWith(Eigen::Matrix2d::Zero()) - alone).norm(), 0);
    // Monte Carlo would show the same: the pose moves by sensitivity * error, independent of the image's noise.
    const Eigen::Vector2d axis(0.3, -0.1);
    const Matrix6 grown = evidence.covarianceWith(axis * axis.transpose()) - alone;
    const Vector6 moved = evidence.sensitivity() * axis;
    EXPECT_LT((grown - moved * moved.transpose()).norm(), 1e-12);
}

TEST(PoseEvidence, SizesThatDoNotBelongTogetherAreABug) {
    PoseEvidence evidence = evidenceOf(linear(3, 2), 2);
    EXPECT_THROW(evidence.poseGiven(Eigen::VectorXd::Zero(3)), std::logic_error);
    EXPECT_THROW(evidence.covarianceWith(Eigen::MatrixXd::Zero(3, 3)), std::logic_error);
    evidence.gradient.resize(6);
    EXPECT_THROW(evidence.covariance(), std::logic_error);
}

}  // namespace
}  // namespace fluorocut
