#include "core/cavity/without_ct.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/cavity/tube_phantom.h"

namespace fluorocut {
namespace {

using test::tubePhantom;
using test::tubeScene;

Rigid3 offset() {
    return Rigid3::fromTranslation({1.5, -1, 1}) *
           Rigid3::fromTwistRollPitch(radiansFromDegrees(2), radiansFromDegrees(-1.5), radiansFromDegrees(3));
}

Vector6 poseWay(double part) {
    Vector6 way;
    way << 9, -12, 8, radiansFromDegrees(1.5), radiansFromDegrees(-2), radiansFromDegrees(2);
    return part * way;
}

Result<CavityLocation> locate(const std::vector<CavityView>& views) {
    CavityLocationOptions options;
    options.view_pose = {0.1, 0.5, radiansFromDegrees(0.1)};
    return locateCavity(views, tubePhantom().stem, tubePhantom().planned, nullptr, options);
}

struct Off {
    double mm, degrees, yaw;
};
Off offOf(const CavityLocation& found, const Rigid3& truth) {
    const Rigid3 off = truth.inverse() * found.femur_from_cavity.target_from_source;
    return {(off * tubePhantom().middle - tubePhantom().middle).norm(), degreesFromRadians(off.rotationAngle()),
            degreesFromRadians(logRotation(off.rotation()).z())};
}

// From the same poses the difference holds the cavity alone.
TEST(WithoutCt, SamePosesTellAll) {
    const test::TubeScene scene = tubeScene(offset(), poseWay(0));
    const Result<CavityLocation> found = locate(scene.views);
    ASSERT_TRUE(found) << found.error().message();
    const Off off = offOf(*found, scene.truth);
    EXPECT_LT(off.mm, 0.15);
    EXPECT_LT(off.degrees, 1);  // 3 about the stem's axis, of which the paper's method finds nothing
    for (const ViewResidual& view : found->views)
        EXPECT_LT(view.contour_px, 4);
}

TEST(WithoutCt, OtherPosesTellLess) {
    const test::TubeScene scene = tubeScene(offset(), poseWay(1));
    const Result<CavityLocation> found = locate(scene.views);
    ASSERT_TRUE(found) << found.error().message();
    const Off off = offOf(*found, scene.truth);
    EXPECT_LT(off.mm, 0.4);
    EXPECT_LT(std::abs(off.yaw), 2);
    const Vector6 error = found->femur_from_cavity.target_from_source.deltaFrom(scene.truth);
    EXPECT_LT(error.dot(found->femur_from_cavity.covariance->ldlt().solve(error)), 16.8);  // 99 % of chi-square's
}

TEST(WithoutCt, AcceptsNothingWhereNothingWasCutSlow) {
    test::TubeScene scene = tubeScene(offset(), poseWay(1));
    std::vector<CavityView> swapped = scene.views, uncut = scene.views;
    for (CavityView& view : swapped) {
        std::swap(view.before, view.after);
        std::swap(view.before_imager_from_femur, view.after_imager_from_femur);
    }
    for (CavityView& view : uncut) {
        view.after = view.before;
        view.after_imager_from_femur = view.before_imager_from_femur;
    }
    for (const auto& views : {swapped, uncut}) {
        const Result<CavityLocation> found = locate(views);
        if (found) {
            EXPECT_FALSE(accepted(found->acceptance));
        }
    }
}

}  // namespace
}  // namespace fluorocut
