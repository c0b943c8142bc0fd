#include "core/image/isosurface.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/mesh_properties.h"
#include "tests/core/image/sampled_volume.h"

namespace fluorocut {
namespace {

using test::sampled;
constexpr double kPi = std::numbers::pi;

VolumeGrid cube(double half_mm, double spacing_mm) {
    VolumeGrid grid;
    grid.size.fill(static_cast<int>(2 * half_mm / spacing_mm) + 1);
    grid.spacing_mm.setConstant(spacing_mm);
    grid.origin_mm.setConstant(-half_mm);
    return grid;
}

// The triangles round every vertex are one fan: what counting the triangles at edges does not see.
bool everyVertexHasOneFan(const TriangleMesh& mesh) {
    std::vector<std::map<std::int32_t, std::int32_t>> next(mesh.vertices.size());
    for (const Triangle& t : mesh.triangles) {
        for (std::size_t c = 0; c < 3; ++c)
            next[static_cast<std::size_t>(t[c])][t[(c + 1) % 3]] = t[(c + 2) % 3];
    }
    return std::ranges::all_of(next, [](const auto& fan) {
        std::size_t steps = 0;
        std::int32_t at = fan.begin()->first;
        do {
            const auto found = fan.find(at);
            if (found == fan.end()) return false;
            at = found->second;
            ++steps;
        } while (at != fan.begin()->first && steps <= fan.size());
        return steps == fan.size();
    });
}

void expectClean(const TriangleMesh& mesh) {
    const MeshProperties properties = meshProperties(mesh);
    EXPECT_TRUE(properties.closedManifold());
    EXPECT_EQ(properties.degenerate_triangles, 0u);
    EXPECT_TRUE(everyVertexHasOneFan(mesh));
}

// The interpolant of a convex function lies above it, so the surface lies inside the sphere, by no more than
// 3 h^2 / (8 r): by a relative volume of 9 h^2 / (8 r^2) at most.
TEST(Isosurface, OfASphereHasItsVolumeAndLiesInsideByTheSagitta) {
    for (const double h : {1.0, 0.5}) {
        const double r = 10;
        const TriangleMesh mesh = isosurface(sampled(cube(12, h), [&](const Vector3& p) { return p.norm() - r; }), 0);
        expectClean(mesh);
        const MeshProperties properties = meshProperties(mesh);
        EXPECT_EQ(properties.components, 1u);
        const double missing = 1 - properties.volume_mm3 / (4 * kPi / 3 * r * r * r);
        EXPECT_GT(missing, 0);
        EXPECT_LT(missing, 9 * h * h / (8 * r * r));
        for (const Vector3& v : mesh.vertices) {
            ASSERT_LT(v.norm(), r + 1.01e-3 * std::sqrt(3) * h);  // vertices kept off the ends of edges; float
            ASSERT_GT(v.norm(), r - 3 * h * h / (8 * r) - 1e-3 * h);
        }
    }
}

// Turned and anisotropic; an ellipsoid's implicit function is no distance, its level is exact.
TEST(Isosurface, OfAnEllipsoidIsTurnedOutwardInGridsOfEitherHand) {
    for (const bool left_handed : {false, true}) {
        VolumeGrid grid;
        grid.size = {60, 70, 80};
        grid.spacing_mm = {0.6, 0.5, 0.7};
        grid.direction = Rigid3::fromRotationVector({0.3, -0.5, 0.8}).rotationMatrix();
        if (left_handed) grid.direction.col(1) *= -1;
        grid.origin_mm = -grid.center();
        const Vector3 radii(9, 12, 6);
        const TriangleMesh mesh =
            isosurface(sampled(grid, [&](const Vector3& p) { return p.cwiseQuotient(radii).squaredNorm(); }), 1);
        expectClean(mesh);
        // 3 h^2/8 r with h = 0.7 and the least radius of curvature 6^2/12 = 3, once more for the three axes: 0.06 mm of
        // 9 mm; the mean over the surface is a fifth of that.
        EXPECT_NEAR(meshProperties(mesh).volume_mm3 / (4 * kPi / 3 * radii.prod()), 1, 0.01);
    }
}

// Any values make a clean surface: noise has every case of every cell, whole numbers have the level at grid points.
TEST(Isosurface, IsClosedAndManifoldForNoiseAndForValuesAtTheLevel) {
    Random random(1);
    for (const bool whole : {false, true}) {
        VolumeGrid grid;
        grid.size = {23, 19, 17};
        const Volume volume = sampled(
            grid, [&](const Vector3&) { return whole ? static_cast<double>(random.below(5)) : random.uniform(0, 4); });
        for (const double level : {1.0, 2.0, 3.0})
            expectClean(isosurface(volume, level));
    }
    VolumeGrid grid;
    grid.size = {5, 4, 3};
    Volume odd(grid, 1.0F);
    odd(2, 2, 1) = -std::numeric_limits<float>::infinity();
    odd(3, 2, 1) = std::numeric_limits<float>::quiet_NaN();
    odd(1, 1, 1) = std::numeric_limits<float>::infinity();
    expectClean(isosurface(odd, 0));
}

// Closed by the grid's border: a hemisphere whose flat face is the border itself, with a sharp rim in its plane.
TEST(Isosurface, IsClosedByFlatFacesWhereItLeavesTheGrid) {
    const double r = 10, h = 0.5;
    for (int axis = 0; axis < 3; ++axis) {
        for (const bool above : {false, true}) {
            VolumeGrid grid = cube(12, h);
            grid.size[static_cast<std::size_t>(axis)] = 25;
            if (!above) grid.origin_mm[axis] = 0;
            const Volume volume = sampled(grid, [&](const Vector3& p) { return p.norm() - r; });
            const TriangleMesh mesh = isosurface(volume, 0);
            expectClean(mesh);
            const MeshProperties properties = meshProperties(mesh);
            EXPECT_NEAR(properties.volume_mm3 / (2 * kPi / 3 * r * r * r), 1, 9 * h * h / (8 * r * r));
            EXPECT_EQ(above ? properties.max_corner[axis] : properties.min_corner[axis], 0);
            // the rim is as wide as the sphere
            EXPECT_NEAR(properties.max_corner[(axis + 1) % 3], r, 1e-3);
            // open, the same surface without the flat face
            const MeshProperties open = meshProperties(isosurface(volume, 0, GridBorder::open));
            EXPECT_GT(open.boundary_edges, 0u);
            EXPECT_EQ(open.non_manifold_edges + open.flipped_edges, 0u);
            EXPECT_NEAR(properties.area_mm2 - open.area_mm2, kPi * r * r, 0.01 * kPi * r * r);
        }
    }
}

TEST(Isosurface, OfAWholeGridIsItsBoxAndOfNothingIsEmpty) {
    VolumeGrid grid;
    grid.size = {4, 5, 6};
    grid.spacing_mm = {1, 2, 3};
    const TriangleMesh box = isosurface(Volume(grid, -1.0F), 0);
    expectClean(box);
    EXPECT_NEAR(meshProperties(box).volume_mm3, 3 * 8 * 15, 1e-9);
    EXPECT_TRUE(isosurface(Volume(grid, -1.0F), 0, GridBorder::open).triangles.empty());
    EXPECT_TRUE(isosurface(Volume(grid, 1.0F), 0).triangles.empty());
    EXPECT_TRUE(isosurface(Volume(), 0).triangles.empty());
    grid.size = {4, 5, 1};  // no cell
    EXPECT_TRUE(isosurface(Volume(grid, -1.0F), 0).triangles.empty());
}

}  // namespace
}  // namespace fluorocut
