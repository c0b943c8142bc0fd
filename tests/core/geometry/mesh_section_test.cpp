#include "core/geometry/mesh_section.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

HalfEdgeMesh halfEdges(const TriangleMesh& mesh) {
    Result<HalfEdgeMesh> result = HalfEdgeMesh::build(mesh);
    EXPECT_OK(result);
    return std::move(*result);
}

// Signed about the plane's normal.
double area(const std::vector<Vector3>& polygon, const Vector3& normal) {
    Vector3 twice = Vector3::Zero();
    for (std::size_t i = 0; i < polygon.size(); ++i)
        twice += polygon[i].cross(polygon[(i + 1) % polygon.size()]);
    return 0.5 * twice.dot(normal.normalized());
}

TEST(MeshSection, OfABoxAlongADiagonalIsARegularHexagon) {
    const HalfEdgeMesh cube = halfEdges(makeBox({10, 10, 10}));
    const Plane plane{Vector3::Zero(), {1, 1, 1}};
    const auto polygons = sectionPolygons(cube, plane);
    ASSERT_EQ(polygons.size(), 1U);
    // Side a / sqrt(2), area 3 sqrt(3) / 2 side^2.
    EXPECT_NEAR(area(polygons[0], plane.normal), 1.5 * std::sqrt(3) * 50, 1e-9);
    for (const Vector3& p : polygons[0])
        EXPECT_NEAR(plane.above(p), 0, 1e-12);
    const auto half = partBelow(cube, plane);
    ASSERT_OK(half);
    const MeshProperties properties = meshProperties(*half);
    EXPECT_TRUE(properties.closedManifold());
    EXPECT_NEAR(properties.volume_mm3, 500, 1e-9);
    EXPECT_LT(plane.above(properties.centroid), 0);
}

// A section of a sphere of radius r at height h: the circle of radius sqrt(r^2 - h^2); the cap's volume
// pi d^2 (3 r - d) / 3 with d = r + h. The inscribed polyhedron lacks volume everywhere
// alike, so a cap lacks no more than the whole does.
TEST(MeshSection, OfASphereAreCirclesAndCaps) {
    const double r = 20;
    const HalfEdgeMesh sphere = halfEdges(makeSphere(r, 5));
    const double lacking = 4.0 / 3 * std::numbers::pi * r * r * r - meshProperties(sphere.mesh()).volume_mm3;
    EXPECT_LT(lacking, 50);
    Random random(4);
    for (const double h : {-15.0, -3.0, 0.0, 8.0, 17.0}) {
        const Vector3 normal = Vector3(random.normal(), random.normal(), random.normal()).normalized();
        const Plane plane{h * normal, 3 * normal};
        const auto polygons = sectionPolygons(sphere, plane);
        ASSERT_EQ(polygons.size(), 1U);
        const double circle = std::numbers::pi * (r * r - h * h);
        EXPECT_NEAR(area(polygons[0], normal), circle, 2e-3 * r * r);
        const auto cap = partBelow(sphere, plane);
        ASSERT_OK(cap);
        const MeshProperties properties = meshProperties(*cap);
        EXPECT_TRUE(properties.closedManifold());
        const double d = r + h;
        EXPECT_NEAR(properties.volume_mm3, std::numbers::pi * d * d * (3 * r - d) / 3, lacking);
    }
}

TEST(MeshSection, HolesRunClockwiseAndStayOpenInTheCap) {
    std::vector<TubePoint> line;
    for (int i = 0; i < 60; ++i) {
        const double a = 2 * std::numbers::pi * i / 60;
        line.push_back({{30 * std::cos(a), 30 * std::sin(a), 0}, {-std::sin(a), std::cos(a), 0}, {0, 0, 1}});
    }
    const HalfEdgeMesh torus = halfEdges(makeTube(line, 8, 32, true));
    // Across the torus' axis: a ring with a hole. By Pappus half of the torus lies below.
    const Plane across{{0, 0, 0.1}, {0, 0, 1}};
    const auto ring = sectionPolygons(torus, across);
    ASSERT_EQ(ring.size(), 2U);
    const double first = area(ring[0], across.normal), second = area(ring[1], across.normal);
    EXPECT_LT(first * second, 0);
    EXPECT_NEAR(first + second, std::numbers::pi * (38 * 38 - 22 * 22), 0.01 * 38 * 38);
    // Along its axis: two discs.
    const Plane along{{0, 1, 0}, {0, 1, 0}};
    const auto discs = sectionPolygons(torus, along);
    ASSERT_EQ(discs.size(), 2U);
    EXPECT_GT(area(discs[0], along.normal), 0);
    EXPECT_GT(area(discs[1], along.normal), 0);
    const double whole = meshProperties(torus.mesh()).volume_mm3;
    for (const Plane& plane : {across, along}) {
        const auto below = partBelow(torus, plane);
        const auto above = partBelow(torus, {plane.point, -plane.normal});
        ASSERT_OK(below);
        ASSERT_OK(above);
        EXPECT_TRUE(meshProperties(*below).closedManifold());
        EXPECT_TRUE(meshProperties(*above).closedManifold());
        EXPECT_NEAR(meshProperties(*below).volume_mm3 + meshProperties(*above).volume_mm3, whole, 1e-8 * whole);
    }
}

// Planes through vertices, along edges and in faces: still closed, nothing lost.
TEST(MeshSection, APlaneThroughVerticesAndFacesCutsAsOneJustBesideIt) {
    const TriangleMesh cylinder = makeCylinder(10, 40, 24);
    const HalfEdgeMesh mesh = halfEdges(cylinder);
    const double whole = meshProperties(cylinder).volume_mm3;
    for (const Plane& plane : {Plane{{0, 0, 0}, {1, 0, 0}}, Plane{{0, 0, 0}, {0, 1, 0}}, Plane{{0, 0, 20}, {1, 0, 0.5}},
                               Plane{{10, 0, 20}, {1, 0, 1}}}) {
        const auto below = partBelow(mesh, plane), above = partBelow(mesh, {plane.point, -plane.normal});
        ASSERT_OK(below);
        EXPECT_TRUE(meshProperties(*below).watertight());
        const double rest = above.ok() ? meshProperties(*above).volume_mm3 : 0;
        EXPECT_NEAR(meshProperties(*below).volume_mm3 + rest, whole, 1e-9 * whole);
    }
    // In the plane of its top everything lies below; in that of its bottom nothing.
    const auto all = partBelow(mesh, {{0, 0, 20}, {0, 0, 1}});
    ASSERT_OK(all);
    EXPECT_NEAR(meshProperties(*all).volume_mm3, whole, 1e-9 * whole);
    EXPECT_TRUE(meshProperties(*all).closedManifold());
    EXPECT_FALSE(partBelow(mesh, {{0, 0, -20}, {0, 0, 1}}).ok());
    EXPECT_TRUE(sectionPolygons(mesh, {{0, 0, 25}, {0, 0, 1}}).empty());
}

}  // namespace
}  // namespace fluorocut
