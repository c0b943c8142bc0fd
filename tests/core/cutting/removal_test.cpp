#include "core/cutting/removal.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/cutting/sweep_tree.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/primitives.h"
#include "tests/core/cutting/cavities.h"

namespace fluorocut {
namespace {

constexpr double kPi = std::numbers::pi;

ToolPath pathOf(const CavityShape& shape, double spacing = 0.5, const ToolPathOptions& options = {}) {
    Result<ToolPath> path = planToolPath(fieldOf(shape, spacing), 0, options);
    EXPECT_TRUE(path) << path.error().message();
    return path ? *path : ToolPath{};
}

ToolPath straightCut(const Cutter& cutter, const std::vector<Vector3>& line) {
    ToolPath path;
    path.cutter = cutter;
    for (std::size_t i = 1; i < line.size(); ++i)
        path.moves.push_back({{line[i - 1], line[i], Vector3::UnitZ()}, ToolMotion::cut, 1});
    return path;
}

TEST(SweepTree, FindsWhatALookAtEverySweepFinds) {
    Random random(1);
    ToolPath path;
    path.cutter = {3, 40};
    Vector3 here(0, 0, 0);
    for (int i = 0; i < 700; ++i) {
        const Vector3 to = here + Vector3(random.normal(), random.normal(), random.normal());
        const Vector3 spindle(0.2 * random.normal(), 0.2 * random.normal(), 1);
        path.moves.push_back({{here, to, spindle.normalized()}, ToolMotion::cut, 1});
        here = to;
    }
    const SweepTree tree(path);
    for (int trial = 0; trial < 500; ++trial) {
        const Vector3 p(random.uniform(-40, 40), random.uniform(-40, 40), random.uniform(-40, 60));
        double least = 1e9;
        for (const ToolMove& move : path.moves)
            least = std::min(least, distanceToSweep(move.segment, 40, p));
        EXPECT_DOUBLE_EQ(tree.nearest(p).distance_mm, least);
        EXPECT_EQ(std::isfinite(tree.nearest(p, 5).distance_mm), least < 5);
        if (least < 5) {
            EXPECT_LE(tree.nearest(p, 9, 5).distance_mm, 5);
        }
    }
}

TEST(Removal, CuspsBetweenTwoPassesAreThoseOfTheFormula) {
    // Passes 2 mm apart over a floor, z = -3 under the balls' centres: ridges of 3 - sqrt(9 - 1) = 0.172 mm between
    // them, and nothing but ridges is left.
    std::vector<Vector3> line;
    for (int i = 0; i <= 10; ++i) {
        line.emplace_back(i % 2 ? 30 : -30, 2 * i, 0);
        line.emplace_back(i % 2 ? -30 : 30, 2 * i, 0);
    }
    ToolPath path = straightCut({3, 50}, line);
    path.most_cusp_mm = 1;
    TriangleMesh floor;
    floor.vertices = {{-20, 0, -3}, {20, 0, -3}, {20, 20, -3}, {-20, 20, -3}};
    floor.triangles = {{0, 2, 1}, {0, 3, 2}};
    const Result<RemovalReport> report = simulateRemoval(path, floor, 0);
    ASSERT_TRUE(report);
    // |p - q| - R over the middle of two passes: sqrt(9 + 1) - 3.
    EXPECT_NEAR(report->most_left_mm, std::sqrt(10.0) - 3, 1e-3);
    EXPECT_NEAR(report->most_beyond_mm, 0, 1e-9);
    // The ridge at s: 3 - sqrt(9 - s^2), s even over 0 to 1: 95 % at s = 0.95; points are 0.2 mm apart.
    EXPECT_NEAR(report->cusp_95_mm, 3 - std::sqrt(9 - 0.95 * 0.95), 2e-3);
    EXPECT_EQ(report->left_mm.size(), 20000u);
    // A distance to a ridge and its height differ in second order: 0.172 against 0.162.
    EXPECT_LE(report->outside_cusps_95_mm, 0.011);

    // A cut 0.4 mm too deep is behind the plan by that much, one too shallow in front of it.
    for (ToolMove& move : path.moves)
        for (Vector3* p : {&move.segment.from_mm, &move.segment.to_mm})
            p->z() -= 0.4;
    EXPECT_NEAR(simulateRemoval(path, floor, 0)->most_beyond_mm, 0.4, 1e-6);
}

TEST(Removal, CornersNoCutterGetsIntoAreNoCusps) {
    // A square floor meets its walls at right angles; a ball of 3 mm leaves (sqrt(2) - 1) 3 = 1.24 mm in the edge.
    const ToolPath path = pathOf(cylinderCavity(8, 20), 0.25);
    const TriangleMesh mesh = meshOf(cylinderCavity(8, 20), 60, 128);
    const Result<RemovalReport> report = simulateRemoval(path, mesh, 0);
    ASSERT_TRUE(report);
    // The trilinear field rounds the edge of the ball's places by up to a quarter of its 0.25 mm; sqrt(2) times the
    // 0.02 mm that the path keeps away.
    EXPECT_NEAR(report->most_left_mm, 3 * (std::sqrt(2.0) - 1), 0.1);
    EXPECT_LE(report->most_beyond_mm, 0);
}

TEST(Removal, WhatStaysIsWithinATenthOfAMillimetreOutsideCusps) {
    struct Case {
        const char* name;
        CavityShape shape;
    };
    for (const Case& c :
         {Case{"cone", coneCavity(4.5, 9, 60)}, Case{"squared", squaredCavity({5, 4.5}, {12.5, 7.5}, 118, 4)},
          Case{"cylinder", cylinderCavity(8, 40, 4)}}) {
        const ToolPath path = pathOf(c.shape);
        const TriangleMesh mesh = meshOf(c.shape, 100, 160);
        ASSERT_TRUE(requireSolid(mesh, c.name));
        const Result<RemovalReport> report = simulateRemoval(path, mesh, 0);
        ASSERT_TRUE(report);
        EXPECT_LE(report->outside_cusps_95_mm, 0.1) << c.name;
        EXPECT_LE(report->cusp_95_mm, 0.05) << c.name;
        // The mesh's own chords: 0.01 mm.
        EXPECT_LE(report->most_beyond_mm, 0.01) << c.name;
    }
}

TEST(Removal, VolumeOfAStraightSlot) {
    // 20 mm along x at depth 5 under the grid's upper face: half a cylinder, half balls at its ends and the walls
    // above.
    const ToolPath path = straightCut({3, 50}, {{-10, 0, 0}, {10, 0, 0}});
    VolumeGrid grid;
    grid.size = {60, 30, 30};
    grid.spacing_mm = Vector3(0.7, 0.7, 0.5);
    const Vector3 middle(0.03, 0.11, 0.7);
    grid.origin_mm = middle - 0.5 * Vector3(59 * 0.7, 29 * 0.7, 29 * 0.5);
    const double up = middle.z() + 7.5;  // the grid's upper face
    const Volume fraction = removedFraction(path, Rigid3(), grid);
    double sum = 0;
    for (const float f : fraction.voxels())
        sum += f;
    const double slot = 20 * 6 + kPi * 9;
    const double expected = slot * up + 20 * kPi * 9 / 2 + 2 * kPi * 27 / 3;
    // Errors of single voxels, 0.01 on the average, cancel: 3000 of them on the surface.
    EXPECT_NEAR(sum * 0.7 * 0.7 * 0.5, expected, 0.002 * expected);
    for (const float f : fraction.voxels()) {
        EXPECT_GE(f, 0);
        EXPECT_LE(f, 1);
    }
}

TEST(Removal, FractionsFollowThePoseOfTheVolume) {
    const ToolPath path = straightCut({3, 50}, {{-4, 0, 0}, {4, 2, -1}, {4, 2, -6}});
    VolumeGrid grid;
    grid.size = {40, 40, 40};
    grid.spacing_mm = Vector3::Constant(0.6);
    grid.origin_mm = Vector3(-12, -12, -12);
    const Rigid3 pose = Rigid3::fromTranslation({3, -2, 1}) * Rigid3::fromRotationVector({0.4, -0.2, 0.9});
    const Volume fraction = removedFraction(path, pose, grid);
    const Rigid3 back = pose.inverse();
    int inside = 0, count = 0;
    double errors = 0;
    for (int k = 0; k < 40; ++k)
        for (int j = 0; j < 40; ++j)
            for (int i = 0; i < 40; ++i) {
                // Counted on 8^3 places of some voxels, each against every sweep.
                if ((i + 7 * j + 13 * k) % 41 != 0) continue;
                int hits = 0;
                for (int n = 0; n < 512; ++n) {
                    const Vector3 part((n % 8 - 3.5) / 8, (n / 8 % 8 - 3.5) / 8, (n / 64 - 3.5) / 8);
                    const Vector3 p = back * grid.pointFromIndex(Vector3(i, j, k) + part);
                    double least = 1e9;
                    for (const ToolMove& move : path.moves)
                        least = std::min(least, distanceToRemoved(path.cutter, move.segment, p));
                    hits += least < 0 ? 1 : 0;
                }
                inside += hits > 0 ? 1 : 0;
                // Counting itself is good to about 0.02 where a face lies along the places.
                EXPECT_NEAR(static_cast<double>(fraction(i, j, k)), hits / 512.0, 0.08);
                if (hits > 0 && hits < 512) {
                    errors += std::abs(static_cast<double>(fraction(i, j, k)) - hits / 512.0);
                    ++count;
                }
            }
    EXPECT_LE(errors / count, 0.015);
    EXPECT_GT(inside, 50);
}

TEST(Removal, SaysWhatIsWrong) {
    const ToolPath path = straightCut({3, 50}, {{0, 0, 0}, {1, 0, 0}});
    EXPECT_EQ(simulateRemoval(ToolPath{}, makeBox({9, 9, 9}), 0).error().where, "tool path");
    EXPECT_EQ(simulateRemoval(path, TriangleMesh{}, 0).error().where, "planned cavity");
    EXPECT_EQ(simulateRemoval(path, makeBox({9, 9, 9}), 0, {0}).error().where, "points");
}

}  // namespace
}  // namespace fluorocut
