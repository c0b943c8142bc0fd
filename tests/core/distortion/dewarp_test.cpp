#include "core/distortion/dewarp.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>

#include "core/base/parallel.h"
#include "tests/core/distortion/synthetic_grooves.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::BentPlate;
using test::groovePoints;

struct Case {
    BentPlate plate;
    DistortionMap map;
};

Case bentMap(int size, std::uint64_t seed) {
    Random random(seed);
    const BentPlate plate = BentPlate::random(size, 0.32 * 512 / size, random);
    return {plate, fitDistortion(groovePoints(plate, {}, random), {}).value()};
}

// Waves of 6 px and longer in every direction: what a detector blurred by a pixel passes.
float waves(const Vector2& p) {
    return static_cast<float>(10 + std::sin(p.x() * 2 * std::numbers::pi / 6.1) +
                              std::cos(p.y() * 2 * std::numbers::pi / 7.3) +
                              std::sin((p.x() + p.y()) * 2 * std::numbers::pi / 11.7));
}

// The picture that the map bends out of straight waves.
Image bentWaves(const DistortionMap& map) {
    Image image(map.columns(), map.rows());
    for (int y = 0; y < map.rows(); ++y) {
        for (int x = 0; x < map.columns(); ++x)
            image(x, y) = waves(map.idealPixel({static_cast<double>(x), static_cast<double>(y)}));
    }
    return image;
}

double rmsInside(const Case& c, const Dewarper& dewarper, const Image& straight) {
    double sum = 0;
    int count = 0;
    for (int y = 0; y < straight.height(); ++y) {
        for (int x = 0; x < straight.width(); ++x) {
            const Vector2 pixel(x, y);
            if (!dewarper.answered()(x, y) || !c.map.covers(c.map.distortedPixel(pixel))) continue;
            const double error = straight(x, y) - waves(pixel);
            sum += error * error;
            ++count;
        }
    }
    EXPECT_GT(count, straight.width() * straight.height() / 2);
    return std::sqrt(sum / count);
}

TEST(Dewarp, StraightensWavesByEitherMethod) {
    const Case c = bentMap(512, 3);
    const Image bent = bentWaves(c.map);
    for (const Resampling method : {Resampling::bspline, Resampling::twoPass}) {
        const Dewarper dewarper(c.map, method);
        const Result<Image> straight = dewarper.dewarped(bent);
        ASSERT_OK(straight);
        // The cubic spline's own error for waves of w px is about (2 pi / w)^4 / 570 of their height, 0.002 at 6 px; a
        // lookup wrong by 0.01 px would add 0.01.
        EXPECT_LT(rmsInside(c, dewarper, *straight), 0.003);
    }
    const Dewarper linear(c.map, Resampling::linear);
    EXPECT_LT(rmsInside(c, linear, linear.dewarped(bent).value()), 0.12);  // (2 pi / w)^2 / 12 and its like
}

TEST(Dewarp, LooksWhereTheMapSays) {
    for (const int size : {512, 1024}) {
        const Case c = bentMap(size, 4);
        const Dewarper dewarper(c.map);
        const double cell = 24;
        double inside = 0, rim = 0;
        for (int y = 0; y < size; y += 13) {
            for (int x = 0; x < size; x += 13) {
                const Vector2 exact = c.map.distortedPixel(Vector2(x, y));
                double& worst = c.map.covers(exact, -cell) ? inside : rim;
                worst = std::max(worst, (dewarper.distortedPixel(x, y) - exact).norm());
            }
        }
        EXPECT_LT(inside, 0.002);
        // At the rim the continued map bends, which the table rounds off; beyond it the map is no measurement.
        EXPECT_LT(rim, 0.02);
    }
}

TEST(Dewarp, DoesNotDependOnThreads) {
    const Case c = bentMap(512, 5);
    const Image bent = bentWaves(c.map);
    for (const Resampling method : {Resampling::bspline, Resampling::twoPass, Resampling::linear}) {
        const Image many = Dewarper(c.map, method).dewarped(bent).value();
        const ThreadLimit one(1);
        EXPECT_EQ(many, Dewarper(c.map, method).dewarped(bent).value());
    }
}

TEST(Dewarp, PixelsThatSeeNothingAreZeroAndCounted) {
    const Case c = bentMap(512, 6);  // a round field: the corners lie more than two pitches beyond it
    const Dewarper dewarper(c.map);
    const Image straight = dewarper.dewarped(Image(512, 512, 7.0F)).value();
    std::size_t lost = 0;
    const double two_pitches = 2 * 6.35 / c.map.pixelMm();
    for (int y = 0; y < 512; ++y) {
        for (int x = 0; x < 512; ++x) {
            lost += !dewarper.answered()(x, y);
            if (dewarper.answered()(x, y)) {
                EXPECT_NEAR(straight(x, y), 7.0F, 1e-4);  // a constant stays one
            } else {
                EXPECT_EQ(straight(x, y), 0.0F);
            }
            const Vector2 pixel = c.map.distortedPixel(Vector2(x, y));
            const bool in_image = pixel.minCoeff() > 0 && pixel.maxCoeff() < 511;
            if (in_image && c.map.covers(pixel, two_pitches - 1)) {
                EXPECT_TRUE(dewarper.answered()(x, y));
            }
            if (!c.map.covers(pixel, two_pitches + 1)) {
                EXPECT_FALSE(dewarper.answered()(x, y));
            }
        }
    }
    EXPECT_EQ(lost, dewarper.pixelsWithoutAnswer());
    EXPECT_GT(lost, 0U);
    EXPECT_FALSE(dewarper.answered()(0, 0));
}

// What the bent imager shows at a pixel, the straightened one shows where the map puts that pixel.
TEST(Dewarp, AStraightenedImagerProjectsIntoTheDewarpedImage) {
    const Case c = bentMap(256, 5);
    CArm carm;
    carm.columns = carm.rows = 256;
    carm.pixel_mm = {c.map.pixelMm() * 1.02, c.map.pixelMm() * 0.97};
    carm.principal_point_px = {131, 120};
    carm.distortion = distortionOf(c.map, carm).value();
    const CArm straight = straightened(c.map, carm);
    for (const Vector3& point : {Vector3(0, 0, 600), Vector3(20, -12, 650), Vector3(-18, 22, 550)}) {
        const Vector2 bent = carm.project(point);
        // The map's inverse is right to 1e-9 mm.
        EXPECT_LT((straight.project(point) - c.map.idealPixel(bent)).norm(), 1e-6);
    }
}

TEST(Dewarp, RefusesAnImageOfAnotherSize) {
    const Case c = bentMap(512, 7);
    const Result<Image> straight = Dewarper(c.map).dewarped(Image(512, 511));
    ASSERT_FALSE(straight.ok());
    EXPECT_EQ(straight.error().code, ErrorCode::invalidInput);
    EXPECT_THAT(straight.error().message(), testing::HasSubstr("512 x 511"));
}

}  // namespace
}  // namespace fluorocut
