#include "core/imaging/mesh_projector.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/stopwatch.h"
#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "tests/core/imaging/pincushion.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using ::testing::HasSubstr;

// float32 holds 100 mm to 4e-6 mm; the projector's own error is below that. Longer chords are compared relatively.
constexpr double kExact_mm = 1e-5;
constexpr double kFloat = 6e-8;  // 2^-24

Vector3 randomVector(Random& random, double scale) {
    return scale * Vector3(random.normal(), random.normal(), random.normal());
}

Rigid3 before(double depth_mm, const Vector3& rotation_rad, const Vector3& shift_mm = Vector3::Zero()) {
    return Rigid3::fromTranslation(Vector3(0, 0, depth_mm) + shift_mm) * Rigid3::fromRotationVector(rotation_rad);
}

CArm smallCArm(int columns, int rows) {
    CArm carm;
    carm.columns = columns;
    carm.rows = rows;
    carm.pixel_mm = {0.9, 1.1};
    carm.principal_point_px = {0.5 * columns - 1.3, 0.5 * rows + 2.2};
    return carm;
}

Image project(const TriangleMesh& mesh, const CArm& carm, const Rigid3& pose, int samples = 1) {
    auto projector = MeshProjector::prepare(mesh);
    EXPECT_OK(projector);
    return projector->project(carm, pose, {samples});
}

// Independent: the chord of a convex solid by cutting the ray, from source to detector, with the half-space of each
// face.
double convexChord(const TriangleMesh& mesh, const Rigid3& imager_from_mesh, const Vector3& detector_point) {
    const Vector3 source = imager_from_mesh.inverse() * Vector3(0, 0, 0);
    const Vector3 direction = imager_from_mesh.inverse().rotate(detector_point);
    double enter = 0, leave = 1;
    for (const Triangle& t : mesh.triangles) {
        const Vector3& a = mesh.vertices[static_cast<std::size_t>(t[0])];
        const Vector3 normal = (mesh.vertices[static_cast<std::size_t>(t[1])] - a)
                                   .cross(mesh.vertices[static_cast<std::size_t>(t[2])] - a)
                                   .normalized();
        const double speed = normal.dot(direction), distance = normal.dot(a - source);
        if (speed < 0) enter = std::max(enter, distance / speed);
        if (speed > 0) leave = std::min(leave, distance / speed);
        if (speed == 0 && distance < 0) return 0;
    }
    return std::max(0.0, leave - enter) * direction.norm();
}

void expectConvexChords(const TriangleMesh& mesh, const CArm& carm, const Rigid3& pose,
                        double tolerance_mm = kExact_mm) {
    const Image image = project(mesh, carm, pose);
    double worst = 0, longest = 0;
    Vector2 where(0, 0);
    for (int y = 0; y < carm.rows; ++y) {
        for (int x = 0; x < carm.columns; ++x) {
            const double expected = convexChord(mesh, pose, carm.detectorPoint({x, y}));
            const double error = std::max(0.0, std::abs(image(x, y) - expected) - kFloat * expected);
            longest = std::max(longest, expected);
            if (!(error <= worst)) worst = error, where = {x, y};
        }
    }
    EXPECT_LE(worst, tolerance_mm) << "at pixel " << where.transpose();
    EXPECT_GT(longest, 0);
}

TEST(MeshProjector, ConvexPolyhedraAreExactAtRandomPoses) {
    Random random(5);
    TriangleMesh tetrahedron;
    tetrahedron.vertices = {{0, 0, 0}, {40, 0, 0}, {0, 30, 0}, {5, 5, 35}};
    tetrahedron.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
    const TriangleMesh meshes[] = {tetrahedron, makeBox({30, 20, 40}), makeCylinder(12, 50, 40),
                                   makeFrustum(15, 0, 40, 31), makeSphere(18, 3)};
    for (const TriangleMesh& mesh : meshes) {
        for (int trial = 0; trial < 5; ++trial) {
            expectConvexChords(mesh, smallCArm(120, 100),
                               before(700, randomVector(random, 2), randomVector(random, 8)));
        }
    }
}

