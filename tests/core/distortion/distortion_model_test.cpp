// The contract that every fitted model keeps (core/distortion/distortion_model.h).
#include "core/distortion/distortion_model.h"

#include <cmath>

#include <gmock/gmock.h>

#include "core/distortion/distortion_map.h"
#include "tests/core/distortion/synthetic_grooves.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::BentPlate;
using test::GrooveNoise;
using test::groovePoints;

DistortionFitOptions withModel(const std::string& name) {
    DistortionFitOptions options;
    options.model = name;
    return options;
}

// Of the 512 x 512 image: the field without its outermost 3 %.
std::vector<Vector2> fieldPixels(const BentPlate& plate) {
    std::vector<Vector2> pixels;
    const int step = plate.size / 64;
    for (int y = 0; y < plate.size; y += step) {
        for (int x = 0; x < plate.size; x += step) {
            if ((Vector2(x, y) - plate.middle()).norm() < 0.47 * plate.size) pixels.emplace_back(x, y);
        }
    }
    return pixels;
}

struct Trials {
    double mean_mm = 0;
    double inside_95 = 0;  // share of pixels whose error lies in the model's own 95 % region
    double answered = 0;
};

Trials run(const std::string& model, const GrooveNoise& noise, int count) {
    Trials result;
    std::vector<double> errors;
    double inside = 0, all = 0;
    for (int trial = 0; trial < count; ++trial) {
        Random random(1000 + static_cast<std::uint64_t>(trial));
        const BentPlate plate = BentPlate::random(512, 0.32, random);
        const auto map = fitDistortion(groovePoints(plate, noise, random), withModel(model));
        if (!map) {
            ADD_FAILURE() << "trial " << trial << ": " << map.error().message();
            continue;
        }
        for (const Vector2& pixel : fieldPixels(plate)) {
            all += 1;
            if (!map->covers(pixel)) continue;
            const Vector2 error = map->model().plateFromPixel(pixel) - plate.plateFromPixel(pixel);
            errors.push_back(error.norm());
            inside += error.dot(map->model().covariance(pixel).inverse() * error) < 5.991;  // chi^2 of two, 95 %
        }
    }
    if (errors.empty()) return result;
    for (const double error : errors)
        result.mean_mm += error / static_cast<double>(errors.size());
    result.inside_95 = inside / static_cast<double>(errors.size());
    result.answered = static_cast<double>(errors.size()) / all;
    return result;
}

// What each model reaches at a point noise of 0.034 mm on a lattice of 24 x 25 grooves, some 470 points each way; the
// prototype's figures (METHODS.md, 2) are 0.011 / 0.016 mm (centre / margin) for the polynomial, 0.012 / 0.019 for the
// spline, 0.026 / 0.068 for the paper's. Bounds: what was measured and a quarter.
struct Expected {
    std::string model;
    double clean_mm, hidden_mm;  // mean error; with a clamp over 15 % of the field and 5 % of false points
    double answered;

    friend void PrintTo(const Expected& expected, std::ostream* to) { *to << expected.model; }
};

class FittedModels : public testing::TestWithParam<Expected> {};

TEST_P(FittedModels, FollowABentPlateSlow) {
    const Trials clean = run(GetParam().model, {}, 20);
    EXPECT_LT(clean.mean_mm, GetParam().clean_mm);
    EXPECT_GT(clean.answered, GetParam().answered);
    const Trials hidden = run(GetParam().model, {.outliers = 0.05, .hidden_block = 0.15}, 20);
    EXPECT_LT(hidden.mean_mm, GetParam().hidden_mm);
}

TEST_P(FittedModels, KnowTheirUncertaintySlow) {
    // Errors are smooth: a trial holds some twenty independent ones, 40 trials give the share to 1 %.
    const Trials trials = run(GetParam().model, {}, 40);
    EXPECT_GT(trials.inside_95, 0.93);
    EXPECT_LT(trials.inside_95, 0.97);
}

DistortionMap fitted(const std::string& model, const BentPlate& plate, std::uint64_t seed) {
    Random random(seed);
    return fitDistortion(groovePoints(plate, {}, random), withModel(model)).value();
}

BentPlate somePlate(std::uint64_t seed) {
    Random random(seed);
    return BentPlate::random(512, 0.32, random);
}

TEST_P(FittedModels, HaveTheJacobianOfTheirValues) {
    const BentPlate plate = somePlate(7);
    const DistortionMap map = fitted(GetParam().model, plate, 7);
    constexpr double kStep = 0.05;
    int compared = 0, off = 0;
    for (const Vector2& pixel : fieldPixels(plate)) {
        const Matrix2 jacobian = map.model().jacobian(pixel);
        Matrix2 differences;
        for (int axis = 0; axis < 2; ++axis) {
            const Vector2 step = kStep * Vector2::Unit(axis);
            differences.col(axis) =
                (map.model().plateFromPixel(pixel + step) - map.model().plateFromPixel(pixel - step)) / (2 * kStep);
        }
        if (!differences.allFinite()) continue;
        ++compared;
        // The error of differences for a third derivative of 1e-5 mm per px^3.
        off += !((jacobian - differences).norm() < 1e-7 + (map.model().answersEverywhere() ? 0 : 2e-3));
    }
    // The paper's model jumps where a groove begins or ends.
    EXPECT_LE(off, map.model().answersEverywhere() ? 0 : compared / 200);
    EXPECT_GT(compared, 2000);
}

