#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/base/units.h"
#include "core/fiducial/corkscrew/pose_near.h"
#include "tests/core/fiducial/corkscrew_view.h"

namespace fluorocut {
namespace {

using corkscrew::poseNear;
using test::CorkscrewView;

CorkscrewView viewAt(double roll_deg) {
    CorkscrewView view;
    view.layout = *readCorkscrew(std::string(FLUOROCUT_SOURCE_DIR) + "/resources/fiducials/corkscrew.json");
    view.imager_from_corkscrew = {
        Rigid3::fromTwistRollPitch(radiansFromDegrees(40), radiansFromDegrees(roll_deg), radiansFromDegrees(30))
            .rotation(),
        {3, -4, 700}};
    return view;
}

// A rotation by 3 degrees and a shift by 5 mm, of random directions.
Rigid3 disturbed(const Rigid3& pose, Random& random) {
    const auto direction = [&] { return Vector3(random.normal(), random.normal(), random.normal()).normalized(); };
    Vector6 off;
    off.head<3>() = 5 * direction();
    off.tail<3>() = radiansFromDegrees(3) * direction();
    return pose.perturbed(off);
}

TEST(CorkscrewPoseNear, FindsItThreeDegreesAndFiveMillimetresAwayInEitherPolarity) {
    Random random(3);
    for (const double roll_deg : {-50.0, 0.0, 30.0}) {
        CorkscrewView view = viewAt(roll_deg);
        for (const bool bright : {false, true}) {
            view.metal_is_bright = bright;
            const Image image = pictureOf(view);
            for (int trial = 0; trial < 5; ++trial) {
                const auto found =
                    poseNear(image, view.carm, view.layout, disturbed(view.imager_from_corkscrew, random));
                ASSERT_TRUE(found) << roll_deg << ' ' << trial;
                EXPECT_EQ(found->metal_is_bright, bright);
                // Where a fit of the shape finds the right lines at once: half the distance between neighbours.
                const Vector6 off = view.imager_from_corkscrew.deltaFrom(found->imager_from_corkscrew);
                EXPECT_LT(off.head<2>().norm(), 1);
                EXPECT_LT(off.tail<3>().norm(), radiansFromDegrees(2));
            }
        }
    }
}

// The rings fit as well with any twist; the helix says no.
TEST(CorkscrewPoseNear, SendsAnotherTwistToTheSearch) {
    const CorkscrewView view = viewAt(20);
    const Image image = pictureOf(view);
    for (const double twist_deg : {40.0, 120.0, 180.0, -60.0}) {
        const Rigid3 other =
            view.imager_from_corkscrew * Rigid3::fromRotationVector({radiansFromDegrees(twist_deg), 0, 0});
        EXPECT_FALSE(poseNear(image, view.carm, view.layout, other)) << twist_deg;
    }
}

TEST(CorkscrewPoseNear, FindsNothingWhereNoneIs) {
    CorkscrewView view = viewAt(20);
    const Rigid3 behind(view.imager_from_corkscrew.rotation(), {0, 0, -700});
    EXPECT_FALSE(poseNear(pictureOf(view), view.carm, view.layout, behind));
    const Rigid3 outside(view.imager_from_corkscrew.rotation(), {400, 0, 700});
    EXPECT_FALSE(poseNear(pictureOf(view), view.carm, view.layout, outside));
    view.corkscrew = false;
    EXPECT_FALSE(poseNear(pictureOf(view), view.carm, view.layout, view.imager_from_corkscrew));
}

}  // namespace
}  // namespace fluorocut