// Poses at which rays meet edges and vertices exactly: a box along the axes whose faces, edges and diagonals are seen
// under pixel centres, and the source in the plane of its sides. One side of a silhouette may go either way (a ray
// along a face lies on the border of the solid): there the chord must be one of the two limits.
TEST(MeshProjector, RaysThroughEdgesAndVerticesNeitherLeakNorCountTwice) {
    CArm carm;
    carm.columns = carm.rows = 65;
    carm.pixel_mm = {1, 1};
    carm.principal_point_px = {32, 32};
    carm.focal_length_mm = 1000;
    // The near face at z = 500 spans 2 pixels per mm: its corners at pixels 32 +- 20, its diagonal through pixel
    // centres.
    const Rigid3 pose = Rigid3::fromTranslation({0, 0, 510});
    const TriangleMesh box = makeBox({20, 20, 20});
    const Image image = project(box, carm, pose);
    for (int y = 0; y < 65; ++y) {
        for (int x = 0; x < 65; ++x) {
            const Vector3 ray = carm.detectorPoint({x, y});
            const double chord = convexChord(box, pose, ray);
            const bool on_silhouette = std::max(std::abs(x - 32), std::abs(y - 32)) == 20;
            if (on_silhouette) {
                EXPECT_LE(image(x, y), 20 * ray.norm() / 1000 + kExact_mm);
                EXPECT_GE(image(x, y), 0);
            } else {
                EXPECT_NEAR(image(x, y), chord, kExact_mm) << x << ' ' << y;
            }
        }
    }
    // The source in the plane of two sides: the rays along x = 10 / 510 ... graze, all others have the full depth or
    // none.
    const Image grazed = project(box, carm, Rigid3::fromTranslation({10, 0, 510}));
    for (int y = 20; y < 45; ++y) {
        EXPECT_EQ(grazed(31, y), 0);
        EXPECT_NEAR(grazed(33, y), convexChord(box, Rigid3::fromTranslation({10, 0, 510}), carm.detectorPoint({33, y})),
                    kExact_mm);
    }
}

// The hardest case for a rasteriser: a solid whose every vertex lies on a pixel's ray, to rounding. Top and bottom are
// height fields over the pixel grid; inside, each pixel's path is the difference of its two vertices' depths.
TEST(MeshProjector, VerticesOnEveryRayAreCountedOnce) {
    Random random(17);
    const CArm carm = smallCArm(60, 50);
    const Rigid3 pose = before(0, {0.3, -0.2, 0.9}, {11, -7, 13});
    const int first = 10, size = 30;
    TriangleMesh mesh;
    std::vector<double> thickness;
    for (const int layer : {0, 1}) {
        for (int n = 0; n < size * size; ++n) {
            const Vector3 ray = carm.rayDirection({first + n % size, first + n / size});
            const double distance = layer == 0 ? random.uniform(690, 700) : random.uniform(705, 715);
            mesh.vertices.push_back(pose.inverse() * (distance * ray));
            if (layer == 0) thickness.push_back(-distance);
            if (layer == 1) thickness[static_cast<std::size_t>(n)] += distance;
        }
    }
    const auto vertex = [&](int layer, int x, int y) { return layer * size * size + y * size + x; };
    const auto quad = [&](std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t d) {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({a, c, d});
    };
    const int last = size - 1;
    for (int i = 0; i < last; ++i) {
        for (int j = 0; j < last; ++j) {
            quad(vertex(0, i, j), vertex(0, i, j + 1), vertex(0, i + 1, j + 1), vertex(0, i + 1, j));
            quad(vertex(1, i, j), vertex(1, i + 1, j), vertex(1, i + 1, j + 1), vertex(1, i, j + 1));
        }
        quad(vertex(0, i, 0), vertex(0, i + 1, 0), vertex(1, i + 1, 0), vertex(1, i, 0));
        quad(vertex(0, i + 1, last), vertex(0, i, last), vertex(1, i, last), vertex(1, i + 1, last));
        quad(vertex(0, 0, i + 1), vertex(0, 0, i), vertex(1, 0, i), vertex(1, 0, i + 1));
        quad(vertex(0, last, i), vertex(0, last, i + 1), vertex(1, last, i + 1), vertex(1, last, i));
    }
    const Image image = project(mesh, carm, pose);
    for (int y = 0; y < carm.rows; ++y) {
        for (int x = 0; x < carm.columns; ++x) {
            const int i = x - first, j = y - first;
            if (i < 0 || j < 0 || i > last || j > last) {
                EXPECT_EQ(image(x, y), 0) << x << ' ' << y;
            } else if (i > 0 && j > 0 && i < last && j < last) {
                EXPECT_NEAR(image(x, y), thickness[static_cast<std::size_t>(j * size + i)], kExact_mm) << x << ' ' << y;
            }
        }
    }
}

