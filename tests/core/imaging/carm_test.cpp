#include "core/imaging/carm.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

TEST(CArm, ProjectsAsEquationsTwoAndFour) {
    CArm carm;
    carm.focal_length_mm = 1000;
    carm.pixel_mm = {0.3, 0.4};
    carm.principal_point_px = {250, 260};
    const Vector2 px = carm.project({30, -20, 500});
    EXPECT_DOUBLE_EQ(px.x(), 1000.0 * 30 / 500 / 0.3 + 250);
    EXPECT_DOUBLE_EQ(px.y(), 1000.0 * -20 / 500 / 0.4 + 260);
    EXPECT_TRUE(std::isnan(carm.project({0, 0, -1}).x()));
}

TEST(CArm, RaysGoThroughTheirPixels) {
    const CArm carm;
    const Vector2 px(17.25, 400.5);
    EXPECT_LT((carm.project(600 * carm.rayDirection(px)) - px).norm(), 1e-10);
}

// A point's pixel in the binned or cropped image is where the averaged or kept pixels are.
TEST(CArm, BinningAndCroppingKeepTheGeometry) {
    const CArm carm;
    const Vector3 point(12, -34, 640);
    const Vector2 px = carm.project(point);
    for (const int factor : {2, 4, 8}) {
        const CArm binned = carm.binned(factor);
        EXPECT_EQ(binned.columns, carm.columns / factor);
        const Vector2 expected = (px.array() + 0.5) / factor - 0.5;
        EXPECT_LT((binned.project(point) - expected).norm(), 1e-10);
    }
    EXPECT_LT((carm.cropped(100, 50, 64, 64).project(point) - (px - Vector2(100, 50))).norm(), 1e-10);
}

TEST(CArm, ValidateNamesFieldValueAndLimit) {
    CArm carm;
    EXPECT_OK(carm.validate());
    carm.focal_length_mm = NAN;
    ASSERT_FALSE(carm.validate().ok());
    EXPECT_EQ(carm.validate().error().message(), "focal_length_mm: found nan, expected 10 to 10000 mm.");
    carm = CArm();
    carm.pixel_mm.y() = 0;
    EXPECT_EQ(carm.validate().error().where, "pixel_mm[1]");
}

}  // namespace
}  // namespace fluorocut
