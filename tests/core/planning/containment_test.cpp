#include "core/planning/containment.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/primitives.h"

namespace fluorocut {
namespace {

// An isotropic translation error of a sphere: the worst place's shift is the error's length, which has a chi
// distribution with three degrees of freedom; its 99 % quantile is 3.368214 sigma.
TEST(Containment, InsetOfASphereIsTheChiQuantile) {
    const auto surface = surfacePoints(makeSphere(10, 4), 6000);
    Matrix6 covariance = Matrix6::Zero();
    covariance.topLeftCorner<3, 3>() = 0.04 * Matrix3::Identity();
    // 20000 draws know the 99 % quantile to about 0.012 sigma (1 standard deviation); the facets' middles lie within
    // 1 degree of any direction (2e-4).
    EXPECT_NEAR(containedInset(surface, Vector3::Zero(), covariance), 0.2 * 3.368214, 0.2 * 0.04);
}

// Rotation about an axis across a rod: |r| half the length, at both ends and both sides.
TEST(Containment, InsetOfATurnGrowsWithTheLever) {
    const auto surface = surfacePoints(makeBox({10, 10, 100}));
    std::vector<SurfacePoint> corners;
    for (const double x : {-5.0, 5.0})
        for (const double z : {-50.0, 50.0})
            corners.push_back({{x, 0, z}, {x > 0 ? 1.0 : -1.0, 0, 0}});
    Matrix6 covariance = Matrix6::Zero();
    covariance(4, 4) = 0.01 * 0.01;  // about y
    // The 99 % quantile of |normal| is 2.575829.
    EXPECT_NEAR(containedInset(corners, Vector3::Zero(), covariance), 50 * 0.01 * 2.575829, 0.5 * 0.05);
    // About the end instead of the middle: twice the lever.
    EXPECT_NEAR(containedInset(corners, {0, 0, -50}, covariance), 100 * 0.01 * 2.575829, 1.0 * 0.05);
    ASSERT_FALSE(surface.empty());
}

// What it promises, by other draws and the whole displaced surface: of 2000 poses, 99 % stay inside.
TEST(Containment, DisplacedCavitiesStayInsideAsOftenAsAsked) {
    const TriangleMesh stem = makeStem();
    const auto surface = surfacePoints(stem);
    Matrix6 covariance = Matrix6::Zero();
    covariance.diagonal() << 0.04, 0.02, 0.09, 1e-5, 2e-5, 3e-5;
    const double inset = containedInset(surface, Vector3::Zero(), covariance);
    Random random(77);
    int inside = 0;
    for (int trial = 0; trial < 2000; ++trial) {
        Vector6 error;
        for (int i = 0; i < 6; ++i)
            error[i] = std::sqrt(covariance(i, i)) * random.normal();
        double worst = 0;
        for (const SurfacePoint& point : surface) {
            const Vector3 moved = Rigid3().perturbed(error) * point.position;
            worst = std::max(worst, point.normal.dot(moved - point.position));
        }
        inside += worst <= inset;
    }
    // Binomial: 99 % of 2000 has a standard deviation of 0.22 %, the quantile's own error another 0.07 %.
    EXPECT_GT(inside, 2000 * 0.983);
    EXPECT_LT(inside, 2000 * 0.997);
}

TEST(Containment, AnUnknownCovarianceGivesNoInset) {
    const auto surface = surfacePoints(makeSphere(10, 1));
    EXPECT_TRUE(std::isnan(containedInset(surface, Vector3::Zero(), Matrix6::Constant(std::nan("")))));
    EXPECT_TRUE(std::isnan(containedInset(surface, Vector3::Zero(), -Matrix6::Identity())));
    EXPECT_EQ(containedInset(surface, Vector3::Zero(), Matrix6::Zero()), 0);
}

}  // namespace
}  // namespace fluorocut