// A sphere of radius r has the chord 2 sqrt(r^2 - d^2). The icosphere lies between the spheres through its vertices and
// through the nearest points of its faces, and so do its chords.
TEST(MeshProjector, ASphereLiesBetweenTheSpheresThatBoundItsPolyhedron) {
    const double radius = 30;
    const TriangleMesh mesh = makeSphere(radius, 6);
    double inner = radius;
    for (const Triangle& t : mesh.triangles) {
        const Vector3 &a = mesh.vertices[static_cast<std::size_t>(t[0])],
                      &b = mesh.vertices[static_cast<std::size_t>(t[1])],
                      &c = mesh.vertices[static_cast<std::size_t>(t[2])];
        inner = std::min(inner, (b - a).cross(c - a).normalized().dot(a));
    }
    EXPECT_GT(inner, radius * (1 - 2e-4));
    const CArm carm = smallCArm(150, 140);
    const Vector3 center(6, -9, 720);
    const Image image = project(mesh, carm, Rigid3::fromTranslation(center));
    const auto chord = [&](double r, const Vector3& ray) {
        const double d2 = center.squaredNorm() - std::pow(center.dot(ray), 2);
        return d2 < r * r ? 2 * std::sqrt(r * r - d2) : 0;
    };
    double sum = 0, expected = 0;
    for (int y = 0; y < carm.rows; ++y) {
        for (int x = 0; x < carm.columns; ++x) {
            const Vector3 ray = carm.rayDirection({x, y});
            EXPECT_GE(image(x, y), chord(inner, ray) - kExact_mm);
            EXPECT_LE(image(x, y), chord(radius, ray) + kExact_mm);
            sum += image(x, y) * std::pow(ray.z(), 3) * carm.pixel_mm.prod() / std::pow(carm.focal_length_mm, 2);
        }
    }
    // Sum of length times solid angle = integral of dV / r^2 over the ball, in closed form. A pixel sum of a function
    // with a square-root rim errs by about (pixel / radius)^1.5 of its rim's share: 3e-4 here.
    const double d = center.norm();
    expected =
        2 * std::numbers::pi * (radius + (radius * radius - d * d) / (2 * d) * std::log((d + radius) / (d - radius)));
    EXPECT_NEAR(sum / expected, 1, 5e-4);
}

TEST(MeshProjector, OnlyWhatLiesBetweenSourceAndDetectorCounts) {
    const CArm carm = smallCArm(60, 60);
    const TriangleMesh box = makeBox({400, 300, 600});
    expectConvexChords(box, carm, before(0, {0.2, 0.1, 0.3}));     // the source inside
    expectConvexChords(box, carm, before(250, {0, 0, 0}));         // reaching behind the source, aligned
    expectConvexChords(box, carm, before(280, {0.3, -0.2, 0.1}));  // the same, oblique
    expectConvexChords(box, carm, before(900, {0.5, 0.4, 0}));     // through the detector
    expectConvexChords(makeBox({10, 10, 3000}), carm, before(0, {0.01, 0.02, 0}));
    for (const double z : {-500.0, 1500.0}) {
        const Image nothing = project(box, carm, before(z, {0.1, 0.2, 0.3}));
        EXPECT_TRUE(std::ranges::all_of(nothing.pixels(), [](float p) { return p == 0; }));
    }
}

TEST(MeshProjector, OverlapsAddAndVoidsSubtract) {
    const CArm carm = smallCArm(80, 80);
    const Rigid3 pose = before(700, {0.4, 0.5, 0.6});
    const TriangleMesh box = makeBox({30, 30, 30}), ball = makeSphere(10, 3);
    const Image of_box = project(box, carm, pose), of_ball = project(ball, carm, pose);
    const Image both = project(merged(box, ball), carm, pose), hollow = project(merged(box, flipped(ball)), carm, pose);
    for (std::size_t i = 0; i < both.size(); ++i) {
        EXPECT_NEAR(both.pixels()[i], of_box.pixels()[i] + of_ball.pixels()[i], kExact_mm);
        EXPECT_NEAR(hollow.pixels()[i], of_box.pixels()[i] - of_ball.pixels()[i], kExact_mm);
    }
}

TEST(MeshProjector, DistortedImagersSeeAlongTheRaysOfTheirPixels) {
    CArm carm = smallCArm(120, 100);
    carm.distortion = std::make_shared<test::Pincushion>(2e-5);  // 60 mm off the axis it moves 4.3 mm: 4 to 5 pixels
    expectConvexChords(makeBox({60, 30, 40}), carm, before(700, {0.3, 0.5, 0.7}));
    expectConvexChords(makeSphere(25, 3), carm, before(700, {}, {20, 15, 0}));
    expectConvexChords(makeBox({400, 300, 600}), carm, before(200, {0.3, -0.2, 0.1}));

    carm.distortion = std::make_shared<test::Pincushion>(2e-5, 50);
    const Image image = project(makeBox({300, 300, 40}), carm, before(700, {}));
    EXPECT_GT(image(60, 50), 39.9);
    EXPECT_TRUE(std::isnan(image(0, 0)));
}

