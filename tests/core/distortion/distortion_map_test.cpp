#include "core/distortion/distortion_map.h"

#include <cmath>
#include <fstream>
#include <iterator>

#include <gmock/gmock.h>

#include "tests/core/distortion/synthetic_grooves.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::BentPlate;
using test::GrooveNoise;
using test::groovePoints;
using testing::HasSubstr;
using testing::Not;

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

DistortionMap someMap(std::uint64_t seed = 2) {
    Random random(seed);
    const BentPlate plate = BentPlate::random(512, 0.32, random);
    return fitDistortion(groovePoints(plate, {}, random), {}).value();
}

TEST(DistortionMap, GoesOnBeyondItsSupportOneToOne) {
    for (const std::uint64_t seed : {2, 3, 4}) {
        const DistortionMap map = someMap(seed);
        for (int y = -256; y < 768; y += 32) {
            for (int x = -256; x < 768; x += 32) {
                const Vector2 pixel(x, y), detector = map.detectorFromPixel(pixel);
                // Twice the image across: found again, and never turned over.
                EXPECT_LT((map.pixelFromDetector(detector) - pixel).norm(), 1e-7) << pixel.transpose();
                Matrix2 jacobian;
                for (int axis = 0; axis < 2; ++axis)
                    jacobian.col(axis) = map.detectorFromPixel(pixel + 0.5 * Vector2::Unit(axis)) -
                                         map.detectorFromPixel(pixel - 0.5 * Vector2::Unit(axis));
                EXPECT_GT(jacobian.determinant(), 0.3 * map.pixelMm() * map.pixelMm());
            }
        }
        // No step at the rim.
        for (const Vector2& rim : map.parts().support.polygon()) {
            const Vector2 outward = 1e-6 * (rim - map.parts().support.centre()).normalized();
            EXPECT_LT((map.detectorFromPixel(rim + outward) - map.detectorFromPixel(rim - outward)).norm(), 1e-6);
            EXPECT_TRUE(map.covers(rim, 0.01));
            EXPECT_FALSE(map.covers(rim, -0.01));
        }
    }
    EXPECT_FALSE(someMap().pixelFromDetector(Vector2::Constant(std::nan(""))).allFinite());
}

TEST(DistortionMap, IsTheDistortionOfACArmWhateverItsPrincipalPoint) {
    const test::ScratchFolder folder;
    const DistortionMap map = someMap();
    ASSERT_OK(writeDistortionMap(folder / "map.json", map));
    CArm carm;
    carm.pixel_mm.setConstant(map.pixelMm());
    carm.principal_point_px = {240, 263};
    carm.distortion = distortionOf(map, carm).value();
    ASSERT_OK(writeCArm(folder / "carm.json", carm, folder / "map.json"));
    const auto read = readCArm(folder / "carm.json", distortionReaders());
    ASSERT_OK(read);
    std::vector<Vector2> row(512);
    for (int y = 0; y < 512; y += 37) {
        read->idealRow(y, row);
        for (int x = 0; x < 512; x += 37) {
            const Vector2 pixel(x, y);
            EXPECT_LT((read->idealPixel(pixel) - map.idealPixel(pixel)).norm(), 1e-9);
            EXPECT_LT((row[static_cast<std::size_t>(x)] - map.idealPixel(pixel)).norm(), 1e-9);
            EXPECT_LT((read->distortedPixel(read->idealPixel(pixel)) - pixel).norm(), 1e-6);
        }
    }
    CArm small = carm;
    small.columns = 511;
    EXPECT_THAT(distortionOf(map, small).error().message(), HasSubstr("a map of 512 x 512 pixels, expected 511 x 512"));
    CArm fine = carm;
    fine.pixel_mm *= 0.5;
    EXPECT_THAT(distortionOf(map, fine).error().message(), HasSubstr("within 10 % of the C-arm's"));
}

