#include "core/image/distance_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "tests/core/image/sampled_volume.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::forEachVoxel;
using test::sampled;
using ::testing::HasSubstr;
using Distance = std::function<double(const Vector3&)>;

// A solid of revolution about z: signed distance to the polygon of its half section (radius, z), counter-clockwise; the
// first edge, on the axis, is none.
double revolved(const std::vector<Vector2>& section, const Vector3& p) {
    const Vector2 q(std::hypot(p.x(), p.y()), p.z());
    double nearest = std::numeric_limits<double>::infinity(), outermost = -nearest;
    for (std::size_t n = 0; n < section.size(); ++n) {
        const Vector2 a = section[n], along = section[(n + 1) % section.size()] - a;
        if (a.x() == 0 && along.x() == 0) continue;
        const Vector2 normal = Vector2(along.y(), -along.x()).normalized();
        outermost = std::max(outermost, normal.dot(q - a));
        nearest =
            std::min(nearest, (q - a - std::clamp(along.dot(q - a) / along.squaredNorm(), 0.0, 1.0) * along).norm());
    }
    return outermost < 0 ? -nearest : nearest;
}

double cylinder(double radius, double length, const Vector3& p) {
    return revolved({{0, -length / 2}, {radius, -length / 2}, {radius, length / 2}, {0, length / 2}}, p);
}

double cone(double radius, double length, const Vector3& p) {  // its tip below
    return revolved({{0, -length / 2}, {radius, length / 2}, {0, length / 2}}, p);
}

VolumeGrid turnedGrid(bool left_handed) {
    VolumeGrid grid;
    grid.size = {54, 48, 62};
    grid.spacing_mm = {0.8, 0.9, 0.7};
    grid.direction = Rigid3::fromRotationVector({0.4, 0.2, -0.9}).rotationMatrix();
    if (left_handed) grid.direction.col(2) *= -1;
    grid.origin_mm = -grid.center();
    return grid;
}

void expectField(const Volume& field, const FieldBand& band, const Distance& truth, double tolerance_mm) {
    double worst = 0;
    forEachVoxel(field, [&](const Vector3& p, float value) {
        worst = std::max(worst, std::abs(value - std::clamp(truth(p), -band.inside_mm, band.outside_mm)));
    });
    EXPECT_LT(worst, tolerance_mm);
}

// Closed forms; the meshes' facets lie inside curved walls by r (1 - cos(pi / 720)) = 1e-4 mm, the sphere's by 5e-4 mm
// (edges of 0.085 mm... 10 mm / 2^7), single precision adds 1e-6.
TEST(DistanceField, OfSolidsOfRevolutionIsTheClosedFormInTheBandAndTheBandBeyond) {
    for (const bool left_handed : {false, true}) {
        const VolumeGrid grid = turnedGrid(left_handed);
        const FieldBand band(3, 5);
        const auto field = [&](const TriangleMesh& mesh) { return distanceField(mesh, grid, band).value(); };
        expectField(
            field(makeCylinder(8, 24, 720)), band, [](const Vector3& p) { return cylinder(8, 24, p); }, 2e-4);
        expectField(
            field(makeFrustum(0, 9, 26, 720)), band, [](const Vector3& p) { return cone(9, 26, p); }, 2e-4);
        expectField(
            field(makeSphere(10, 6)), band, [](const Vector3& p) { return p.norm() - 10; }, 1e-3);
    }
}

// Rows of voxels that run through vertices, along edges and in faces: every one of them a tie.
TEST(DistanceField, SignIsRightWhereRowsMeetVerticesEdgesAndFaces) {
    VolumeGrid grid;
    grid.size = {21, 21, 21};
    grid.origin_mm.setConstant(-10);
    const Distance box = [](const Vector3& p) { return p.cwiseAbs().maxCoeff() - 6; };
    const Volume field = distanceField(makeBox({12, 12, 12}), grid, 100).value();
    int wrong = 0;
    forEachVoxel(field, [&](const Vector3& p, float value) { wrong += (value < 0) != (box(p) < 0) && box(p) != 0; });
    EXPECT_EQ(wrong, 0);
    // an octahedron with its vertices on the rows, its edges in the planes
    TriangleMesh octahedron = makeSphere(1, 0);
    octahedron.vertices = {{7, 0, 0}, {-7, 0, 0}, {0, 7, 0}, {0, -7, 0}, {0, 0, 7}, {0, 0, -7}};
    octahedron.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
    const Volume other = distanceField(octahedron, grid, 100).value();
    forEachVoxel(other, [&](const Vector3& p, float value) {
        const double beyond = p.cwiseAbs().sum() - 7;
        wrong += (value < 0) != (beyond < 0) && beyond != 0;
    });
    EXPECT_EQ(wrong, 0);
}

