#include "core/cavity/removed_bone.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/geometry/primitives.h"
#include "core/imaging/mesh_projector.h"
#include "core/imaging/standard_views.h"

namespace fluorocut::cavity {
namespace {

struct Setting {
    std::shared_ptr<const Volume> ct;
    TriangleMesh stem;
};

// Water everywhere: 0 HU.
Setting setting() {
    VolumeGrid grid;
    grid.size = {80, 80, 190};
    grid.spacing_mm.setConstant(0.8);
    grid.origin_mm = {-32, -32, -130};
    StemShape shape;
    shape.segments = 24;
    shape.sections = 20;
    return {std::make_shared<Volume>(grid, 0.0f), makeStem(shape)};
}

double sumOf(const Image& image) {
    double sum = 0;
    for (const float pixel : image.pixels())
        sum += pixel;
    return sum;
}

// The way through the resampled cavity against the mesh's own, ray by ray.
TEST(RemovedBone, IsAsLongAsTheWayThroughTheMesh) {
    const Setting all = setting();
    Result<RemovedBone> removed = RemovedBone::prepare(all.ct, all.stem, {}, 2);
    ASSERT_TRUE(removed) << removed.error().message();
    Vector6 off;
    off << 1.3, -0.7, 2.1, 0.05, -0.03, 0.4;
    const Rigid3 pose = Rigid3::identity().perturbed(off);
    CArm carm = standardCArm();
    carm.columns = carm.rows = 256;
    carm.pixel_mm = {0.9, 0.9};
    carm.principal_point_px = {127.5, 127.5};
    const Rigid3 view = standardView(StandardView::ap, {0, 0, -50}, 700);
    const double exact = sumOf(MeshProjector::prepare(all.stem)->project(carm, view * pose, {4}));
    for (const int finer : {1, 2}) {
        ASSERT_TRUE(removed->settle(pose, finer));
        const Result<Removed> there = removed->at(pose);
        ASSERT_TRUE(there);
        const double length = sumOf(there->length.project(carm, view));
        // The fast projector is good to 0.1 % here.
        EXPECT_NEAR(length / exact, 1, 0.003) << finer;
        // Of water, 0.02 /mm.
        EXPECT_NEAR(sumOf(there->bone.project(carm, view)) / length, 0.02, 1e-4) << finer;
    }
}

TEST(RemovedBone, KnowsHowFarTheCavityMayMoveWithinItsPart) {
    const Setting all = setting();
    Result<RemovedBone> removed = RemovedBone::prepare(all.ct, all.stem, {}, 2);
    ASSERT_TRUE(removed);
    ASSERT_TRUE(removed->settle(Rigid3::identity(), 1));
    EXPECT_TRUE(removed->settledFor(Rigid3::fromTranslation({0.5, 0, 0}), 0.5));
    EXPECT_FALSE(removed->settledFor(Rigid3::fromTranslation({6, 0, 0}), 0.5));
}

TEST(RemovedBone, RefusesACavityOutsideTheCt) {
    const Setting all = setting();
    Result<RemovedBone> removed = RemovedBone::prepare(all.ct, all.stem, {}, 2);
    ASSERT_TRUE(removed);
    const Result<void> far = removed->settle(Rigid3::fromTranslation({500, 0, 0}), 1);
    ASSERT_FALSE(far);
    EXPECT_THAT(far.error().message(), ::testing::HasSubstr("lies outside the CT"));
}

}  // namespace
}  // namespace fluorocut::cavity
