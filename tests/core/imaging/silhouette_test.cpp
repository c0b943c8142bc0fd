#include "core/imaging/silhouette.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <set>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "core/imaging/mesh_projector.h"
#include "tests/core/imaging/pincushion.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using ::testing::HasSubstr;

constexpr double kFocal = 1000, kPixel = 0.32;

Rigid3 before(double depth_mm, const Vector3& rotation_rad, const Vector3& shift_mm = Vector3::Zero()) {
    return Rigid3::fromTranslation(Vector3(0, 0, depth_mm) + shift_mm) * Rigid3::fromRotationVector(rotation_rad);
}

Vector3 randomVector(Random& random, double scale) {
    return scale * Vector3(random.normal(), random.normal(), random.normal());
}

std::vector<ContourLoop> contours(const TriangleMesh& mesh, const CArm& carm, const Rigid3& pose,
                                  const SilhouetteOptions& options = {}) {
    const auto silhouette = Silhouette::prepare(mesh);
    EXPECT_OK(silhouette);
    const auto loops = silhouette->project(carm, pose, options);
    EXPECT_OK(loops);
    return *loops;
}

TriangleMesh makeTorus(double ring_mm, double wire_mm, int around, int segments) {
    std::vector<TubePoint> line;
    for (int i = 0; i < around; ++i) {
        const double a = 2 * std::numbers::pi * i / around;
        line.push_back(
            {ring_mm * Vector3(std::cos(a), std::sin(a), 0), Vector3(-std::sin(a), std::cos(a), 0), Vector3::UnitZ()});
    }
    return makeTube(line, wire_mm, segments, true);
}

