#include "core/robot/motion_profile.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/core/robot/motions.h"

namespace fluorocut {
namespace {

constexpr double kAcceleration = 1000;
constexpr double kLever = 100;
// Sums of a few hundred terms in doubles.
constexpr double kRounding = 1e-9;

double timeOf(const CheckedMotion& motion) {
    return SpeedProfile(MotionTrack(motion.steps(), kLever), 0, kAcceleration).duration();
}

TEST(MotionProfile, AStraightMoveTakesTheTrapezoidsTime) {
    for (const double length : {100.0, 10.0, 1.0}) {  // v^2 / a = 0.4 mm
        EXPECT_NEAR(timeOf(motionThrough({Vector3(0, 0, 0), Vector3(0, length, 0)}, 20)),
                    length / 20 + 20 / kAcceleration, kRounding);
    }
    for (const double length : {0.399, 0.1, 0.001}) {
        EXPECT_NEAR(timeOf(motionThrough({Vector3(0, 0, 0), Vector3(0, length, 0)}, 20)),
                    2 * std::sqrt(length / kAcceleration), kRounding);
    }
}

TEST(MotionProfile, ALineInPiecesTakesNoLongerThanWhole) {
    std::vector<Vector3> places;
    for (int i = 0; i <= 300; ++i)
        places.push_back(0.1 * i * Vector3(1, 2, 2) / 3);
    EXPECT_NEAR(timeOf(motionThrough(places, 20)), 30.0 / 20 + 20 / kAcceleration, 1e-6);
}

TEST(MotionProfile, ARightAngleIsTakenFromRestAndAHalfOneSlower) {
    const double one = 10.0 / 20 + 20 / kAcceleration;
    EXPECT_NEAR(timeOf(motionThrough({Vector3(0, 0, 0), Vector3(10, 0, 0), Vector3(10, 10, 0)}, 20)), 2 * one,
                kRounding);
    // Down to 20 cos 45 degrees and up again: each side saves (v_j / a) - v_j^2 / (2 a v).
    const double joint = 20 * std::numbers::sqrt2 / 2, side = 10 / std::numbers::sqrt2;
    const double saved = joint / kAcceleration - joint * joint / (2 * kAcceleration * 20);
    EXPECT_NEAR(timeOf(motionThrough({Vector3(0, 0, 0), Vector3(10, 0, 0), Vector3(10 + side, side, 0)}, 20)),
                2 * (one - saved), kRounding);
}

TEST(MotionProfile, ATurnOnTheSpotTakesTheTimeOfItsLever) {
    const auto turn = tryMotion({{Rigid3(), 20}, {Rigid3::fromRotationVector({0, 0.3, 0}), 20}});
    EXPECT_NEAR(timeOf(*turn), 0.3 * kLever / 20 + 20 / kAcceleration, kRounding);
    const MotionTrack track(turn->steps(), kLever);
    EXPECT_NEAR(track.poseAt(0.25 * track.length()).rotationAngle(), 0.075, kRounding);
}

TEST(MotionProfile, NeitherFeedsNorAccelerationAreExceededOnAnyWay) {
    Random random(3);
    for (int trial = 0; trial < 50; ++trial) {
        std::vector<MotionStep> steps{{Rigid3(), 1}};
        for (int i = 0; i < 40; ++i) {
            const Vector3 way(random.normal(), 0.3 * random.normal(), 0);
            steps.push_back(
                {Rigid3::fromTranslation(steps.back().robot_from_cutter.translation() + way), random.uniform(2, 60)});
        }
        const MotionTrack track(steps, kLever);
        const SpeedProfile profile(track, 0, kAcceleration);
        const double dt = profile.duration() / 5000;
        SpeedProfile::State before = profile.at(0);
        EXPECT_EQ(before.speed_mm_s, 0);
        for (int i = 1; i <= 5000; ++i) {
            const SpeedProfile::State at = profile.at(i * dt);
            ASSERT_GE(at.along_mm, before.along_mm - kRounding);
            ASSERT_LE(std::abs(at.speed_mm_s - before.speed_mm_s), kAcceleration * dt + 1e-6);
            // The way is the speed's integral: a trapezoid's rule is off by at most a dt^2 / 2 where pieces meet.
            ASSERT_NEAR(at.along_mm - before.along_mm, 0.5 * dt * (at.speed_mm_s + before.speed_mm_s),
                        kAcceleration * dt * dt);
            ASSERT_LE(at.speed_mm_s, track.feedOf(track.stepAt(at.along_mm)) + 1e-6);
            before = at;
        }
        EXPECT_NEAR(before.along_mm, track.length(), 1e-6);
        EXPECT_NEAR(before.speed_mm_s, 0, 1e-6);
    }
}

TEST(MotionProfile, GoesOnFromAnywhereAndEndsAtTheEnd) {
    const CheckedMotion motion = motionThrough({Vector3(0, 0, 0), Vector3(10, 0, 0), Vector3(10, 10, 0)}, 20);
    const MotionTrack track(motion.steps(), kLever);
    const SpeedProfile rest(track, 4, kAcceleration);
    EXPECT_EQ(rest.at(0).along_mm, 4);
    EXPECT_NEAR(rest.duration(), 6.0 / 20 + 10.0 / 20 + 2 * 20 / kAcceleration, kRounding);
    EXPECT_EQ(rest.at(1e3).along_mm, 20);
    EXPECT_EQ(SpeedProfile(track, 20, kAcceleration).duration(), 0);
    // A motion that stays where it is has no length and no time.
    const CheckedMotion still = motionThrough({Vector3(1, 2, 3), Vector3(1, 2, 3)}, 20);
    const MotionTrack nowhere(still.steps(), kLever);
    EXPECT_EQ(nowhere.length(), 0);
    EXPECT_EQ(SpeedProfile(nowhere, 0, kAcceleration).duration(), 0);
    EXPECT_EQ(nowhere.poseAt(0).translation(), Vector3(1, 2, 3));
}

}  // namespace
}  // namespace fluorocut
