#include "core/simulation/cutting.h"

#include <cmath>
#include <numeric>
#include <stdexcept>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/primitives.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

constexpr double kAir = -1000;

// 70 x 70 x 140 mm around the origin, anisotropic voxels, bone-like values that vary from voxel to voxel.
Volume bone() {
    VolumeGrid grid;
    grid.size = {100, 80, 110};
    grid.spacing_mm = {0.7, 0.9, 1.3};
    grid.origin_mm = -0.5 * grid.spacing_mm.cwiseProduct(Vector3(99, 79, 109));
    Random random(3);
    Volume volume(grid);
    for (float& value : volume.voxels())
        value = static_cast<float>(random.uniform(100, 1500));
    return volume;
}

Rigid3 randomPose(Random& random) {
    const Vector3 turn(random.uniform(-3, 3), random.uniform(-3, 3), random.uniform(-3, 3));
    return Rigid3::fromTranslation({random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)}) *
           Rigid3::fromRotationVector(turn);
}

// The promise of the header: partial volumes are exact. 0.2 % is what is asked for; the voxels hold fractions as
// floats, whose rounding errors add up to less than 1e-6 of the volume.
TEST(CutMesh, RemovesTheVolumeOfTheMeshInAnyPose) {
    const Volume ct = bone();
    const TriangleMesh meshes[] = {makeBox({23, 23, 40}), makeSphere(14, 3), makeCylinder(8, 50, 64)};
    Random random(11);
    for (const TriangleMesh& mesh : meshes) {
        for (int trial = 0; trial < 4; ++trial) {
            const auto cut = cutMesh(ct, mesh, randomPose(random));
            ASSERT_OK(cut);
            EXPECT_NEAR(cut->removed_mm3, cut->mesh_mm3, 1e-6 * cut->mesh_mm3);
            EXPECT_EQ(cut->newly_removed_mm3, cut->removed_mm3);
            EXPECT_TRUE(cut->warnings.empty());
        }
    }
}

// A box from the middle of one voxel to a quarter of another: whole voxels are air, partial ones keep their rest.
TEST(CutMesh, KeepsPartialVolumes) {
    VolumeGrid grid;
    grid.size = {8, 8, 8};
    Volume ct(grid, 600.0f);
    // x from 2 (centre of voxel 2: half of it) to 5.25 (three quarters of voxel 5), whole voxels 2..5 along y and z
    const auto cut = cutMesh(ct, makeBox({3.25, 4, 4}), Rigid3::fromTranslation({3.625, 3.5, 3.5}));
    ASSERT_OK(cut);
    const double expected[] = {600, 600, 0.5 * 600 + 0.5 * kAir, kAir, kAir, 0.25 * 600 + 0.75 * kAir, 600, 600};
    for (int i = 0; i < 8; ++i) {
        EXPECT_NEAR(cut->volume(i, 3, 3), expected[i], 1e-3) << i;
        EXPECT_EQ(cut->volume(i, 1, 3), 600) << i;
    }
    EXPECT_EQ(cut->voxels_touched, 4u * 4 * 4);
    EXPECT_NEAR(cut->removed_mm3, 3.25 * 16, 1e-5);
    EXPECT_NEAR(cut->removed_fraction(5, 3, 3), 0.75, 1e-6);
}

TEST(CutMesh, FillsWithFluidWhenAsked) {
    CutOptions options;
    options.fill_hu = 30;
    const auto cut = cutMesh(bone(), makeBox({20, 20, 20}), Rigid3(), options);
    ASSERT_OK(cut);
    EXPECT_FLOAT_EQ(cut->volume(50, 40, 55), 30);
}

TEST(CutMesh, DoesNotCutTheSamePlaceTwice) {
    const Rigid3 pose = Rigid3::fromTwistRollPitch(0.2, 0.3, 0.4);
    const auto first = cutMesh(bone(), makeBox({23, 23, 40}), pose);
    ASSERT_OK(first);
    const auto again = cutMesh(first->volume, makeBox({23, 23, 40}), pose, {}, &first->removed_fraction);
    ASSERT_OK(again);
    EXPECT_EQ(again->newly_removed_mm3, 0);
    EXPECT_EQ(again->removed_mm3, first->removed_mm3);
    EXPECT_EQ(again->volume.voxels(), first->volume.voxels());
}

