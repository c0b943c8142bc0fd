#include "core/imaging/rays.h"

#include <cmath>
#include <memory>

#include <Eigen/Cholesky>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/base/units.h"
#include "tests/core/imaging/pincushion.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using ::testing::HasSubstr;

Vector3 randomVector(Random& random, double scale) {
    return scale * Vector3(random.normal(), random.normal(), random.normal());
}

// A C-arm turned about the world's y axis that sees the world's origin near the middle of the image, 700 mm away.
View viewFrom(double degrees, bool distorted = false) {
    View view;
    if (distorted) view.carm.distortion = std::make_shared<test::Pincushion>(8e-6);  // 80 mm off the axis: 4 mm
    view.imager_from_world =
        Rigid3::fromTranslation({4, -6, 700}) * Rigid3::fromRotationVector({0.05, radiansFromDegrees(degrees), 0.02});
    return view;
}

Observation see(const View& view, const Vector3& point, double sigma_px = 0.3) {
    return {view, view.carm.project(view.imager_from_world * point), sigma_px};
}

TEST(PixelRay, StartsAtTheSourceAndMeetsWhatThePixelShows) {
    const View view = viewFrom(25, true);
    const Vector3 point(12, -34, 20);
    const Ray ray = pixelRay(view.carm, view.imager_from_world, see(view, point).pixel);
    EXPECT_LT((view.imager_from_world * ray.origin).norm(), 1e-10);
    EXPECT_NEAR(ray.direction.norm(), 1, 1e-12);
    EXPECT_LT(ray.direction.cross(point - ray.origin).norm(), 1e-8);
    EXPECT_GT(ray.direction.dot(point - ray.origin), 0);
}

// Points of a ray of one view are seen on its epipolar line in the other: 1e-9 px of 500 is rounding.
TEST(Epipolar, TheLineHoldsThePicturesOfAllPointsOfTheRay) {
    Random random(4);
    for (const bool distorted : {false, true}) {
        for (int trial = 0; trial < 50; ++trial) {
            const View a = viewFrom(random.uniform(-60, 0), distorted), b = viewFrom(random.uniform(20, 90), distorted);
            const Vector3 point = randomVector(random, 20);
            const auto line = epipolarLine(a, see(a, point).pixel, b);
            ASSERT_OK(line);
            EXPECT_NEAR(line->head<2>().norm(), 1, 1e-12);
            const Vector2 seen = b.carm.idealPixel(see(b, point).pixel);
            EXPECT_NEAR(line->dot(seen.homogeneous()), 0, distorted ? 1e-6 : 1e-9);
        }
    }
}

// The scale of the line is pixels: a point beside the ray is seen as far from the line as from the foot of its
// perpendicular.
TEST(Epipolar, TheLineMeasuresDistanceInPixels) {
    const View a = viewFrom(0), b = viewFrom(50);
    const auto line = epipolarLine(a, {200, 300}, b);
    ASSERT_OK(line);
    const Vector2 direction(-line->y(), line->x()), foot = -line->z() * line->head<2>();
    const Vector2 beside = foot + 37 * direction + 5 * line->head<2>();
    EXPECT_NEAR(line->dot(beside.homogeneous()), 5, 1e-9);
}

TEST(Epipolar, TheCurvePassesThroughThePictureOfEveryPointOfTheRayAndNothingElse) {
    const View a = viewFrom(-20, true), b = viewFrom(35, true);
    const Vector2 pixel(180, 333);
    const auto curve = epipolarCurve(a, pixel, b, 2);
    ASSERT_OK(curve);
    ASSERT_GT(curve->size(), 50u);
    for (std::size_t i = 1; i < curve->size(); ++i)
        EXPECT_LT(((*curve)[i] - (*curve)[i - 1]).norm(), 2 * 1.3);  // stretched by the distortion, at most 1 + 3 k r^2
    const Ray ray = pixelRay(a.carm, a.imager_from_world, pixel);
    int inside = 0;
    for (double depth = 1; depth < 1000; depth += 1) {
        const Vector2 seen = see(b, ray.origin + depth * ray.direction).pixel;
        if (!(seen.x() > 0 && seen.y() > 0 && seen.x() < 511 && seen.y() < 511)) continue;
        ++inside;
        double nearest = 1e9;
        for (std::size_t i = 1; i < curve->size(); ++i) {
            const Vector2 start = (*curve)[i - 1], along = (*curve)[i] - start;
            const double t = std::clamp((seen - start).dot(along) / along.squaredNorm(), 0.0, 1.0);
            nearest = std::min(nearest, (seen - start - t * along).norm());
        }
        EXPECT_LT(nearest, 0.01);  // sagitta of a 2 px chord at this distortion
    }
    EXPECT_GT(inside, 100);
    for (const Vector2& vertex : *curve) {
        EXPECT_GT(vertex.minCoeff(), -30);
        EXPECT_LT(vertex.maxCoeff(), 541);
    }
}

