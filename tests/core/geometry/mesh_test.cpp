#include <algorithm>
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/geometry/half_edge_mesh.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using ::testing::HasSubstr;
constexpr double kPi = std::numbers::pi;

Rigid3 somewhere() {
    return exp((Vector6() << 120, -340, 560, 0.7, -1.1, 0.4).finished());
}

TriangleMesh soup(const TriangleMesh& mesh) {
    TriangleMesh result;
    for (const Triangle& t : mesh.triangles) {
        const auto n = static_cast<std::int32_t>(result.vertices.size());
        for (const std::int32_t v : t)
            result.vertices.push_back(mesh.vertices[static_cast<std::size_t>(v)]);
        result.triangles.push_back({n, n + 1, n + 2});
    }
    return result;
}

// Closed forms of the polyhedra themselves, at a far and turned pose: 1e-10 leaves room for rounding only.
TEST(MeshProperties, MeasuresPrismsConesAndBoxesExactly) {
    const double polygon = 0.5 * 24 * std::sin(2 * kPi / 24);  // area of the 24-gon in the unit circle
    const double apothem = std::cos(kPi / 24), side = 2 * std::sin(kPi / 24);
    struct Case {
        TriangleMesh mesh;
        double volume, area, centroid_z;
    };
    const Case cases[] = {
        {makeBox({2, 3, 4}), 24, 52, 0},
        {makeCylinder(5, 20, 24), polygon * 25 * 20, 2 * polygon * 25 + 24 * 5 * side * 20, 0},
        // a cone's centroid lies a quarter of its height above its base
        {makeFrustum(5, 0, 20, 24), polygon * 25 * 20 / 3,
         polygon * 25 + 24 * 0.5 * 5 * side * std::hypot(20, 5 * apothem), -5},
        {makeFrustum(4, 2, 9, 24), polygon * 9 * (16 + 8 + 4) / 3,
         polygon * (16 + 4) + 24 * 0.5 * (4 + 2) * side * std::hypot(9, 2 * apothem),
         9.0 / 4 * (16 + 2 * 8 + 3 * 4) / (16 + 8 + 4) - 4.5},
    };
    for (const Case& c : cases) {
        const MeshProperties p = meshProperties(transformed(c.mesh, somewhere()));
        EXPECT_TRUE(p.closedManifold());
        EXPECT_EQ(p.components, 1u);
        EXPECT_EQ(p.degenerate_triangles, 0u);
        EXPECT_NEAR(p.volume_mm3 / c.volume, 1, 1e-10);
        EXPECT_NEAR(p.area_mm2 / c.area, 1, 1e-10);
        EXPECT_LT((p.centroid - somewhere() * Vector3(0, 0, c.centroid_z)).norm(), 1e-10);
        EXPECT_EQ(p.vertices + p.triangles, p.edges + 2);  // Euler
    }
}

// An inscribed polyhedron lacks about the square of its angular step (Taylor): each subdivision takes a quarter of the
// error.
TEST(MeshProperties, SpheresAndEllipsoidsConvergeToTheirVolume) {
    double previous = 0;
    for (int n = 2; n <= 5; ++n) {
        const double missing = 1 - meshProperties(makeEllipsoid({3, 4, 5}, n)).volume_mm3 / (4 * kPi / 3 * 60);
        EXPECT_GT(missing, 0);
        if (n > 2) {
            EXPECT_NEAR(previous / missing, 4, 0.1);
        }
        previous = missing;
    }
    const MeshProperties sphere = meshProperties(makeSphere(10, 4));
    EXPECT_EQ(sphere.triangles, 5120u);
    EXPECT_TRUE(sphere.closedManifold());
    EXPECT_LT(sphere.max_corner.maxCoeff(), 10 + 1e-12);
}

TEST(MeshProperties, TheStemHasItsMeasures) {
    const MeshProperties p = meshProperties(makeStem());
    EXPECT_TRUE(p.closedManifold());
    EXPECT_EQ(p.degenerate_triangles, 0u);
    EXPECT_GT(p.volume_mm3, 0);
    EXPECT_DOUBLE_EQ(p.max_corner.z(), 0);
    EXPECT_DOUBLE_EQ(p.min_corner.z(), -118);
    EXPECT_NEAR(p.max_corner.x() - p.min_corner.x(), 25, 0.01);
    EXPECT_NEAR(p.max_corner.y() - p.min_corner.y(), 15, 0.01);
}