// The progressive cut: 18, then 23 mm leaves what 23 mm at once leaves. 0.01 HU: floats of 1e3 divided by small rests.
TEST(CutMesh, NestedCutsAreTheLargestAlone) {
    const Volume ct = bone();
    const Rigid3 pose = Rigid3::fromTwistRollPitch(-0.3, 0.1, 0.7);
    const auto small = cutMesh(ct, makeBox({18, 18, 36}), pose);
    ASSERT_OK(small);
    const auto both = cutMesh(small->volume, makeBox({23, 23, 40}), pose, {}, &small->removed_fraction);
    const auto large = cutMesh(ct, makeBox({23, 23, 40}), pose);
    ASSERT_OK(both);
    ASSERT_OK(large);
    EXPECT_NEAR(both->newly_removed_mm3, large->removed_mm3 - small->removed_mm3, 1e-6 * large->removed_mm3);
    double worst = 0;
    for (std::size_t n = 0; n < ct.voxels().size(); ++n)
        worst = std::max(worst, std::abs(double(both->volume.voxels()[n]) - large->volume.voxels()[n]));
    EXPECT_LT(worst, 0.01);
    EXPECT_EQ(both->removed_fraction.voxels(), large->removed_fraction.voxels());
}

// A box swept along its own axis is a longer box; a ball leaves a cylinder with two round ends. 0.2 %: union by maxima
// of fractions, steps of half a voxel.
TEST(CutMesh, SweptMeshRemovesItsPath) {
    const Rigid3 pose = Rigid3::fromTwistRollPitch(0.15, 0.25, 0.35);
    CutOptions options;
    options.sweep_mm = 25;
    const auto box = cutMesh(bone(), makeBox({14, 12, 20}), pose, options);
    ASSERT_OK(box);
    EXPECT_NEAR(box->removed_mm3, 14 * 12 * 45, 0.002 * 14 * 12 * 45);

    const TriangleMesh ball = makeSphere(10, 4);
    const auto swept = cutMesh(bone(), ball, pose, options);
    ASSERT_OK(swept);
    // The inscribed ball's section is a little smaller than the circle's, as is its volume: take the circle of the
    // sphere with the mesh's volume.
    const double radius = std::cbrt(swept->mesh_mm3 / (4.0 / 3 * M_PI));
    const double expected = swept->mesh_mm3 + M_PI * radius * radius * 25;
    EXPECT_NEAR(swept->removed_mm3, expected, 0.002 * expected);
}

TEST(CutMesh, SaysWhatIsWrong) {
    const Volume ct = bone();
    const auto outside = cutMesh(ct, makeBox({5, 5, 5}), Rigid3::fromTranslation({500, 0, 0}));
    ASSERT_FALSE(outside.ok());
    EXPECT_EQ(outside.error().code, ErrorCode::invalidInput);

    TriangleMesh open = makeBox({5, 5, 5});
    open.triangles.pop_back();
    EXPECT_EQ(cutMesh(ct, open, Rigid3()).error().code, ErrorCode::invalidInput);

    CutOptions options;
    options.fill_hu = NAN;
    EXPECT_EQ(cutMesh(ct, makeBox({5, 5, 5}), Rigid3(), options).error().where, "fill_hu");
    options = {};
    options.sweep_direction_in_cavity = {0, 0, 2};
    EXPECT_EQ(cutMesh(ct, makeBox({5, 5, 5}), Rigid3(), options).error().where, "sweep_direction_in_cavity");

    const Volume other(VolumeGrid{{3, 3, 3}});
    EXPECT_THROW((void)cutMesh(ct, makeBox({5, 5, 5}), Rigid3(), {}, &other), std::logic_error);
}

TEST(CutMesh, WarnsWhenPartOfTheMeshIsOutside) {
    const auto cut = cutMesh(bone(), makeBox({20, 20, 20}), Rigid3::fromTranslation({35, 0, 0}));
    ASSERT_OK(cut);
    EXPECT_NEAR(cut->removed_mm3, 0.5 * cut->mesh_mm3, 1e-6 * cut->mesh_mm3);  // the CT ends at x = 35
    ASSERT_EQ(cut->warnings.size(), 1u);
    EXPECT_EQ(cut->warnings[0], "50.0 % of the cavity lies outside the CT and removes nothing");
}

TEST(CutMesh, CanBeCancelled) {
    class Cancelled final : public Progress {
      public:
        void report(double, std::string_view) override {}
        bool isCancelled() const override { return true; }
    } progress;
    EXPECT_TRUE(cutMesh(bone(), makeBox({5, 5, 5}), Rigid3(), {}, nullptr, progress).error().isCancelled());
}

}  // namespace
}  // namespace fluorocut
