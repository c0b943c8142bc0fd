#include "core/distortion/bead_test.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>

#include "core/base/random.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using testing::HasSubstr;

// A lattice of (2 n + 1)^2 points.
std::vector<Vector2> lattice(int n, double spacing_mm, double turn_rad, const Vector2& shift_mm) {
    std::vector<Vector2> points;
    for (int j = -n; j <= n; ++j)
        for (int i = -n; i <= n; ++i)
            points.emplace_back(Eigen::Rotation2Dd(turn_rad) * Vector2(i * spacing_mm, j * spacing_mm) + shift_mm);
    return points;
}

TEST(BeadTest, APerfectLatticeHasNoErrorsHoweverItLies) {
    for (const double turn : {0.0, 0.3, -0.7, 0.78}) {
        const auto test = beadTest(lattice(3, 20, turn, {3, -7}));
        ASSERT_OK(test);
        EXPECT_EQ(test->beads, 49);
        EXPECT_EQ(test->stray, 0);
        EXPECT_EQ(test->all_neighbours.pairs, 2 * 6 * 7);
        EXPECT_EQ(test->all_pairs.pairs, 49 * 48 / 2);
        EXPECT_EQ(test->centre.pairs + test->margin.pairs, test->all_neighbours.pairs);
        EXPECT_LT(test->all_pairs.largest_mm, 1e-12);
        EXPECT_NEAR(test->scale, 1, 1e-12);
        EXPECT_NEAR(std::sin(2 * (test->rotation_rad - turn)), 0, 1e-9);  // modulo 90 degrees
    }
}

TEST(BeadTest, AWrongScaleIsSeenInEveryDistance) {
    auto points = lattice(3, 20, 0.1, {0, 0});
    for (Vector2& point : points)
        point *= 1.003;
    const auto test = beadTest(points);
    ASSERT_OK(test);
    EXPECT_NEAR(test->scale, 1.003, 1e-12);
    EXPECT_NEAR(test->all_neighbours.mean_mm, 0.06, 1e-12);
    EXPECT_NEAR(test->all_neighbours.largest_mm, 0.06, 1e-12);
    EXPECT_NEAR(test->all_pairs.largest_mm, 0.003 * 120 * std::sqrt(2.0), 1e-9);  // the diagonal
}

TEST(BeadTest, CentreAndMarginAreToldApart) {
    // Turned by nothing: columns at -80 ... 80; those beyond 60 mm are squeezed by 0.5 mm.
    std::vector<Vector2> points = lattice(4, 20, 0, {0, 0});
    for (Vector2& point : points)
        if (point.x() > 60.1) point.x() -= 0.5;
    const auto test = beadTest(points);
    ASSERT_OK(test);
    EXPECT_EQ(test->centre.pairs, 2 * 6 * 7);
    EXPECT_LT(test->centre.largest_mm, 1e-12);
    EXPECT_NEAR(test->margin.largest_mm, 0.5, 1e-12);
    // 9 of the 2 * 8 * 9 - 84 = 60 pairs of the margin are short by 0.5 mm.
    EXPECT_EQ(test->margin.pairs, 60);
    EXPECT_NEAR(test->margin.mean_mm, 9 * 0.5 / 60, 1e-12);
}

TEST(BeadTest, HeightOfTheBeadsIsTakenOut) {
    BeadTestOptions options;
    options.bead_height_mm = 4;
    options.source_mm = 1000;
    auto points = lattice(3, 20, 0.2, {5, 5});
    for (Vector2& point : points)
        point *= 1000.0 / 996.0;
    const auto test = beadTest(points, options);
    ASSERT_OK(test);
    EXPECT_LT(test->all_pairs.largest_mm, 1e-9);
    EXPECT_GT(beadTest(points)->all_pairs.largest_mm, 0.5);
}

TEST(BeadTest, MissingAndFalseBeadsDoNoHarm) {
    Random random(5);
    auto points = lattice(3, 20, -0.4, {1, 2});
    points.erase(points.begin() + 24);  // the middle one
    points.erase(points.begin() + 3);
    for (int i = 0; i < 6; ++i)  // clear of the lattice: halfway between its points
        points.emplace_back(Eigen::Rotation2Dd(-0.4) * Vector2(20 * i - 50, 10) + Vector2(1, 2));
    std::shuffle(points.begin(), points.end(), std::mt19937(3));
    const auto test = beadTest(points);
    ASSERT_OK(test);
    EXPECT_EQ(test->beads, 47);
    EXPECT_EQ(test->stray, 6);
    EXPECT_LT(test->all_pairs.largest_mm, 1e-12);
}

TEST(BeadTest, NoiseComesOutAsItWentIn) {
    // The difference of two coordinates with standard deviation s has s sqrt(2); the mean of its absolute value is
    // s sqrt(2) sqrt(2 / pi).
    Random random(11);
    const double s = 0.05;
    double sum = 0;
    for (int trial = 0; trial < 50; ++trial) {
        auto points = lattice(3, 20, 0.2, {0, 0});
        for (Vector2& point : points)
            point += Vector2(random.normal(), random.normal()) * s;
        const auto test = beadTest(points);
        ASSERT_OK(test);
        sum += test->all_neighbours.mean_mm / 50;
    }
    EXPECT_NEAR(sum, s * 2 / std::sqrt(std::numbers::pi),
                0.03 * s * 2 / std::sqrt(std::numbers::pi));  // 4200 distances: 1.5 % expected
}

TEST(BeadTest, RefusesWhatIsNoLatticeOfThatSpacing) {
    const auto message = [](const std::vector<Vector2>& points, const BeadTestOptions& options = {}) {
        const auto test = beadTest(points, options);
        return test ? std::string("no error") : test.error().message();
    };
    EXPECT_THAT(message({}), HasSubstr("found 0 of 0 beads in a square lattice"));
    EXPECT_THAT(message(lattice(3, 27, 0, {0, 0})), HasSubstr("20 mm apart"));
    std::vector<Vector2> row;
    for (int i = 0; i < 9; ++i)
        row.emplace_back(20 * i, 0);
    EXPECT_THAT(message(row), HasSubstr("two rows and two columns"));
    BeadTestOptions wrong;
    wrong.spacing_mm = -20;
    EXPECT_THAT(message(lattice(3, 20, 0, {0, 0}), wrong), HasSubstr("spacing_mm: found -20"));
}

TEST(BeadTest, JudgedByThePapersFigures) {
    BeadTest test;
    EXPECT_FALSE(accepted(judge(test)));  // never run
    test.centre = {10, 0.11, 0.1, 0.2};
    EXPECT_TRUE(accepted(judge(test)));
    test.margin = {10, 0.26, 0.1, 0.2};
    EXPECT_FALSE(accepted(judge(test)));
}

}  // namespace
}  // namespace fluorocut