TEST_P(FittedModels, GiveRowsAsTheyGivePixels) {
    const BentPlate plate = somePlate(8);
    const DistortionMap map = fitted(GetParam().model, plate, 8);
    std::vector<Vector2> row(60);
    map.model().plateFromRow({100.5, 200.25}, 1.5, row);
    for (std::size_t i = 0; i < row.size(); ++i) {
        const Vector2 one = map.model().plateFromPixel({100.5 + 1.5 * static_cast<double>(i), 200.25});
        EXPECT_LT((row[i] - one).norm(), 1e-11);  // rounding
    }
}

TEST_P(FittedModels, LieAtAnyAngle) {
    // Half a turn more or less is another plate frame only; 45 degrees is the most a plate can be turned.
    for (const double turn : {-0.78, -0.3, 0.5, 0.78}) {
        BentPlate plate = somePlate(9);
        plate.plate_turn_rad = turn;
        const DistortionMap map = fitted(GetParam().model, plate, 9);
        double sum = 0;
        int count = 0;
        for (const Vector2& pixel : fieldPixels(plate)) {
            if (!map.covers(pixel)) continue;
            sum += (map.model().plateFromPixel(pixel) - plate.plateFromPixel(pixel)).norm();
            ++count;
        }
        EXPECT_LT(sum / count, 1.5 * GetParam().clean_mm);  // one plate, not the mean of twenty
        // The picture is not turned with the plate.
        const Matrix2 jacobian = map.detectorJacobian(map.middle());
        EXPECT_NEAR(jacobian(0, 1), jacobian(1, 0), 1e-12);
        EXPECT_GT(jacobian.trace(), 0);
    }
}

TEST_P(FittedModels, ComeBackFromTheirFileToTheLastBit) {
    const test::ScratchFolder folder;
    const BentPlate plate = somePlate(10);
    const DistortionMap map =
        fitted(GetParam().model, plate, 10)
            .measured(CArmPosition{.orbital_rad = 0.3, .angulation_rad = -0.2}, "2026-03-01T09:30:00Z");
    ASSERT_OK(writeDistortionMap(folder / "map.json", map));
    const auto copy = readDistortionMap(folder / "map.json");
    ASSERT_OK(copy);
    for (const Vector2& pixel : fieldPixels(plate)) {
        EXPECT_LT((copy->detectorFromPixel(pixel) - map.detectorFromPixel(pixel)).norm(), 1e-12);
        const Matrix2 covariance = map.model().covariance(pixel);
        if (!covariance.allFinite()) continue;
        EXPECT_LT((copy->model().covariance(pixel) - covariance).norm(), 1e-12);
    }
    EXPECT_EQ(copy->model().name(), GetParam().model);
    EXPECT_EQ(copy->pixelMm(), map.pixelMm());
    EXPECT_NEAR(copy->parts().position->orbital_rad, 0.3, 1e-15);  // degrees in the file
    EXPECT_NEAR(copy->parts().position->angulation_rad, -0.2, 1e-15);
    EXPECT_EQ(copy->parts().measured_at, "2026-03-01T09:30:00Z");
    EXPECT_EQ(copy->quality().rms_mm, map.quality().rms_mm);
    EXPECT_EQ(copy->quality().points_used, map.quality().points_used);
}

TEST_P(FittedModels, RefuseTooFewPointsInWords) {
    Random random(11);
    GroovePoints points = groovePoints(somePlate(11), {.field = 0.485}, random);
    points.along_x.resize(15);
    const auto map = fitDistortion(points, withModel(GetParam().model));
    ASSERT_FALSE(map.ok());
    EXPECT_EQ(map.error().code, ErrorCode::noSolution);
    EXPECT_THAT(map.error().message(), testing::HasSubstr("grooves along x: found 15 points on "));
}

INSTANTIATE_TEST_SUITE_P(All, FittedModels,
                         testing::Values(Expected{"polynomial", 0.0125, 0.0145, 0.99},
                                         Expected{"thin-plate-spline", 0.0140, 0.0170, 0.99},
                                         Expected{"bernstein", 0.0270, 0.0360, 0.88}),
                         [](const auto& test) {
                             std::string name = test.param.model;
                             std::erase(name, '-');
                             return name;
                         });

TEST(DistortionModels, EveryFittedOneIsUnderTest) {
    for (const DistortionModelKind& kind : distortionModels()) {
        EXPECT_TRUE(kind.fit == nullptr || kind.name == "polynomial" || kind.name == "bernstein" ||
                    kind.name == "thin-plate-spline")
            << kind.name;
        EXPECT_EQ(findDistortionModel(kind.name), &kind);
    }
    EXPECT_EQ(findDistortionModel("moving-least-squares"), nullptr);
}

}  // namespace
}  // namespace fluorocut