TEST(MeshProjector, SamplesPerAxisIsTheMeanOfAFinerImage) {
    const CArm carm = smallCArm(64, 48);
    CArm fine = carm;
    fine.columns *= 4;
    fine.rows *= 4;
    fine.pixel_mm /= 4;
    fine.principal_point_px = ((carm.principal_point_px.array() + 0.5) * 4 - 0.5).matrix();
    const TriangleMesh wire = makeCylinder(0.2, 60, 24);  // 0.4 mm seen by pixels of 0.6 mm at its depth
    const Rigid3 pose = before(700, {0.2, 1.2, 0.4});
    const Image averaged = project(wire, carm, pose, 4), finer = project(wire, fine, pose);
    for (int y = 0; y < carm.rows; ++y) {
        for (int x = 0; x < carm.columns; ++x) {
            double sum = 0;
            for (int s = 0; s < 16; ++s)
                sum += finer(4 * x + s % 4, 4 * y + s / 4);
            EXPECT_NEAR(averaged(x, y), sum / 16, 1e-6);
        }
    }
}

// More samples than are held in memory at a time: the image is made in strips, whose seams must not show.
TEST(MeshProjector, StripsLeaveNoSeam) {
    CArm carm;
    carm.columns = 300;
    carm.rows = 260;
    carm.principal_point_px = {150, 130};
    const TriangleMesh box = makeBox({100, 100, 20});
    const Image image = project(box, carm, before(700, {}), 8);  // all pixels see it, edge to edge
    for (int y = 0; y < carm.rows; ++y) {
        for (int x = 0; x < carm.columns; ++x)
            EXPECT_NEAR(image(x, y), 20 * carm.detectorPoint({x, y}).norm() / 1000, 1e-5);
    }
}

// A crop of the detector sees the same rays.
TEST(MeshProjector, ACroppedImagerSeesPartOfTheSameImage) {
    const CArm carm = smallCArm(90, 80);
    const Rigid3 pose = before(650, {0.4, 0.5, 0.6}, {3, 4, 5});
    const TriangleMesh stem = makeStem();
    const Image whole = project(stem, carm, pose), part = project(stem, carm.cropped(20, 31, 40, 30), pose);
    for (int y = 0; y < 30; ++y) {
        for (int x = 0; x < 40; ++x)
            EXPECT_NEAR(part(x, y), whole(x + 20, y + 31), kExact_mm);
    }
}

TEST(MeshProjector, RefusesAnOpenMeshAndBadOptions) {
    TriangleMesh open = makeBox({1, 1, 1});
    open.triangles.pop_back();
    EXPECT_THAT(MeshProjector::prepare(open, "nail.stl").error().message(), HasSubstr("nail.stl: found a hole"));
    const auto projector = MeshProjector::prepare(makeBox({1, 1, 1}));
    ASSERT_OK(projector);
    EXPECT_THROW((void)projector->project(CArm(), {}, {0}), std::logic_error);
    EXPECT_THAT(MeshProjectionOptions{17}.validate().error().message(), HasSubstr("samples_per_axis: found 17"));
}

// The gate is 5 ms for 50,000 triangles at 512 x 512 on two free cores; the assertion forgives a loaded machine and
// sanitizers.
TEST(MeshProjector, IsFastAndTheSameOnAnyNumberOfThreads) {
    StemShape shape;
    shape.sections = 200;
    shape.segments = 125;
    const TriangleMesh stem = makeStem(shape);
    EXPECT_GT(stem.triangles.size(), 49000u);
    const auto projector = MeshProjector::prepare(stem);
    ASSERT_OK(projector);
    const CArm carm;
    const Rigid3 pose = Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(1.4, Vector3::UnitX())), {10, -20, 680}) *
                        Rigid3::fromTranslation({0, 0, 59});
    const Image reference = projector->project(carm, pose);
    std::vector<double> milliseconds;
    for (int run = 0; run < 15; ++run) {
        const Stopwatch stopwatch;
        const Image again = projector->project(carm, pose);
        milliseconds.push_back(stopwatch.ms());
        ASSERT_EQ(again, reference);
    }
    std::ranges::sort(milliseconds);
    std::printf("mesh projector: %zu triangles, 512 x 512, median %.2f ms, best %.2f ms\n", stem.triangles.size(),
                milliseconds[7], milliseconds[0]);
    EXPECT_LT(milliseconds[0], 500);
    const ThreadLimit one(1);
    EXPECT_EQ(projector->project(carm, pose), reference);
}

}  // namespace
}  // namespace fluorocut
