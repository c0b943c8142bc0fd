#include "core/geometry/mesh_distance.h"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using ::testing::HasSubstr;

Vector3 uniformPoint(Random& random, double half_mm) {
    return {random.uniform(-half_mm, half_mm), random.uniform(-half_mm, half_mm), random.uniform(-half_mm, half_mm)};
}

MeshDistance built(TriangleMesh mesh) {
    Result<MeshDistance> distance = MeshDistance::build(std::move(mesh));
    EXPECT_OK(distance);
    return std::move(distance).value();
}

double boxDistance(const Vector3& half, const Vector3& p) {
    const Vector3 beyond = p.cwiseAbs() - half;
    return beyond.cwiseMax(0).norm() + std::min(beyond.maxCoeff(), 0.0);
}

// A program of its own for the distance to a triangle: the plane's point when it lies inside by barycentric
// coordinates, otherwise the nearest of three edges.
double slowDistance(const TriangleMesh& mesh, const Vector3& p) {
    double best = std::numeric_limits<double>::infinity();
    for (const Triangle& t : mesh.triangles) {
        Matrix3 corner;
        for (int i = 0; i < 3; ++i)
            corner.col(i) = mesh.vertices[static_cast<std::size_t>(t[static_cast<std::size_t>(i)])];
        const Vector3 across = (corner.col(1) - corner.col(0)).cross(corner.col(2) - corner.col(0));
        const Vector3 normal = across.normalized();
        bool inside = across.norm() > 1e-9;
        for (int i = 0; i < 3; ++i) {
            const Vector3 a = corner.col(i), edge = corner.col((i + 1) % 3) - a;
            inside = inside && normal.cross(edge).dot(p - a) >= 0;
            const double s = std::clamp(edge.dot(p - a) / edge.squaredNorm(), 0.0, 1.0);
            best = std::min(best, (p - a - s * edge).norm());
        }
        if (inside) best = std::min(best, std::abs(normal.dot(p - corner.col(0))));
    }
    return best;
}

// Rounding only: 1e-12 of 30 mm.
TEST(MeshDistance, OfABoxIsTheClosedFormInsideOutsideAndOnItsEdges) {
    const Vector3 size(10, 20, 30);
    const MeshDistance box = built(makeBox(size));
    Random random(1);
    for (int trial = 0; trial < 20000; ++trial) {
        const Vector3 p = uniformPoint(random, 25);
        ASSERT_NEAR(box.signedDistance(p), boxDistance(0.5 * size, p), 1e-11);
    }
    // straight in front of corners, edges and the faces' diagonals, where the nearest triangle is not unique
    for (const double out : {-0.5, 0.5}) {
        for (int corner = 0; corner < 27; ++corner) {
            const Vector3 side(corner % 3 - 1, corner / 3 % 3 - 1, corner / 9 - 1);
            if (side.isZero()) continue;
            const Vector3 p = 0.5 * size.cwiseProduct(side) + out * side;
            EXPECT_NEAR(box.signedDistance(p), boxDistance(0.5 * size, p), 1e-11) << side.transpose();
        }
    }
}

TEST(MeshDistance, OfASphereIsThatOfItsFacets) {
    const double radius = 10;
    const MeshDistance sphere = built(makeSphere(radius, 4));
    double sagitta = 0;  // of the facet that lies deepest inside the sphere
    for (const Triangle& t : sphere.mesh().triangles) {
        const auto corner = [&](std::size_t i) { return sphere.mesh().vertices[static_cast<std::size_t>(t[i])]; };
        const Vector3 normal = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
        sagitta = std::max(sagitta, radius - normal.dot(corner(0)));
    }
    ASSERT_LT(sagitta, 0.015);
    Random random(2);
    for (int trial = 0; trial < 5000; ++trial) {
        const Vector3 p = uniformPoint(random, 15);
        const double deeper = sphere.signedDistance(p) - (p.norm() - radius);
        ASSERT_GE(deeper, -1e-11);
        ASSERT_LE(deeper, sagitta + 1e-11);
    }
}

// Two programs, one answer: any triangles, welded or not, with slivers and triangles without area among them.
TEST(MeshDistance, EqualsTheSearchOfAllTriangles) {
    Random random(3);
    TriangleMesh soup;
    for (int n = 0; n < 400; ++n) {
        const Vector3 middle = uniformPoint(random, 20);
        const double size = n % 3 == 0 ? 10 : 1;
        for (int corner = 0; corner < 3; ++corner)
            soup.vertices.push_back(middle + uniformPoint(random, size));
        if (n % 7 == 0) soup.vertices.back() = 0.3 * soup.vertices[3U * n] + 0.7 * soup.vertices[3U * n + 1];
        soup.triangles.push_back({3 * n, 3 * n + 1, 3 * n + 2});
    }
    const MeshDistance distance = built(soup);
    for (int trial = 0; trial < 3000; ++trial) {
        const Vector3 p = uniformPoint(random, 30);
        const double truth = slowDistance(soup, p);
        const NearestPoint nearest = distance.nearest(p);
        ASSERT_NEAR(nearest.distance_mm, truth, 1e-10);
        ASSERT_NEAR((nearest.point - p).norm(), truth, 1e-10);
        ASSERT_GE(nearest.triangle, 0);
        // a guess, however bad, changes nothing
        EXPECT_EQ(distance.nearest(p, 1e9, trial % 400).distance_mm, nearest.distance_mm);
        // and a limit hides only what lies beyond it
        EXPECT_EQ(distance.nearest(p, 1.001 * truth).distance_mm, nearest.distance_mm);
        EXPECT_EQ(distance.nearest(p, 0.999 * truth).triangle, -1);
    }
    EXPECT_EQ(distance.nearest(Vector3::Constant(std::nan(""))).triangle, -1);
}

