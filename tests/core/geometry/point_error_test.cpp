#include "core/geometry/point_error.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace fluorocut {
namespace {

// One, two and three equal axes: the tables' quantiles of chi with as many degrees of freedom.
TEST(PointError, RadiusOfEqualAxes) {
    const auto radius = [](double a, double b, double c) {
        return errorRadius(Vector3(a * a, b * b, c * c).asDiagonal());
    };
    EXPECT_NEAR(radius(0.3, 0.3, 0.3), 0.3 * 2.795483, 1e-5);
    EXPECT_NEAR(radius(2, 2, 0), 2 * 2.447747, 1e-4);
    EXPECT_NEAR(radius(0, 0.1, 0), 0.1 * 1.959964, 1e-5);
    EXPECT_NEAR(radius(1e-4, 0.1, 1e-5), 0.1 * 1.959964, 1e-4);
    EXPECT_EQ(radius(0, 0, 0), 0);
    EXPECT_TRUE(std::isnan(radius(NAN, 1, 1)));
}

TEST(PointError, UnequalAxesAsDrawn) {
    Random random(3);
    const Vector3 s(0.5, 0.2, 0.05);
    const Matrix3 r = expRotation({0.3, -1, 0.4}).toRotationMatrix();
    const Matrix3 covariance = r * s.cwiseAbs2().asDiagonal() * r.transpose();
    const double radius = errorRadius(covariance);
    int held = 0;
    constexpr int kDraws = 200'000;
    for (int i = 0; i < kDraws; ++i) {
        const Vector3 e(s.x() * random.normal(), s.y() * random.normal(), s.z() * random.normal());
        held += e.norm() < radius ? 1 : 0;
    }
    // The share's standard error is 0.0005.
    EXPECT_NEAR(held / static_cast<double>(kDraws), 0.95, 0.002);
    const WorstDirection worst = worstDirection(covariance);
    EXPECT_NEAR(worst.sigma_mm, 0.5, 1e-12);
    EXPECT_NEAR(std::abs(worst.direction.dot(r.col(0))), 1, 1e-12);
}

}  // namespace
}  // namespace fluorocut
