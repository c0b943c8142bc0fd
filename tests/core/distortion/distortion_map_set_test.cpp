#include "core/distortion/distortion_map_set.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include <gmock/gmock.h>

#include "core/simulation/intensifier_distortion.h"
#include "tests/core/distortion/synthetic_grooves.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::GrooveNoise;
using test::groovePoints;
using testing::HasSubstr;

// A plate before the simulated image intensifier.
struct IntensifierPlate {
    int size = 512;
    double pixel_mm = 0.32;
    std::shared_ptr<const IntensifierDistortion> bending;

    explicit IntensifierPlate(const CArmPosition& position)
        : bending(
              IntensifierDistortion::create(intensifierAt(IntensifierOptions{}, nominalImagerFromRoom(position, 650)))
                  .value()) {}

    Vector2 middle() const { return Vector2::Constant(0.5 * (size - 1)); }
    Vector2 pixelFromPlate(const Vector2& plate_mm) const { return middle() + bending->distorted(plate_mm) / pixel_mm; }
    Eigen::Matrix2d jacobian(const Vector2& pixel) const {
        Eigen::Matrix2d j;
        for (int axis = 0; axis < 2; ++axis) {
            const Vector2 step = 1e-3 * Vector2::Unit(axis);
            j.col(axis) = (bending->undistorted((pixel + step - middle()) * pixel_mm) -
                           bending->undistorted((pixel - step - middle()) * pixel_mm)) /
                          2e-3;
        }
        return j;
    }
};

CArmPosition pose(double orbital_deg, double angulation_deg) {
    return {.orbital_rad = radiansFromDegrees(orbital_deg), .angulation_rad = radiansFromDegrees(angulation_deg)};
}

const std::string kThen = "2026-03-01T09:30:00Z", kNow = "2026-03-05T08:00:00Z";

DistortionMap mapOf(const CArmPosition& position, double noise_mm, const std::string& when = kThen) {
    Random noise = Random(5).fork(static_cast<std::uint64_t>(1e4 * (position.orbital_rad + 10)) * 1000000 +
                                  static_cast<std::uint64_t>(1e4 * (position.angulation_rad + 10)));
    return fitDistortion(groovePoints(IntensifierPlate(position), GrooveNoise{.sigma_mm = noise_mm}, noise), {})
        .value()
        .measured(position, when);
}

DistortionMapSet setOf(const std::vector<CArmPosition>& poses, double noise_mm) {
    std::vector<DistortionMap> maps;
    for (const CArmPosition& one : poses)
        maps.push_back(mapOf(one, noise_mm));
    return DistortionMapSet::create(std::move(maps)).value();
}

std::vector<CArmPosition> posesEvery(double degrees) {
    std::vector<CArmPosition> poses;
    for (double orbital = -90; orbital <= 90; orbital += degrees) {
        for (double angulation = -30; angulation <= 30; angulation += degrees)
            poses.push_back(pose(orbital, angulation));
    }
    return poses;
}

struct Comparison {
    double rms_mm = 0, inside_95 = 0;
};

Comparison compare(const DistortionMap& map, const DistortionMap& truth) {
    Comparison result;
    int count = 0;
    for (int y = 8; y < 512; y += 16) {
        for (int x = 8; x < 512; x += 16) {
            const Vector2 pixel(x, y);
            if ((pixel - map.middle()).norm() > 0.46 * 512) continue;
            const Vector2 error = map.detectorFromPixel(pixel) - truth.detectorFromPixel(pixel);
            result.rms_mm += error.squaredNorm();
            result.inside_95 += error.dot(map.covariance(pixel).inverse() * error) < 5.991;
            ++count;
        }
    }
    result.rms_mm = std::sqrt(result.rms_mm / count);
    result.inside_95 /= count;
    return result;
}

struct Interpolation {
    double mean_rms_mm = 0, nearest_rms_mm = 0, inside_95 = 0;
};

