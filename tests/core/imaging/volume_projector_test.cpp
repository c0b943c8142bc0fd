#include "core/imaging/volume_projector.h"

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

#include "core/imaging/slab/slab_kernels.h"
#include "tests/core/imaging/blob_volumes.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::Blob;
using test::blobIntegrals;
using test::centeredGrid;
using test::makeBlobs;
using test::makeVolume;
using test::normalizedRms;
using test::orbit;

constexpr ProjectionOptions kExact{ProjectionMethod::exact, 1, std::nullopt};

VolumeProjector prepared(const std::shared_ptr<const Volume>& volume) {
    Result<VolumeProjector> projector = VolumeProjector::prepare(volume);
    if (!projector) throw std::runtime_error(projector.error().message());
    return std::move(projector).value();
}

CArm smallCArm(int pixels = 128, double field_mm = 400) {
    CArm carm;
    carm.columns = carm.rows = pixels;
    carm.pixel_mm = Vector2::Constant(field_mm / pixels);
    carm.principal_point_px = Vector2::Constant(0.5 * (pixels - 1));
    return carm;
}

std::shared_ptr<const Volume> noiseVolume(const VolumeGrid& grid, std::uint64_t seed = 1) {
    auto volume = std::make_shared<Volume>(grid);
    Random random(seed);
    for (float& hu : volume->voxels())
        hu = static_cast<float>(random.uniform(-1000, 1500));
    return volume;
}

const std::vector<Blob> kBlobs{{{7.3, -11.7, 4.9}, 20, 10000}};

// The gate of the whole engine, at the size it is stated for: 512 x 512 from 256^3, normalised RMS error <= 1e-4.
TEST(VolumeProjector, FastIsWithinOneTenThousandthOfTheClosedFormFromAnyDirection) {
    const VolumeProjector projector = prepared(makeBlobs(centeredGrid({256, 256, 256}, {1, 1, 1}), kBlobs));
    CArm carm;
    carm.pixel_mm = {0.8, 0.8};
    for (const Vector2& angles :
         {Vector2(0, 0), Vector2(90, 0), Vector2(0, 90), Vector2(45, 0), Vector2(45, 35.26), Vector2(-135, -35.26),
          Vector2(5, 12), Vector2(185, 20), Vector2(60, -50), Vector2(275, 3), Vector2(30, 75), Vector2(200, -85)}) {
        const Rigid3 pose = orbit(angles.x(), angles.y());
        const Image closed_form = blobIntegrals(kBlobs, carm, pose);
        EXPECT_LT(normalizedRms(projector.project(carm, pose), closed_form), 1e-4) << angles.transpose();
        // Whichever main axis is held, within its reach, the image is nearly the same.
        for (int axis = 0; axis < 3; ++axis) {
            if (std::abs(pose.inverse().rotate(Vector3::UnitZ())[axis]) < 0.65) continue;
            const ProjectionOptions held{ProjectionMethod::fast, 1, axis};
            EXPECT_LT(normalizedRms(projector.project(carm, pose, held), closed_form), 1.5e-4)
                << angles.transpose() << " axis " << axis;
        }
    }
}