// Two ways to tell inside from outside: turns of the surface round a point, the pseudonormal at the nearest point.
TEST(DistanceField, SignIsThatOfThePseudonormal) {
    const TriangleMesh stem = makeStem();
    const VolumeGrid grid = gridAround({-20, -12, -125}, {25, 12, 5}, 1.3, 0.123).value();
    const MeshDistance distance = MeshDistance::build(stem).value();
    const Volume field = distanceField(stem, grid, 1000).value();
    forEachVoxel(field, [&](const Vector3& p, float value) {
        ASSERT_NEAR(value, distance.signedDistance(p), 1e-4) << p.transpose();  // single precision of 100 mm
    });
}

TEST(DistanceField, OverlappingPartsAreTheirUnion) {
    const TriangleMesh both =
        merged(makeSphere(8, 5), transformed(makeSphere(8, 5), Rigid3::fromTranslation({6, 0, 0})));
    const VolumeGrid grid = gridAround({-8, -8, -8}, {14, 8, 8}, 0.5, 3).value();
    const Distance join = [](const Vector3& p) { return std::min(p.norm() - 8, (p - Vector3(6, 0, 0)).norm() - 8); };
    const Volume field = distanceField(both, grid, 4).value();
    forEachVoxel(field, [&](const Vector3& p, float value) {
        ASSERT_TRUE((value < 0) == (join(p) < 0) || std::abs(value) < 3e-3);
        if (join(p) > 0) {
            ASSERT_NEAR(value, std::min(join(p), 4.0), 3e-3);
        }
    });
    // on the first sphere, 4 mm inside the second: its face is forgotten
    const Vector3 hidden(8, 0, 0);
    EXPECT_NEAR(sampleField(field, hidden, 9), 0, 0.2);
    EXPECT_NEAR(sampleField(redistanced(field, 7).value(), hidden, 9), -6, 0.02);
}

// A function with the right level and the wrong slope becomes a distance. The interpolated surface lies inside the
// sphere by up to 3 h^2 / (8 r) = 0.009 mm.
TEST(DistanceField, RedistancedIsTheDistanceToTheLevel) {
    const VolumeGrid grid = gridAround(Vector3::Constant(-10), Vector3::Constant(10), 0.5, 3).value();
    Volume field(grid);
    for (int k = 0; k < field.size(2); ++k) {
        for (int j = 0; j < field.size(1); ++j) {
            for (int i = 0; i < field.size(0); ++i)
                field(i, j, k) = static_cast<float>(grid.pointFromIndex(Vector3(i, j, k)).squaredNorm());
        }
    }
    const FieldBand band(6, 2);
    expectField(
        redistanced(field, band, 100).value(), band, [](const Vector3& p) { return p.norm() - 10; }, 0.01);
    // without a surface: one side everywhere
    EXPECT_EQ(redistanced(field, band, 1e6).value().voxels(), Volume(grid, -6.0F).voxels());
    EXPECT_EQ(redistanced(field, band, -1).value().voxels(), Volume(grid, 2.0F).voxels());
}

// A sphere pulled upward is a half sphere with a cylinder on it; outside, distances stay distances but for the sweep's
// steps, which reach h^2 / (8 r) short of the equator.
TEST(DistanceField, SweptSphereIsAHalfSphereAndACylinder) {
    const double r = 8, h = 0.5;
    const VolumeGrid grid = gridAround({-r, -r, -r}, {r, r, r + 6}, h, 3.1).value();
    Volume field = distanceField(makeSphere(r, 6), grid, 100).value();
    sweepUp(field);
    const double tolerance = h * h / (8 * r) + 1e-3;  // 0.004 mm, and the facets
    forEachVoxel(field, [&](const Vector3& p, float value) {
        const double truth = p.z() < 0 ? p.norm() - r : std::hypot(p.x(), p.y()) - r;
        if (truth > 0) {
            ASSERT_NEAR(value, truth, tolerance) << p.transpose();
        }
        if (truth < -tolerance) {
            ASSERT_LT(value, 0);
        }
        if (truth <= 0) {
            ASSERT_GT(value, truth - 1e-3);
        }  // a bound
    });
}

