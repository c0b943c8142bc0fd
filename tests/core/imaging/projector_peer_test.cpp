// The fast projector against an independent program, the exact ray tracer of plastimatch, on shapes whose projection is
// known in closed form.
#include <gtest/gtest.h>

#include "core/imaging/volume_projector.h"
#include "tests/core/imaging/blob_volumes.h"
#include "tests/support/fixtures.h"
#include "tests/support/peers/plastimatch.h"

namespace fluorocut {
namespace {

using test::centeredGrid;
using test::normalizedRms;

struct Shape {
    const char* name;
    std::function<bool(const Vector3&)> inside;
    std::function<double(const Vector3& source, const Vector3& direction)> chord_mm;
};

const Vector3 kCenter(7.3, -11.7, 4.9);

double sphereChord(double radius, const Vector3& source, const Vector3& direction) {
    const Vector3 m = source - kCenter;
    const double b = m.dot(direction), q = b * b - m.squaredNorm() + radius * radius;
    return q > 0 ? 2 * std::sqrt(q) : 0;
}

double cylinderChord(double radius, double half_length, const Vector3& source, const Vector3& direction) {
    const Vector3 m = source - kCenter;
    const double a = direction.head<2>().squaredNorm(), b = m.head<2>().dot(direction.head<2>());
    const double q = b * b - a * (m.head<2>().squaredNorm() - radius * radius);
    if (!(q > 0 && a > 0)) return 0;
    double low = (-half_length - m.z()) / direction.z(), high = (half_length - m.z()) / direction.z();
    if (low > high) std::swap(low, high);
    return std::max(0.0, std::min((-b + std::sqrt(q)) / a, high) - std::max((-b - std::sqrt(q)) / a, low));
}

std::vector<Shape> shapes() {
    return {
        {"sphere", [](const Vector3& p) { return (p - kCenter).norm() < 60; },
         [](const Vector3& s, const Vector3& d) { return sphereChord(60, s, d); }},
        {"cylinder shell",
         [](const Vector3& p) {
             const Vector3 d = p - kCenter;
             const double r = d.head<2>().norm();
             return r > 30 && r < 40 && std::abs(d.z()) < 80;
         },
         [](const Vector3& s, const Vector3& d) { return cylinderChord(40, 80, s, d) - cylinderChord(30, 80, s, d); }},
    };
}

std::shared_ptr<const Volume> voxelise(const Shape& shape, const VolumeGrid& grid, int samples_per_axis) {
    const int n = samples_per_axis;
    return test::makeVolume(grid, [&](const Vector3& point) {
        // A voxel whose corners agree is whole: both shapes are much larger than a voxel.
        int corners = 0;
        for (int c = 0; c < 8; ++c) {
            corners += shape.inside(
                point + (Vector3(c & 1, c >> 1 & 1, c >> 2).array() - 0.5).matrix().cwiseProduct(grid.spacing_mm));
        }
        if (corners == 0 || corners == 8) return corners == 0 ? -1000.0 : 0.0;
        int count = 0;
        for (int s = 0; s < n * n * n; ++s) {
            const Vector3 offset(s % n, s / n % n, s / (n * n));
            count += shape.inside(point + ((offset.array() + 0.5) / n - 0.5).matrix().cwiseProduct(grid.spacing_mm));
        }
        return -1000 + 1000.0 * count / (n * n * n);
    });
}

// Voxels as whole boxes and as partial volumes, seen along and across the grid.
TEST(ProjectorPeerSlow, ShapesAreNoWorseThanByAnExactRayTracer) {
    if (!test::plastimatchIsInstalled()) GTEST_SKIP() << "plastimatch is not installed";
    const test::ScratchFolder scratch;
    const VolumeGrid grid = centeredGrid({192, 192, 192}, {1, 1, 1});
    CArm carm;
    carm.pixel_mm = {0.6, 0.6};
    for (const Shape& shape : shapes()) {
        for (const int samples_per_axis : {1, 4}) {
            const auto volume = voxelise(shape, grid, samples_per_axis);
            test::writeForPlastimatch(*volume, scratch / "density.mha");
            const Result<VolumeProjector> projector = VolumeProjector::prepare(volume);
            ASSERT_OK(projector);
            double own2 = 0, peer2 = 0;
            for (const double angle : {5.0, 35.0, 140.0}) {
                const Rigid3 pose = test::orbit(angle, 12);
                const Rigid3 volume_from_imager = pose.inverse();
                Image closed_form(carm.columns, carm.rows);
                for (int y = 0; y < carm.rows; ++y) {
                    for (int x = 0; x < carm.columns; ++x) {
                        closed_form(x, y) = static_cast<float>(
                            test::kMuWater *
                            shape.chord_mm(volume_from_imager.translation(),
                                           volume_from_imager.rotate(carm.rayDirection(Vector2(x, y)))));
                    }
                }
                Image peer = test::runPlastimatch(scratch / "density.mha", carm, pose, scratch.path()).line_integrals;
                for (float& value : peer.pixels())
                    value *= static_cast<float>(test::kMuWater / 1000);
                const double own_error = normalizedRms(projector->project(carm, pose), closed_form);
                const double peer_error = normalizedRms(peer, closed_form);
                // View by view within three percent (1.7 at worst); over the views better.
                EXPECT_LT(own_error, 1.03 * peer_error) << shape.name << " " << samples_per_axis << " " << angle;
                own2 += own_error * own_error;
                peer2 += peer_error * peer_error;
            }
            EXPECT_LT(own2, peer2) << shape.name << " " << samples_per_axis;
        }
    }
}

// The same pixels, the same orientation, the same scale: on a smooth volume the two programs agree.
TEST(ProjectorPeer, SmoothVolumesLookTheSame) {
    if (!test::plastimatchIsInstalled()) GTEST_SKIP() << "plastimatch is not installed";
    const test::ScratchFolder scratch;
    VolumeGrid grid = centeredGrid({100, 90, 60}, {0.9, 1.1, 1.7});
    grid.origin_mm += Vector3(10, -20, 5);
    const std::vector<test::Blob> blobs{{grid.center() + Vector3(10, -8, 6), 9, 3000},
                                        {grid.center() - Vector3(5, 9, 8), 8, 2000}};
    const auto volume = test::makeBlobs(grid, blobs);
    test::writeForPlastimatch(*volume, scratch / "density.mha");
    const Result<VolumeProjector> projector = VolumeProjector::prepare(volume);
    ASSERT_OK(projector);
    CArm carm;
    carm.columns = 200;
    carm.rows = 150;
    carm.pixel_mm = {1.1, 1.3};
    carm.focal_length_mm = 950;
    carm.principal_point_px = {99.5, 74.5};
    for (const double angle : {0.0, 40.0, 110.0, 260.0}) {
        const Rigid3 pose = Rigid3::fromRotationVector({0, 0, 0.2}) * test::orbit(angle, -20, 700);
        Image peer = test::runPlastimatch(scratch / "density.mha", carm, pose, scratch.path()).line_integrals;
        for (float& value : peer.pixels())
            value *= static_cast<float>(test::kMuWater / 1000);
        // Boxes of 1.7 mm against linear interpolation on blobs of 8 mm: (1.7/8)^2/12 = 4e-3 at a peak at most.
        EXPECT_LT(normalizedRms(projector->project(carm, pose), peer), 2e-3) << angle;
    }
}

}  // namespace
}  // namespace fluorocut
