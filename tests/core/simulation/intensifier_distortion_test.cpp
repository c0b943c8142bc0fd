#include "core/simulation/intensifier_distortion.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/imaging/carm.h"
#include "core/imaging/carm_position.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

constexpr double kRadius = 82;

IntensifierDistortionParameters typical() {
    IntensifierDistortionParameters p;
    p.pincushion_mm = 2.1;
    p.s_shape_rad = 0.02;
    p.shift_mm = {0.7, -0.4};
    p.rotation_rad = 0.01;
    return p;
}

std::shared_ptr<const IntensifierDistortion> make(const IntensifierDistortionParameters& p) {
    auto made = IntensifierDistortion::create(p);
    EXPECT_OK(made);
    return *made;
}

Rigid3 standing(double orbital_deg, double angulation_deg) {
    return nominalImagerFromRoom({radiansFromDegrees(orbital_deg), radiansFromDegrees(angulation_deg), {0, 0, 0}}, 650);
}

// Closed form, from the field's centre to far outside it (the corner of a square detector is at 1.41 R). The header
// promises 1e-9 mm.
TEST(IntensifierDistortion, ForwardAndInverseAreInverse) {
    IntensifierDistortionParameters barrel = typical();
    barrel.pincushion_mm = -4;
    IntensifierDistortionParameters strong = typical();
    strong.pincushion_mm = 30;
    strong.s_shape_rad = -0.5;
    for (const auto& parameters : {typical(), barrel, strong}) {
        const auto distortion = make(parameters);
        for (double x = -250; x <= 250; x += 10) {
            for (double y = -250; y <= 250; y += 10) {
                const Vector2 p(x, y);
                ASSERT_LT((distortion->undistorted(distortion->distorted(p)) - p).norm(), 1e-9) << x << " " << y;
                ASSERT_LT((distortion->distorted(distortion->undistorted(p)) - p).norm(), 1e-9) << x << " " << y;
            }
        }
    }
}

TEST(IntensifierDistortion, PincushionMovesOutwardWithTheCube) {
    IntensifierDistortionParameters p;
    p.pincushion_mm = 2;
    const auto distortion = make(p);
    for (const double share : {0.25, 0.5, 1.0, 1.4}) {
        const Vector2 direction(0.6, -0.8);
        const Vector2 moved = distortion->distorted(share * kRadius * direction) - share * kRadius * direction;
        EXPECT_LT((moved - 2 * std::pow(share, 3) * direction).norm(), 1e-12);
    }
}

TEST(IntensifierDistortion, SShapeTurnsWithTheSquareOfTheRadius) {
    IntensifierDistortionParameters p;
    p.s_shape_rad = 0.02;
    const auto distortion = make(p);
    for (const double share : {0.25, 0.5, 1.0}) {
        const Vector2 bent = distortion->distorted({share * kRadius, 0});
        EXPECT_NEAR(bent.norm(), share * kRadius, 1e-12);
        EXPECT_NEAR(std::atan2(bent.y(), bent.x()), 0.02 * share * share, 1e-14);
    }
    // A line through the centre becomes point-symmetric, not straight: an S.
    EXPECT_LT((distortion->distorted({60, 0}) + distortion->distorted({-60, 0})).norm(), 1e-12);
}

TEST(IntensifierDistortion, IsContinuousWhereTheCubicEnds) {
    const auto distortion = make(typical());
    const double end = 2 * kRadius, h = 1e-6;
    const Vector2 before = distortion->distorted({end - h, 0}), at = distortion->distorted({end, 0}),
                  after = distortion->distorted({end + h, 0});
    EXPECT_LT((after - 2 * at + before).norm(), 1e-9);  // no step and no kink
}

