#include "core/registration/next_robot_pose.h"

#include <cmath>

#include <gmock/gmock.h>

#include "tests/core/registration/hand_eye_scene.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::HandEyeScene;
using testing::HasSubstr;

HandEyeObservation seenFrom(const HandEyeScene& scene, const Rigid3& robot_from_flange, Random& random) {
    HandEyeObservation one;
    one.name = "image " + std::to_string(scene.observations.size() + 1);
    one.imager = scene.observations[0].imager;
    one.robot_from_flange = robot_from_flange;
    const Rigid3 truth = scene.imager_from_robot[0] * robot_from_flange * scene.flange_from_corkscrew;
    one.covariance = CorkscrewNoise{}.covarianceAt(truth);
    one.imager_from_corkscrew = truth.perturbed(test::drawnFrom(*one.covariance, random));
    return one;
}

struct Course {
    double worst_place_mm = 0, worst_rotation_rad = 0, error_mm = 0;
};

// Three images to begin with, all within 15 degrees; then `more` images, suggested or taken at random within the same
// limits (a turn of 40 degrees about the corkscrew's middle from the first pose, roll within 60 degrees).
Course follow(bool suggested, int more, std::uint64_t seed) {
    Random random(seed);
    test::SceneOptions options;
    options.poses = 3;
    options.turn_rad = radiansFromDegrees(15);
    // A start that turns about two axes.
    HandEyeScene scene = test::handEyeScene(options, random);
    while (!calibrateHandEye(scene.observations))
        scene = test::handEyeScene(options, random);
    const Rigid3 reference = scene.observations[0].robot_from_flange;
    for (int i = 0;; ++i) {
        const Result<HandEyeCalibration> result = calibrateHandEye(scene.observations);
        if (!result) {
            ADD_FAILURE() << result.error().message();
            return {};
        }
        if (i == more) return {result->worst_place_mm, result->worst_rotation_rad, scene.placeError(*result)};
        Rigid3 next = reference;
        if (suggested) {
            const Result<NextPose> found = suggestNextPose(*result, reference, 0);
            if (!found) {
                ADD_FAILURE() << found.error().message();
                return {};
            }
            next = found->robot_from_flange;
        } else {
            const Rigid3& mount = scene.flange_from_corkscrew;
            for (;;) {
                const Vector3 axis = Vector3(random.normal(), random.normal(), random.normal()).normalized();
                const double angle = random.uniform(0, radiansFromDegrees(40));
                next = reference * mount * Rigid3::fromRotationVector(axis * angle) * mount.inverse();
                const Rigid3 seen = scene.imager_from_robot[0] * next * mount;
                if (std::abs(seen.twistRollPitch().y()) <= radiansFromDegrees(60)) break;
            }
        }
        scene.observations.push_back(seenFrom(scene, next, random));
    }
}

TEST(NextRobotPoseTest, FollowingTheSuggestionsBeatsRandomPoses) {
    Course with, without;
    const int trials = 40;
    int better = 0;
    for (int trial = 0; trial < trials; ++trial) {
        const auto seed = static_cast<std::uint64_t>(100 + trial);
        const Course a = follow(true, 4, seed), b = follow(false, 4, seed);
        with.worst_place_mm += a.worst_place_mm / trials;
        with.error_mm += a.error_mm / trials;
        without.worst_place_mm += b.worst_place_mm / trials;
        without.error_mm += b.error_mm / trials;
        better += a.worst_place_mm < b.worst_place_mm;
    }
    RecordProperty("sd_suggested_mm", std::to_string(with.worst_place_mm));
    RecordProperty("sd_random_mm", std::to_string(without.worst_place_mm));
    RecordProperty("error_suggested_mm", std::to_string(with.error_mm));
    RecordProperty("error_random_mm", std::to_string(without.error_mm));
    EXPECT_LT(with.worst_place_mm, 0.6 * without.worst_place_mm);
    EXPECT_LT(with.error_mm, without.error_mm);
    EXPECT_GE(better, 35);
}

// What is foreseen is what the calibration then says, within what the noise moves the weights.
TEST(NextRobotPoseTest, TheForeseenStandardDeviationComesTrue) {
    Random random(7);
    HandEyeScene scene = test::handEyeScene({}, random);
    const Result<HandEyeCalibration> before = calibrateHandEye(scene.observations);
    ASSERT_OK(before);
    const Result<NextPose> next = suggestNextPose(*before, scene.observations[0].robot_from_flange, 0);
    ASSERT_OK(next);
    EXPECT_NEAR(next->place_before_mm, before->worst_place_mm, 1e-12);
    EXPECT_LT(next->place_after_mm, next->place_before_mm);
    scene.observations.push_back(seenFrom(scene, next->robot_from_flange, random));
    const Result<HandEyeCalibration> after = calibrateHandEye(scene.observations);
    ASSERT_OK(after);
    EXPECT_NEAR(next->place_after_mm, after->worst_place_mm, 0.02 * after->worst_place_mm);
    EXPECT_NEAR(next->rotation_after_rad, after->worst_rotation_rad, 0.02 * after->worst_rotation_rad);
    EXPECT_THAT(next->sentence, HasSubstr("turn the flange by"));
}

TEST(NextRobotPoseTest, OnlyPosesWithinTheLimitsAreSuggested) {
    Random random(8);
    const HandEyeScene scene = test::handEyeScene({}, random);
    const Result<HandEyeCalibration> calibration = calibrateHandEye(scene.observations);
    ASSERT_OK(calibration);
    const Rigid3 reference = scene.observations[0].robot_from_flange;
    NextPoseOptions options;
    options.most_turn_rad = 0.2;
    options.most_roll_rad = 0.5;
    const Result<NextPose> next = suggestNextPose(*calibration, reference, 0, {}, options);
    ASSERT_OK(next);
    EXPECT_LE((next->robot_from_flange * reference.inverse()).rotationAngle(), 0.2 + 1e-6);
    EXPECT_LE(std::abs(next->imager_from_corkscrew.twistRollPitch().y()), 0.5);
    // A pose far from view.
    options.candidates = {Rigid3::fromTranslation({500, 0, 0}) * reference};
    const Result<NextPose> none = suggestNextPose(*calibration, reference, 0, {}, options);
    ASSERT_FALSE(none);
    EXPECT_THAT(none.error().message(), HasSubstr("in view"));
}

}  // namespace
}  // namespace fluorocut
