#include "core/imaging/projected_error.h"

#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/core/imaging/pincushion.h"

namespace fluorocut {
namespace {

// On the axis at depth z a pixel is f / (z p) wide for a millimetre across, and depth does nothing.
TEST(PixelCovariance, IsTheMagnifiedOneOnTheAxis) {
    CArm carm;
    carm.pixel_mm = {0.4, 0.25};
    const double z = 625;
    Matrix3 of_point = Vector3(0.01, 0.04, 9).asDiagonal();
    of_point(0, 1) = of_point(1, 0) = 0.005;
    const Matrix2 found =
        pixelCovariance(carm, Rigid3::fromTranslation({0, 0, z}), Vector3::Zero(), of_point, Matrix6::Zero());
    const double mu = carm.focal_length_mm / (z * 0.4), mv = carm.focal_length_mm / (z * 0.25);
    EXPECT_NEAR(found(0, 0), 0.01 * mu * mu, 1e-12);
    EXPECT_NEAR(found(1, 1), 0.04 * mv * mv, 1e-12);
    EXPECT_NEAR(found(0, 1), 0.005 * mu * mv, 1e-12);
}

// Turned about the imager's z by dr, a point r from the axis moves by r dr across.
TEST(PixelCovariance, KnowsWhatATurnOfThePoseDoes) {
    const CArm carm;
    Matrix6 of_pose = Matrix6::Zero();
    of_pose(5, 5) = 1e-4;
    const Matrix2 found =
        pixelCovariance(carm, Rigid3::fromTranslation({0, 0, 500}), {30, 0, 0}, Matrix3::Zero(), of_pose);
    const double px_per_mm = carm.focal_length_mm / (500 * carm.pixel_mm.y());
    EXPECT_NEAR(found(1, 1), 1e-4 * 30 * 30 * px_per_mm * px_per_mm, 1e-9);
    EXPECT_NEAR(found(0, 0), 0, 1e-12);
}

TEST(PixelCovariance, IsUnknownBehindTheSource) {
    EXPECT_TRUE(pixelCovariance(CArm{}, Rigid3::fromTranslation({0, 0, -1}), Vector3::Zero(), Matrix3::Identity(),
                                Matrix6::Zero())
                    .array()
                    .isNaN()
                    .all());
}

// With distortion and everything at once, against samples: 20,000 give variances to 1 %, three times that is allowed,
// and the same holds for the share of 95 % (0.15 %).
TEST(ErrorEllipse, Holds95PercentOfWhatPointAndPoseLeaveOpen) {
    CArm carm;
    carm.distortion = std::make_shared<test::Pincushion>(2e-6);
    const Rigid3 pose = Rigid3::fromTranslation({8, -5, 640}) * Rigid3::fromRotationVector({0.4, -0.2, 0.7});
    const Vector3 point(20, -35, 40);
    Matrix3 half = Matrix3::Zero();
    half << 0.3, 0, 0, 0.1, 0.2, 0, -0.1, 0.05, 0.4;
    const Matrix3 of_point = half * half.transpose();
    Vector6 sigma;
    sigma << 0.2, 0.1, 1, 0.002, 0.001, 0.003;
    const Matrix6 of_pose = sigma.cwiseAbs2().asDiagonal();
    const Matrix2 covariance = pixelCovariance(carm, pose, point, of_point, of_pose);
    const Vector2 middle = carm.project(pose * point);
    const auto ellipse = errorEllipse(middle, covariance, 0.95, 720);
    ASSERT_EQ(ellipse.size(), 720U);
    // Its corners lie where the quadratic form is that of chi-square: 5.9915 for two degrees of freedom.
    for (const Vector2& corner : ellipse)
        EXPECT_NEAR((corner - middle).dot(covariance.inverse() * (corner - middle)), 5.99146, 1e-4);

    Random random(3);
    constexpr int kSamples = 20000;
    Matrix2 seen = Matrix2::Zero();
    int inside = 0;
    for (int i = 0; i < kSamples; ++i) {
        const Vector3 moved = point + half * Vector3(random.normal(), random.normal(), random.normal());
        Vector6 delta;
        for (int j = 0; j < 6; ++j)
            delta[j] = sigma[j] * random.normal();
        const Vector2 off = carm.project(pose.perturbed(delta) * moved) - middle;
        seen += off * off.transpose() / kSamples;
        inside += off.dot(covariance.inverse() * off) <= 5.99146;
    }
    EXPECT_LT((seen - covariance).norm(), 0.03 * covariance.norm());
    EXPECT_NEAR(inside / double(kSamples), 0.95, 0.005);
}

TEST(ErrorEllipse, IsALineForAnErrorInOneDirectionAndNothingForNoCovariance) {
    Matrix2 flat = Matrix2::Zero();
    flat(0, 0) = 4;
    for (const Vector2& corner : errorEllipse({10, 20}, flat)) {
        EXPECT_NEAR(corner.y(), 20, 1e-9);
        EXPECT_LE(std::abs(corner.x() - 10), 2 * std::sqrt(5.99147));
    }
    EXPECT_TRUE(errorEllipse({10, 20}, -flat).empty());
    EXPECT_TRUE(errorEllipse({10, 20}, Matrix2::Constant(std::nan(""))).empty());
    EXPECT_THROW((void)errorEllipse({0, 0}, flat, 1.0), std::logic_error);
}

}  // namespace
}  // namespace fluorocut