// A cylinder that leans: a point is swept over when the line below it meets the cylinder.
TEST(DistanceField, SweptLeaningCylinderIsWhatTheLinesBelowMeet) {
    const double r = 6, length = 30, h = 0.5;
    const Rigid3 lean = Rigid3::fromRotationVector({0.35, 0.1, 0});
    const VolumeGrid grid = gridAround({-14, -14, -20}, {14, 14, 20}, h, 2.2).value();
    Volume field = distanceField(transformed(makeCylinder(r, length, 720), lean), grid, 100).value();
    sweepUp(field);
    const Rigid3 upright = lean.inverse();
    Random random(7);
    for (int trial = 0; trial < 2500; ++trial) {
        const std::array<int, 3> at{static_cast<int>(random.below(static_cast<std::uint64_t>(field.size(0)))),
                                    static_cast<int>(random.below(static_cast<std::uint64_t>(field.size(1)))),
                                    static_cast<int>(random.below(static_cast<std::uint64_t>(field.size(2))))};
        const Vector3 p = grid.pointFromIndex(Vector3(at[0], at[1], at[2]));
        const float value = field(at[0], at[1], at[2]);
        // dense search along the line down, far finer than the grid
        double nearest = std::numeric_limits<double>::infinity();
        for (double down = 0; down < 45; down += 0.05)
            nearest = std::min(nearest, cylinder(r, length, upright * Vector3(p.x(), p.y(), p.z() - down)));
        // The grid's steps find the minimum to h^2 / (8 r) across the wall and half a step where edges pass by: 0.1 mm.
        ASSERT_GE(value, nearest - 0.01);
        ASSERT_LT(value, std::max(nearest, 0.0) + 0.13) << p.transpose();
        if (std::abs(nearest) > 0.13) {
            ASSERT_EQ(value < 0, nearest < 0) << p.transpose();
        }
    }
}

TEST(DistanceField, SamplesAndGradientsOfALinearFieldAreExact) {
    const VolumeGrid grid = turnedGrid(true);
    const Vector3 slope(0.3, -0.5, 0.7);
    const Volume field = sampled(grid, [&](const Vector3& p) { return slope.dot(p) + 2; });
    Random random(6);
    for (int trial = 0; trial < 200; ++trial) {
        const Vector3 p(random.uniform(-10, 10), random.uniform(-10, 10), random.uniform(-10, 10));
        EXPECT_NEAR(sampleField(field, p, 99), slope.dot(p) + 2, 1e-5);  // single precision
        EXPECT_LT((fieldGradient(field, p) - slope).norm(), 1e-4);
    }
    EXPECT_EQ(sampleField(field, {1000, 0, 0}, 99), 99);
    EXPECT_EQ(fieldGradient(field, {1000, 0, 0}), Vector3::Zero());
    EXPECT_EQ(fieldGradient(field, Vector3::Constant(std::nan(""))), Vector3::Zero());
}

TEST(DistanceField, GridHoldsTheBoxAndRefusesToBeTooLarge) {
    const VolumeGrid grid = gridAround({-1, 0, 5}, {2, 4, 6}, 0.5, 1).value();
    EXPECT_EQ(grid.origin_mm, Vector3(-2, -1, 4));
    EXPECT_EQ(grid.size, (std::array<int, 3>{11, 13, 7}));
    EXPECT_THAT(gridAround({0, 0, 0}, {100, 100, 100}, 0.1, 0).error().message(),
                HasSubstr("spacing_mm: found 0.1 mm"));
    EXPECT_FALSE(gridAround({0, 0, 0}, {1, 1, 1}, 0, 0).ok());
    EXPECT_FALSE(gridAround({0, 0, 0}, {1, 1, 1}, std::nan(""), 0).ok());
    EXPECT_FALSE(gridAround({0, 0, 0}, {std::nan(""), 1, 1}, 1, 0).ok());
    EXPECT_FALSE(gridAround({0, 0, 0}, {1e300, 1, 1}, 1, 0).ok());
}

TEST(DistanceField, RefusesWhatIsNoSolidAndCanBeStopped) {
    TriangleMesh open = makeBox({3, 3, 3});
    open.triangles.pop_back();
    const VolumeGrid grid = gridAround({-3, -3, -3}, {3, 3, 3}, 0.5, 0).value();
    EXPECT_THAT(distanceField(open, grid, 1, Progress::none(), "stem.stl").error().message(),
                HasSubstr("stem.stl: found a hole"));
    class Stop final : public Progress {
        void report(double, std::string_view) override {}
        bool isCancelled() const override { return true; }
    } stop;
    EXPECT_TRUE(distanceField(makeBox({3, 3, 3}), grid, 1, stop).error().isCancelled());
}

TEST(DistanceField, IsTheSameOnAnyNumberOfThreads) {
    const TriangleMesh stem = makeStem();
    const VolumeGrid grid = gridAround({-20, -12, -125}, {25, 12, 5}, 1, 0).value();
    const Volume field = distanceField(stem, grid, 3).value();
    const ThreadLimit one(1);
    EXPECT_EQ(distanceField(stem, grid, 3).value().voxels(), field.voxels());
}

}  // namespace
}  // namespace fluorocut
