#include "core/registration/chain.h"

#include <cmath>
#include <stdexcept>

#include <gmock/gmock.h>

#include "core/base/chi_square.h"
#include "tests/core/registration/chain_scene.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

ChainOptions at(const std::vector<NamedPoint>& points) {
    ChainOptions options;
    options.points = points;
    options.limits.most_radius95_mm = 1000;
    return options;
}

const NamedPoint kTip{"stem's tip", {5, -10, -140}};

TEST(Chain, WithoutErrorsItIsTheProductOfItsLinks) {
    const test::ChainScene scene;
    const auto chain = solveChain(scene.problem(nullptr), at({kTip}));
    ASSERT_OK(chain);
    const Vector6 off = chain->robot_from_femur.target_from_source.deltaFrom(scene.robot_from_femur);
    // Rounding, over a chain of transforms of a metre.
    EXPECT_LT(off.head<3>().norm(), 1e-9);
    EXPECT_LT(off.tail<3>().norm(), 1e-12);
    EXPECT_NEAR(chain->chi_square, 0, 1e-6);
    EXPECT_EQ(chain->degrees_of_freedom, 6);
    EXPECT_THAT(chain->outliers, IsEmpty());
}

TEST(Chain, OneViewGivesTheCovarianceOfTheProductOfPoses) {
    test::ChainScene scene;
    scene.orbital_deg = {0};
    ChainProblem problem = scene.problem(nullptr);
    problem.parameters.clear();
    for (PoseMeasurement* one : {&problem.views[0].imager_from_corkscrew, &problem.views[0].imager_from_femur}) {
        one->parameters.clear();
        one->sensitivity.resize(6, 0);
    }
    const auto chain = solveChain(problem);
    ASSERT_OK(chain);
    const Pose product = problem.views[0].robot_from_flange * problem.flange_from_corkscrew *
                         problem.views[0].imager_from_corkscrew.pose.inverse() *
                         problem.views[0].imager_from_femur.pose;
    EXPECT_LT((*chain->robot_from_femur.covariance - *product.covariance).norm(), 1e-8 * product.covariance->norm());
    EXPECT_TRUE(std::isnan(chain->probability));
    EXPECT_THAT(chain->warnings, ElementsAre(HasSubstr("One view alone")));
}

// The joint problem with every unknown kept: poses of the imagers, hand-eye, robot, parameters. Its normal equations
// must give the same covariance as the eliminated form.
TEST(Chain, TheEliminatedFormIsTheJointLeastSquaresProblem) {
    const test::ChainScene scene;
    const ChainProblem problem = scene.problem(nullptr);
    const auto chain = solveChain(problem);
    ASSERT_OK(chain);
    // Unknowns: X (6), hand-eye (6), parameters (3), then for each view robot (6) and the imager in the corkscrew (6).
    const int n = 15 + 12 * 2;
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
    const auto add = [&](const Eigen::MatrixXd& jacobian, const Eigen::MatrixXd& covariance) {
        information += jacobian.transpose() * covariance.ldlt().solve(jacobian);
    };
    Eigen::MatrixXd j = Eigen::MatrixXd::Zero(6, n);
    j.block<6, 6>(0, 6).setIdentity();
    add(j, scene.hand_eye);
    Eigen::MatrixXd p = Eigen::MatrixXd::Zero(3, n);
    p.block<3, 3>(0, 12).setIdentity();
    add(p, Eigen::Vector3d(scene.focal_sigma, scene.center_sigma_px, scene.center_sigma_px).cwiseAbs2().asDiagonal());
    for (int k = 0; k < 2; ++k) {
        const ChainView& view = problem.views[static_cast<std::size_t>(k)];
        const int robot = 15 + 12 * k, imager = robot + 6;
        j.setZero();
        j.block<6, 6>(0, robot).setIdentity();
        add(j, scene.robot);
        j.setZero();  // measured = pose + own error + sensitivity * (parameters' error): here the sign is minus
        j.block<6, 6>(0, imager).setIdentity();
        j.block<6, 3>(0, 12) = view.imager_from_corkscrew.sensitivity;
        add(j, scene.corkscrew);
        // imager_from_femur = imager_from_corkscrew * (robot * hand-eye)^-1 * X, by numbers.
        const auto predicted = [&](const Eigen::VectorXd& x) {
            const Rigid3 a = view.imager_from_corkscrew.pose.target_from_source.perturbed(x.segment<6>(imager));
            const Rigid3 r = view.robot_from_flange.target_from_source.perturbed(x.segment<6>(robot));
            const Rigid3 h = problem.flange_from_corkscrew.target_from_source.perturbed(x.segment<6>(6));
            return a * (r * h).inverse() * scene.robot_from_femur.perturbed(x.head<6>());
        };
        j.setZero();
        const Rigid3 here = predicted(Eigen::VectorXd::Zero(n));
        for (int i = 0; i < n; ++i) {
            Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
            constexpr double kStep = 1e-6;
            x[i] = kStep;
            j.col(i) = predicted(x).deltaFrom(here) / kStep;
        }
        j.block<6, 3>(0, 12) += view.imager_from_femur.sensitivity;
        add(j, scene.beads);
    }
    const Matrix6 joint = information.inverse().topLeftCorner<6, 6>();
    // Differences of 1e-6 mm leave 1e-7 of the derivatives.
    EXPECT_LT((joint - *chain->robot_from_femur.covariance).norm(), 1e-4 * joint.norm());
}

