#include "core/procedure/pose_fusion.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "core/base/chi_square.h"
#include "core/base/random.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

const Rigid3 kPlace(expRotation({0.4, -0.7, 0.2}), {120, -40, 300});

Matrix6 spread(double mm, double rad) {
    Vector6 variance;
    variance << Vector3::Constant(mm * mm), Vector3::Constant(rad * rad);
    return variance.asDiagonal();
}

// Positive definite, with everything correlated.
Matrix6 randomSpread(Random& random, double mm, double rad) {
    Matrix6 root;
    for (int i = 0; i < 36; ++i)
        root(i / 6, i % 6) = random.normal();
    Vector6 scale;
    scale << Vector3::Constant(mm), Vector3::Constant(rad);
    return scale.asDiagonal() * Matrix6(root * root.transpose() / 6 + 0.2 * Matrix6::Identity()) * scale.asDiagonal();
}

Vector6 draw(Random& random, const Matrix6& covariance) {
    Vector6 normal;
    for (int i = 0; i < 6; ++i)
        normal[i] = random.normal();
    return Matrix6(covariance.llt().matrixL()) * normal;
}

TEST(PoseFusion, WithoutMeasurementsThePriorStays) {
    const Result<FusedPose> fused = fusePoses({kPlace, spread(1, 0.01)}, {}, Matrix6::Zero());
    ASSERT_OK(fused);
    EXPECT_EQ(fused->pose.deltaFrom(kPlace).norm(), 0);
    EXPECT_LT((fused->covariance - spread(1, 0.01)).norm(), 1e-12);
    EXPECT_EQ(fused->probability, 1);
}

TEST(PoseFusion, IsTheWeightedMeanOfPlaces) {
    // One dimension by hand: variances 1 and 1/4, then 1/4 again: the means weigh 1 : 4 : 4.
    const auto at = [](double x) { return Rigid3::fromTranslation({x, 0, 0}) * kPlace; };
    Result<FusedPose> fused = fusePoses({at(0), spread(1, 0.01)}, {{at(1), spread(0.5, 0.005)}}, Matrix6::Zero());
    ASSERT_OK(fused);
    EXPECT_NEAR(fused->pose.deltaFrom(at(0))[0], 0.8, 1e-9);
    EXPECT_NEAR(fused->covariance(0, 0), 0.2, 1e-9);
    EXPECT_NEAR(fused->weights[0](0, 0), 0.8, 1e-9);
    EXPECT_NEAR(fused->prior_weight(0, 0), 0.2, 1e-9);
    EXPECT_NEAR(fused->chi_square, 1 / (1 + 0.25), 1e-9);
    fused = fusePoses({at(0), spread(1, 0.01)}, {{at(1), spread(0.5, 0.005)}, {at(2), spread(0.5, 0.005)}},
                      Matrix6::Zero());
    ASSERT_OK(fused);
    EXPECT_NEAR(fused->pose.deltaFrom(at(0))[0], (4 + 8) / 9.0, 1e-9);
    EXPECT_NEAR(fused->covariance(0, 0), 1 / 9.0, 1e-9);
}

TEST(PoseFusion, WhatAllMeasurementsShareIsNotAveragedAway) {
    // A poor prior, n measurements of 0.1 mm with 0.05 mm in common: 0.05^2 + 0.1^2 / n, and never below 0.05^2.
    for (const int n : {1, 4, 400}) {
        const std::vector<MeasuredPose> measured(static_cast<std::size_t>(n), {kPlace, spread(0.1, 0.001)});
        const Result<FusedPose> fused = fusePoses({kPlace, spread(100, 1)}, measured, spread(0.05, 0.0005));
        ASSERT_OK(fused);
        // The prior's own information, 1e-4 of 1/mm^2, is 3e-7 of it.
        EXPECT_NEAR(fused->covariance(0, 0), 0.0025 + 0.01 / n, 1e-7) << n;
        EXPECT_NEAR(fused->covariance(5, 5), 2.5e-7 + 1e-6 / n, 1e-11) << n;
    }
}

