#include "core/image/voxelize.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/stopwatch.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using ::testing::HasSubstr;

Vector3 randomVector(Random& random, double scale) {
    return scale * Vector3(random.normal(), random.normal(), random.normal());
}

// A CT-like grid about the origin of its frame: oblique, anisotropic, left-handed when asked.
VolumeGrid obliqueGrid(Random& random, bool left_handed) {
    VolumeGrid grid;
    grid.size = {260, 200, 240};
    grid.spacing_mm = {random.uniform(0.7, 1.0), random.uniform(0.7, 1.0), random.uniform(0.7, 1.0)};
    grid.direction = Rigid3::fromRotationVector(randomVector(random, 1)).rotationMatrix();
    if (left_handed) grid.direction.col(2) *= -1;
    grid.origin_mm.setZero();
    grid.origin_mm = -grid.center();
    return grid;
}

// Sum of fractions and their centroid; voxel centres stand for voxels.
struct Moments {
    double volume = 0;
    Vector3 centroid = Vector3::Zero();
};

Moments moments(const VoxelCoverage& coverage) {
    Moments result;
    const Volume& fraction = coverage.fraction;
    for (int k = 0; k < fraction.size(2); ++k) {
        for (int j = 0; j < fraction.size(1); ++j) {
            for (int i = 0; i < fraction.size(0); ++i) {
                result.volume += fraction(i, j, k);
                result.centroid += fraction(i, j, k) * fraction.grid().pointFromIndex(Vector3(i, j, k));
            }
        }
    }
    result.centroid /= result.volume;
    result.volume *= fraction.grid().spacing_mm.prod();
    return result;
}

// Boxes along the grid: every fraction by hand.
TEST(Voxelize, FractionsOfAnAlignedBoxAreExact) {
    VolumeGrid grid;
    grid.size = {6, 5, 4};
    grid.spacing_mm = {1, 2, 0.5};
    grid.origin_mm = {10, 20, 30};
    // x from voxel edge 9.5 + 1 to 9.5 + 3.25; y from 19 + 1 to 19 + 4; z exactly voxels 1 and 2
    const Vector3 low(10.5, 20, 30.25), high(12.75, 23, 31.25);
    const auto coverage = voxelize(makeBox(high - low), Rigid3::fromTranslation(0.5 * (low + high)), grid);
    ASSERT_OK(coverage);
    EXPECT_EQ(coverage->offset, (std::array<int, 3>{1, 0, 1}));
    EXPECT_EQ(coverage->fraction.grid().size, (std::array<int, 3>{3, 2, 2}));
    EXPECT_EQ(coverage->fraction.grid().origin_mm, grid.pointFromIndex({1, 0, 1}));
    const double x[] = {1, 1, 0.25}, y[] = {0.5, 1};
    for (int k = 0; k < 2; ++k) {
        for (int j = 0; j < 2; ++j) {
            for (int i = 0; i < 3; ++i)
                EXPECT_NEAR(coverage->fraction(i, j, k), x[i] * y[j], 1e-7);  // float32
        }
    }
    EXPECT_NEAR(coverage->volume_mm3, 2.25 * 3 * 1, 1e-12);
}

// The gate is 0.2 %; the method is exact, so the polyhedron's own volume must come out to rounding: 1e-6 leaves room
// for float32 fractions. The centroid of the voxels differs from the solid's by the first moments inside partial
// voxels, which average out: 0.01 mm is a hundredth of a voxel.
TEST(Voxelize, VolumesAndCentroidsAreThoseOfTheMeshAtAnyPoseSpacingAndHandedness) {
    Random random(3);
    const TriangleMesh meshes[] = {makeStem(), makeSphere(12, 5), makeCylinder(9, 60, 90), makeBox({20, 15, 40}),
                                   makeFrustum(12, 0, 50, 64)};
    for (int trial = 0; trial < 4; ++trial) {
        for (const TriangleMesh& mesh : meshes) {
            const VolumeGrid grid = obliqueGrid(random, trial % 2 == 1);
            const MeshProperties truth = meshProperties(mesh);
            const Rigid3 turn = Rigid3::fromRotationVector(randomVector(random, 2));
            const Rigid3 pose =
                Rigid3::fromTranslation(randomVector(random, 3)) * turn * Rigid3::fromTranslation(-truth.centroid);
            const auto coverage = voxelize(mesh, pose, grid);
            ASSERT_OK(coverage);
            const Moments found = moments(*coverage);
            EXPECT_NEAR(found.volume / truth.volume_mm3, 1, 1e-6);
            EXPECT_NEAR(coverage->volume_mm3 / truth.volume_mm3, 1, 1e-9);
            EXPECT_LT((found.centroid - pose * truth.centroid).norm(), 0.01);
            const auto [least, most] = std::ranges::minmax(coverage->fraction.voxels());
            EXPECT_EQ(least, 0);
            EXPECT_EQ(most, 1);
        }
    }
}