TEST(MeshProperties, FaultsAreCountedAndNamed) {
    const TriangleMesh box = makeBox({1, 1, 1});
    EXPECT_OK(requireSolid(box, "box.stl"));

    TriangleMesh holed = box;
    holed.triangles.pop_back();
    EXPECT_EQ(meshProperties(holed).boundary_edges, 3u);
    EXPECT_THAT(requireSolid(holed, "box.stl").error().message(), HasSubstr("box.stl: found a hole: 3 edges"));

    TriangleMesh turned = box;
    std::swap(turned.triangles[4][0], turned.triangles[4][1]);
    EXPECT_EQ(meshProperties(turned).flipped_edges, 3u);
    EXPECT_THAT(requireSolid(turned, "box.stl").error().message(), HasSubstr("turned opposite ways at 3 edges"));

    EXPECT_THAT(requireSolid(flipped(box), "box.stl").error().message(), HasSubstr("inside out"));
    EXPECT_THAT(requireSolid(TriangleMesh{}, "box.stl").error().message(), HasSubstr("no triangles"));

    TriangleMesh wild = box;
    wild.vertices[3].y() = NAN;
    EXPECT_THAT(requireSolid(wild, "box.stl").error().message(), HasSubstr("1 of 8 vertices"));
    EXPECT_TRUE(std::isnan(meshProperties(wild).volume_mm3));
    wild = box;
    wild.triangles[0][1] = 8;
    EXPECT_THAT(requireSolid(wild, "box.stl").error().message(), HasSubstr("1 triangles with a corner"));

    // The same two triangles back to back enclose nothing.
    TriangleMesh flat = box;
    flat.triangles = {{0, 1, 2}, {0, 2, 1}};
    EXPECT_TRUE(meshProperties(flat).watertight());
    EXPECT_THAT(requireSolid(flat, "box.stl").error().message(), HasSubstr("encloses no volume"));
}

TEST(MeshProperties, PartsThatTouchAlongAnEdgeAreWatertightButNotManifold) {
    TriangleMesh two = merged(makeBox({2, 2, 2}), transformed(makeBox({2, 2, 2}), Rigid3::fromTranslation({2, 2, 0})));
    EXPECT_EQ(meshProperties(two).components, 2u);
    two = weldVertices(two);
    const MeshProperties p = meshProperties(two);
    EXPECT_EQ(p.vertices, 14u);
    EXPECT_EQ(p.components, 1u);
    EXPECT_EQ(p.non_manifold_edges, 1u);
    EXPECT_TRUE(p.watertight());
    EXPECT_FALSE(p.closedManifold());
    EXPECT_NEAR(p.volume_mm3, 16, 1e-12);
    const auto half_edges = HalfEdgeMesh::build(two, "two.stl");
    ASSERT_FALSE(half_edges.ok());
    EXPECT_THAT(half_edges.error().message(), HasSubstr("4 triangles at the edge between vertices"));
}

TEST(WeldVertices, MakesAClosedMeshOfASoup) {
    const TriangleMesh stem = makeStem();
    const TriangleMesh welded = weldVertices(soup(stem));
    EXPECT_EQ(welded.vertices.size(), stem.vertices.size());
    EXPECT_EQ(welded.triangles.size(), stem.triangles.size());
    EXPECT_OK(requireSolid(welded, "stem"));
}

// A soup whose corners are scattered by 1e-4 mm, as text files with few digits make them.
TEST(WeldVertices, ToleranceClosesScatteredCornersAndDropsCollapsedTriangles) {
    TriangleMesh scattered = soup(makeBox({3, 3, 3}));
    for (std::size_t i = 0; i < scattered.vertices.size(); ++i)
        scattered.vertices[i] +=
            1e-4 * Vector3(std::sin(7.0 * double(i)), std::cos(3.0 * double(i)), std::sin(double(i)));
    EXPECT_FALSE(requireSolid(weldVertices(scattered), "box").ok());
    const TriangleMesh welded = weldVertices(scattered, 1e-3);
    EXPECT_EQ(welded.vertices.size(), 8u);
    EXPECT_OK(requireSolid(welded, "box"));
    EXPECT_TRUE(weldVertices(scattered, 10).triangles.empty());
    EXPECT_THROW((void)weldVertices(scattered, NAN), std::logic_error);
}