TEST(Epipolar, WhatLiesBehindASourceIsNotSeen) {
    const View a = viewFrom(0);
    View b = viewFrom(40);
    // Turned about its own source by half a turn, b has the whole ray behind it.
    b.imager_from_world = Rigid3::fromRotationVector({0, radiansFromDegrees(180), 0}) * b.imager_from_world;
    const auto curve = epipolarCurve(a, {256, 256}, b);
    ASSERT_OK(curve);
    EXPECT_TRUE(curve->empty());
    EXPECT_THAT(epipolarLine(a, {256, 256}, a).error().message(), HasSubstr("source of the other view on the ray"));
    EXPECT_THAT(epipolarCurve(a, {256, 256}, a, 0).error().message(), HasSubstr("step_px: found 0"));
}

TEST(Triangulate, ExactPicturesGiveTheExactPoint) {
    Random random(6);
    for (const bool distorted : {false, true}) {
        for (int trial = 0; trial < 20; ++trial) {
            const Vector3 point = randomVector(random, 25);
            std::vector<Observation> seen = {see(viewFrom(-30, distorted), point), see(viewFrom(25, distorted), point)};
            if (trial % 2) seen.push_back(see(viewFrom(80, distorted), point, 1.0));
            const auto found = triangulate(seen);
            ASSERT_OK(found);
            EXPECT_LT((found->point - point).norm(), 1e-6);
            EXPECT_LT(found->rms_px, 1e-6);
            EXPECT_EQ(found->residuals_px.size(), seen.size());
            EXPECT_TRUE(found->warnings.empty());
        }
    }
}

// Whitened scatter must be the identity: 4000 draws give each entry a standard error of 0.022 (diagonal) and 0.016; 0.1
// is more than four of them. The mean must be unbiased within four standard errors.
void expectPredictedScatter(const std::vector<View>& views, double sigma_px, std::uint64_t seed) {
    Random random(seed);
    const Vector3 point(10, -15, 20);
    std::vector<Observation> exact;
    for (const View& view : views)
        exact.push_back(see(view, point, sigma_px));
    const auto predicted = triangulate(exact);
    ASSERT_OK(predicted);
    const Matrix3 whitener = Matrix3(predicted->covariance.llt().matrixL()).inverse();
    Matrix3 scatter = Matrix3::Zero();
    Vector3 mean = Vector3::Zero();
    double chi_squared = 0;
    const int draws = 4000;
    for (int draw = 0; draw < draws; ++draw) {
        std::vector<Observation> noisy = exact;
        for (Observation& o : noisy) {
            o.pixel += sigma_px * Vector2(random.normal(), random.normal());
            if (o.view.covariance.isZero()) continue;
            Vector6 z;
            for (int i = 0; i < 6; ++i)
                z[i] = random.normal();
            o.view.imager_from_world = o.view.imager_from_world.perturbed(o.view.covariance.llt().matrixL() * z);
        }
        const auto found = triangulate(noisy);
        ASSERT_OK(found);
        const Vector3 error = whitener * (found->point - point);
        mean += error / draws;
        scatter += error * error.transpose() / draws;
        chi_squared += found->chi_squared / draws;
    }
    EXPECT_LT((scatter - Matrix3::Identity()).cwiseAbs().maxCoeff(), 0.1) << scatter;
    EXPECT_LT(mean.cwiseAbs().maxCoeff(), 4 / std::sqrt(draws));
    EXPECT_NEAR(chi_squared / predicted->degrees_of_freedom, 1, 0.1);
}

TEST(Triangulate, CovarianceIsTheScatterUnderPixelNoise) {
    expectPredictedScatter({viewFrom(0), viewFrom(50)}, 0.3, 21);
    expectPredictedScatter({viewFrom(0), viewFrom(20, true), viewFrom(70)}, 0.5, 22);
}

