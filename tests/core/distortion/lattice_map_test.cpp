#include "core/distortion/lattice_map.h"

#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace fluorocut::grooves {
namespace {

constexpr double kPitchPx = 20;
const Vector2 kMiddle(255.5, 255.5);

// A cubic bend of 6 px at 256 px.
Vector2 truth(const Vector2& pixel) {
    const Vector2 from = pixel - kMiddle;
    return from * (1 - 6.0 / 256 * from.squaredNorm() / (256.0 * 256.0)) / kPitchPx;
}

std::vector<LatticeSample> samples(int coordinate, double right_end, double noise, Random& random) {
    std::vector<LatticeSample> result;
    for (double v = 20; v < 500; v += 25)
        for (double u = 20; u < right_end; u += 25)
            result.push_back({Vector2(u, v), truth({u, v})[coordinate] + noise * random.normal(), 1 / (noise * noise)});
    return result;
}

LatticeMap mapThrough(double right_end, double noise, Random& random, int outliers = 0) {
    LatticeMap map(kMiddle, 256, Eigen::Matrix2d::Identity() / (1.05 * kPitchPx));
    for (int c = 0; c < 2; ++c) {
        auto all = samples(c, right_end, noise, random);
        for (int n = 0; n < outliers; ++n)
            all[static_cast<std::size_t>(n * 7)].value += 1;
        EXPECT_TRUE(map.fit(c, all, 0.05));
    }
    return map;
}

TEST(LatticeMap, FollowsABendInSpiteOfOutliers) {
    Random random(1);
    const LatticeMap map = mapThrough(500, 0.01, random, 40);
    for (const Vector2& pixel : {Vector2(30, 40), Vector2(256, 256), Vector2(480, 100)})
        EXPECT_LT((map.at(pixel) - truth(pixel)).norm(), 0.015);  // three of the 0.005 that 350 points leave
}

TEST(LatticeMap, KnowsWhatItDoesNotKnow) {
    Random random(2);
    const LatticeMap map = mapThrough(260, 0.02, random);  // half the field
    EXPECT_LT(map.sigma(0, {140, 256}), 0.02);
    EXPECT_GT(map.sigma(0, {490, 256}), 0.1);
    for (double u = 30; u < 500; u += 10)  // where it is wrong it says so
        EXPECT_LT(std::abs(map.at({u, 200})[0] - truth({u, 200})[0]), 4 * map.sigma(0, {u, 200}) + 0.002) << u;
}

TEST(LatticeMap, ItsDerivativesAndItsInverseAreItsOwn) {
    Random random(3);
    const LatticeMap map = mapThrough(500, 0.02, random);
    const Vector2 pixel(400, 130);
    const LatticePlace place = map.place(pixel);
    EXPECT_LT((place.lattice - map.at(pixel)).norm(), 1e-12);
    const double h = 0.5;
    for (int k = 0; k < 2; ++k) {
        const Vector2 step = h * Vector2::Unit(k);
        const Vector2 slope = (map.at(pixel + step) - map.at(pixel - step)) / (2 * h);
        EXPECT_LT((place.jacobian.col(k) - slope).norm(), 1e-7);  // third derivatives times h^2 / 6
        const Eigen::Matrix2d before = map.place(pixel - step).jacobian, after = map.place(pixel + step).jacobian;
        for (std::size_t c = 0; c < 2; ++c) {
            const Eigen::RowVector2d change = (after - before).row(static_cast<Eigen::Index>(c)) / (2 * h);
            EXPECT_LT((place.hessian[c].row(k) - change).norm(), 1e-9);
        }
    }
    const auto back = map.pixelOf(place.lattice, pixel + Vector2(9, -12));
    ASSERT_TRUE(back.has_value());
    EXPECT_LT((*back - pixel).norm(), 1e-6);
    EXPECT_FALSE(map.pixelOf(place.lattice + Vector2(10, 0), pixel).has_value());  // too far to be sure
}

TEST(LatticeMap, MagnifiedItNamesTheSamePlace) {
    Random random(4);
    const LatticeMap map = mapThrough(500, 0.02, random), fine = map.magnified(2);
    // Pixel u of the coarse image is the middle of pixels 2 u and 2 u + 1.
    EXPECT_LT((fine.at({2 * 100 + 0.5, 2 * 300 + 0.5}) - map.at({100, 300})).norm(), 1e-12);
    EXPECT_LT((map.transformed(0.5, {0.25, 0}).at({7, 9}) - (0.5 * map.at({7, 9}) + Vector2(0.25, 0))).norm(), 1e-12);
}

}  // namespace
}  // namespace fluorocut::grooves