// Against brute force: 20,000 samples of the zero-padded trilinear interpolant per ray.
TEST(VolumeProjector, ExactIsTheIntegralOfTheTrilinearInterpolant) {
    VolumeGrid grid = centeredGrid({17, 13, 11}, {1.5, 2, 3}, Rigid3::fromTwistRollPitch(0.2, -0.5, 1.1));
    const auto volume = noiseVolume(grid);
    VolumeGrid padded_grid = grid;
    padded_grid.size = {19, 15, 13};
    padded_grid.origin_mm = grid.pointFromIndex({-1, -1, -1});
    Volume padded(padded_grid, -1000);
    for (int k = 0; k < 11; ++k)
        for (int j = 0; j < 13; ++j)
            for (int i = 0; i < 17; ++i)
                padded(i + 1, j + 1, k + 1) = (*volume)(i, j, k);

    const VolumeProjector projector = prepared(volume);
    CArm carm = smallCArm(12, 70);
    const Rigid3 pose = orbit(33, 21, 600);
    const Image image = projector.project(carm, pose, kExact);
    const Rigid3 volume_from_imager = pose.inverse();
    for (int y = 0; y < carm.rows; ++y) {
        for (int x = 0; x < carm.columns; ++x) {
            const Vector3 end = carm.detectorPoint(Vector2(x, y));
            const int samples = 20000;
            double sum = 0;
            for (int s = 0; s < samples; ++s) {
                const double t = 0.45 + 0.3 * (s + 0.5) / samples;  // from 450 to 750 mm of 1000
                const Vector3 point = volume_from_imager * Vector3(t * end);
                sum += (sampleLinear(padded, padded_grid.indexFromPoint(point), -1000) + 1000) * 0.02 / 1000;
            }
            // The midpoint rule's error on piecewise smooth values, 0.015 mm steps through about 30 mm.
            EXPECT_NEAR(image(x, y), sum * 0.3 * end.norm() / samples, 2e-5) << x << " " << y;
        }
    }
}

TEST(VolumeProjector, AnisotropicObliqueLeftHandedVolumesAreInTheirPlace) {
    VolumeGrid grid = centeredGrid({150, 110, 60}, {0.7, 1.1, 2.5}, Rigid3::fromTwistRollPitch(0.4, 0.3, -1.2));
    grid.direction.col(1) *= -1;
    grid.origin_mm += Vector3(5, -7, 9);
    const std::vector<Blob> blobs{{grid.center() + Vector3(3, 4, -5), 9, 3000},
                                  {grid.center() + Vector3(-12, 8, 6), 7, 2000}};
    const VolumeProjector projector = prepared(makeBlobs(grid, blobs));
    const CArm carm = smallCArm(160, 250);
    for (const Vector2& angles : {Vector2(0, 0), Vector2(70, 10), Vector2(130, -40), Vector2(20, 80)}) {
        const Rigid3 pose = orbit(angles.x(), angles.y());
        const Image closed_form = blobIntegrals(blobs, carm, pose);
        // 2.5 mm voxels and a sigma of 7 mm: linear interpolation alone loses (2.5/7)^2/24 of the peak.
        EXPECT_LT(normalizedRms(projector.project(carm, pose), closed_form), 1e-3) << angles.transpose();
        EXPECT_LT(normalizedRms(projector.project(carm, pose, kExact), closed_form), 1.5e-3) << angles.transpose();
    }
}

// Half-line integrals of a blob, from a source inside the volume, outside but near it, and far.
TEST(VolumeProjector, TheSourceMayBeNearOrInsideTheVolume) {
    const Blob blob{{4, 45, -3}, 12, 5000};
    const VolumeProjector projector = prepared(makeBlobs(centeredGrid({200, 200, 200}, {1, 1, 1}), {blob}));
    CArm carm = smallCArm(128, 400);
    carm.focal_length_mm = 400;
    for (const double source_to_center : {-10.0, 0.0, 0.37, 40.0, 99.5, 101.0, 130.0}) {
        const Rigid3 pose = orbit(0, 0, source_to_center);
        Image closed_form(carm.columns, carm.rows);
        const Vector3 center = pose * blob.center;
        for (int y = 0; y < carm.rows; ++y) {
            for (int x = 0; x < carm.columns; ++x) {
                const Vector3 direction = carm.rayDirection(Vector2(x, y));
                const double along = center.dot(direction), across2 = center.squaredNorm() - along * along;
                closed_form(x, y) =
                    static_cast<float>(test::kMuWater / 1000 * blob.hu * blob.sigma_mm * std::sqrt(2 * M_PI) *
                                       std::exp(-across2 / (2 * blob.sigma_mm * blob.sigma_mm)) * 0.5 *
                                       (1 + std::erf(along / (blob.sigma_mm * std::sqrt(2.0)))));
            }
        }
        // Trilinear interpolation of 1 mm voxels takes (1/6) / 12^2 = 1.2e-3 off the blob's peak.
        EXPECT_LT(normalizedRms(projector.project(carm, pose, kExact), closed_form), 6e-4) << source_to_center;
        // Rays up to 45 degrees from the main axis here, and a first slice that lies partly behind the source.
        EXPECT_LT(normalizedRms(projector.project(carm, pose), closed_form), 6e-4) << source_to_center;
    }
}