TEST(Triangulate, CovarianceIsTheScatterUnderPoseNoiseToo) {
    std::vector<View> views = {viewFrom(0), viewFrom(50), viewFrom(90, true)};
    // Corkscrew poses: depth ten times worse than x and y.
    views[0].covariance.diagonal() << 0.01, 0.01, 1, 1e-6, 1e-6, 1e-6;
    views[2].covariance.diagonal() << 0.04, 0.02, 2, 2e-6, 1e-6, 4e-6;
    views[2].covariance(0, 4) = views[2].covariance(4, 0) = 1e-4;
    views[1].covariance.diagonal() << 0.01, 0.01, 0.5, 1e-6, 2e-6, 1e-6;
    expectPredictedScatter(views, 0.3, 23);
}

// Two views at a small angle: the weak direction is the viewing direction, with the closed form for two equal rays at
// angle t, each with the standard deviation s across: s / sqrt(2) / sin(t / 2) along.
TEST(Triangulate, NarrowViewsAreDoneWithAWarningInWords) {
    const Vector3 point(0, 0, 0);
    const auto found = triangulate({see(viewFrom(0), point), see(viewFrom(3), point)});
    ASSERT_OK(found);
    EXPECT_NEAR(degreesFromRadians(found->angle_rad), 3, 0.01);
    const double across_mm = 0.3 * 0.32 * 700 / 1000;
    EXPECT_NEAR(found->weakest_sigma_mm, across_mm / std::sqrt(2) / std::sin(radiansFromDegrees(1.5)), 0.01);
    const Vector3 viewing = viewFrom(1.5).imager_from_world.inverse().rotate({0, 0, 1});
    EXPECT_GT(std::abs(found->weakest_direction.dot(viewing)), 0.999);
    ASSERT_EQ(found->warnings.size(), 1u);
    EXPECT_THAT(found->warnings[0], HasSubstr("the two views are only 3.0 degrees apart: depth is hardly observable"));
}

TEST(Triangulate, PixelsOfDifferentPointsAreNoticed) {
    std::vector<Observation> seen = {see(viewFrom(0), {0, 0, 0}), see(viewFrom(60), {0, 4, 0})};
    const auto found = triangulate(seen);
    ASSERT_OK(found);
    ASSERT_EQ(found->warnings.size(), 1u);
    EXPECT_THAT(found->warnings[0], HasSubstr("may show different points"));
    // The same disagreement is nothing unusual when the poses are that bad.
    for (Observation& o : seen)
        o.view.covariance.topLeftCorner<3, 3>().diagonal().setConstant(9);
    EXPECT_TRUE(triangulate(seen)->warnings.empty());
}

TEST(Triangulate, RefusesInWords) {
    const Vector3 point(1, 2, 3);
    const auto messageOf = [](const std::vector<Observation>& seen) {
        const auto found = triangulate(seen);
        return found.ok() ? std::string("no error") : found.error().message();
    };
    EXPECT_THAT(messageOf({}), HasSubstr("found 0 views, expected two views"));
    EXPECT_THAT(messageOf({see(viewFrom(0), point)}), HasSubstr("found 1 view, expected two views"));
    EXPECT_THAT(messageOf({see(viewFrom(0), point), see(viewFrom(0), point)}), HasSubstr("depth is not observable"));
    View front, back;
    front.imager_from_world = Rigid3::fromTranslation({0, 0, 700});
    back.imager_from_world = front.imager_from_world * Rigid3::fromRotationVector({0, radiansFromDegrees(180), 0});
    EXPECT_THAT(messageOf({see(front, {0, 0, 5}), see(back, {0, 0, 5})}), HasSubstr("0.0 degrees from opposite"));
    std::vector<Observation> seen = {see(viewFrom(0), point), see(viewFrom(40), point)};
    seen[1].pixel.x() = NAN;
    EXPECT_THAT(messageOf(seen), HasSubstr("view 2: found the pixel (nan"));
    seen[1] = see(viewFrom(40), point, 0);
    EXPECT_THAT(messageOf(seen), HasSubstr("view 2, sigma_px: found 0"));
    // Two parallel C-arms 100 mm apart whose rays run apart: they meet behind both sources.
    seen[1] = seen[0] = see(viewFrom(0), point);
    seen[1].view.imager_from_world = Rigid3::fromTranslation({-100, 0, 0}) * seen[0].view.imager_from_world;
    seen[0].pixel = {100, 256};
    seen[1].pixel = {400, 256};
    EXPECT_THAT(messageOf(seen), HasSubstr("behind the X-ray source of view 1"));
    EXPECT_TRUE(std::isnan(TriangulatedPoint().weakest_sigma_mm));
    EXPECT_THAT(triangulate(seen, {.iterations = 0}).error().message(), HasSubstr("iterations: found 0"));
}

}  // namespace
}  // namespace fluorocut