TEST(DistortionMap, BadFilesAreRefusedInWords) {
    const test::ScratchFolder folder;
    ASSERT_OK(writeDistortionMap(folder / "map.json", someMap()));
    std::ifstream stream(folder / "map.json");
    const std::string good((std::istreambuf_iterator<char>(stream)), {});
    const auto message = [&](const std::string& from, const std::string& to) {
        std::string text = good;
        const auto at = text.find(from);
        EXPECT_NE(at, std::string::npos) << from;
        std::ofstream(folder / "bad.json") << text.replace(at, from.size(), to);
        const auto map = readDistortionMap(folder / "bad.json");
        return map ? std::string("no error") : map.error().message();
    };
    EXPECT_EQ(message("\"rows\"", "\"rows\""), "no error");
    EXPECT_THAT(message("\"polynomial\"", "\"spiral\""), HasSubstr("spiral"));
    EXPECT_THAT(message("\"columns\": 512", "\"columns\": 0"), HasSubstr("columns"));
    EXPECT_THAT(message("\"pitch_mm\": 6.35", "\"pitch_mm\": -6.35"), HasSubstr("pitch_mm"));
    EXPECT_THAT(message("\"radius_px\": [", "\"radius_px\": [-1, "), HasSubstr("radius_px"));
    EXPECT_THAT(message("\"measured_at\": null", "\"measured_at\": \"noon\""), HasSubstr("found \"noon\""));
    EXPECT_THAT(message("\"covariance_order\"", "\"covariance_degree\""), HasSubstr("covariance_"));
    EXPECT_THAT(message("\"triangle_px\": [", "\"triangle_px\": [1e300, "), HasSubstr("triangle_px"));
    EXPECT_THAT(message("\"quality\"", "\"quality_of_all\""), HasSubstr("quality"));
    EXPECT_THAT(message("{", "["), Not(HasSubstr("no error")));
}

TEST(DistortionMap, LowersTheOrderRatherThanGuess) {
    Random random(6);
    BentPlate plate = BentPlate::random(512, 0.32, random);
    GroovePoints points = groovePoints(plate, {.field = 0.485}, random);
    // Of the grooves along x only those in a strip are seen: y is anyone's guess elsewhere.
    std::erase_if(points.along_x, [](const GroovePoint& point) { return std::abs(point.pixel.x() - 250) > 40; });
    DistortionFitOptions options;
    options.order = 5;
    const auto map = fitDistortion(points, options);
    ASSERT_OK(map);
    ASSERT_EQ(map->quality().warnings.size(), 1U);
    EXPECT_THAT(map->quality().warnings[0], HasSubstr("order was lowered from 5 to "));
    EXPECT_LT(map->model().parameters()[0].second[0], 5);
    EXPECT_LT(map->quality().coverage, 0.5);  // both directions are needed
}

TEST(DistortionMap, AnAutomaticOrderIsAsHighAsThePointsTell) {
    Random random(8);
    const BentPlate plate = BentPlate::random(512, 0.32, random);
    const auto order = [&](double noise_mm) {
        DistortionFitOptions options;
        options.order = 0;
        return fitDistortion(groovePoints(plate, {.sigma_mm = noise_mm}, random), options)
            .value()
            .model()
            .parameters()[0]
            .second[0];
    };
    EXPECT_EQ(order(0.034), 5);
    EXPECT_GT(order(0.001), 5);
    EXPECT_LE(order(0.3), 3);
}

TEST(DistortionMap, OptionsNameFieldValueAndLimit) {
    DistortionFitOptions options;
    EXPECT_TRUE(options.validate().ok());
    options.model = "table";  // there is one, but none is fitted
    EXPECT_THAT(options.validate().error().message(), HasSubstr("one of polynomial, bernstein, thin-plate-spline"));
    options = {.order = 10};
    EXPECT_THAT(options.validate().error().message(), HasSubstr("order: found 10"));
    options = {.pixel_mm = -1};
    EXPECT_THAT(options.validate().error().message(), HasSubstr("pixel_mm: found -1"));
}

}  // namespace
}  // namespace fluorocut