TEST(Chain, SlowRegionsOf95PercentHoldTheTruthAsOftenAsTheySay) {
    const test::ChainScene scene;
    Random random(20);
    constexpr int kTrials = 3000;
    const double limit = chiSquareQuantile(0.05, 6);
    int held = 0, sphere = 0, agreeing = 0;
    for (int i = 0; i < kTrials; ++i) {
        Random trial = random.fork(static_cast<std::uint64_t>(i));
        ChainOptions options = at({kTip});
        options.outlier_probability = 0;
        const auto chain = solveChain(scene.problem(&trial), options);
        ASSERT_OK(chain);
        const Vector6 e = scene.robot_from_femur.deltaFrom(chain->robot_from_femur.target_from_source);
        held += e.dot(chain->robot_from_femur.covariance->ldlt().solve(e)) < limit ? 1 : 0;
        sphere +=
            (scene.robot_from_femur * kTip.in_femur - chain->points[0].in_robot).norm() < chain->points[0].radius95_mm
                ? 1
                : 0;
        agreeing += chain->probability > 0.05 ? 1 : 0;
    }
    // 3,000 trials: the shares' standard error is 0.4 %. The contract: 93 to 97 %.
    EXPECT_NEAR(held, 0.95 * kTrials, 0.02 * kTrials);
    EXPECT_NEAR(sphere, 0.95 * kTrials, 0.02 * kTrials);
    EXPECT_NEAR(agreeing, 0.95 * kTrials, 0.02 * kTrials);
}

TEST(Chain, TheBudgetAddsUpAndNamesTheLargest) {
    test::ChainScene scene;
    auto chain = solveChain(scene.problem(nullptr), at({kTip, {"head's centre", {40, 0, 60}}}));
    ASSERT_OK(chain);
    Matrix6 sum = Matrix6::Zero();
    for (const ChainTerm& term : chain->terms)
        sum += term.covariance;
    EXPECT_LT((sum - *chain->robot_from_femur.covariance).norm(), 1e-6 * sum.norm());
    for (const PointBudget& budget : chain->points) {
        double shares = 0;
        for (const double share : budget.shares)
            shares += share;
        EXPECT_NEAR(shares, 1, 1e-6);
        EXPECT_THAT(budget.sentence, HasSubstr(budget.point.name));
    }
    // One view whose corkscrew is 2 mm uncertain in depth, and a hand-eye calibration 1 mm uncertain in each direction:
    // variances of 4 and 3 mm^2, which nothing else in the scene comes near.
    scene.orbital_deg = {0};
    scene.corkscrew(2, 2) += 4;
    scene.hand_eye = test::diagonal(1, 1, 0, 0);
    chain = solveChain(scene.problem(nullptr), at({kTip}));
    ASSERT_OK(chain);
    EXPECT_THAT(chain->points[0].sentence, HasSubstr("stem's tip: corkscrew, depth of view v1 contributes most"));
    const auto part = pointByPose(chain->robot_from_femur.target_from_source, kTip.in_femur);
    int found = 0;
    for (const ChainTerm& term : chain->terms) {
        const double variance = (part * term.covariance * part.transpose()).trace();
        if (term.text() == "hand-eye calibration") {
            EXPECT_NEAR(variance, 3, 1e-6);
            ++found;
        } else if (term.text() == "corkscrew, depth of view v1") {
            EXPECT_NEAR(variance, 4, 0.2);
            ++found;
        }
    }
    EXPECT_EQ(found, 2);
}

