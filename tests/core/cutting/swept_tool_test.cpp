#include "core/cutting/swept_tool.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace fluorocut {
namespace {

Vector3 randomVector(Random& random, double size) {
    return Vector3(random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size));
}

// Convex problem in (s, t): alternating exact line searches on a fine start reach the least distance.
double searched(const ToolSegment& segment, double length, const Vector3& point) {
    double best = 1e9;
    constexpr int kSteps = 400;
    for (int i = 0; i <= kSteps; ++i) {
        const Vector3 foot = segment.from_mm + (segment.to_mm - segment.from_mm) * i / kSteps;
        const double t = std::clamp((point - foot).dot(segment.spindle), 0.0, length);
        best = std::min(best, (point - foot - t * segment.spindle).norm());
    }
    return best;
}

TEST(SweptTool, DistanceIsThatOfASearchOverTheWholeMotion) {
    Random random(1);
    for (int trial = 0; trial < 500; ++trial) {
        ToolSegment segment{randomVector(random, 10), randomVector(random, 10), randomVector(random, 1).normalized()};
        if (trial % 5 == 0) segment.to_mm = segment.from_mm;
        if (trial % 5 == 1) segment.to_mm = segment.from_mm + 7 * segment.spindle;
        const double length = random.uniform(5, 30);
        const Vector3 point = randomVector(random, 25);
        const double exact = distanceToSweep(segment, length, point);
        const double found = searched(segment, length, point);
        EXPECT_LE(exact, found + 1e-9);
        // The search misses the best place by at most half a step of 35 mm / 400.
        EXPECT_NEAR(exact, found, 0.044);
    }
}

TEST(SweptTool, RemovesBallAndShankAboveTheWay) {
    const Cutter cutter{3, 50};
    const ToolSegment segment{{0, 0, 0}, {10, 0, 0}, Vector3::UnitZ()};
    EXPECT_NEAR(distanceToRemoved(cutter, segment, {5, 0, -4}), 1, 1e-12);   // under the ball
    EXPECT_NEAR(distanceToRemoved(cutter, segment, {5, 4, 20}), 1, 1e-12);   // beside the shank
    EXPECT_NEAR(distanceToRemoved(cutter, segment, {15, 0, 20}), 2, 1e-12);  // ahead of it
    EXPECT_NEAR(distanceToRemoved(cutter, segment, {5, 0, 20}), -3, 1e-12);
    EXPECT_NEAR(distanceToRemoved(cutter, segment, {13, 0, -4}), 5 - 3, 1e-12);
}

TEST(SweptTool, CutterNamesWhatIsWrongWithIt) {
    EXPECT_TRUE(Cutter{}.validate());
    EXPECT_EQ((Cutter{-1, 50}.validate().error().where), "cutter.radius_mm");
    EXPECT_EQ((Cutter{3, 1}.validate().error().where), "cutter.length_mm");
    EXPECT_FALSE((Cutter{std::nan(""), 50}.validate()));
}

}  // namespace
}  // namespace fluorocut