TEST(VolumeProjector, WideConesFallBackToTheExactPathAndStayRight) {
    const Blob blob{{0, 0, 0}, 12, 3000};
    const VolumeProjector projector = prepared(makeBlobs(centeredGrid({100, 100, 100}, {1, 1, 1}), {blob}));
    CArm carm = smallCArm(64, 3000);  // 1500 mm to each side at 200 mm: 82 degrees
    carm.focal_length_mm = 200;
    const Rigid3 pose = orbit(40, 0, 90);
    EXPECT_LT(normalizedRms(projector.project(carm, pose), blobIntegrals({blob}, carm, pose)), 2e-4);
}

// Rays end at the detector: a volume that reaches through its plane is seen up to there.
TEST(VolumeProjector, TheDetectorMayStandInsideTheVolume) {
    const Blob blob{{4, 5, -3}, 12, 5000};
    const VolumeProjector projector = prepared(makeBlobs(centeredGrid({120, 120, 120}, {1, 1, 1}), {blob}));
    CArm carm = smallCArm(64, 100);
    const Rigid3 pose = orbit(20, 10, 995);  // the middle of the blob is about where the detector is
    Image closed_form(carm.columns, carm.rows);
    const Vector3 center = pose * blob.center;
    for (int y = 0; y < carm.rows; ++y) {
        for (int x = 0; x < carm.columns; ++x) {
            const Vector3 end = carm.detectorPoint(Vector2(x, y)), direction = end.normalized();
            const double along = center.dot(direction), across2 = center.squaredNorm() - along * along;
            closed_form(x, y) =
                static_cast<float>(test::kMuWater / 1000 * blob.hu * blob.sigma_mm * std::sqrt(2 * M_PI) *
                                   std::exp(-across2 / (2 * blob.sigma_mm * blob.sigma_mm)) * 0.5 *
                                   (1 + std::erf((end.norm() - along) / (blob.sigma_mm * std::sqrt(2.0)))));
        }
    }
    EXPECT_LT(normalizedRms(projector.project(carm, pose), closed_form), 1e-3);  // interpolation: (1/6) / 12^2
}

// Joseph's rule and the exact integral of the interpolant differ most where neighbours are independent and rays run
// diagonally: up to 1.0e-2 of the largest value on this volume, 4e-3 along an axis.
TEST(VolumeProjector, FastAndExactAgreeEvenOnWhiteNoise) {
    const VolumeProjector projector = prepared(noiseVolume(centeredGrid({96, 96, 96}, {1, 1, 1})));
    const CArm carm = smallCArm(128, 180);
    for (const double angle : {0.0, 20.0, 45.0, 90.0, 200.0}) {
        const Rigid3 pose = orbit(angle, 15);
        EXPECT_LT(normalizedRms(projector.project(carm, pose), projector.project(carm, pose, kExact)), 1.2e-2) << angle;
    }
}

// Renaming the axes of a volume and turning the view with them changes nothing: the three orientations' code paths,
// seen against each other on noise.
TEST(VolumeProjector, AllThreeMainAxesAreTheSameProjector) {
    const VolumeGrid grid = centeredGrid({40, 40, 40}, {1, 1, 1});
    const auto volume = noiseVolume(grid);
    auto permuted = std::make_shared<Volume>(grid);
    for (int k = 0; k < 40; ++k)
        for (int j = 0; j < 40; ++j)
            for (int i = 0; i < 40; ++i)
                (*permuted)(j, k, i) = (*volume)(i, j, k);
    Matrix3 turn;  // the point (i, j, k) is now at (j, k, i)
    turn << 0, 1, 0, 0, 0, 1, 1, 0, 0;
    const Rigid3 permuted_from_volume(turn, Vector3::Zero());
    const VolumeProjector a = prepared(volume), b = prepared(permuted);
    const CArm carm = smallCArm(96, 90);
    for (const Vector2& angles : {Vector2(3, 5), Vector2(95, 8), Vector2(20, 80)}) {
        const Rigid3 pose = orbit(angles.x(), angles.y());
        const Rigid3 turned = pose * permuted_from_volume.inverse();
        EXPECT_EQ((a.mainAxis(carm, pose) + 2) % 3, b.mainAxis(carm, turned));
        EXPECT_LT(normalizedRms(a.project(carm, pose), b.project(carm, turned)), 2e-5) << angles.transpose();
        EXPECT_LT(normalizedRms(a.project(carm, pose, kExact), b.project(carm, turned, kExact)), 1e-6);
    }
}