TEST(HalfEdgeMesh, TwinsEdgesAndRingsFitTogether) {
    const TriangleMesh sphere = makeSphere(10, 3);
    const auto built = HalfEdgeMesh::build(sphere);
    ASSERT_OK(built);
    const HalfEdgeMesh& mesh = *built;
    EXPECT_TRUE(mesh.closed());
    EXPECT_EQ(mesh.edges().size(), sphere.vertices.size() + sphere.triangles.size() - 2);
    for (std::int32_t h = 0; h < static_cast<std::int32_t>(3 * sphere.triangles.size()); ++h) {
        EXPECT_EQ(mesh.next(mesh.next(mesh.next(h))), h);
        EXPECT_EQ(mesh.previous(mesh.next(h)), h);
        EXPECT_EQ(mesh.twin(mesh.twin(h)), h);
        EXPECT_EQ(mesh.origin(mesh.twin(h)), mesh.tip(h));
        const HalfEdgeMesh::Edge& e = mesh.edges()[static_cast<std::size_t>(mesh.edge(h))];
        EXPECT_EQ(mesh.face(h), mesh.origin(h) == e.v0 ? e.f0 : e.f1);
    }
    std::size_t outgoing = 0;
    for (std::int32_t v = 0; v < static_cast<std::int32_t>(sphere.vertices.size()); ++v) {
        const auto ring = mesh.outgoing(v);
        outgoing += ring.size();
        ASSERT_GE(ring.size(), 5u);
        // Counter-clockwise about the outward direction: consecutive neighbours turn left.
        const Vector3& p = sphere.vertices[static_cast<std::size_t>(v)];
        for (std::size_t i = 0; i < ring.size(); ++i) {
            EXPECT_EQ(mesh.origin(ring[i]), v);
            const Vector3 a = sphere.vertices[static_cast<std::size_t>(mesh.tip(ring[i]))] - p;
            const Vector3 b = sphere.vertices[static_cast<std::size_t>(mesh.tip(ring[(i + 1) % ring.size()]))] - p;
            EXPECT_GT(p.dot(a.cross(b)), 0);
        }
    }
    EXPECT_EQ(outgoing, 3 * sphere.triangles.size());
    for (std::size_t f = 0; f < sphere.triangles.size(); ++f) {
        const Vector3& n = mesh.faceNormals()[f];
        EXPECT_NEAR(n.norm(), 1, 1e-12);
        EXPECT_GT(n.dot(sphere.vertices[static_cast<std::size_t>(sphere.triangles[f][0])]), 9);
    }
}

TEST(HalfEdgeMesh, ARimVertexsFanStartsAtTheHole) {
    TriangleMesh cone = makeFrustum(5, 0, 10, 8);
    cone.triangles.resize(8);  // the mantle without its base
    const auto built = HalfEdgeMesh::build(cone);
    ASSERT_OK(built);
    EXPECT_FALSE(built->closed());
    EXPECT_EQ(built->boundaryEdges(), 8u);
    EXPECT_EQ(std::ranges::count_if(built->edges(), [](const auto& e) { return e.f1 < 0; }), 8);
    const auto ring = built->outgoing(0);
    ASSERT_EQ(ring.size(), 2u);
    EXPECT_EQ(built->twin(ring[0]), -1);
    EXPECT_EQ(built->twin(built->previous(ring[1])), -1);
    EXPECT_EQ(built->outgoing(8).size(), 8u);  // the apex
}

TEST(HalfEdgeMesh, RefusesWhatItCannotDescribe) {
    TriangleMesh box = makeBox({1, 1, 1});
    std::swap(box.triangles[4][0], box.triangles[4][1]);
    EXPECT_THAT(HalfEdgeMesh::build(box, "cup.stl").error().message(),
                HasSubstr("cup.stl: found neighbours turned opposite"));
    box.triangles[4] = {0, 0, 1};
    EXPECT_THAT(HalfEdgeMesh::build(box, "cup.stl").error().message(),
                HasSubstr("triangle 4 that uses the vertex 0 twice"));
    box.triangles[4] = {0, 1, -1};
    EXPECT_THAT(HalfEdgeMesh::build(box, "cup.stl").error().message(), HasSubstr("triangle 4 with the corner -1"));
}