Interpolation interpolate(double degrees, double noise_mm) {
    const DistortionMapSet set = setOf(posesEvery(degrees), noise_mm);
    Interpolation mean;
    Random random(3);
    constexpr int kTrials = 10;
    for (int i = 0; i < kTrials; ++i) {
        const CArmPosition at = pose(random.uniform(-90, 90), random.uniform(-30, 30));
        const auto map = set.mapAt(at, kNow, {.max_angle_rad = radiansFromDegrees(45)});
        if (!map) {
            ADD_FAILURE() << map.error().message();
            continue;
        }
        const auto nearer = [&](const DistortionMap& a, const DistortionMap& b) {
            return angleBetween(*a.parts().position, at) < angleBetween(*b.parts().position, at);
        };
        const DistortionMap truth = mapOf(at, 0);
        const Comparison comparison = compare(*map, truth);
        mean.mean_rms_mm += comparison.rms_mm / kTrials;
        mean.inside_95 += comparison.inside_95 / kTrials;
        mean.nearest_rms_mm +=
            compare(*std::min_element(set.maps().begin(), set.maps().end(), nearer), truth).rms_mm / kTrials;
    }
    return mean;
}

TEST(DistortionMapSet, InterpolatesWhatTurnsWithFieldAndGravitySlow) {
    const Interpolation exact = interpolate(30, 0);
    EXPECT_LT(exact.mean_rms_mm, 0.003);  // 0.0014
    EXPECT_GT(exact.nearest_rms_mm, 10 * exact.mean_rms_mm);
    // The points' noise averages out over maps (order 5 for all: 0.012 mm); what the orders chosen for single maps
    // leave out does not (0.016 mm).
    const Interpolation noisy = interpolate(30, 0.034);
    EXPECT_LT(noisy.mean_rms_mm, 0.018);
    EXPECT_GT(noisy.inside_95, 0.9);
}

TEST(DistortionMapSet, KnowsThatFewPosesInterpolateWorse) {
    const Interpolation coarse = interpolate(60, 0.034);
    EXPECT_GT(coarse.mean_rms_mm, 0.015);
    // One smooth error field per trial, its variance learnt from eight maps: the share itself is uncertain to 0.1.
    EXPECT_GT(coarse.inside_95, 0.75);
}

TEST(DistortionMapSet, IsExactAtMeasuredPosesAndSmoothNearby) {
    const DistortionMapSet set = setOf({pose(0, 0), pose(30, 0), pose(60, 0), pose(30, 20)}, 0.034);
    const DistortionMap measured = set.maps()[1];
    const auto same = set.mapAt(pose(30, 0), kNow);
    const auto near = set.mapAt(pose(30.001, 0), kNow);
    ASSERT_OK(same);
    ASSERT_OK(near);
    EXPECT_EQ(compare(*same, measured).rms_mm, 0);
    EXPECT_LT(compare(*near, measured).rms_mm, 1e-4);  // the table's own error, and a thousandth of a degree
    EXPECT_EQ(near->model().name(), "table");
    // The noise of the measured map stays.
    const double here = measured.covariance({300, 200}).trace(), there = near->covariance({300, 200}).trace();
    EXPECT_NEAR(there / here, 1, 0.05);
    const auto between = set.mapAt(pose(15, 0), kNow);
    ASSERT_OK(between);
    EXPECT_NEAR(between->parts().position->orbital_rad, radiansFromDegrees(15), 1e-15);
    EXPECT_EQ(between->parts().measured_at, kThen);
    EXPECT_LT(between->detectorFromPixel(between->middle()).norm(), 1e-7);  // between nodes
}