TEST(VolumeProjector, IsLinearInAttenuation) {
    const VolumeGrid grid = centeredGrid({30, 32, 34}, {1.2, 1, 0.9});
    const auto a = noiseVolume(grid, 1), b = noiseVolume(grid, 2);
    auto sum = std::make_shared<Volume>(grid);
    for (std::size_t i = 0; i < sum->voxels().size(); ++i) {
        sum->voxels()[i] = a->voxels()[i] + b->voxels()[i] + 1000;
    }
    const CArm carm = smallCArm(64, 80);
    const Rigid3 pose = orbit(25, 30);
    for (const ProjectionOptions& options : {ProjectionOptions{}, kExact}) {
        const Image pa = prepared(a).project(carm, pose, options), pb = prepared(b).project(carm, pose, options);
        Image expected(carm.columns, carm.rows);
        for (std::size_t i = 0; i < expected.size(); ++i)
            expected.pixels()[i] = pa.pixels()[i] + pb.pixels()[i];
        EXPECT_LT(normalizedRms(prepared(sum).project(carm, pose, options), expected), 3e-5);
    }
}

// The projector's adjoint test needs no adjoint code: the sum over the image of w * P(volume) is linear in each voxel,
// and by symmetry equals the sum over voxels of volume * P'(w), P' from the responses of single voxels.
TEST(VolumeProjector, SingleVoxelsAddUpToTheWhole) {
    const VolumeGrid grid = centeredGrid({3, 3, 3}, {4, 4, 4});
    const auto volume = noiseVolume(grid);
    const CArm carm = smallCArm(48, 40);
    const Rigid3 pose = orbit(18, -12);
    const Image whole = prepared(volume).project(carm, pose, kExact);
    Image sum(carm.columns, carm.rows);
    for (std::size_t v = 0; v < volume->voxels().size(); ++v) {
        auto one = std::make_shared<Volume>(grid, -1000.0f);
        one->voxels()[v] = volume->voxels()[v];
        const Image response = prepared(one).project(carm, pose, kExact);
        for (std::size_t i = 0; i < sum.size(); ++i)
            sum.pixels()[i] += response.pixels()[i];
    }
    EXPECT_LT(normalizedRms(sum, whole), 1e-6);
}

TEST(VolumeProjector, DerivativesAreThoseOfTheClosedForm) {
    const std::vector<Blob> blobs{{{7.3, -5.7, 4.9}, 10, 4000}, {{-10, 5, -12}, 8, 3000}};
    const VolumeProjector projector = prepared(
        makeBlobs(centeredGrid({140, 150, 160}, {0.9, 0.8, 0.7}, Rigid3::fromTwistRollPitch(0.1, 0.2, 0.3)), blobs));
    const CArm carm = smallCArm(128, 250);
    for (const Vector2& angles : {Vector2(0, 0), Vector2(50, 10), Vector2(100, -30), Vector2(10, 85)}) {
        const Rigid3 pose = orbit(angles.x(), angles.y());
        const ProjectionWithGradient result = projector.projectWithGradient(carm, pose);
        EXPECT_LT(normalizedRms(result.image, projector.project(carm, pose)), 1e-6) << "without derivatives";
        for (int k = 0; k < 6; ++k) {
            // A step whose rounding (1e-7 of the image) and curvature (step^2 / sigma^2) are both below 1e-4.
            const double step = k < 3 ? 0.1 : 0.1 / 650;
            const Vector6 delta = step * Vector6::Unit(k);
            const Image ahead = blobIntegrals(blobs, carm, pose.perturbed(delta));
            const Image behind = blobIntegrals(blobs, carm, pose.perturbed(-delta));
            Image expected(carm.columns, carm.rows);
            for (std::size_t i = 0; i < expected.size(); ++i) {
                expected.pixels()[i] = static_cast<float>((ahead.pixels()[i] - behind.pixels()[i]) / (2 * step));
            }
            // Interpolation of 0.9 mm voxels takes up to 3/2 (0.81/6) / 8^2 = 3.2e-3 off a derivative's peak.
            EXPECT_LT(normalizedRms(result.gradient[static_cast<std::size_t>(k)], expected), 3.5e-3)
                << angles.transpose() << " parameter " << k;
        }
    }
}