TEST(PoseFusion, WeightsAddUpToOne) {
    Random random(3);
    std::vector<MeasuredPose> measured;
    for (int k = 0; k < 3; ++k)
        measured.push_back({kPlace, randomSpread(random, 0.1, 0.002)});
    const Result<FusedPose> fused =
        fusePoses({kPlace, randomSpread(random, 1, 0.01)}, measured, randomSpread(random, 0.05, 0.001));
    ASSERT_OK(fused);
    Matrix6 sum = fused->prior_weight;
    for (const Matrix6& weight : fused->weights)
        sum += weight;
    EXPECT_LT((sum - Matrix6::Identity()).norm(), 1e-9);
}

TEST(PoseFusion, ItsCovarianceIsThatOfItsErrors) {
    Random random(7);
    const Matrix6 prior = randomSpread(random, 0.8, 0.01), common = randomSpread(random, 0.05, 0.0008),
                  own = randomSpread(random, 0.1, 0.002);
    const int runs = 2000;
    double error = 0, differences = 0;
    for (int run = 0; run < runs; ++run) {
        const Vector6 shared = draw(random, common);
        std::vector<MeasuredPose> measured;
        for (int k = 0; k < 3; ++k)
            measured.push_back({kPlace.perturbed(shared + draw(random, own)), own});
        const Result<FusedPose> fused = fusePoses({kPlace.perturbed(draw(random, prior)), prior}, measured, common);
        ASSERT_OK(fused);
        const Vector6 off = fused->pose.deltaFrom(kPlace);
        error += off.dot(fused->covariance.ldlt().solve(off)) / runs;
        differences += fused->chi_square / runs;
    }
    // Means of 2000 chi-squares of 6 and 18 degrees: standard deviations sqrt(2 * 6 / 2000) and sqrt(2 * 18 / 2000);
    // four of them, and 1 % for angles of 0.01 rad beyond the first order.
    EXPECT_NEAR(error, 6, 0.31 + 0.06);
    EXPECT_NEAR(differences, 18, 0.54 + 0.18);
}

TEST(PoseFusion, MeasurementsThatContradictHaveASmallProbability) {
    const Result<FusedPose> fused =
        fusePoses({kPlace, spread(1, 0.01)},
                  {{kPlace, spread(0.1, 0.001)}, {Rigid3::fromTranslation({1, 0, 0}) * kPlace, spread(0.1, 0.001)}},
                  Matrix6::Zero());
    ASSERT_OK(fused);
    EXPECT_LT(fused->probability, 1e-5);
    EXPECT_EQ(fused->degrees_of_freedom, 12);
}

TEST(PoseFusion, RefusesWhatIsNoCovarianceAndPosesFarApart) {
    const MeasuredPose good{kPlace, spread(1, 0.01)};
    Matrix6 skewed = good.covariance;
    skewed(0, 1) = 0.5;
    for (const Matrix6& bad :
         {Matrix6(Matrix6::Zero()), Matrix6(-good.covariance), Matrix6(Matrix6::Constant(std::nan(""))), skewed}) {
        EXPECT_FALSE(fusePoses({kPlace, bad}, {good}, Matrix6::Zero()).ok());
        EXPECT_FALSE(fusePoses(good, {{kPlace, bad}}, Matrix6::Zero()).ok());
    }
    EXPECT_FALSE(fusePoses(good, {good}, -good.covariance).ok());
    const Rigid3 turned = Rigid3::fromRotationVector({0, 0, 1}) * kPlace;
    const Result<FusedPose> far = fusePoses(good, {{turned, good.covariance}}, Matrix6::Zero());
    ASSERT_FALSE(far.ok());
    EXPECT_EQ(far.error().code, ErrorCode::noSolution);
}

}  // namespace
}  // namespace fluorocut