// An independent answer for single voxels: a sphere's fraction of a voxel by counting 40^3 points. Their error is that
// of a surface among cells 1/40 of a voxel wide: below 0.01. The icosphere itself lies 1 - 1e-4 of its radius inside.
TEST(Voxelize, PartialVoxelsOfASphereAreThoseOfPointCounting) {
    VolumeGrid grid;
    grid.size = {9, 9, 9};
    grid.spacing_mm = {1.1, 0.9, 1.3};
    const Vector3 center(4.3, 3.7, 5.1);
    const double radius = 2.6;
    const auto coverage = voxelize(makeSphere(radius, 6), Rigid3::fromTranslation(center), grid);
    ASSERT_OK(coverage);
    const Volume& fraction = coverage->fraction;
    for (int k = 0; k < fraction.size(2); ++k) {
        for (int j = 0; j < fraction.size(1); ++j) {
            for (int i = 0; i < fraction.size(0); ++i) {
                int inside = 0;
                for (int s = 0; s < 40 * 40 * 40; ++s) {
                    const Vector3 sub(s % 40, s / 40 % 40, s / 1600);
                    const Vector3 index = Vector3(i, j, k) + ((sub.array() + 0.5) / 40 - 0.5).matrix();
                    inside += (fraction.grid().pointFromIndex(index) - center).norm() < radius;
                }
                EXPECT_NEAR(fraction(i, j, k), inside / 64000.0, 0.01);
            }
        }
    }
}

// A box that hangs out of the grid on every side in turn: what is inside the grid is counted, the rest is not.
TEST(Voxelize, WhatLiesOutsideTheGridIsCutOff) {
    VolumeGrid grid;
    grid.size = {20, 16, 12};  // 20 x 16 x 12 mm from -0.5 mm
    for (int axis = 0; axis < 3; ++axis) {
        for (const bool above : {false, true}) {
            Vector3 center(9.5, 7.5, 5.5);
            const double edge = above ? grid.size[static_cast<std::size_t>(axis)] - 0.5 : -0.5;
            center[axis] = edge;
            const auto coverage = voxelize(makeBox({5, 5, 5}), Rigid3::fromTranslation(center), grid);
            ASSERT_OK(coverage);
            EXPECT_NEAR(coverage->volume_mm3, 62.5, 1e-9);
        }
    }
    const auto all = voxelize(makeBox({100, 100, 100}), exp((Vector6() << 9, 7, 5, 0.3, 0.2, 0.1).finished()), grid);
    ASSERT_OK(all);
    EXPECT_EQ(all->fraction.grid(), grid);
    EXPECT_TRUE(std::ranges::all_of(all->fraction.voxels(), [](float f) { return f == 1; }));
    for (const Vector3& away : {Vector3(500, 0, 0), Vector3(0, -500, 0), Vector3(0, 0, 1e12)}) {
        const auto nothing = voxelize(makeBox({5, 5, 5}), Rigid3::fromTranslation(away), grid);
        ASSERT_OK(nothing);
        EXPECT_TRUE(nothing->fraction.empty());
        EXPECT_EQ(nothing->volume_mm3, 0);
    }
}

TEST(Voxelize, AVoidInsideIsEmptyAndOverlapsCountOnceInside) {
    VolumeGrid grid;
    grid.size = {40, 40, 40};
    const Rigid3 middle = Rigid3::fromTranslation({20, 20, 20});
    const TriangleMesh shell = merged(makeSphere(15, 4), flipped(makeSphere(10, 4)));
    const auto hollow = voxelize(shell, middle, grid);
    ASSERT_OK(hollow);
    EXPECT_NEAR(hollow->volume_mm3 / meshProperties(shell).volume_mm3, 1, 1e-9);
    const int centre = 20 - hollow->offset[0];
    EXPECT_EQ(hollow->fraction(centre, centre, centre), 0);
    const auto twice = voxelize(merged(makeBox({9, 9, 9}), makeBox({9, 9, 9})), middle, grid);
    ASSERT_OK(twice);
    EXPECT_NEAR(twice->volume_mm3, 729, 1e-9);
}

TEST(Voxelize, RefusesAnOpenOrTurnedMesh) {
    VolumeGrid grid;
    grid.size = {10, 10, 10};
    TriangleMesh open = makeBox({3, 3, 3});
    open.triangles.pop_back();
    EXPECT_THAT(voxelize(open, {}, grid, "cavity.stl").error().message(), HasSubstr("cavity.stl: found a hole"));
    EXPECT_THAT(voxelize(flipped(makeBox({3, 3, 3})), {}, grid).error().message(), HasSubstr("inside out"));
}

// 200,000 triangles take well under a second (measured 0.02 s on two cores); 5 s forgives a loaded machine and
// sanitizers.
TEST(Voxelize, IsFastAndTheSameOnAnyNumberOfThreads) {
    Random random(11);
    StemShape shape;
    shape.sections = 400;
    shape.segments = 250;
    const TriangleMesh stem = makeStem(shape);
    EXPECT_GT(stem.triangles.size(), 199000u);
    const VolumeGrid grid = obliqueGrid(random, false);
    const Rigid3 pose = Rigid3::fromRotationVector({0.4, 0.3, 1}) * Rigid3::fromTranslation({0, 0, 59});
    const Stopwatch stopwatch;
    const auto many = voxelize(stem, pose, grid);
    const double seconds = stopwatch.ms() / 1000;
    ASSERT_OK(many);
    RecordProperty("seconds", std::to_string(seconds));
    std::printf("voxelize: %zu triangles in %.3f s\n", stem.triangles.size(), seconds);
    EXPECT_LT(seconds, 5);
    const ThreadLimit one(1);
    const auto single = voxelize(stem, pose, grid);
    ASSERT_OK(single);
    EXPECT_EQ(single->fraction.voxels(), many->fraction.voxels());
    EXPECT_EQ(single->volume_mm3, many->volume_mm3);
}

}  // namespace
}  // namespace fluorocut