// On structure as fine as the voxels the derivative of the fast image points where the exact image's differences do.
TEST(VolumeProjector, DerivativesFollowTheImageOnFineStructure) {
    const VolumeProjector projector = prepared(noiseVolume(centeredGrid({64, 64, 64}, {1, 1, 1})));
    const CArm carm = smallCArm(96, 120);
    const Rigid3 pose = orbit(17, 9);
    const ProjectionWithGradient result = projector.projectWithGradient(carm, pose);
    for (int k = 0; k < 6; ++k) {
        const double step = k < 3 ? 0.2 : 0.2 / 650;
        const Vector6 delta = step * Vector6::Unit(k);
        const Image ahead = projector.project(carm, pose.perturbed(delta), kExact);
        const Image behind = projector.project(carm, pose.perturbed(-delta), kExact);
        double dot = 0, own2 = 0, other2 = 0;
        for (std::size_t i = 0; i < ahead.size(); ++i) {
            const double expected = (ahead.pixels()[i] - behind.pixels()[i]) / (2 * step);
            const double own = result.gradient[static_cast<std::size_t>(k)].pixels()[i];
            dot += expected * own;
            own2 += own * own;
            other2 += expected * expected;
        }
        EXPECT_GT(dot / std::sqrt(own2 * other2), 0.95) << "parameter " << k;
    }
}

TEST(VolumeProjector, BinnedPixelsAreMeansOfTheFullImage) {
    const VolumeProjector projector =
        prepared(makeBlobs(centeredGrid({128, 128, 128}, {1, 1, 1}), {{{3, 4, 5}, 12, 4000}}));
    const CArm carm = smallCArm(256, 200);
    const Rigid3 pose = orbit(30, 10);
    const Image full = projector.project(carm, pose);
    for (const int binning : {2, 4, 8}) {
        const Image binned = projector.project(carm, pose, {ProjectionMethod::fast, binning, {}});
        const ProjectionWithGradient with_gradient =
            projector.projectWithGradient(carm, pose, {ProjectionMethod::fast, binning, {}});
        Image expected(carm.columns / binning, carm.rows / binning);
        for (int y = 0; y < expected.height(); ++y) {
            for (int x = 0; x < expected.width(); ++x) {
                double sum = 0;
                for (int i = 0; i < binning * binning; ++i)
                    sum += full(x * binning + i % binning, y * binning + i / binning);
                expected(x, y) = static_cast<float>(sum / (binning * binning));
            }
        }
        EXPECT_EQ(binned.width(), expected.width());
        EXPECT_LT(normalizedRms(binned, expected), 1e-4) << binning;
        EXPECT_LT(normalizedRms(with_gradient.image, expected), 1e-4) << binning;
        EXPECT_EQ(with_gradient.gradient[5].width(), expected.width());
    }
}

TEST(VolumeProjector, ARegionOfInterestIsTheSamePartOfTheFullImage) {
    const VolumeProjector projector = prepared(noiseVolume(centeredGrid({80, 80, 80}, {1, 1, 1})));
    const CArm carm = smallCArm(200, 200);
    const Rigid3 pose = orbit(12, 34);
    const Image full = projector.project(carm, pose);
    const Image part = projector.project(carm.cropped(60, 80, 50, 33), pose);
    Image expected(50, 33);
    for (int y = 0; y < 33; ++y)
        for (int x = 0; x < 50; ++x)
            expected(x, y) = full(x + 60, y + 80);
    EXPECT_LT(normalizedRms(part, expected), 1e-5);  // float32 positions relative to another origin
}