TEST(DistortionMapSet, RefusesInWordsWhatItCannotAnswerFor) {
    const DistortionMapSet set = setOf({pose(0, 0), pose(30, 0)}, 0.034);
    const auto message = [&](const CArmPosition& at, const std::string& now) {
        const auto map = set.mapAt(at, now);
        return map ? std::string("no error") : map.error().message();
    };
    EXPECT_THAT(message(pose(90, 0), kNow), HasSubstr("the nearest 60.0 degrees away, at orbital 30.0"));
    EXPECT_THAT(message(pose(10, 0), "2027-03-01T09:30:00Z"), HasSubstr("found one that is 365 days old"));
    EXPECT_THAT(message(pose(10, 0), "2026-02-01T09:30:00Z"), HasSubstr("a time after now"));
    EXPECT_THAT(message(pose(10, 0), "yesterday"), HasSubstr("now: found \"yesterday\""));
    EXPECT_THAT(message(pose(10, 95), kNow), HasSubstr("angulation"));
    EXPECT_EQ(set.mapAt(pose(90, 0), kNow).error().code, ErrorCode::noSolution);
    const auto limits = set.mapAt(pose(0, 0), kNow, {.max_age_days = -1});
    ASSERT_FALSE(limits.ok());
    EXPECT_THAT(limits.error().message(), HasSubstr("max_age_days"));

    const DistortionMapSet one = setOf({pose(0, 0)}, 0.034);
    EXPECT_TRUE(one.mapAt(pose(1, 0), kNow).ok());
    EXPECT_FALSE(one.mapAt(pose(5, 0), kNow).ok());

    const auto empty = DistortionMapSet::create({});
    EXPECT_FALSE(empty.ok());
    const auto nowhere = DistortionMapSet::create({mapOf(pose(0, 0), 0.034).measured({}, kThen)});
    ASSERT_FALSE(nowhere.ok());
    EXPECT_THAT(nowhere.error().message(), HasSubstr("map 1: found no position"));
}

TEST(DistortionMapSet, TakesTheNewestOfOnePose) {
    const DistortionMap old = mapOf(pose(0, 0), 0.034), fresh = mapOf(pose(0.1, 0), 0.034, "2026-03-04T09:30:00Z");
    const auto set = DistortionMapSet::create({old, fresh, mapOf(pose(20, 0), 0.034)});
    ASSERT_OK(set);
    const auto map = set->mapAt(pose(0.1, 0), kNow);
    ASSERT_OK(map);
    EXPECT_EQ(compare(*map, fresh).rms_mm, 0);
}

TEST(DistortionMapSet, GoesThroughItsFilesAndSoDoesAnInterpolatedMap) {
    const test::ScratchFolder folder;
    const DistortionMapSet set = setOf({pose(0, 0), pose(30, 10)}, 0.034);
    std::filesystem::create_directory(folder / "maps");
    const std::vector<std::filesystem::path> files = {folder / "maps/ap.json", folder / "maps/oblique.json"};
    for (std::size_t i = 0; i < 2; ++i)
        ASSERT_OK(writeDistortionMap(files[i], set.maps()[i]));
    ASSERT_OK(writeDistortionMapSet(folder / "set.json", set, files));
    const auto copy = readDistortionMapSet(folder / "set.json");
    ASSERT_OK(copy);
    const auto map = set.mapAt(pose(10, 5), kNow), again = copy->mapAt(pose(10, 5), kNow);
    ASSERT_OK(map);
    ASSERT_OK(again);
    EXPECT_LT(compare(*again, *map).rms_mm, 1e-12);
    ASSERT_OK(writeDistortionMap(folder / "between.json", *map));
    const auto stored = readDistortionMap(folder / "between.json");
    ASSERT_OK(stored);
    EXPECT_LT(compare(*stored, *map).rms_mm, 1e-12);
    EXPECT_LT((stored->covariance({100, 200}) - map->covariance({100, 200})).norm(), 1e-12);

    std::ofstream(folder / "bad.json")
        << R"({"schema": "fluorocut/distortion-set/1", "maps": [{"file": "maps/ap.json", "orbital_deg": 0,)"
        << R"( "angulation_deg": 0, "measured_at": "1 March"}]})";
    const auto bad = readDistortionMapSet(folder / "bad.json");
    ASSERT_FALSE(bad.ok());
    EXPECT_THAT(bad.error().message(), HasSubstr("measured_at: found \"1 March\""));
}

}  // namespace
}  // namespace fluorocut