// A straight one is a prism whose base has the circle's area, at any number of sides: exact up to rounding.
TEST(MakeTube, AStraightWireHoldsAsMuchAsTheCylinder) {
    const Vector3 axis = Vector3(1, 2, -2).normalized();
    for (const int sides : {3, 12, 48}) {
        const TriangleMesh wire =
            makeTube({{axis, axis, Vector3::UnitX()}, {11 * axis, 3 * axis, Vector3::UnitX()}}, 1.5, sides, false);
        const MeshProperties p = meshProperties(wire);
        EXPECT_TRUE(p.closedManifold());
        EXPECT_EQ(p.components, 1u);
        EXPECT_NEAR(p.volume_mm3, kPi * 1.5 * 1.5 * 10, 1e-9);
        EXPECT_LT((p.centroid - 6 * axis).norm(), 1e-9);
        // Vertices a little outside, middles of the sides a little inside the circle.
        double farthest = 0;
        for (const Vector3& v : wire.vertices)
            farthest = std::max(farthest, (v - v.dot(axis) * axis).norm());
        const double step = 2 * kPi / sides;
        EXPECT_NEAR(farthest, 1.5 * std::sqrt(step / std::sin(step)), 1e-12);
    }
}

std::vector<TubePoint> circle(double radius_mm, int chords) {
    std::vector<TubePoint> line;
    for (int i = 0; i < chords; ++i) {
        const double a = 2 * kPi * i / chords;
        line.push_back(
            {{0, radius_mm * std::cos(a), radius_mm * std::sin(a)}, {0, -std::sin(a), std::cos(a)}, Vector3::UnitX()});
    }
    return line;
}

// Pappus: volume 2 pi^2 R r^2, area 4 pi^2 R r. Facets fall short by the square of their angles: a fourth of it with
// twice the chords.
TEST(MakeTube, AClosedOneIsATorus) {
    const double volume = 2 * kPi * kPi * 14 * 0.25, area = 4 * kPi * kPi * 14 * 0.5;
    double before = 0;
    for (const int fineness : {64, 128, 256}) {
        const MeshProperties p = meshProperties(
            transformed(makeTube(circle(14, fineness), 0.5, 64, true), Rigid3::fromRotationVector({0.3, 1, -2})));
        EXPECT_TRUE(p.closedManifold());
        EXPECT_EQ(p.components, 1u);
        EXPECT_EQ(p.degenerate_triangles, 0u);
        EXPECT_LT(p.centroid.norm(), 1e-9);
        const double error = std::abs(p.volume_mm3 / volume - 1);
        EXPECT_LT(error, 8.0 / (fineness * fineness));
        EXPECT_NEAR(p.area_mm2 / area, 1, 8.0 / (fineness * fineness) + 1e-3);  // 1e-3: the 64-gon's perimeter
        if (before > 0) {
            EXPECT_NEAR(error / before, 0.25, 0.01);
        }
        before = error;
    }
}

TEST(MakeTube, WhatIsNoWireIsABrokenContract) {
    const auto line = circle(14, 8);
    EXPECT_THROW(makeTube(line, 0, 8, true), std::logic_error);
    EXPECT_THROW(makeTube(line, NAN, 8, true), std::logic_error);
    EXPECT_THROW(makeTube(line, 0.5, 2, true), std::logic_error);
    EXPECT_THROW(makeTube({line[0]}, 0.5, 8, false), std::logic_error);
    auto along = line;
    along[3].up = along[3].tangent;
    EXPECT_THROW(makeTube(along, 0.5, 8, true), std::logic_error);
}

TEST(Primitives, ShapesThatAreNoneAreABrokenContract) {
    EXPECT_THROW((void)makeBox({1, 0, 1}), std::logic_error);
    EXPECT_THROW((void)makeSphere(NAN, 2), std::logic_error);
    EXPECT_THROW((void)makeFrustum(0, 0, 1, 8), std::logic_error);
    EXPECT_THROW((void)makeCylinder(1, -1, 8), std::logic_error);
}

}  // namespace
}  // namespace fluorocut