class Barrel final : public Distortion {
  public:
    Vector2 distorted(const Vector2& p) const override { return p * (1 - 1e-6 * p.squaredNorm()); }
    Vector2 undistorted(const Vector2& p) const override {
        Vector2 q = p;
        for (int i = 0; i < 30; ++i)
            q = p / (1 - 1e-6 * q.squaredNorm());
        return q;
    }
};

TEST(VolumeProjector, ADistortedImagerIsProjectedInItsOwnPixels) {
    const std::vector<Blob> blobs{{{12, -15, 10}, 10, 4000}};
    const VolumeProjector projector = prepared(makeBlobs(centeredGrid({128, 128, 128}, {1, 1, 1}), blobs));
    CArm carm = smallCArm(160, 200);
    carm.distortion = std::make_shared<Barrel>();
    const Rigid3 pose = orbit(30, 10);
    const Image closed_form = blobIntegrals(blobs, carm, pose);
    ASSERT_GT(normalizedRms(blobIntegrals(blobs, carm.ideal(), pose), closed_form), 5e-4)
        << "a distortion that matters";
    EXPECT_LT(normalizedRms(projector.project(carm, pose), closed_form), 1e-4);
    EXPECT_LT(normalizedRms(projector.project(carm, pose, kExact), closed_form), 2e-4);
    EXPECT_EQ(projector.project(carm, pose, {ProjectionMethod::fast, 4, {}}).width(), 40);
}

TEST(VolumeProjector, DoesNotDependOnTheNumberOfThreads) {
    const VolumeProjector projector = prepared(noiseVolume(centeredGrid({70, 60, 50}, {1, 1, 1})));
    const CArm carm = smallCArm(100, 150);
    const Rigid3 pose = orbit(50, 20);
    const ProjectionWithGradient many = projector.projectWithGradient(carm, pose);
    const Image many_exact = projector.project(carm, pose, kExact);
    const ThreadLimit one(1);
    const ProjectionWithGradient single = projector.projectWithGradient(carm, pose);
    EXPECT_EQ(many.image, single.image);
    EXPECT_EQ(many.gradient, single.gradient);
    EXPECT_EQ(many_exact, projector.project(carm, pose, kExact));
}

TEST(VolumeProjector, EmptySpaceAroundAnObjectChangesNothing) {
    const std::vector<Blob> blobs{{{2, -3, 4}, 5, 4000}};  // gone (below 1e-7 of a HU) 33 mm away
    const CArm carm = smallCArm(128, 150);
    const Rigid3 pose = orbit(75, 5);
    const VolumeProjector tight = prepared(makeBlobs(centeredGrid({80, 80, 80}, {1, 1, 1}), blobs));
    const VolumeProjector roomy = prepared(makeBlobs(centeredGrid({200, 200, 200}, {1, 1, 1}), blobs));
    EXPECT_LT(normalizedRms(roomy.project(carm, pose), tight.project(carm, pose)), 1e-6);
    EXPECT_LT(normalizedRms(roomy.project(carm, pose, kExact), tight.project(carm, pose, kExact)), 1e-6);
}

TEST(VolumeProjector, AirAndViewsPastTheVolumeAreZero) {
    const VolumeGrid grid = centeredGrid({20, 20, 20}, {1, 1, 1});
    const CArm carm = smallCArm(32, 60);
    const Image zero(32, 32);
    const VolumeProjector air = prepared(std::make_shared<Volume>(grid, -1000.0f));
    EXPECT_EQ(air.project(carm, orbit(10, 10)), zero);
    EXPECT_EQ(air.project(carm, orbit(10, 10), kExact), zero);
    const VolumeProjector noise = prepared(noiseVolume(grid));
    const Rigid3 behind = orbit(10, 10, -200), beside = Rigid3::fromTranslation({400, 0, 0}) * orbit(10, 10);
    for (const Rigid3& pose : {behind, beside}) {
        EXPECT_EQ(noise.project(carm, pose), zero);
        EXPECT_EQ(noise.project(carm, pose, kExact), zero);
        EXPECT_EQ(noise.projectWithGradient(carm, pose).gradient[3], zero);
    }
}