TEST(Chain, AFocalLengthThatBothPosesFollowPartlyCancels) {
    test::ChainScene scene;
    scene.orbital_deg = {0};
    scene.focal_sigma = 0.01;
    scene.center_sigma_px = 0;
    ChainProblem problem = scene.problem(nullptr);
    const auto together = solveChain(problem);
    ASSERT_OK(together);
    // The same errors, each on its own.
    for (PoseMeasurement* one : {&problem.views[0].imager_from_corkscrew, &problem.views[0].imager_from_femur}) {
        *one->pose.covariance += 1e-4 * one->sensitivity.col(0) * one->sensitivity.col(0).transpose();
        one->parameters.clear();
        one->sensitivity.resize(6, 0);
    }
    const auto apart = solveChain(problem);
    ASSERT_OK(apart);
    // 1 % of 700 mm each, apart: sqrt(2) 6.7 mm; together the difference of two depths that are 100 mm apart at most.
    EXPECT_GT(apart->points[0].worst_sigma_mm, 9);
    EXPECT_LT(together->points[0].worst_sigma_mm, 2);
}

TEST(Chain, AViewThatContradictsTheOthersIsLeftOutByName) {
    test::ChainScene scene;
    scene.orbital_deg = {0, 45, 90, -40};
    scene.angulation_deg = {0, 10, 0, 20};
    Random random(7);
    ChainProblem problem = scene.problem(&random);
    problem.views[2].imager_from_femur.pose.target_from_source =
        problem.views[2].imager_from_femur.pose.target_from_source.perturbed(
            (Vector6() << 4, 0, 0, 0, 0, 0.05).finished());
    const auto chain = solveChain(problem, at({kTip}));
    ASSERT_OK(chain);
    EXPECT_THAT(chain->outliers, ElementsAre("v3"));
    EXPECT_FALSE(chain->views[2].used);
    EXPECT_LT(chain->views[2].probability, 1e-6);
    EXPECT_GT(chain->views[2].residual_mm, 3);
    EXPECT_THAT(chain->warnings, ElementsAre(HasSubstr("View v3 contradicts")));
    EXPECT_GT(chain->probability, 1e-3);
}

TEST(Chain, SwappedViewsAreRecognisedByTryingTheExchange) {
    test::ChainScene scene;
    scene.angulation_deg = {0, 25};
    Random random(8);
    ChainProblem problem = scene.problem(&random);
    std::swap(problem.views[0].imager_from_femur, problem.views[1].imager_from_femur);
    const auto chain = solveChain(problem);
    ASSERT_FALSE(chain);
    EXPECT_EQ(chain.error().code, ErrorCode::noSolution);
    EXPECT_THAT(chain.error().message(), HasSubstr("exchange the poses of the femur of v1 and v2"));
}

TEST(Chain, TwoViewsThatContradictAreNotAccepted) {
    const test::ChainScene scene;
    Random random(9);
    ChainProblem problem = scene.problem(&random);
    problem.views[0].robot_from_flange.target_from_source =
        Rigid3::fromTranslation({5, 5, 5}) * problem.views[0].robot_from_flange.target_from_source;
    const auto chain = solveChain(problem, at({kTip}));
    ASSERT_OK(chain);
    EXPECT_FALSE(accepted(chain->acceptance));
    EXPECT_LT(chain->probability, 1e-3);
}

TEST(Chain, TwoViewsFromTheSameDirectionAreRefused) {
    test::ChainScene scene;
    scene.orbital_deg = {30, 33};
    scene.angulation_deg = {0, 0};
    const auto chain = solveChain(scene.problem(nullptr));
    ASSERT_FALSE(chain);
    EXPECT_THAT(chain.error().message(), HasSubstr("same direction, 3.0 degrees apart"));
    // From the other side is the same direction as well.
    scene.orbital_deg = {-90, 90};
    EXPECT_FALSE(solveChain(scene.problem(nullptr)));
}

TEST(Chain, MeasurementsWithoutCovarianceAreRefused) {
    const test::ChainScene scene;
    ChainProblem problem = scene.problem(nullptr);
    problem.views[1].imager_from_corkscrew.pose.covariance.reset();
    const auto chain = solveChain(problem);
    ASSERT_FALSE(chain);
    EXPECT_EQ(chain.error().code, ErrorCode::invalidInput);
    EXPECT_THAT(chain.error().message(), HasSubstr("view v2, imager_from_corkscrew"));
    problem = scene.problem(nullptr);
    std::swap(problem.views[1].imager_from_corkscrew, problem.views[1].imager_from_femur);
    EXPECT_THROW(static_cast<void>(solveChain(problem)), std::logic_error);
}

}  // namespace
}  // namespace fluorocut