// Winding numbers at pixel centres, from directed steps that together form closed curves.
BasicImage<int> windings(const std::vector<ContourLoop>& loops, int columns, int rows, bool outline_only) {
    BasicImage<int> result(columns, rows, 0);
    for (const ContourLoop& loop : loops) {
        for (std::size_t i = 0; i < loop.size(); ++i) {
            if (outline_only && !loop[i].outline) continue;
            const Vector2 &a = loop[i].pixel, &b = loop[(i + 1) % loop.size()].pixel;
            for (int y = std::max(0, static_cast<int>(std::floor(std::min(a.y(), b.y()))));
                 y < rows && y <= std::max(a.y(), b.y()); ++y) {
                if ((a.y() <= y) == (b.y() <= y)) continue;
                const double x_meets = a.x() + (y - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
                for (int x = 0; x < columns && x < x_meets; ++x)
                    result(x, y) += b.y() < a.y() ? 1 : -1;  // up: the ray to the right leaves there
            }
        }
    }
    return result;
}

// The border of the polyhedron's shadow is met by a pixel's centre with probability zero: every pixel must agree.
TEST(Silhouette, LoopsWindAboutEveryPixelAsOftenAsItsRayEntersTheSolid) {
    Random random(3);
    CArm carm;
    carm.columns = 150;
    carm.rows = 140;
    carm.pixel_mm = {0.9, 1.1};
    carm.principal_point_px = {77.3, 66.1};
    const TriangleMesh bent =
        merged(makeTorus(30, 8, 48, 24), transformed(makeStem(), Rigid3::fromTranslation({5, -20, 40})));
    for (const TriangleMesh& mesh : {makeTorus(30, 8, 60, 24), makeStem(), bent}) {
        const auto projector = MeshProjector::prepare(mesh);
        for (int trial = 0; trial < 8; ++trial) {
            const Rigid3 pose = before(700, randomVector(random, 2), randomVector(random, 8));
            const Image lengths = projector->project(carm, pose);
            const auto loops = contours(mesh, carm, pose, {true, false});
            const auto all = windings(loops, carm.columns, carm.rows, false);
            const auto outline = windings(loops, carm.columns, carm.rows, true);
            int different_all = 0, different_outline = 0, inside = 0;
            for (std::size_t p = 0; p < lengths.size(); ++p) {
                const bool in = lengths.pixels()[p] > 0;
                inside += in;
                different_all += in != (all.pixels()[p] > 0);
                different_outline += outline.pixels()[p] != (in ? 1 : 0);
            }
            EXPECT_GT(inside, 1000);
            EXPECT_EQ(different_all, 0) << trial;
            EXPECT_EQ(different_outline, 0) << trial;
        }
    }
}

// The outline of a convex solid is the hull of its corners' images.
TEST(Silhouette, OfConvexPolyhedraIsTheHullOfTheirCorners) {
    Random random(8);
    CArm carm;
    for (const TriangleMesh& mesh : {makeBox({30, 20, 40}), makeCylinder(12, 50, 40), makeSphere(18, 3)}) {
        for (int trial = 0; trial < 10; ++trial) {
            const Rigid3 pose = before(700, randomVector(random, 2), randomVector(random, 20));
            const auto loops = contours(mesh, carm, pose, {true, true});
            ASSERT_EQ(loops.size(), 1U);
            // Every corner lies on the inner side of every step, and every step is border and seen.
            for (std::size_t i = 0; i < loops[0].size(); ++i) {
                const Vector2 a = loops[0][i].pixel, step = loops[0][(i + 1) % loops[0].size()].pixel - a;
                EXPECT_TRUE(loops[0][i].outline);
                EXPECT_FALSE(loops[0][i].hidden);
                for (const Vector3& v : mesh.vertices) {
                    const double inner = Vector2(step.y(), -step.x()).normalized().dot(carm.project(pose * v) - a);
                    EXPECT_GT(inner, -1e-9);  // px: rounding of 1e2 px
                }
            }
        }
    }
}

TEST(Silhouette, OfASphereIsItsShadowsEllipse) {
    // d . c^2 = |d|^2 (|c|^2 - r^2) for the rays that touch a sphere: their angle to the centre's ray is asin(r / |c|).
    const double radius = 25;
    const TriangleMesh mesh = makeSphere(radius, 5);
    CArm carm;
    const Vector3 center(60, -40, 700);
    const auto loops = contours(mesh, carm, Rigid3::fromTranslation(center));
    ASSERT_EQ(loops.size(), 1U);
    const double touching = std::asin(radius / center.norm());
    // A vertex on the contour belongs to a facet that holds a point of the true contour: it lies within an edge (2.4
    // degrees at the most: 63.4 / 32, stretched by the subdivision) of it, seen 1 - cos of that inside the radius.
    const double sagitta = radius * (1 - std::cos(2.4 * std::numbers::pi / 180)) / center.norm();
    double length = 0;
    for (std::size_t i = 0; i < loops[0].size(); ++i) {
        const Vector3 ray = carm.rayDirection(loops[0][i].pixel);
        const double angle = std::acos(ray.dot(center.normalized()));
        EXPECT_LT(angle, touching + 1e-9);
        EXPECT_GT(angle, touching - sagitta);
        EXPECT_NEAR(loops[0][i].point.norm(), radius, 1e-9);
        EXPECT_LT((carm.project(center + loops[0][i].point) - loops[0][i].pixel).norm(), 1e-9);
        length += (loops[0][(i + 1) % loops[0].size()].pixel - loops[0][i].pixel).norm();
    }
    // Ramanujan's circumference of the ellipse of core/fiducial/sphere_shadow.h; the polygon is shorter by 2e-4.
    const double z = center.z(), a = kFocal * radius * std::sqrt(center.squaredNorm() - radius * radius) /
                                     (z * z - radius * radius) / kPixel;
    const double b = kFocal * radius / std::sqrt(z * z - radius * radius) / kPixel;
    const double h = std::pow((a - b) / (a + b), 2);
    EXPECT_NEAR(length, std::numbers::pi * (a + b) * (1 + 3 * h / (10 + std::sqrt(4 - 3 * h))), 5e-4 * length);
}

TEST(Silhouette, OfACylinderAcrossTheBeamIsBoundedByTangentRays) {
    const double radius = 10, depth = 650;
    const int segments = 720;
    CArm carm;
    // The cylinder's axis along the image's columns: its sides are seen at angles asin(r / d) from the axis.
    const auto loops = contours(makeCylinder(radius, 80, segments), carm, before(depth, {std::numbers::pi / 2, 0, 0}));
    ASSERT_EQ(loops.size(), 1U);
    const double side_px = kFocal * std::tan(std::asin(radius / depth)) / kPixel;
    // The polygon lies up to r (1 - cos(pi / n)) inside the circle.
    const double sagitta_px = kFocal / depth * radius * (1 - std::cos(std::numbers::pi / segments)) / kPixel;
    double low = 1e9, high = -1e9;
    for (const ContourPoint& p : loops[0]) {
        low = std::min(low, p.pixel.x() - carm.principal_point_px.x());
        high = std::max(high, p.pixel.x() - carm.principal_point_px.x());
    }
    EXPECT_NEAR(high, side_px, 1.01 * sagitta_px);
    EXPECT_NEAR(low, -side_px, 1.01 * sagitta_px);
    EXPECT_LT(sagitta_px, 1e-3);
}

TEST(Silhouette, IsDistortedAsTheImageIs) {
    CArm carm;
    carm.distortion = std::make_shared<test::Pincushion>(2e-6);
    StemShape shape;
    shape.sections = 120;
    shape.segments = 96;
    const TriangleMesh mesh = makeStem(shape);
    const Rigid3 pose = before(680, {1.4, 0.1, 0.2}, {10, -50, 0});
    const Image lengths = MeshProjector::prepare(mesh)->project(carm, pose);
    const auto loops = contours(mesh, carm, pose, {true, false});
    const auto filled = windings(loops, carm.columns, carm.rows, true);
    int both = 0, either = 0, not_at_the_border = 0;
    for (int y = 1; y + 1 < carm.rows; ++y) {
        for (int x = 1; x + 1 < carm.columns; ++x) {
            const bool a = lengths(x, y) > 0, b = filled(x, y) > 0;
            both += a && b;
            either += a || b;
            if (a == b) continue;
            int inside = 0;  // of the mask's neighbourhood: 0 or 9 away from its border
            for (int dy = -1; dy <= 1; ++dy)
                for (int dx = -1; dx <= 1; ++dx)
                    inside += lengths(x + dx, y + dy) > 0;
            not_at_the_border += inside == 0 || inside == 9;
        }
    }
    // The steps of the contour (2 px) are straight in the ideal image: off by 2^2 / 8 of the bending's curvature
    // (2e-6 * 6 * 80 mm / mm^2: 1e-3 per px), under 1e-3 px of a border of 1000 px, one or two pixels.
    EXPECT_EQ(not_at_the_border, 0);
    EXPECT_GT(both, 8000);
    EXPECT_GT(static_cast<double>(both) / either, 0.9997);
    for (const ContourPoint& p : loops[0])
        EXPECT_LT((carm.project(pose * p.point) - p.pixel).norm(), 1e-6);
}

TEST(Silhouette, WhatLiesBehindAnotherPartIsHidden) {
    const double near_radius = 10, far_radius = 12;
    const Vector3 near_center(0, 0, -60), far_center(12, 0, 60);
    const TriangleMesh mesh = merged(transformed(makeSphere(near_radius, 5), Rigid3::fromTranslation(near_center)),
                                     transformed(makeSphere(far_radius, 5), Rigid3::fromTranslation(far_center)));
    CArm carm;
    const Rigid3 pose = before(700, {0, 0, 0});
    const auto loops = contours(mesh, carm, pose, {true, true});
    ASSERT_EQ(loops.size(), 2U);
    const Vector3 center = pose * near_center;
    const double touching = std::asin(near_radius / center.norm());
    int hidden = 0, seen = 0;
    for (const ContourLoop& loop : loops) {
        const bool is_near = loop[0].point.z() < 0;
        for (std::size_t i = 0; i < loop.size(); ++i) {
            const Vector2 middle = 0.5 * (loop[i].pixel + loop[(i + 1) % loop.size()].pixel);
            const double angle = std::acos(carm.rayDirection(middle).dot(center.normalized()));
            if (is_near) {
                EXPECT_FALSE(loop[i].hidden);
                continue;
            }
            // The near sphere's polyhedron is up to 0.1 % smaller than the sphere.
            if (std::abs(angle - touching) < 1.5e-3 * touching) continue;
            EXPECT_EQ(loop[i].hidden, angle < touching);
            EXPECT_EQ(loop[i].outline, !loop[i].hidden);
            (loop[i].hidden ? hidden : seen) += 1;
        }
    }
    EXPECT_GT(hidden, 30);
    EXPECT_GT(seen, 30);
    // The two circles cross in two places: each loop is split there into one part on the border and one inside it.
    for (const ContourLoop& loop : loops) {
        EXPECT_EQ(contourParts(loop, [](const ContourPoint& p) { return p.outline; }).size(), 1U);
        EXPECT_EQ(contourParts(loop, [](const ContourPoint& p) { return !p.outline; }).size(), 1U);
    }
    // The near sphere is seen in front of the far one: not on the border, not hidden.
    const ContourLoop& near_loop = loops[loops[0][0].point.z() < 0 ? 0 : 1];
    EXPECT_TRUE(std::any_of(near_loop.begin(), near_loop.end(), [](const ContourPoint& p) { return !p.outline; }));
}

TEST(Silhouette, OfATorusHasAHoleAndPartsBehindItsOwnRing) {
    CArm carm;
    const TriangleMesh mesh = makeTorus(30, 8, 96, 48);
    // Face on: two circles, both border, both seen.
    const auto face_on = contours(mesh, carm, before(700, {0, 0, 0}), {true, true});
    ASSERT_EQ(face_on.size(), 2U);
    for (const ContourLoop& loop : face_on)
        for (const ContourPoint& p : loop)
            EXPECT_TRUE(p.outline && !p.hidden);
    // Strongly tilted (20 degrees from on edge): the far inner rim disappears behind the near part of the ring.
    const auto tilted = contours(mesh, carm, before(700, {1.22, 0, 0}), {true, true});
    int inner_seen = 0, inner_hidden = 0;
    for (const ContourLoop& loop : tilted) {
        for (const ContourPoint& p : loop) {
            EXPECT_FALSE(p.outline && p.hidden);
            inner_hidden += p.hidden;
            inner_seen += !p.outline && !p.hidden;
        }
    }
    EXPECT_GT(inner_seen, 10);
    EXPECT_GT(inner_hidden, 10);
}

// Each step is an edge of the mesh, used once; the loops together are the border of a set of facets.
void expectClosedOnTheMesh(const std::vector<ContourLoop>& loops, const TriangleMesh& mesh) {
    std::set<std::array<double, 6>> edges, used;
    const auto key = [](const Vector3& a, const Vector3& b) {
        return std::array<double, 6>{a.x(), a.y(), a.z(), b.x(), b.y(), b.z()};
    };
    for (const Triangle& t : mesh.triangles)
        for (std::size_t c = 0; c < 3; ++c)
            edges.insert(key(mesh.vertices[static_cast<std::size_t>(t[c])],
                             mesh.vertices[static_cast<std::size_t>(t[(c + 1) % 3])]));
    for (const ContourLoop& loop : loops) {
        ASSERT_GE(loop.size(), 3U);
        for (std::size_t i = 0; i < loop.size(); ++i) {
            const auto step = key(loop[i].point, loop[(i + 1) % loop.size()].point);
            EXPECT_TRUE(edges.contains(step));
            EXPECT_TRUE(used.insert(step).second);
        }
    }
}

TEST(Silhouette, LoopsCloseWhateverTheView) {
    Random random(21);
    CArm carm;
    const TriangleMesh mesh = merged(makeTorus(30, 8, 40, 16), makeStem());
    for (int trial = 0; trial < 20; ++trial) {
        const auto loops = contours(mesh, carm, before(700, randomVector(random, 2), randomVector(random, 20)));
        EXPECT_GE(loops.size(), 2U);
        expectClosedOnTheMesh(loops, mesh);
    }
}

TEST(Silhouette, FacetsSeenOnEdgeFaceAwayWithAllTheirNeighbours) {
    CArm carm;
    // The source in the plane of the box's left side, and in the planes of two sides at once.
    const TriangleMesh box = makeBox({20, 20, 20});
    for (const Vector3& shift : {Vector3(10, 3, 0), Vector3(10, -10, 0)}) {
        const auto loops = contours(box, carm, before(700, {0, 0, 0}, shift));
        ASSERT_EQ(loops.size(), 1U);
        expectClosedOnTheMesh(loops, box);
        EXPECT_EQ(loops[0].size(), 4U);  // the near face alone
        for (const ContourPoint& p : loops[0])
            EXPECT_EQ(p.point.z(), -10);
    }
    // The flat cap of a cylinder seen on edge, in a tilted frame where nothing is exact: all of the cap or nothing.
    const TriangleMesh cylinder = makeCylinder(15, 60, 64);
    for (int trial = 0; trial < 50; ++trial) {
        const Vector3 source(100.0 + trial, -650, 30);  // in the plane of the cap, z = 30
        const Vector3 toward = (Vector3(0, 0, 20) - source).normalized();
        Matrix3 axes;  // of the imager, as rows
        axes.row(0) = toward.cross(Vector3::UnitZ()).normalized();
        axes.row(1) = toward.cross(Vector3(axes.row(0)));
        axes.row(2) = toward;
        const Rigid3 imager_from_mesh(axes, -(axes * source));
        const auto loops = contours(cylinder, carm, imager_from_mesh);
        ASSERT_EQ(loops.size(), 1U);
        for (const ContourPoint& p : loops[0])
            EXPECT_GT(p.point.head<2>().norm(), 14.9);  // never through the hub of a cap
    }
}

TEST(Silhouette, RefusesWhatItCannotShow) {
    TriangleMesh open = makeBox({10, 10, 10});
    open.triangles.pop_back();
    const auto refused = Silhouette::prepare(open, "stem.stl");
    ASSERT_FALSE(refused.ok());
    EXPECT_THAT(refused.error().message(), HasSubstr("stem.stl"));

    const auto box = Silhouette::prepare(makeBox({10, 10, 10}));
    const auto behind = box->project(CArm{}, Rigid3::fromTranslation({0, 0, 4}));
    ASSERT_FALSE(behind.ok());
    EXPECT_THAT(behind.error().message(), HasSubstr("source"));
    EXPECT_FALSE(box->project(CArm{}, before(700, {0, 0, 0}), {true, true, -1}).ok());
}

}  // namespace
}  // namespace fluorocut
