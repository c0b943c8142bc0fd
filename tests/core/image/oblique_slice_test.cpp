#include "core/image/oblique_slice.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/primitives.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

Vector3 randomVector(Random& random) {
    return {random.normal(), random.normal(), random.normal()};
}

// Trilinear interpolation reproduces what is linear in space, in whatever grid: left-handed and oblique too.
TEST(ObliqueSlice, ShowsALinearFieldExactlyAndTheRestAsOutside) {
    Random random(3);
    VolumeGrid grid;
    grid.size = {40, 50, 30};
    grid.spacing_mm = {0.7, 0.9, 1.3};
    grid.origin_mm = {-12, 5, 40};
    grid.direction = Rigid3::fromRotationVector({0.3, -0.2, 0.5}).rotationMatrix();
    grid.direction.col(1) *= -1;
    const Vector3 slope(3, -2, 5);
    Volume volume(grid);
    for (int k = 0; k < 30; ++k)
        for (int j = 0; j < 50; ++j)
            for (int i = 0; i < 40; ++i)
                volume(i, j, k) = static_cast<float>(100 + slope.dot(grid.pointFromIndex(Vector3(i, j, k))));
    for (int trial = 0; trial < 10; ++trial) {
        const SlicePlane plane =
            sliceAbout(grid.center() + randomVector(random), randomVector(random), randomVector(random), {40, 30}, 0.4);
        const Image slice = obliqueSlice(volume, plane, -1000);
        EXPECT_EQ(slice.width(), 100);
        EXPECT_EQ(slice.height(), 75);
        int inside = 0, outside = 0;
        for (int y = 0; y < slice.height(); ++y) {
            for (int x = 0; x < slice.width(); ++x) {
                const Vector3 point = plane.pointAt({x, y}), index = grid.indexFromPoint(point);
                const Vector3 last(39, 49, 29);
                if ((index.array() > 1e-9).all() && (index.array() < last.array() - 1e-9).all()) {
                    EXPECT_NEAR(slice(x, y), 100 + slope.dot(point), 1e-3);  // float32 of some 500
                    ++inside;
                } else if ((index.array() < -1e-9).any() || (index.array() > last.array() + 1e-9).any()) {
                    EXPECT_EQ(slice(x, y), -1000);
                    ++outside;
                }
            }
        }
        EXPECT_GT(inside, 500);
        EXPECT_GT(outside, 10);
    }
}

TEST(ObliqueSlice, PixelsAndPlacesAreInverse) {
    const SlicePlane plane = sliceAbout({10, 20, 30}, {1, 1, 0}, {0, 1, 1}, {50, 40}, 0.5);
    EXPECT_NEAR(plane.right.dot(plane.down), 0, 1e-12);
    EXPECT_LT((plane.pixelAt(plane.pointAt({12.25, 7.5})) - Vector2(12.25, 7.5)).norm(), 1e-9);
    EXPECT_LT((plane.pointAt({49.5, 39.5}) - Vector3(10, 20, 30)).norm(), 1e-9);  // the middle of 100 x 80 pixels
    EXPECT_THROW(sliceAbout({0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {10, 10}, 1), std::logic_error);
    EXPECT_THROW(sliceAbout({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1e6, 1e6}, 0.1), std::logic_error);
}

// A cylinder of radius r cut at an angle: an ellipse with the semi-axes r and r / cos. The prism of 360 sides has
// 5e-5 less of it.
TEST(ObliqueSlice, ACylindersSectionIsAnEllipse) {
    const double r = 8, tilt = 0.6;
    const Result<HalfEdgeMesh> mesh = HalfEdgeMesh::build(makeCylinder(r, 100, 360));
    ASSERT_OK(mesh);
    const Rigid3 volume_from_mesh = Rigid3::fromTranslation({5, -7, 11}) * Rigid3::fromRotationVector({0.2, 0.4, -1});
    const Vector3 center = volume_from_mesh * Vector3(0, 0, 3);
    // In the mesh's frame: `right` across the axis, `down` leaning along it.
    const Vector3 right = volume_from_mesh.rotate({1, 0, 0});
    const Vector3 down = volume_from_mesh.rotate({0, std::cos(tilt), std::sin(tilt)});
    const SlicePlane plane = sliceAbout(center, right, down, {60, 60}, 0.25);
    const auto polygons = sectionInSlice(*mesh, volume_from_mesh, plane);
    ASSERT_EQ(polygons.size(), 1U);
    double twice = 0;
    const Vector2 middle = plane.pixelAt(center);
    for (std::size_t i = 0; i < polygons[0].size(); ++i) {
        const Vector2 a = 0.25 * (polygons[0][i] - middle),
                      b = 0.25 * (polygons[0][(i + 1) % polygons[0].size()] - middle);
        twice += a.x() * b.y() - a.y() * b.x();
        // Corners lie on the prism's facets: up to r (1 - cos(pi / 360)) inside the ellipse.
        const double on = std::hypot(a.x() / r, a.y() * std::cos(tilt) / r);
        EXPECT_LT(on, 1 + 1e-9);
        EXPECT_GT(on, std::cos(std::numbers::pi / 360) - 1e-9);
    }
    EXPECT_NEAR(twice / 2, std::numbers::pi * r * r / std::cos(tilt), 1e-4 * r * r * 4);
}

}  // namespace
}  // namespace fluorocut
