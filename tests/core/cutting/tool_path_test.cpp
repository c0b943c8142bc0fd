#include "core/cutting/tool_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <gtest/gtest.h>

#include "core/base/parallel.h"
#include "tests/core/cutting/cavities.h"

namespace fluorocut {
namespace {

constexpr double kPi = std::numbers::pi;

ToolPath plannedOr(const Volume& field, const ToolPathOptions& options) {
    Result<ToolPath> path = planToolPath(field, 0, options);
    EXPECT_TRUE(path) << path.error().message();
    return path ? *path : ToolPath{};
}

void expectWhole(const ToolPath& path, const ToolPathOptions& options) {
    ASSERT_FALSE(path.moves.empty());
    double time = 0, cutting = 0;
    for (std::size_t i = 0; i < path.moves.size(); ++i) {
        const ToolMove& move = path.moves[i];
        const double length = (move.segment.to_mm - move.segment.from_mm).norm();
        if (i > 0) {
            EXPECT_EQ(move.segment.from_mm, path.moves[i - 1].segment.to_mm);
        }
        EXPECT_NEAR(move.segment.spindle.norm(), 1, 1e-12);
        EXPECT_LE(std::acos(std::min(move.segment.spindle.z(), 1.0)), options.most_tilt_rad + 1e-9);
        EXPECT_GT(move.feed_mm_s, 0);
        if (move.motion == ToolMotion::rapid) {
            EXPECT_GE(move.segment.from_mm.z(), options.clearancePlane(0) - 1e-9);
            EXPECT_GE(move.segment.to_mm.z(), options.clearancePlane(0) - 1e-9);
        }
        if (move.motion == ToolMotion::cut) {
            cutting += length;
            EXPECT_LE(move.feed_mm_s, options.most_feed_mm_s);
        }
        time += length / move.feed_mm_s;
    }
    EXPECT_NEAR(path.cutting_mm, cutting, 1e-9 * cutting);
    EXPECT_NEAR(path.time_s, time, 1e-9 * time);
    EXPECT_NEAR(path.moves.front().segment.from_mm.z(), options.clearancePlane(0), 1e-9);
    EXPECT_NEAR(path.moves.back().segment.to_mm.z(), options.clearancePlane(0), 1e-9);
}

double lowestCut(const ToolPath& path) {
    double z = 1e9;
    for (const ToolMove& move : path.moves)
        z = std::min(z, move.segment.to_mm.z());
    return z;
}

TEST(ToolPath, CylinderTakesTheLayersLoopsAndTimeOfTheClosedForm) {
    const double radius = 8, depth = 30;
    ToolPathOptions options;
    const ToolPath path = plannedOr(fieldOf(cylinderCavity(radius, depth), 0.5), options);
    expectWhole(path, options);
    // Ball centres from z = 3 - 1 down to 3 - 30, 1 mm apart.
    EXPECT_EQ(path.layers, 30);
    EXPECT_NEAR(lowestCut(path), 3 - depth, 1.1 * options.tolerance_mm);  // that, and the last search step

    // A layer: loops of radius 5, 3 and 1; the innermost a slot of 6 mm at 60 / 6 mm/s, the others as fast as may be;
    // two steps of 2 mm between them in the slot's feed; 4 mm back to the middle, 1 mm down.
    const double layer_mm = 2 * kPi * (5 + 3 + 1) + 4;
    const double layer_s = 2 * kPi * 8 / 20 + 2 * kPi / 10 + 4.0 / 10 + 4.0 / 20 + 1.0 / 3;
    // The floor: loops so close that they leave 0.05 mm, c = 1.09 mm, as radii 5, 5 - c, ..., to half a c.
    const double c = 2 * std::sqrt(2 * 3 * 0.05 - 0.05 * 0.05);
    double floor_mm = 0, floor_s = 0;
    for (double r = 5; r > 0; r -= r > 1.1 * c ? c : 0.5 * c) {
        floor_mm += 2 * kPi * r;
        floor_s += 2 * kPi * r / (r > 0.5 * c ? 20 : 10);
        if (r <= 0.5 * c) break;
    }
    floor_mm += 5;
    floor_s += 5.0 / 10 + 5.0 / 20 + 1.0 / 3;
    // Down 7 mm to the first layer (4.8 of it free), and up again from the floor.
    const double ways_s = 35.0 / 20 + 5.0 / 20;
    // Loops are polygons with sagittas up to 0.02 mm inside circles up to 0.02 mm too small: shorter by (0.02 + 4/3
    // 0.02) / r, which is 5 % of a loop of 1 mm, 1.6 % of one of 3 and 0.5 % (the border's own tolerance) of one of 5.
    EXPECT_NEAR(path.cutting_mm, 29 * layer_mm + floor_mm, 0.015 * path.cutting_mm);
    EXPECT_NEAR(path.time_s, 29 * layer_s + floor_s + ways_s, 0.015 * path.time_s);
}

TEST(ToolPath, StaysInsideAndKeepsToTheBorder) {
    const CavityShape shapes[] = {cylinderCavity(8, 30), coneCavity(4.5, 9, 50),
                                  squaredCavity({5, 4.5}, {10, 7}, 60, 4)};
    for (const CavityShape& shape : shapes) {
        ToolPathOptions options;
        const ToolPath path = plannedOr(fieldOf(shape, 0.5), options);
        expectWhole(path, options);
        EXPECT_TRUE(path.warnings.empty());
        const double beyond = mostBeyond(path, shape, options.openPlane(0));
        // A trilinear field lies inside a convex one's border, by up to spacing^2 / (8 r): 0.02 mm at the r = 1.5 mm of
        // a tip's region. The path keeps between none and all of the tolerance inside the field's border.
        EXPECT_LE(beyond, 0);
        EXPECT_GE(beyond, -options.tolerance_mm);
    }
}

TEST(ToolPath, LayersGetThinnerWhereTheWallFlattens) {
    // Steep walls: a step down each. Round the tip the way between layers is what leaves the allowed cusp.
    ToolPathOptions options;
    options.most_cusp_mm = 0.02;
    const double tip = 6;
    const ToolPath path = plannedOr(fieldOf(coneCavity(tip, 9, 40), 0.25), options);
    std::vector<double> heights;
    for (const ToolMove& move : path.moves)
        if (move.motion == ToolMotion::cut) heights.push_back(move.segment.to_mm.z());
    std::sort(heights.begin(), heights.end());
    heights.erase(std::unique(heights.begin(), heights.end()), heights.end());
    const double c = 2 * std::sqrt(2 * 3 * 0.02 - 0.02 * 0.02);
    for (std::size_t i = 1; i < heights.size(); ++i) {
        const double low = heights[i - 1] + 40 - tip, high = std::min(heights[i] + 40 - tip, 0.0);
        EXPECT_LE(high - low, std::min(options.step_down_mm, c) + 1e-9);
        if (high >= 0) continue;
        // Both on the sphere of centres, 3 mm round the tip's: so far apart, measured straight.
        const auto across = [&](double z) { return std::sqrt(std::max((tip - 3) * (tip - 3) - z * z, 0.0)); };
        EXPECT_LE(std::hypot(high - low, across(high) - across(low)), c + 0.05) << low << " to " << high;
    }
}

TEST(ToolPath, CutsFromTheInsideOutAndGoesUpOnlyAtTheEnd) {
    ToolPathOptions options;
    const ToolPath path = plannedOr(fieldOf(squaredCavity({5, 4.5}, {10, 7}, 40, 4), 0.5), options);
    int retracts = 0;
    double z = 1e9;
    for (const ToolMove& move : path.moves) {
        retracts += move.motion == ToolMotion::retract ? 1 : 0;
        if (move.motion == ToolMotion::retract) continue;
        EXPECT_LE(move.segment.to_mm.z(), z + 1e-12) << "up between layers";
        z = move.segment.to_mm.z();
    }
    EXPECT_EQ(retracts, 1);
    EXPECT_EQ(path.moves.back().motion, ToolMotion::retract);
}

TEST(ToolPath, TwoPitsUnderOneOpeningAreCutOneAfterTheOther) {
    // Two round pits of radius 5, 14 mm apart, under a long trough 10 mm deep.
    const CavityShape left = cylinderCavity(5, 30), trough = cylinderCavity(13, 10);
    CavityShape both = trough;
    both.low.z() = -30;
    both.distance = [=](const Vector3& p) {
        const Vector3 shift(7, 0, 0);
        return std::min({trough.distance(p), left.distance(p + shift), left.distance(p - shift)});
    };
    ToolPathOptions options;
    const ToolPath path = plannedOr(fieldOf(both, 0.5), options);
    expectWhole(path, options);
    EXPECT_LE(mostBeyond(path, both, options.openPlane(0)), 0.02);
    int changes = 0, rapids = 0;
    double side = 0;
    for (const ToolMove& move : path.moves) {
        rapids += move.motion == ToolMotion::rapid ? 1 : 0;
        if (move.motion != ToolMotion::cut || move.segment.to_mm.z() > -12) continue;
        const double now = move.segment.to_mm.x() < 0 ? -1 : 1;
        changes += side != 0 && now != side ? 1 : 0;
        side = now;
    }
    EXPECT_EQ(changes, 1);
    EXPECT_EQ(rapids, 1);
}

TEST(ToolPath, AnIslandStays) {
    // A ring-shaped pit round a post of radius 4.
    const CavityShape ring = ringCavity(4, 16, 12);
    ToolPathOptions options;
    const ToolPath path = plannedOr(fieldOf(ring, 0.5), options);
    expectWhole(path, options);
    EXPECT_LE(mostBeyond(path, ring, options.openPlane(0)), 0.02);
    EXPECT_NEAR(lowestCut(path), 3 - 12, 1.1 * options.tolerance_mm);
}

TEST(ToolPath, TiltReachesWhatConstantOrientationCannot) {
    const CavityShape bowed = bowedCavity(5, 70, 500);
    const Volume field = fieldOf(bowed, 0.5);
    ToolPathOptions options;
    const ToolPath straight = plannedOr(field, options);
    options.most_tilt_rad = 0.15;
    const ToolPath tilted = plannedOr(field, options);
    expectWhole(tilted, options);
    ASSERT_EQ(straight.warnings.size(), 1u);
    EXPECT_NE(straight.warnings[0].find("the shank would leave the cavity"), std::string::npos);
    // Straight down, a way of radius 2 ends where the arc has gone 4 mm aside: 500 (1 - cos a) = 4, 500 sin a = 63.1;
    // layers are 1 mm apart.
    EXPECT_NEAR(lowestCut(straight), -63.1, 1);
    EXPECT_NEAR(lowestCut(tilted), 3 - 70, 1);
    EXPECT_LT(tilted.unreached, 0.35 * straight.unreached);
    // The shank is sampled at half a millimetre on a bend of 500 mm: far below the field's own 0.02.
    EXPECT_LE(mostBeyond(straight, bowed, options.openPlane(0)), 0.02);
    EXPECT_LE(mostBeyond(tilted, bowed, options.openPlane(0)), 0.02);
}

TEST(ToolPath, TheMeshGivesBackTheEdgesThatTheFieldRoundsOff) {
    // Edges as round as the cutter: the ball's places have sharp corners. Their diagonal is cut off by the field.
    const CavityShape shape = squaredCavity({5, 4.5}, {6, 5.5}, 20, 3);
    const Volume field = fieldOf(shape, 0.5);
    const TriangleMesh mesh = meshOf(shape, 40, 240);
    ToolPathOptions options;
    const ToolPath rounded = plannedOr(field, options);
    const Result<ToolPath> sharp = planToolPath(field, mesh, 0, options);
    ASSERT_TRUE(sharp) << sharp.error().message();
    expectWhole(*sharp, options);
    // Walls lean 1 in 20: at the height z of the ball's centre the corner is 3 / cos(lean) inside the walls' own.
    const auto farthest = [](const ToolPath& path) {
        double shortest = 0;
        for (const ToolMove& move : path.moves) {
            const Vector3& p = move.segment.to_mm;
            if (p.z() > -12 || p.z() < -14) continue;
            const Vector2 corner = Vector2(6, 5.5) + Vector2::Constant(p.z() / 20 - 3 * std::hypot(1, 0.05));
            const double left = (corner - p.head<2>().cwiseAbs()).norm();
            shortest = shortest == 0 ? left : std::min(shortest, left);
        }
        return shortest;
    };
    EXPECT_GT(farthest(rounded), 0.05);
    // The mesh's chords of 0.15 mm, 0.001 mm deep, and the path's own tolerance on two walls, and its chords'.
    EXPECT_LE(farthest(*sharp), 2.5 * options.tolerance_mm);
    EXPECT_LE(mostBeyond(*sharp, shape, options.openPlane(0)), 0);
    EXPECT_EQ(planToolPath(field, TriangleMesh{}, 0).error().where, "planned cavity");
}

TEST(ToolPath, TiltIsNotUsedWhereItIsNotNeeded) {
    const Volume field = fieldOf(coneCavity(4.5, 7, 30), 0.5);
    ToolPathOptions options;
    const ToolPath straight = plannedOr(field, options);
    options.most_tilt_rad = 0.15;
    const ToolPath tilted = plannedOr(field, options);
    ASSERT_EQ(straight.moves.size(), tilted.moves.size());
    for (std::size_t i = 0; i < straight.moves.size(); ++i) {
        EXPECT_EQ(straight.moves[i].segment.to_mm, tilted.moves[i].segment.to_mm);
        EXPECT_EQ(tilted.moves[i].segment.spindle, Vector3::UnitZ());
    }
}

TEST(ToolPath, IsTheSameOnAnyNumberOfThreads) {
    const Volume field = fieldOf(bowedCavity(5, 50, 300), 0.5);
    ToolPathOptions options;
    options.most_tilt_rad = 0.15;
    const ToolPath all = plannedOr(field, options);
    const ThreadLimit limit(1);
    const ToolPath one = plannedOr(field, options);
    ASSERT_EQ(all.moves.size(), one.moves.size());
    for (std::size_t i = 0; i < all.moves.size(); ++i)
        EXPECT_EQ(all.moves[i].segment.to_mm, one.moves[i].segment.to_mm);
}

TEST(ToolPath, SaysWhatIsWrong) {
    const Volume field = fieldOf(cylinderCavity(8, 30), 0.5);
    ToolPathOptions options;
    options.step_over_mm = 5.5;
    EXPECT_EQ(planToolPath(field, 0, options).error().where, "step_over_mm");
    options = {};
    options.tolerance_mm = std::nan("");
    EXPECT_EQ(planToolPath(field, 0, options).error().where, "tolerance_mm");
    options = {};
    options.cutter.length_mm = 20;
    EXPECT_EQ(planToolPath(field, 0, options).error().where, "cutter.length_mm");
    options = {};
    options.cutter.radius_mm = 9;
    EXPECT_EQ(planToolPath(field, 0, options).error().code, ErrorCode::noSolution);
    EXPECT_EQ(planToolPath(field, 100).error().where, "cavity field");
    EXPECT_EQ(planToolPath(field, std::nan("")).error().where, "cavity field");
    EXPECT_EQ(planToolPath(Volume(), 0).error().where, "cavity field");
    Volume holed = field;
    holed(3, 3, 3) = std::nanf("");
    EXPECT_EQ(planToolPath(holed, 0).error().found, "values that are no number");
}

}  // namespace
}  // namespace fluorocut
