#include "core/cavity/plane_contours.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "core/base/units.h"
#include "core/cavity/paper_method.h"
#include "core/cavity/plane_images.h"
#include "core/imaging/standard_views.h"

namespace fluorocut::cavity {
namespace {

// Brightness falls by one a pixel from `at`: its level sets are circles.
Image cone(int size, const Vector2& at, float top) {
    Image image(size, size);
    for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x)
            image(x, y) = top - static_cast<float>((Vector2(x, y) - at).norm());
    return image;
}

// Like a stem's outline: long, and no two of its sides alike.
Contour stemOutline(double step_px) {
    return resampled({{0, 0}, {60, -4}, {80, 20}, {70, 120}, {50, 380}, {36, 390}, {25, 380}, {10, 120}}, step_px);
}

Contour moved(const Contour& contour, const PlaneRigid& by) {
    Contour result;
    for (const Vector2& p : contour)
        result.push_back(by * p);
    return result;
}

TEST(IsoContours, CircleOfACone) {
    const Vector2 at(31.3, 28.7);
    const std::vector<Contour> contours = isoContours(cone(64, at, 20), 0);
    ASSERT_EQ(contours.size(), 1U);
    // Between pixels h apart a circle of radius r is off a straight line by h^2 / (8 r) at most: 0.006 px.
    for (const Vector2& p : contours[0])
        EXPECT_NEAR((p - at).norm(), 20, 0.0065);
    // The border of what is above is negative; its polygon lies inside the circle by less than that.
    EXPECT_NEAR(signedArea(contours[0]), -std::numbers::pi * 400, 2 * std::numbers::pi * 20 * 0.0065);
    EXPECT_NEAR(length(contours[0]), 2 * std::numbers::pi * 20, 0.2);
}

TEST(IsoContours, HolesAndBorders) {
    Image ring = cone(64, {32, 32}, 0);
    for (float& pixel : ring.pixels())
        pixel = 5 - std::abs(-pixel - 15);  // above 0 between the radii 10 and 20
    std::vector<Contour> contours = isoContours(ring, 0);
    ASSERT_EQ(contours.size(), 2U);
    EXPECT_LT(signedArea(contours[0]), 0);
    EXPECT_GT(signedArea(contours[1]), 0);
    // All above: along the border's pixels. None above: nothing.
    contours = isoContours(Image(8, 5, 1.0f), 0.5f);
    ASSERT_EQ(contours.size(), 1U);
    EXPECT_NEAR(signedArea(contours[0]), -7 * 4, 1e-9);
    EXPECT_TRUE(isoContours(Image(8, 5, 0.0f), 0.5f).empty());
}

TEST(IsoContours, SaddleIsPartedByItsMean) {
    Image saddle(4, 4);
    saddle(1, 1) = saddle(2, 2) = 1;
    EXPECT_EQ(isoContours(saddle, 0.6f).size(), 2U);  // mean 0.5: two parts
    EXPECT_EQ(isoContours(saddle, 0.4f).size(), 1U);  // one part
    std::swap(saddle(1, 1), saddle(1, 2));
    std::swap(saddle(2, 2), saddle(2, 1));
    EXPECT_EQ(isoContours(saddle, 0.6f).size(), 2U);
    EXPECT_EQ(isoContours(saddle, 0.4f).size(), 1U);
}

TEST(Snake, GoesToTheEdge) {
    const Vector2 at(40, 40);
    Image edge = cone(80, at, 0);
    for (float& pixel : edge.pixels())
        pixel = std::exp(-0.5f * std::pow((-pixel - 20) / 2.5f, 2.0f));  // a ridge of radius 20
    Contour start;
    for (int i = 0; i < 50; ++i) {
        const double a = 2 * std::numbers::pi * i / 50;
        start.push_back(at + (20 + 3 * std::cos(3 * a)) * Vector2(std::cos(a), std::sin(a)));
    }
    // Bending and stretching pull a circle of radius 20 inward by a little against a force that is 1 at most.
    for (const Vector2& p : snake(start, edge))
        EXPECT_NEAR((p - at).norm(), 20, 0.35);
}

TEST(RigidFit, FindsAKnownMotion) {
    const PlaneRigid truth{radiansFromDegrees(4), {12, -9}};
    const Contour from = stemOutline(3), to = moved(stemOutline(2.3), truth);
    // Moments are integrals along the same polygon but for its cut corners.
    const PlaneRigid moments = momentFit(from, to);
    EXPECT_NEAR(moments.angle_rad, truth.angle_rad, 1e-3);
    const std::optional<ContourFit> fit = rigidFit(from, to);
    ASSERT_TRUE(fit);
    EXPECT_NEAR(fit->to_from.angle_rad, truth.angle_rad, 1e-4);
    for (const Vector2& p : from)
        EXPECT_LT((fit->to_from * p - truth * p).norm(), 0.05);
    EXPECT_LT(fit->rms_px, 0.05);
    // Already there.
    EXPECT_LT(rigidFit(from, from)->to_from.shift_px.norm(), 1e-9);
}

TEST(RigidFit, RefusesWhatHasNoExtent) {
    EXPECT_FALSE(rigidFit({{1, 1}, {1, 1}, {1, 1}}, stemOutline(3)));
    EXPECT_FALSE(rigidFit({}, stemOutline(3)));
}

TEST(RigidFit, NearestPointsLieOnSegments) {
    const Contour square{{0, 0}, {10, 0}, {10, 10}, {0, 10}};
    EXPECT_LT((nearestOn(square, {4, -3}) - Vector2(4, 0)).norm(), 1e-12);
    EXPECT_LT((nearestOn(square, {-3, 4}) - Vector2(0, 4)).norm(), 1e-12);  // the side from the last to the first
    EXPECT_LT((nearestOn(square, {13, 14}) - Vector2(10, 10)).norm(), 1e-12);
    EXPECT_NEAR(distanceTo({{4, -3}, {4, -1}}, square), std::sqrt(5.0), 1e-12);
}

// What moves as the back-projection says is seen to move as the image said, at its depth exactly.
TEST(BackProjection, RoundTrip) {
    CArm carm = standardCArm();
    carm.principal_point_px += Vector2(13, -7);
    const PlaneRigid seen{radiansFromDegrees(3), {25, -14}};
    const double depth = 640;
    const Rigid3 delta = backProjected(seen, carm, depth);
    for (const Vector2& px : {Vector2(100, 200), Vector2(255, 255), Vector2(400, 90)}) {
        const Vector3 p = carm.detectorPoint(px) * (depth / carm.focal_length_mm);
        EXPECT_LT((carm.project(delta * p) - seen * px).norm(), 1e-9);
    }
    EXPECT_NEAR(delta.translation().z(), 0, 1e-12);
}

Image scene(int size, const PlaneSimilarity& scene_from_image) {
    Image image(size, size);
    for (int y = 0; y < size; ++y) {
        for (int x = 0; x < size; ++x) {
            const Vector2 p = scene_from_image * Vector2(x, y);
            double sum = 0;
            // Edges of many directions.
            for (const auto& [at, radius] : {std::pair{Vector2(60, 70), 22.0},
                                             {Vector2(130, 60), 15.0},
                                             {Vector2(110, 130), 35.0},
                                             {Vector2(50, 150), 18.0}})
                sum += 0.4 / (1 + std::exp((p - at).norm() - radius));
            image(x, y) = static_cast<float>(sum);
        }
    }
    return image;
}

TEST(AlignImages, FindsAKnownSimilarity) {
    PlaneSimilarity truth;
    truth.a = 1.012 * std::cos(0.02);
    truth.b = 1.012 * std::sin(0.02);
    truth.shift_px = {4.3, -3.1};
    const Image before = scene(200, {});
    Image after = scene(200, truth);  // brighter, and of more contrast
    for (float& pixel : after.pixels())
        pixel = 1.1f * pixel + 0.3f;
    const Region region{10, 10, 180, 180};
    PlaneSimilarity start = truth;  // as poses have it
    start.shift_px += Vector2(1.5, -1);
    const auto alignment = alignImages(before, after, region, Mask(180, 180), start);
    ASSERT_TRUE(alignment);
    for (const Vector2& p : {Vector2(20, 20), Vector2(100, 100), Vector2(180, 40)})
        EXPECT_LT((alignment->before_from_after * p - truth * p).norm(), 0.05);
    // The difference is that of resampling a smooth picture.
    const Image difference =
        differenceFrom(alignedBefore(before, region, alignment->before_from_after), after, region, Mask(180, 180));
    for (int y = 20; y < 160; ++y)
        for (int x = 20; x < 160; ++x)
            ASSERT_NEAR(difference(x, y), 0, 0.01) << x << " " << y;
    // Nothing to hold on to.
    EXPECT_FALSE(alignImages(before, after, region, Mask(180, 180, 1), {}));
}

TEST(PlaneSimilarity, BestOfPoints) {
    PlaneSimilarity truth;
    truth.a = 0.9;
    truth.b = -0.3;
    truth.shift_px = {5, 7};
    const Contour from{{0, 0}, {10, 3}, {-4, 8}};
    Contour to;
    for (const Vector2& p : from)
        to.push_back(truth * p);
    const PlaneSimilarity found = bestSimilarity(from, to);
    EXPECT_NEAR(found.a, truth.a, 1e-12);
    EXPECT_NEAR(found.b, truth.b, 1e-12);
    EXPECT_LT((found.shift_px - truth.shift_px).norm(), 1e-12);
}

TEST(FilledMask, AreaAndMargin) {
    const Contour square{{10.5, 10.5}, {20.5, 10.5}, {20.5, 30.5}, {10.5, 30.5}};
    const auto count = [&](double margin) {
        int sum = 0;
        const Mask mask = filledMask(60, 60, {square}, margin);
        for (const auto pixel : mask.pixels())
            sum += pixel;
        return sum;
    };
    EXPECT_EQ(count(0), 10 * 20);
    // Minkowski's sum with a disc: area + perimeter r + pi r^2, to the pixels along its border.
    EXPECT_NEAR(count(5), 200 + 60 * 5 + std::numbers::pi * 25, 20);
}

}  // namespace
}  // namespace fluorocut::cavity
