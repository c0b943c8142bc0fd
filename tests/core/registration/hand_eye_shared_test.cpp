// The fiducial's dimensions, the focal length and the image centre estimated with the mount.
#include <cmath>

#include <gtest/gtest.h>

#include "core/registration/hand_eye.h"
#include "tests/core/registration/corkscrew_points.h"
#include "tests/core/registration/hand_eye_scene.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::CorkscrewPoints;
using test::HandEyeScene;

struct Trial {
    HandEyeScene scene;
    Eigen::VectorXd truth;              // of the shared parameters
    std::vector<Eigen::VectorXd> seen;  // of each image
};

// A corkscrew made with errors of 0.05 mm, a C-arm calibrated within 0.1 % and 1 px; the fits take both as they should
// be.
Trial trial(int poses, Random& random, double dimension_mm = 0.05) {
    Trial result;
    test::SceneOptions options;
    options.noise.reset();
    options.poses = poses;
    result.scene = test::handEyeScene(options, random);
    const SharedPrior prior = CorkscrewPoints::prior(0.001, 1, dimension_mm);
    result.truth = prior.mean;
    for (Eigen::Index i = 0; i < prior.size(); ++i)
        result.truth[i] += prior.sigma[i] * random.normal();
    for (HandEyeObservation& one : result.scene.observations) {
        result.seen.push_back(CorkscrewPoints::observe(one.imager_from_corkscrew, result.truth, random));
        one.evidence = CorkscrewPoints::fit(result.seen.back(), one.imager_from_corkscrew, prior.mean);
        one.imager_from_corkscrew = one.evidence->target_from_source;
    }
    return result;
}

HandEyeOptions jointly(const Trial& trial, double dimension_mm = 0.05) {
    HandEyeOptions options;
    options.shared = CorkscrewPoints::prior(0.001, 1, dimension_mm);
    options.relinearise = [&trial](std::size_t i, const Rigid3& pose,
                                   const Eigen::VectorXd& shared) -> Result<PoseEvidence> {
        return CorkscrewPoints::fit(trial.seen[i], pose, shared);
    };
    return options;
}

// Where the imager believes the corkscrew's region to be: what does not depend on where "the middle of the corkscrew"
// is said to lie, which errors of its dimensions move along.
Vector3 imagerError(const Trial& trial, const HandEyeCalibration& result) {
    const Vector3 place =
        trial.scene.observations[0].robot_from_flange * trial.scene.flange_from_corkscrew * Vector3::Zero();
    return result.imagers[0].imager_from_robot.target_from_source * place - trial.scene.imager_from_robot[0] * place;
}

TEST(HandEyeSharedTest, ErrorsOfManufactureAreEstimatedWithTheMount) {
    Random random(1);
    double alone_depth = 0, joint_depth = 0, image_depth = 0, before_mm = 0, after_mm = 0;
    const int trials = 40;
    for (int t = 0; t < trials; ++t) {
        const Trial one = trial(8, random);
        // Dimensions and C-arm taken as exact: what each image says alone, with its own small noise.
        HandEyeOptions alone;
        alone.shared = CorkscrewPoints::prior(0, 0, 0);
        const Result<HandEyeCalibration> taken = calibrateHandEye(one.scene.observations, alone);
        const Result<HandEyeCalibration> joint = calibrateHandEye(one.scene.observations, jointly(one));
        ASSERT_OK(joint);
        ASSERT_OK(taken);
        alone_depth += std::abs(imagerError(one, *taken).z()) / trials;
        joint_depth += std::abs(imagerError(one, *joint).z()) / trials;
        const Rigid3 truth = one.scene.imager_from_robot[0] * one.scene.observations[0].robot_from_flange *
                             one.scene.flange_from_corkscrew;
        image_depth +=
            std::abs(one.scene.observations[0].imager_from_corkscrew.translation().z() - truth.translation().z()) /
            trials;
        // A radius does not depend on the choice of the middle.
        before_mm += std::abs(one.truth[4]) / trials;
        after_mm += std::abs(joint->shared[0][4] - one.truth[4]) / trials;
        EXPECT_EQ(joint->used(), 8u);
    }
    RecordProperty("depth_one_image_mm", std::to_string(image_depth));
    RecordProperty("depth_taken_as_exact_mm", std::to_string(alone_depth));
    RecordProperty("depth_joint_mm", std::to_string(joint_depth));
    RecordProperty("ring_radius_before_mm", std::to_string(before_mm));
    RecordProperty("ring_radius_after_mm", std::to_string(after_mm));
    EXPECT_GT(image_depth, 0.4);
    EXPECT_LT(joint_depth, 0.1);
    EXPECT_LT(joint_depth, 0.2 * alone_depth);
    EXPECT_LT(after_mm, 0.5 * before_mm);
}

// Mount and shared parameters together, 95 % regions.
TEST(HandEyeSharedTest, TheCovarianceKnowsOfTheSharedParametersSlow) {
    Random random(2);
    int mount = 0, shared = 0;
    const int trials = 300;
    for (int t = 0; t < trials; ++t) {
        const Trial one = trial(6, random);
        const Result<HandEyeCalibration> joint = calibrateHandEye(one.scene.observations, jointly(one));
        ASSERT_OK(joint);
        const Vector6 error =
            one.scene.flange_from_corkscrew.deltaFrom(joint->flange_from_corkscrew.target_from_source);
        mount += error.dot(joint->flange_from_corkscrew.covariance->ldlt().solve(error)) < 12.592;
        const Eigen::VectorXd off = one.truth - joint->shared[0];
        // chi squared of 15 degrees of freedom
        shared += off.dot(joint->shared_covariance.ldlt().solve(off)) < 24.996;
    }
    EXPECT_NEAR(shared / static_cast<double>(trials), 0.95, 0.04);
}

// The prior of several positions: p + q_k, as its covariance has it.
TEST(HandEyeSharedTest, ParametersThatChangeFromPositionToPositionAreTied) {
    SharedPrior prior;
    prior.names = {"focal length", "ring 1 x"};
    prior.mean = Vector2(0.1, 0.2);
    prior.sigma = Vector2(3, 2);
    prior.change_sigma = Vector2(0.5, 0);
    const SharedLayout layout(prior, 3);
    ASSERT_EQ(layout.mean.size(), 4);
    Matrix4 covariance = Matrix4::Zero();
    covariance.topLeftCorner<3, 3>() = Matrix3::Constant(9) + 0.25 * Matrix3::Identity();
    covariance(3, 3) = 4;
    EXPECT_LT((layout.information - covariance.inverse()).norm(), 1e-12);
    EXPECT_EQ(layout.index[2][0], 2);
    EXPECT_EQ(layout.index[2][1], 3);
    prior.sigma[0] = std::numeric_limits<double>::infinity();
    EXPECT_LT((SharedLayout(prior, 3).information.topLeftCorner<3, 3>() * Vector3::Ones()).norm(), 1e-12);
}

}  // namespace
}  // namespace fluorocut
