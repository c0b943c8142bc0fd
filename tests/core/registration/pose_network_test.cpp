#include "core/registration/pose_network.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace fluorocut {
namespace {

Vector6 normals(Random& random, double mm, double rad) {
    Vector6 v;
    for (int i = 0; i < 6; ++i)
        v[i] = (i < 3 ? mm : rad) * random.normal();
    return v;
}

Rigid3 anyPose(Random& random) {
    return Rigid3::identity().perturbed(normals(random, 200, 1));
}

Matrix6 anyCovariance(Random& random, double mm, double rad) {
    Matrix6 root;
    for (int i = 0; i < 6; ++i)
        root.row(i) = (i < 3 ? mm : rad) * normals(random, 1, 1).transpose();
    Matrix6 result = root * root.transpose() / 6;
    for (int i = 0; i < 6; ++i)
        result(i, i) += 0.1 * (i < 3 ? mm * mm : rad * rad);
    return result;
}

TEST(PoseNetworkTest, DerivativesOfAChainAreThoseOfSmallDifferences) {
    Random random(1);
    for (int trial = 0; trial < 20; ++trial) {
        std::vector<Rigid3> poses{anyPose(random), anyPose(random)};
        const std::vector<PoseStep> chain{PoseStep::unknown(0), PoseStep::exactly(anyPose(random)),
                                          PoseStep::inverseOf(1)};
        for (const std::size_t step : {0u, 2u}) {
            const Matrix6 exact = stepDerivative(chain, step, poses);
            const std::size_t pose = step == 0 ? 0 : 1;
            for (int i = 0; i < 6; ++i) {
                const double h = 1e-5;
                std::vector<Rigid3> up = poses, down = poses;
                up[pose] = poses[pose].perturbed(h * Vector6::Unit(i));
                down[pose] = poses[pose].perturbed(-h * Vector6::Unit(i));
                const Vector6 slope = (product(chain, up).deltaFrom(product(chain, poses)) -
                                       product(chain, down).deltaFrom(product(chain, poses))) /
                                      (2 * h);
                // Central differences of lever arms of some 500 mm: h^2 * 500 = 5e-8, rounding 500 * 1e-16 / h = 1e-8.
                EXPECT_LT((slope - exact.col(i)).cwiseAbs().maxCoeff(), 1e-6);
            }
        }
    }
}

// Two measurements of one pose: the mean weighted by information, and the sum of the informations.
TEST(PoseNetworkTest, TwoMeasurementsGiveTheirWeightedMean) {
    Random random(2);
    const Rigid3 truth = anyPose(random);
    const Matrix6 first = anyCovariance(random, 0.1, 1e-4), second = anyCovariance(random, 0.1, 1e-4);
    const Vector6 a = normals(random, 0.1, 1e-4), b = normals(random, 0.1, 1e-4);
    PoseNetwork network;
    network.poses = {Rigid3::identity()};
    network.shared_information = Eigen::MatrixXd(0, 0);
    network.factors = {{{PoseStep::unknown(0)}, evidenceOf(truth.perturbed(a), first), {}, 1},
                       {{PoseStep::unknown(0)}, evidenceOf(truth.perturbed(b), second), {}, 1}};
    const PoseNetworkResult result = solvePoseNetwork(network);
    EXPECT_TRUE(result.converged);
    const Matrix6 information = first.inverse() + second.inverse();
    const Vector6 mean = information.inverse() * (first.inverse() * a + second.inverse() * b);
    const Vector6 error = result.poses[0].deltaFrom(truth) - mean;
    // Rotation vectors add up to products of 1e-4 rad: 1e-8.
    EXPECT_LT(error.head<3>().norm(), 1e-4);
    EXPECT_LT(error.tail<3>().norm(), 1e-7);
    // In standard deviations. The logarithm's derivative at residuals of 1e-4 rad is one within 1e-4.
    const Vector6 sigma = information.inverse().diagonal().cwiseSqrt().cwiseInverse();
    const Matrix6 off = result.covariance - information.inverse();
    EXPECT_LT((sigma.asDiagonal() * off * sigma.asDiagonal()).norm(), 1e-3);
}

// A known step's covariance at the end of a chain, by its formula: K + J C J^T.
TEST(PoseNetworkTest, ACoarselyKnownStepWeakensWhatTheImageSays) {
    Random random(3);
    const Rigid3 truth = anyPose(random), step = anyPose(random);
    const Matrix6 image = anyCovariance(random, 0.1, 1e-3), robot = anyCovariance(random, 0.1, 1e-3);
    PoseNetwork network;
    network.poses = {truth};
    network.shared_information = Eigen::MatrixXd(0, 0);
    network.factors = {{{PoseStep::unknown(0), PoseStep::about(step, robot)}, evidenceOf(truth * step, image), {}, 1}};
    const PoseNetworkResult result = solvePoseNetwork(network);
    const Matrix6 of_step = stepDerivative(network.factors[0].chain, 1, result.poses);
    const Matrix6 of_pose = stepDerivative(network.factors[0].chain, 0, result.poses);
    const Matrix6 end = image + of_step * robot * of_step.transpose();
    const Matrix6 expected = of_pose.inverse() * end * of_pose.inverse().transpose();
    EXPECT_LT((result.covariance - expected).norm(), 1e-6 * expected.norm());
}

// Evidence with a shared parameter p: measurements of linear functions of (pose, p). The network's answer is that of
// all their normal equations together, whatever the pose each quadratic was taken at.
TEST(PoseNetworkTest, SharedParametersAreSolvedWithThePoses) {
    Random random(4);
    const Eigen::Index n = 2;
    PoseNetwork network;
    network.shared = Eigen::VectorXd::Zero(n);
    network.shared_information = Eigen::MatrixXd::Identity(n, n) * 0.5;
    const int count = 4;
    const Eigen::Index all = 6 * count + n;
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(all, all);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(all);
    information.bottomRightCorner(n, n) = network.shared_information;
    for (int i = 0; i < count; ++i) {
        // 12 noisy measurements of (pose, p); the pose is about the identity, so that its perturbations just add.
        Eigen::MatrixXd jacobian(12, 6 + n);
        for (Eigen::Index r = 0; r < jacobian.rows(); ++r)
            for (Eigen::Index c = 0; c < jacobian.cols(); ++c)
                jacobian(r, c) = random.normal();
        Eigen::VectorXd seen(12);
        for (Eigen::Index r = 0; r < 12; ++r)
            seen[r] = 1e-4 * random.normal();
        PoseEvidence evidence;
        evidence.shared = 1e-4 * Eigen::VectorXd::Random(n);
        evidence.information = jacobian.transpose() * jacobian;
        Eigen::VectorXd at = Eigen::VectorXd::Zero(6 + n);
        at.tail(n) = evidence.shared;
        evidence.gradient = jacobian.transpose() * (jacobian * at - seen);
        network.poses.push_back(Rigid3::identity());
        network.factors.push_back({{PoseStep::unknown(i)}, evidence, {0, 1}, 1});
        Eigen::MatrixXd wide = Eigen::MatrixXd::Zero(12, all);
        wide.middleCols(6 * i, 6) = jacobian.leftCols(6);
        wide.rightCols(n) = jacobian.rightCols(n);
        information += wide.transpose() * wide;
        right += wide.transpose() * seen;
    }
    const PoseNetworkResult result = solvePoseNetwork(network);
    const Eigen::VectorXd expected = information.ldlt().solve(right);
    EXPECT_TRUE(result.converged);
    // Rotations of 1e-4 rad compose to 1e-8.
    EXPECT_LT((result.shared - expected.tail(n)).norm(), 1e-7);
    for (int i = 0; i < count; ++i) {
        const Vector6 part = expected.segment<6>(6 * i);
        EXPECT_LT((result.poses[static_cast<std::size_t>(i)].deltaFrom(Rigid3::identity()) - part).norm(), 1e-7);
    }
    EXPECT_LT((result.covariance - information.inverse()).norm(), 1e-3 * result.covariance.norm());
}

TEST(PoseNetworkTest, EvidenceIsWeakenedToTheNoiseThatIsKnownOfOtherwise) {
    Random random(6);
    const Matrix6 covariance = anyCovariance(random, 0.1, 1e-3);
    PoseEvidence evidence = evidenceOf(anyPose(random), covariance);
    evidence.gradient = normals(random, 1, 1);
    const PoseEvidence weaker = withNoise(evidence, 9 * covariance);
    EXPECT_LT((weaker.covariance() - 9 * covariance).norm(), 1e-9 * covariance.norm());
    // The same answer from less.
    EXPECT_LT(weaker.poseGiven({}).deltaFrom(evidence.poseGiven({})).norm(), 1e-9);
    EXPECT_EQ(withNoise(evidence, 0.5 * covariance).information, evidence.information);
}

// One image alone leaves the parameters where they were, however much it pulls; its pose follows them as before.
TEST(PoseNetworkTest, PosesOnlyLeavesTheParametersToOthers) {
    Random random(7);
    PoseEvidence evidence;
    Eigen::MatrixXd jacobian(12, 8);
    for (double& value : jacobian.reshaped())
        value = random.normal();
    evidence.shared = Eigen::VectorXd::Zero(2);
    evidence.information = jacobian.transpose() * jacobian;
    evidence.gradient = 1e-4 * Eigen::VectorXd::LinSpaced(8, 1, 3);
    PoseNetwork network;
    network.poses = {Rigid3::identity()};
    network.shared = Eigen::VectorXd::Zero(2);
    network.shared_information = Eigen::MatrixXd::Identity(2, 2);
    network.factors = {{{PoseStep::unknown(0)}, posesOnly(evidence), {0, 1}, 1}};
    const PoseNetworkResult result = solvePoseNetwork(network);
    EXPECT_LT(result.shared.norm(), 1e-12);
    EXPECT_LT((result.covariance.bottomRightCorner<2, 2>() - Matrix2::Identity()).norm(), 1e-9);
    EXPECT_LT((posesOnly(evidence).sensitivity() - evidence.sensitivity()).norm(), 1e-12);
    EXPECT_LT(result.poses[0].deltaFrom(evidence.poseGiven(evidence.shared)).norm(), 1e-7);
}

TEST(PoseNetworkTest, AGrossErrorHardlyMovesTheRobustSolution) {
    Random random(5);
    const Rigid3 truth = anyPose(random);
    Matrix6 covariance = Matrix6::Zero();
    covariance.diagonal() << 0.01, 0.01, 0.01, 1e-6, 1e-6, 1e-6;  // 0.1 mm, 1 mrad
    PoseNetwork network;
    network.poses = {truth.perturbed(normals(random, 1, 0.01))};
    network.shared_information = Eigen::MatrixXd(0, 0);
    for (int i = 0; i < 6; ++i) {
        const Vector6 error = i == 2 ? Vector6(normals(random, 20, 0.2)) : normals(random, 0.1, 1e-3);
        network.factors.push_back({{PoseStep::unknown(0)}, evidenceOf(truth.perturbed(error), covariance), {}, 1});
    }
    PoseNetworkOptions options;
    options.robust_scale = 5;
    const PoseNetworkResult result = solvePoseNetwork(network, options);
    EXPECT_LT(result.weights[2], 1e-2);
    // Five measurements of 0.1 mm and 1 mrad: 0.045 per axis; four of these for the norm of three.
    EXPECT_LT(result.poses[0].deltaFrom(truth).head<3>().norm(), 0.2);
    EXPECT_LT(result.poses[0].deltaFrom(truth).tail<3>().norm(), 2e-3);
}

}  // namespace
}  // namespace fluorocut
