#include "core/cutting/envelope_check.h"

#include <cmath>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "core/geometry/mesh_properties.h"
#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "tests/core/cutting/cavities.h"

namespace fluorocut {
namespace {

constexpr double kOpen = 9;  // top 0, ball 3, clearance 5, and 1

TriangleMesh opened(const TriangleMesh& cavity) {
    const Result<TriangleMesh> envelope = openedUpward(cavity, kOpen);
    EXPECT_TRUE(envelope) << envelope.error().message();
    return envelope ? *envelope : TriangleMesh{};
}

// Down the axis of a cylinder to z, `aside`, and out again.
ToolPath straightDown(double x, double z, const Vector3& spindle = Vector3::UnitZ()) {
    ToolPath path;
    const Vector3 low(x, 0, z), high = low + (8 - z) / spindle.z() * spindle;
    path.moves.push_back({{high, low, spindle}, ToolMotion::entry, 3});
    path.moves.push_back({{low, high, spindle}, ToolMotion::retract, 20});
    return path;
}

struct Both {
    Result<EnvelopeVerdict> mesh, voxels;
};
Both check(const ToolPath& path, const TriangleMesh& envelope, const EnvelopeOptions& options = {}) {
    return {checkByMesh(path, envelope, options), checkByVoxels(path, envelope, options)};
}

TEST(EnvelopeCheck, TheWayInIsTheTopsSectionStraightUp) {
    const double volume = meshProperties(makeBox({20, 10, 30})).volume_mm3;
    TriangleMesh box = makeBox({20, 10, 30});
    for (Vector3& v : box.vertices)
        v.z() -= 15;
    const TriangleMesh envelope = opened(box);
    const MeshProperties properties = meshProperties(envelope);
    EXPECT_TRUE(requireSolid(properties, "envelope"));
    EXPECT_NEAR(properties.volume_mm3, volume + 20 * 10 * kOpen, 1e-9 * volume);
    const TriangleMesh ring = opened(ringMesh(4, 16, 12, 64));
    EXPECT_TRUE(requireSolid(ring, "ring"));
    EXPECT_NEAR(meshProperties(ring).volume_mm3, meshProperties(ringMesh(4, 16, 12, 64)).volume_mm3 * (12 + kOpen) / 12,
                1e-6);
    EXPECT_EQ(openedUpward(box, -1).error().where, "cavity");
    EXPECT_EQ(openedUpward(makeSphere(5, 2), 20).error().found, "no flat face at its top");
}

TEST(EnvelopeCheck, BothFindHowFarABallGoesIntoWallAndFloor) {
    // A fine cylinder of radius 6, floor at -20: into the wall by x + 3 - 6, into the floor by -20 - (z - 3).
    TriangleMesh cylinder = makeCylinder(6, 20, 512);
    for (Vector3& v : cylinder.vertices)
        v.z() -= 10;
    const TriangleMesh envelope = opened(cylinder);
    for (const double beyond : {-0.4, -0.1, 0.02, 0.3, 1.0}) {
        for (const bool wall : {true, false}) {
            const ToolPath path = wall ? straightDown(3 + beyond, -15) : straightDown(0.3, -17 - beyond);
            const Both both = check(path, envelope);
            ASSERT_TRUE(both.mesh && both.voxels);
            // A polygon of 512 sides is 0.0001 mm inside its circle.
            EXPECT_NEAR(both.mesh->worst_mm, beyond, 2e-4) << wall;
            // The transform is exact near the radius: e (L - R) / R with |e| <= 0.22 mm.
            EXPECT_NEAR(both.voxels->worst_mm, beyond, 0.02 + 0.05 * std::abs(beyond)) << wall;
            EXPECT_EQ(both.mesh->passed(), beyond < 0.05);
            EXPECT_EQ(both.voxels->passed(), beyond < 0.05);
        }
    }
}

TEST(EnvelopeCheck, VoxelsPlaceASurfaceWithinATenthOfAVoxel) {
    // A ball goes down a round pit to its bottom, half a ball of radius 5, and touches it on all sides: nothing beyond.
    const TriangleMesh mesh = opened(meshOf(cylinderCavity(5, 25, 5), 40, 160));
    const auto touch = [](int k) {
        const double up = -(k + 0.5) / 300, around = 2.399963 * k, across = std::sqrt(1 - up * up);
        return Vector3(2 * across * std::cos(around), 2 * across * std::sin(around), -20 + 2 * up);
    };
    for (const double voxel : {0.25, 0.4}) {
        EnvelopeOptions options;
        options.voxel_mm = voxel;
        ToolPath all;
        Vector3 here(0, 0, 8);
        for (int k = 0; k < 300; ++k) {
            for (const Vector3& to : {touch(k), Vector3(0, 0, -20)}) {
                all.moves.push_back({{here, to, Vector3::UnitZ()}, ToolMotion::entry, 1});
                here = to;
            }
        }
        const Result<EnvelopeVerdict> verdict = checkByVoxels(all, mesh, options);
        ASSERT_TRUE(verdict);
        EXPECT_LE(verdict->worst_mm, 0.1 * voxel);
        // One by one, none is overlooked by more.
        for (int k = 0; k < 300; k += 30) {
            all.moves.assign(
                1, {{Vector3(touch(k).x(), touch(k).y(), 8), touch(k), Vector3::UnitZ()}, ToolMotion::entry, 1});
            EXPECT_GE(checkByVoxels(all, mesh, options)->worst_mm, -0.1 * voxel) << k;
        }
    }
}

TEST(EnvelopeCheck, ABallThatJustFitsIsNotRefused) {
    // Its centre's places are a line: the ridge of the distance, in all places relative to the voxels.
    for (int k = 0; k < 8; ++k) {
        const CavityShape pit = moved(cylinderCavity(3.02, 20 + 0.03 * k, 3.02), {0.031 * k, -0.017 * k});
        ToolPath path = straightDown(0, -16.98 - 0.03 * k);
        for (ToolMove& move : path.moves)
            for (Vector3* p : {&move.segment.from_mm, &move.segment.to_mm})
                *p += Vector3(0.031 * k, -0.017 * k, 0);
        const Both both = check(path, opened(meshOf(pit, 30, 120)));
        ASSERT_TRUE(both.mesh && both.voxels);
        EXPECT_TRUE(both.mesh->passed());
        EXPECT_LE(both.voxels->worst_mm, 0.1 * 0.25);
    }
}

TEST(EnvelopeCheck, TheShankIsHeldAgainstTheWallsToo) {
    // The ball is well inside; the spindle leans so that the shank, 15 mm higher, has gone 15 tan a aside.
    TriangleMesh cylinder = makeCylinder(6, 20, 512);
    for (Vector3& v : cylinder.vertices)
        v.z() -= 10;
    const TriangleMesh envelope = opened(cylinder);
    for (const double angle : {0.05, 0.2}) {
        const Vector3 spindle(std::sin(angle), 0, std::cos(angle));
        const ToolPath path = straightDown(0, -15, spindle);
        // At the open end, z = 9, the axis is 24 tan a aside, and the wall is met across the axis.
        const double beyond = 24 * std::tan(angle) + 3 / std::cos(angle) - 6;
        const Both both = check(path, envelope);
        ASSERT_TRUE(both.mesh && both.voxels);
        EXPECT_EQ(both.mesh->passed(), beyond < 0);
        EXPECT_EQ(both.voxels->passed(), beyond < 0);
    }
}

TEST(EnvelopeCheck, OutsideIsNotInsideHoweverFarTheWallsAre) {
    const TriangleMesh envelope = opened(meshOf(cylinderCavity(6, 20, 4), 16, 48));
    const Both both = check(straightDown(60, -15), envelope);
    ASSERT_TRUE(both.mesh && both.voxels);
    EXPECT_FALSE(both.mesh->passed());
    EXPECT_FALSE(both.voxels->passed());
    EXPECT_GT(both.mesh->worst_mm, 3);
}

TEST(EnvelopeCheck, GoodPathsPass) {
    struct Case {
        std::string name;
        CavityShape shape;
        double tilt;
        double radius;
    };
    const Case cases[] = {{"cylinder", cylinderCavity(8, 30, 4), 0, 3},
                          {"narrow cylinder", cylinderCavity(3.5, 25, 3.5), 0, 3},
                          {"cone", coneCavity(4.5, 9, 50), 0, 3},
                          {"cone off the axis", moved(coneCavity(4.5, 7, 30), {9, 3}), 0, 3},
                          {"squared", squaredCavity({5, 4.5}, {10, 7}, 50, 4), 0, 3},
                          {"small cutter", coneCavity(3, 6, 25), 0, 1.5},
                          {"bowed", bowedCavity(5, 60, 400), 0.15, 3}};
    for (const Case& c : cases) {
        ToolPathOptions options;
        options.most_tilt_rad = c.tilt;
        options.cutter.radius_mm = c.radius;
        options.step_over_mm = 0.6 * c.radius;
        const Result<ToolPath> path = planToolPath(fieldOf(c.shape, 0.5), 0, options);
        ASSERT_TRUE(path) << c.name;
        const Result<TriangleMesh> envelope = openedUpward(meshOf(c.shape, 30, 100), options.openPlane(0));
        ASSERT_TRUE(envelope);
        const Result<CheckedToolPath> checked = checkToolPath(*path, options.cutter, *envelope);
        ASSERT_TRUE(checked) << c.name << ": " << checked.error().message();
        // The mesh is inscribed by up to 0.01 mm, of a field that is 0.02 mm inside: all within the tolerance.
        EXPECT_LE(checked->worstByMesh(), 0.02) << c.name;
        EXPECT_NEAR(checked->worstByVoxels(), checked->worstByMesh(), 0.1 * 0.25) << c.name;
        EXPECT_EQ(checked->path().moves.size(), path->moves.size());
    }
}

TEST(EnvelopeCheck, SaysWhatIsWrong) {
    const TriangleMesh cavity = meshOf(cylinderCavity(6, 20, 4), 16, 48), envelope = opened(cavity);
    const ToolPath good = straightDown(0, -15);
    ASSERT_TRUE(checkToolPath(good, good.cutter, envelope));
    EXPECT_EQ(checkToolPath(good, {2.5, 150}, envelope).error().where, "tool path, cutter");
    EXPECT_EQ(checkToolPath(good, {3, std::nan("")}, envelope).error().where, "tool path, cutter");
    EXPECT_EQ(checkToolPath({}, {}, envelope).error().found, "no moves");
    EXPECT_FALSE(checkByMesh({}, envelope));
    EXPECT_FALSE(checkByVoxels({}, envelope));
    EXPECT_EQ(checkToolPath(good, good.cutter, makeSphere(30, 3)).error().where, "envelope");
    EXPECT_FALSE(checkByMesh(good, {}));
    EXPECT_FALSE(checkByVoxels(good, {}));
    EXPECT_FALSE(checkByMesh(good, flipped(envelope)));
    EnvelopeOptions options;
    options.voxel_mm = 0.001;
    EXPECT_EQ(checkByVoxels(good, envelope, options).error().where, "voxel_mm");
    TriangleMesh huge = envelope;
    for (Vector3& v : huge.vertices)
        v *= 1000;
    EXPECT_EQ(checkByVoxels(good, huge).error().where, "envelope");

    const Result<CheckedToolPath> deep = checkToolPath(straightDown(0, -19), {}, envelope);
    ASSERT_FALSE(deep);
    EXPECT_EQ(deep.error().code, ErrorCode::noSolution);
    EXPECT_NE(deep.error().where.find("move 1 of 2 (entry"), std::string::npos) << deep.error().where;
    EXPECT_NE(deep.error().found.find("by both checks"), std::string::npos) << deep.error().found;
}

TEST(EnvelopeCheck, AVerdictThatWasNeverReachedIsNoPass) {
    EXPECT_FALSE(EnvelopeVerdict{}.passed());
    EnvelopeVerdict verdict;
    verdict.inside = {true};
    EXPECT_FALSE(verdict.passed());  // the worst is no number
    verdict.worst_mm = -1;
    EXPECT_TRUE(verdict.passed());
    verdict.inside.push_back(false);
    EXPECT_FALSE(verdict.passed());
}

}  // namespace
}  // namespace fluorocut