// A wedge of 6 degrees: outside in front of its edge, the normal of one of its two faces alone says "inside" for half
// of the points.
TEST(MeshDistance, SignIsRightInFrontOfASharpEdgeAndAtASharpTip) {
    TriangleMesh blade = makeBox({20, 1, 20});
    for (Vector3& v : blade.vertices) {
        if (v.x() > 0) v.y() *= 1e-9;
    }
    const MeshDistance wedge = built(blade);
    const MeshDistance needle = built(makeFrustum(1, 0, 40, 7));
    Random random(4);
    for (int trial = 0; trial < 5000; ++trial) {
        const Vector3 off(std::abs(random.normal()), random.normal(), random.uniform(-9, 9));
        ASSERT_GT(wedge.signedDistance(Vector3(10, 0, 0) + off), 0);
        const Vector3 above(random.normal(), random.normal(), 0.01 + std::abs(random.normal()));
        ASSERT_GT(needle.signedDistance(Vector3(0, 0, 20) + above), 0);
    }
    for (const double x : {-9.0, 0.0, 9.0, 9.99})
        EXPECT_LT(wedge.signedDistance({x, 0, 3}), 0);
    EXPECT_LT(needle.signedDistance({0, 0, 19.5}), 0);
}

// Sheets 0.01 mm thin, and 0.01 mm apart.
TEST(MeshDistance, SignIsRightInThinPartsAndThinGaps) {
    const TriangleMesh sheet = makeBox({30, 30, 0.01});
    const MeshDistance sheets = built(merged(sheet, transformed(sheet, Rigid3::fromTranslation({0, 0, 0.02}))));
    EXPECT_NEAR(sheets.signedDistance({3, 4, 0}), -0.005, 1e-12);
    EXPECT_NEAR(sheets.signedDistance({3, 4, 0.01}), 0.005, 1e-12);
    EXPECT_NEAR(sheets.signedDistance({3, 4, 0.02}), -0.005, 1e-12);
    EXPECT_NEAR(sheets.signedDistance({3, 4, 5.025}), 5, 1e-12);
}

// What a table of neighbours would get wrong: a sliver (a corner of one face in the middle of its neighbour's edge) at
// the edge of a wedge, and vertices that are equal but not one.
TEST(MeshDistance, SignDoesNotNeedWeldedOrWellShapedTriangles) {
    // a thin wedge along x whose edge, from (0, 0, 0) to (10, 0, 0), one face has as two pieces
    TriangleMesh wedge;
    wedge.vertices = {{0, 0, 0}, {10, 0, 0}, {4, 0, 0}, {0, -10, 1}, {10, -10, 1}, {0, -10, -1}, {10, -10, -1}};
    wedge.triangles = {{0, 4, 3}, {0, 1, 4},                         // top
                       {0, 2, 1},                                    // the sliver
                       {0, 5, 2}, {2, 5, 6}, {2, 6, 1},              // bottom
                       {3, 4, 6}, {3, 6, 5}, {0, 3, 5}, {1, 6, 4}};  // back and ends
    TriangleMesh outward = wedge;
    ASSERT_TRUE(meshProperties(wedge).watertight());
    if (meshProperties(wedge).volume_mm3 < 0) outward = flipped(wedge);
    TriangleMesh soup;
    for (const Triangle& t : outward.triangles) {
        const auto n = static_cast<std::int32_t>(soup.vertices.size());
        for (const std::int32_t v : t)
            soup.vertices.push_back(outward.vertices[static_cast<std::size_t>(v)]);
        soup.triangles.push_back({n, n + 1, n + 2});
    }
    Random random(5);
    for (const TriangleMesh& mesh : {outward, soup}) {
        const MeshDistance distance = built(mesh);
        for (int trial = 0; trial < 2000; ++trial) {
            const Vector3 p(random.uniform(0.1, 9.9), 0.001 + std::abs(random.normal()), random.normal());
            ASSERT_GT(distance.signedDistance(p), 0) << p.transpose();
            ASSERT_GT(distance.signedDistance({4, p.y(), p.z()}), 0);
        }
        EXPECT_LT(distance.signedDistance({4, -5, 0}), 0);
        EXPECT_LT(distance.signedDistance({4, -0.1, 0}), 0);
    }
}

TEST(MeshDistance, RefusesWhatIsNoSurface) {
    EXPECT_THAT(MeshDistance::build({}, "stem.stl").error().message(), HasSubstr("stem.stl: found no triangles"));
    TriangleMesh bad = makeBox({1, 1, 1});
    bad.triangles[3][1] = 8;
    EXPECT_THAT(MeshDistance::build(bad).error().message(), HasSubstr("corner 8"));
    bad = makeBox({1, 1, 1});
    bad.vertices[2].x() = std::nan("");
    EXPECT_THAT(MeshDistance::build(bad).error().message(), HasSubstr("vertex 2 that is not finite"));
}

}  // namespace
}  // namespace fluorocut
