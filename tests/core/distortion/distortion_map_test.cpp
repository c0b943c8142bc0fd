#include "core/distortion/distortion_map.h"

#include <gmock/gmock.h>

#include "tests/core/distortion/synthetic_grooves.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::BentPlate;
using test::GrooveNoise;
using test::groovePoints;

TEST(DistortionMap, APolynomialFollowsABentPlate) {
    Random random(1);
    const BentPlate plate = BentPlate::random(512, 0.32, random);
    const auto map = fitDistortion(groovePoints(plate, {}, random), {});
    ASSERT_OK(map);
    double sum = 0;
    int count = 0;
    for (int y = 0; y < 512; y += 8) {
        for (int x = 0; x < 512; x += 8) {
            const Vector2 pixel(x, y);
            if ((pixel - plate.middle()).norm() > 0.47 * 512) continue;
            const double error = (map->plateFromPixel(pixel) - plate.plateFromPixel(pixel)).norm();
            sum += error;
            ++count;
            const Vector2 detector = map->detectorFromPixel(pixel);
            EXPECT_LT((map->pixelFromDetector(detector) - pixel).norm(), 1e-8);
        }
    }
    // Half the noise is left by 20 coefficients to 470 points, the rest is what order 5 cannot follow.
    EXPECT_LT(sum / count, 0.02);
    EXPECT_LT(map->detectorFromPixel(map->middle()).norm(), 1e-12);
}

}  // namespace
}  // namespace fluorocut
