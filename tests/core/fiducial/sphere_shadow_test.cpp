#include "core/fiducial/sphere_shadow.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/core/imaging/pincushion.h"

namespace fluorocut {
namespace {

// Rays at the shadow's rim, found by bisection on whether they meet the sphere.
double rimDistance(const Vector3& center, double radius, double focal, const Vector2& from, double angle) {
    const Vector2 direction(std::cos(angle), std::sin(angle));
    double inside = 0, outside = focal;
    for (int i = 0; i < 80; ++i) {
        const double middle = 0.5 * (inside + outside);
        const Vector2 place = from + middle * direction;
        const Vector3 ray = Vector3(place.x(), place.y(), focal).normalized();
        const double off2 = center.squaredNorm() - std::pow(ray.dot(center), 2);
        (off2 < radius * radius ? inside : outside) = middle;
    }
    return inside;
}

TEST(SphereShadow, IsTheEllipseThatRaysDraw) {
    // From a bead of a phantom to a ball near the source, where the ellipse's centre is far from the projected centre.
    for (const auto& [center, radius] :
         {std::pair<Vector3, double>{{60, -80, 760}, 1.5}, {{40, 30, 150}, 20}, {{0, 0, 500}, 10}}) {
        const double focal = 1000;
        const SphereShadow shadow = sphereShadow(center, radius, focal);
        Vector2 sum = Vector2::Zero();
        for (int i = 0; i < 360; ++i) {
            const double angle = 2 * M_PI * i / 360;
            // Opposite rim points seen from an ellipse's centre are equally far.
            const double here = rimDistance(center, radius, focal, shadow.center_mm, angle);
            const double there = rimDistance(center, radius, focal, shadow.center_mm, angle + M_PI);
            EXPECT_NEAR(here, there, 1e-6 * here);
            const Vector2 point = shadow.at(angle);
            const Vector2 off = point - shadow.center_mm;
            EXPECT_NEAR(rimDistance(center, radius, focal, shadow.center_mm, std::atan2(off.y(), off.x())), off.norm(),
                        1e-6 * off.norm());
            sum += point;
        }
        EXPECT_LT((sum / 360 - shadow.center_mm).norm(), 1e-9);
    }
    const SphereShadow near = sphereShadow({40, 30, 150}, 20, 1000);
    EXPECT_GT((near.center_mm - Vector2(40, 30) / 150 * 1000).norm(), 5);  // mm: what is being corrected
}

TEST(SphereShadow, GoesThroughTheDistortionAndBack) {
    CArm carm;
    carm.distortion = std::make_shared<test::Pincushion>(3e-6);
    const Vector3 center(50, -40, 760);
    const Vector2 seen = shadowCenter(carm, center, 1.5);
    Vector2 sum = Vector2::Zero();
    const auto outline = shadowOutline(carm, center, 1.5, 200);
    for (const Vector2& point : outline)
        sum += point;
    EXPECT_LT((seen - sum / 200).norm(), 1e-7);
    EXPECT_GT((seen - carm.ideal().project(center)).norm(), 1);
    // Back: the shadow is not quite a circle; what that leaves is far below any measurement.
    const Vector2 ideal = shadowCenter(carm.ideal(), center, 1.5);
    EXPECT_LT((idealShadowCenter(carm, seen, 6.2) - ideal).norm(), 1e-3);
}

TEST(SphereShadow, BehindTheSourceThereIsNone) {
    EXPECT_TRUE(std::isnan(sphereShadow({0, 0, 1}, 1.5, 1000).center_mm.x()));
    EXPECT_TRUE(std::isnan(sphereShadow({0, 0, -100}, 1.5, 1000).radial_mm));
}

}  // namespace
}  // namespace fluorocut
