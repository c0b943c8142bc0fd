#include "core/imaging/standard_views.h"

#include <limits>

#include <gtest/gtest.h>

#include "core/imaging/carm.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

const Vector3 kTarget(30, -200, 55);
const Vector3 kLeft(1, 0, 0);
const Vector3 kBack(0, 1, 0);
const Vector3 kHead(0, 0, 1);

// How far the image of the target moves, in pixels, when the target moves by 1 mm.
Vector2 shift(StandardView view, const Vector3& direction) {
    const CArm carm;
    const Rigid3 imager_from_femur = standardView(view, kTarget, 700);
    return carm.project(imager_from_femur * (kTarget + direction)) - carm.project(imager_from_femur * kTarget);
}

TEST(StandardViews, SeeTheTargetInTheMiddle) {
    for (const StandardView view : {StandardView::ap, StandardView::lateral}) {
        const Vector3 seen = standardView(view, kTarget, 700) * kTarget;
        EXPECT_NEAR((seen - Vector3(0, 0, 700)).norm(), 0, 1e-9);  // rounding of a few hundred mm
    }
}

TEST(StandardViews, AreOrientedAsTheHeaderSays) {
    const double scale = 1000.0 / 700 / 0.32;  // pixels per mm at the target
    EXPECT_NEAR(shift(StandardView::ap, kLeft).x(), scale, 1e-9);
    EXPECT_NEAR(shift(StandardView::ap, kHead).y(), -scale, 1e-9);
    EXPECT_NEAR(shift(StandardView::ap, kBack).norm(), 0, 1e-9);  // along the beam
    EXPECT_NEAR(shift(StandardView::lateral, -kBack).x(), scale, 1e-9);
    EXPECT_NEAR(shift(StandardView::lateral, kHead).y(), -scale, 1e-9);
    EXPECT_NEAR(shift(StandardView::lateral, kLeft).norm(), 0, 1e-9);
}

TEST(StandardViews, TheSourceIsInFrontAndOnTheRight) {
    const Vector3 ap = standardView(StandardView::ap, kTarget, 700).inverse().translation() - kTarget;
    EXPECT_NEAR((ap - -700 * kBack).norm(), 0, 1e-9);
    const Vector3 lateral = standardView(StandardView::lateral, kTarget, 700).inverse().translation() - kTarget;
    EXPECT_NEAR((lateral - -700 * kLeft).norm(), 0, 1e-9);
}

TEST(StandardViews, TheStandardCArmIsValidAndCentred) {
    const CArm carm = standardCArm();
    ASSERT_OK(carm.validate());
    // The axis meets the middle of the detector, between the middle pixels.
    EXPECT_EQ(carm.project({0, 0, kStandardObjectDepthMm}), Vector2(0.5 * (carm.columns - 1), 0.5 * (carm.rows - 1)));
    EXPECT_LT(kStandardObjectDepthMm, carm.focal_length_mm);
}

TEST(StandardViews, RefuseADistanceThatIsNone) {
    EXPECT_THROW(standardView(StandardView::ap, kTarget, 0), std::logic_error);
    EXPECT_THROW(standardView(StandardView::ap, kTarget, std::numeric_limits<double>::quiet_NaN()), std::logic_error);
}

}  // namespace
}  // namespace fluorocut