// One voxel of 2 mm: a ray through its centre along an axis meets a triangle of base 4 mm and height mu.
TEST(VolumeProjector, VolumesOneVoxelThickAreVolumes) {
    auto one = std::make_shared<Volume>(centeredGrid({1, 1, 1}, {2, 2, 2}), 1000.0f);
    CArm carm = smallCArm(3, 0.3);
    const double expected = 0.02 * 2 * 2;  // mu of 1000 HU, 2 mm
    EXPECT_NEAR(prepared(one).project(carm, orbit(0, 0), kExact)(1, 1), expected, 1e-6);
    auto slice = std::make_shared<Volume>(centeredGrid({50, 50, 1}, {1, 1, 2}), 0.0f);
    EXPECT_NEAR(prepared(slice).project(carm, orbit(0, 90), kExact)(1, 1), 0.04, 1e-6);
    EXPECT_NEAR(prepared(slice).project(carm, orbit(0, 90))(1, 1), 0.04, 1e-5);
}

TEST(VolumeProjector, LineIntegralsAreNeverNegative) {
    const VolumeProjector projector = prepared(makeVolume(centeredGrid({60, 60, 60}, {1, 1, 1}), [](const Vector3& p) {
        return p.cwiseAbs().maxCoeff() < 20 ? 2000.0 : -1000.0;  // a cube in air: the sharpest edges there are
    }));
    const CArm carm = smallCArm(200, 120);
    for (const Vector2& angles : {Vector2(0, 0), Vector2(30, 20)}) {
        const Rigid3 pose = orbit(angles.x(), angles.y());
        const Image image = projector.project(carm, pose);
        EXPECT_EQ(*std::min_element(image.pixels().begin(), image.pixels().end()), 0.0f);
        const Image with_gradient = projector.projectWithGradient(carm, pose).image;
        EXPECT_EQ(*std::min_element(with_gradient.pixels().begin(), with_gradient.pixels().end()), 0.0f);
    }
}

TEST(VolumeProjector, NoisyAirIsSkippedOnRequest) {
    auto volume = std::make_shared<Volume>(centeredGrid({20, 20, 20}, {1, 1, 1}), -980.0f);
    (*volume)(10, 10, 10) = 500;
    const Result<VolumeProjector> with = VolumeProjector::prepare(volume, {0.02, -1000});
    const Result<VolumeProjector> without = VolumeProjector::prepare(volume, {0.02, -950});
    ASSERT_OK(with);
    ASSERT_OK(without);
    const CArm carm = smallCArm(33, 40);
    EXPECT_GT(with->project(carm, orbit(0, 0))(4, 4), 1e-3f);
    EXPECT_EQ(without->project(carm, orbit(0, 0))(4, 4), 0);
}

TEST(VolumeProjector, RefusesWhatItCannotAnswerFor) {
    auto volume = std::make_shared<Volume>(centeredGrid({4, 4, 4}, {1, 1, 1}), 0.0f);
    EXPECT_FALSE(VolumeProjector::prepare(volume, {0, -1000}).ok());
    EXPECT_FALSE(VolumeProjector::prepare(volume, {NAN, -1000}).ok());
    EXPECT_FALSE(VolumeProjector::prepare(volume, {0.02, -2000}).ok());
    EXPECT_THROW((void)prepared(volume).project(smallCArm(), orbit(0, 0), {ProjectionMethod::fast, 3, {}}),
                 std::logic_error);
    for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        auto broken = std::make_shared<Volume>(*volume);
        (*broken)(1, 2, 3) = bad;
        const Result<VolumeProjector> result = VolumeProjector::prepare(broken);
        ASSERT_FALSE(result.ok());
        EXPECT_EQ(result.error().code, ErrorCode::invalidInput);
    }
}

}  // namespace
}  // namespace fluorocut