TEST(IntensifierDistortion, RefusesWhatFoldsOver) {
    IntensifierDistortionParameters p;
    p.pincushion_mm = -10;  // slope at 2 R: 1 - 12 * 10 / 82 < 0
    const auto folded = IntensifierDistortion::create(p);
    ASSERT_FALSE(folded.ok());
    EXPECT_EQ(folded.error().where, "pincushion_mm");
    EXPECT_NE(folded.error().message().find("folds over"), std::string::npos);
    p.pincushion_mm = NAN;
    EXPECT_FALSE(IntensifierDistortion::create(p).ok());
    p = {};
    p.shift_mm.y() = NAN;
    EXPECT_EQ(IntensifierDistortion::create(p).error().where, "shift_mm[1]");
}

// What real tubes show (METHODS: 5 to 8 pixels of 0.32 mm at the rim), in every pose in use.
TEST(IntensifierOptions, BendByFiveToEightPixelsAtTheRim) {
    for (const double orbital : {-90.0, -40.0, 0.0, 50.0, 90.0}) {
        for (const double angulation : {-30.0, 0.0, 30.0}) {
            const auto distortion = make(intensifierAt({}, standing(orbital, angulation)));
            double mean_px = 0;
            for (int i = 0; i < 36; ++i) {
                const Vector2 rim(kRadius * std::cos(i * M_PI / 18), kRadius * std::sin(i * M_PI / 18));
                const Vector2 center = distortion->distorted(Vector2::Zero());
                mean_px += (distortion->distorted(rim) - center - rim).norm() / 0.32 / 36;
            }
            EXPECT_GT(mean_px, 5) << orbital << " " << angulation;
            EXPECT_LT(mean_px, 9) << orbital << " " << angulation;  // with the S-shape and the sag's turn
        }
    }
}

TEST(IntensifierOptions, DifferByPoseSmoothlyAndRepeat) {
    const auto at = [](double orbital) { return make(intensifierAt({}, standing(orbital, 10))); };
    const Vector2 rim(58, -58);
    EXPECT_GT((at(0)->distorted(rim) - at(50)->distorted(rim)).norm(), 0.32);     // more than a pixel in 50 degrees
    EXPECT_LT((at(20)->distorted(rim) - at(20.1)->distorted(rim)).norm(), 0.02);  // 0.1 degrees: no jump
    EXPECT_EQ(at(20)->distorted(rim), at(20)->distorted(rim));
    // The S-shape follows the axial field: half a turn of the tube reverses it.
    EXPECT_NEAR(intensifierAt({}, standing(0, 0)).s_shape_rad, -intensifierAt({}, standing(180, 0)).s_shape_rad, 1e-12);
    EXPECT_EQ(make(intensifierAt(IntensifierOptions::none(), standing(30, 0)))->distorted(rim), rim);
}

TEST(IntensifierOptions, DisturbanceHasItsSize) {
    Random random(1);
    double sum = 0;
    for (int i = 0; i < 2000; ++i)
        sum += std::pow(disturbed(typical(), 0.05, random).shift_mm.x() - 0.7, 2);
    EXPECT_NEAR(std::sqrt(sum / 2000), 0.05, 5 * 0.05 / std::sqrt(4000.0));  // five standard errors
    EXPECT_EQ(disturbed(typical(), 0, random).pincushion_mm, typical().pincushion_mm);
}

TEST(IntensifierOptions, ValidateNamesTheField) {
    EXPECT_OK(IntensifierOptions().validate());
    IntensifierOptions options;
    options.repeatability_mm = -1;
    EXPECT_EQ(options.validate().error().where, "repeatability_mm");
    options = {};
    options.pincushion_mm = -50;
    EXPECT_EQ(options.validate().error().where, "pincushion_mm");
}

// The C-arm model uses it both ways.
TEST(IntensifierDistortion, FitsIntoTheCArm) {
    CArm carm;
    carm.distortion = make(typical());
    for (const Vector2& pixel : {Vector2(0, 0), Vector2(255.5, 255.5), Vector2(500, 30)})
        EXPECT_LT((carm.project(650 * carm.rayDirection(pixel)) - pixel).norm(), 1e-8);
}

}  // namespace
}  // namespace fluorocut
