#include "core/registration/hand_eye.h"

#include <cmath>

#include <gmock/gmock.h>
#include <opencv2/calib3d.hpp>

#include "tests/core/registration/hand_eye_scene.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::handEyeScene;
using test::HandEyeScene;
using test::SceneOptions;
using testing::HasSubstr;

double degrees(double rad) {
    return degreesFromRadians(rad);
}

cv::Mat matrix(const Matrix3& m) {
    cv::Mat result(3, 3, CV_64F);
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
            result.at<double>(r, c) = m(r, c);
    return result;
}

cv::Mat matrix(const Vector3& v) {
    return (cv::Mat_<double>(3, 1) << v.x(), v.y(), v.z());
}

Rigid3 rigid(const cv::Mat& rotation, const cv::Mat& translation) {
    Matrix3 r;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            r(i, j) = rotation.at<double>(i, j);
    const Eigen::Quaterniond q(r);
    return {q, Vector3(translation.at<double>(0), translation.at<double>(1), translation.at<double>(2))};
}

// OpenCV's camera is our corkscrew, its target our imager: gripper_from_cam = flange_from_corkscrew.
Rigid3 byOpenCv(const HandEyeScene& scene, cv::HandEyeCalibrationMethod method) {
    std::vector<cv::Mat> robot_r, robot_t, target_r, target_t;
    for (const HandEyeObservation& one : scene.observations) {
        robot_r.push_back(matrix(one.robot_from_flange.rotationMatrix()));
        robot_t.push_back(matrix(one.robot_from_flange.translation()));
        const Rigid3 corkscrew_from_imager = one.imager_from_corkscrew.inverse();
        target_r.push_back(matrix(corkscrew_from_imager.rotationMatrix()));
        target_t.push_back(matrix(corkscrew_from_imager.translation()));
    }
    cv::Mat r, t;
    cv::calibrateHandEye(robot_r, robot_t, target_r, target_t, r, t, method);
    return rigid(r, t);
}

TEST(HandEyeTest, ExactPosesGiveTheExactMount) {
    Random random(1);
    for (int poses = 3; poses <= 12; poses += 3) {
        SceneOptions options;
        options.noise.reset();
        options.poses = poses;
        options.turn_rad = 0.3;
        const HandEyeScene scene = handEyeScene(options, random);
        const Result<HandEyeCalibration> result = calibrateHandEye(scene.observations);
        ASSERT_OK(result);
        // 1000 mm at double precision, some steps of it.
        EXPECT_LT(scene.placeError(*result), 1e-6);
        EXPECT_LT(scene.rotationError(*result), 1e-9);
        EXPECT_EQ(result->used(), scene.observations.size());
    }
}

// OpenCV's five methods solve the same equations without weights: on exact poses the same answer, on noisy ones worse.
TEST(HandEyeTest, AgreesWithOpenCvOnExactPosesAndIsBetterOnNoisyOnes) {
    Random random(2);
    SceneOptions exact;
    exact.noise.reset();
    for (const auto method :
         {cv::CALIB_HAND_EYE_TSAI, cv::CALIB_HAND_EYE_PARK, cv::CALIB_HAND_EYE_HORAUD, cv::CALIB_HAND_EYE_DANIILIDIS}) {
        const HandEyeScene scene = handEyeScene(exact, random);
        const Result<HandEyeCalibration> ours = calibrateHandEye(scene.observations);
        ASSERT_OK(ours);
        const Rigid3 theirs = byOpenCv(scene, method);
        const Vector6 difference = theirs.deltaFrom(ours->flange_from_corkscrew.target_from_source);
        EXPECT_LT(difference.head<3>().norm(), 1e-5) << method;
        EXPECT_LT(difference.tail<3>().norm(), 1e-8) << method;
    }
    double ours = 0, theirs = 0;
    for (int trial = 0; trial < 50; ++trial) {
        const HandEyeScene scene = handEyeScene({}, random);
        const Result<HandEyeCalibration> result = calibrateHandEye(scene.observations);
        ASSERT_OK(result);
        ours += scene.placeError(*result) / 50;
        theirs += (byOpenCv(scene, cv::CALIB_HAND_EYE_PARK).translation() - scene.flange_from_corkscrew.translation())
                      .norm() /
                  50;
    }
    RecordProperty("ours_mm", std::to_string(ours));
    RecordProperty("opencv_park_mm", std::to_string(theirs));
    EXPECT_LT(ours, 0.5 * theirs);
}

// 1000 random robots: the 95 % regions, of six degrees of freedom together, hold the truth in 93 to 97 %. The
// binomial's standard deviation is 0.7 %.
double coverage(const SceneOptions& options, const HandEyeOptions& calibration, std::uint64_t seed, double& mean_mm,
                double& mean_deg) {
    Random random(seed);
    int inside = 0;
    const int trials = 1000;
    mean_mm = mean_deg = 0;
    for (int trial = 0; trial < trials; ++trial) {
        const HandEyeScene scene = handEyeScene(options, random);
        const Result<HandEyeCalibration> result = calibrateHandEye(scene.observations, calibration);
        if (!result) {
            ADD_FAILURE() << result.error().message();
            return 0;
        }
        const Vector6 error = scene.flange_from_corkscrew.deltaFrom(result->flange_from_corkscrew.target_from_source);
        // chi squared of 6 degrees of freedom
        inside += error.dot(result->flange_from_corkscrew.covariance->ldlt().solve(error)) < 12.592;
        mean_mm += scene.placeError(*result) / trials;
        mean_deg += degrees(scene.rotationError(*result)) / trials;
    }
    return inside / static_cast<double>(trials);
}

TEST(HandEyeTest, EightPosesReachTheGoalAndTheCovarianceHolds) {
    double mm = 0, deg = 0;
    const double share = coverage({}, {}, 10, mm, deg);
    RecordProperty("mean_mm", std::to_string(mm));
    RecordProperty("mean_deg", std::to_string(deg));
    RecordProperty("coverage", std::to_string(share));
    EXPECT_LT(mm, 0.05);
    EXPECT_LT(deg, 0.05);
    EXPECT_GT(share, 0.93);
    EXPECT_LT(share, 0.97);
}

TEST(HandEyeTest, ThreeToTwelvePosesAndPositionsWithARobotThatErrs) {
    for (const auto& [poses, positions] : {std::pair(4, 1), std::pair(8, 2), std::pair(12, 3)}) {
        SceneOptions options;
        options.poses = poses;
        options.positions = positions;
        options.robot_place_mm = 0.03;
        options.robot_rotation_rad = 1e-4;
        HandEyeOptions calibration;
        calibration.robot_place_mm = options.robot_place_mm;
        calibration.robot_rotation_rad = options.robot_rotation_rad;
        double mm = 0, deg = 0;
        const double share = coverage(options, calibration, 20, mm, deg);
        const std::string name = std::to_string(poses) + "_poses_" + std::to_string(positions) + "_positions";
        RecordProperty(name + "_mm", std::to_string(mm));
        RecordProperty(name + "_deg", std::to_string(deg));
        RecordProperty(name + "_coverage", std::to_string(share));
        EXPECT_GT(share, 0.93);
        EXPECT_LT(share, 0.97);
    }
}

// Poses without covariances: the noise is estimated from the residuals. With 8 poses, 36 numbers over: a region of the
// normal distribution holds a little less than it says.
TEST(HandEyeTest, UnstatedNoiseIsEstimated) {
    SceneOptions options;
    options.state_covariance = false;
    CorkscrewNoise noise;
    noise.in_plane_mm *= 3;
    noise.depth_mm *= 3;
    noise.twist_rad *= 3;
    noise.roll_rad *= 3;
    noise.pitch_rad *= 3;
    options.noise = noise;
    double mm = 0, deg = 0;
    const double share = coverage(options, {}, 30, mm, deg);
    EXPECT_GT(share, 0.90);
    EXPECT_LT(share, 0.97);
    Random random(31);
    const HandEyeScene scene = handEyeScene(options, random);
    const Result<HandEyeCalibration> result = calibrateHandEye(scene.observations);
    ASSERT_OK(result);
    // 36 degrees of freedom: 3 within 12 %, three times that.
    EXPECT_NEAR(result->noise_factor, 3, 1.1);
}

TEST(HandEyeTest, GrossErrorsAreLeftOutAndNamed) {
    Random random(40);
    for (int trial = 0; trial < 30; ++trial) {
        for (const bool stated : {true, false}) {
            SceneOptions options;
            options.poses = 10;
            options.state_covariance = stated;
            HandEyeScene scene = handEyeScene(options, random);
            // The other sign of roll, say, and a depth off by 3 mm.
            HandEyeObservation& turned = scene.observations[2];
            turned.imager_from_corkscrew = turned.imager_from_corkscrew * Rigid3::fromRotationVector({0, 0.2, 0});
            HandEyeObservation& deep = scene.observations[7];
            deep.imager_from_corkscrew = Rigid3::fromTranslation({0, 0, 3}) * deep.imager_from_corkscrew;
            const Result<HandEyeCalibration> result = calibrateHandEye(scene.observations);
            ASSERT_OK(result);
            for (std::size_t i = 0; i < 10; ++i)
                EXPECT_EQ(result->residuals[i].rejected, i == 2 || i == 7) << trial << " " << i << " " << stated;
            ASSERT_FALSE(result->warnings.empty());
            EXPECT_THAT(result->warnings[0], HasSubstr("image 3, image 8"));
            // Eight good ones: 0.024 mm in the mean, hardly ever four times that.
            EXPECT_LT(scene.placeError(*result), 0.12);
        }
    }
}

TEST(HandEyeTest, TwoSwappedImagesAreRecognised) {
    Random random(41);
    SceneOptions options;
    options.poses = 8;
    HandEyeScene scene = handEyeScene(options, random);
    std::swap(scene.observations[1].robot_from_flange, scene.observations[5].robot_from_flange);
    const Result<HandEyeCalibration> result = calibrateHandEye(scene.observations);
    ASSERT_OK(result);
    EXPECT_THAT(result->warnings, testing::Contains(HasSubstr("image 2 and image 6 fit with each other's robot pose")));
}

TEST(HandEyeTest, SimpleMistakesAreNamed) {
    Random random(50);
    for (const bool stated : {true, false}) {
        SceneOptions options;
        options.state_covariance = stated;
        const HandEyeScene scene = handEyeScene(options, random);
        const auto messageOf = [](const std::vector<HandEyeObservation>& observations) {
            const Result<HandEyeCalibration> result = calibrateHandEye(observations);
            return result ? std::string("no error") : result.error().message();
        };
        std::vector<HandEyeObservation> wrong = scene.observations;
        for (HandEyeObservation& one : wrong)
            one.robot_from_flange = one.robot_from_flange.inverse();
        EXPECT_THAT(messageOf(wrong), HasSubstr("flange_from_robot"));
        wrong = scene.observations;
        for (HandEyeObservation& one : wrong)
            one.imager_from_corkscrew = one.imager_from_corkscrew.inverse();
        EXPECT_THAT(messageOf(wrong), HasSubstr("corkscrew_from_imager"));
        wrong = scene.observations;
        for (HandEyeObservation& one : wrong)
            one.robot_from_flange =
                Rigid3(one.robot_from_flange.rotation(), one.robot_from_flange.translation() / 1000);
        EXPECT_THAT(messageOf(wrong), HasSubstr("metres"));
        wrong = scene.observations;
        for (std::size_t i = 0; i < wrong.size(); ++i)
            wrong[i].robot_from_flange = scene.observations[(i + 1) % wrong.size()].robot_from_flange;
        EXPECT_THAT(messageOf(wrong), HasSubstr("the image after it"));
        wrong = scene.observations;
        for (HandEyeObservation& one : wrong)
            one.robot_from_flange = test::anyPose(random, 500);
        EXPECT_THAT(messageOf(wrong), HasSubstr("contradict each other"));
    }
}

TEST(HandEyeTest, MotionsThatLeaveTheAnswerOpenAreRefused) {
    Random random(60);
    const HandEyeScene scene = handEyeScene({}, random);
    // Motions of the flange about one of its axes, or none, seen without any error.
    const auto messageOf = [&](int poses, const Vector3& axis, double angle_rad) {
        std::vector<HandEyeObservation> observations;
        for (int i = 0; i < poses; ++i) {
            HandEyeObservation one = scene.observations[static_cast<std::size_t>(i)];
            one.robot_from_flange = scene.observations[0].robot_from_flange *
                                    Rigid3::fromTranslation({5.0 * i, -3.0 * i * i, 4.0 * i}) *
                                    Rigid3::fromRotationVector(axis * angle_rad * i);
            one.imager_from_corkscrew =
                scene.imager_from_robot[0] * one.robot_from_flange * scene.flange_from_corkscrew;
            observations.push_back(one);
        }
        const Result<HandEyeCalibration> result = calibrateHandEye(observations);
        return result ? std::string("no error") : result.error().message();
    };
    EXPECT_THAT(messageOf(6, Vector3::UnitZ(), 0.3), HasSubstr("the flange's z axis"));
    EXPECT_THAT(messageOf(6, Vector3::UnitZ(), 0.3), HasSubstr("rotate about a second axis"));
    EXPECT_THAT(messageOf(6, Vector3::UnitZ(), 0), HasSubstr("only moved, not turned"));
    EXPECT_THAT(messageOf(2, Vector3::UnitZ(), 0.3), HasSubstr("2 poses"));
    EXPECT_THAT(messageOf(0, Vector3::UnitZ(), 0.3), HasSubstr("0 poses"));
}

// Three positions with two images each: one motion per position, three in all, are enough.
TEST(HandEyeTest, PositionsOfTheCArmAddUp) {
    Random random(70);
    SceneOptions options;
    options.poses = 6;
    options.positions = 3;
    const HandEyeScene scene = handEyeScene(options, random);
    const Result<HandEyeCalibration> result = calibrateHandEye(scene.observations);
    ASSERT_OK(result);
    EXPECT_EQ(result->imagers.size(), 3u);
    const Vector6 error = scene.flange_from_corkscrew.deltaFrom(result->flange_from_corkscrew.target_from_source);
    // 99.99 % of chi squared with 6 degrees of freedom.
    EXPECT_LT(error.dot(result->flange_from_corkscrew.covariance->ldlt().solve(error)), 27.9);
    for (std::size_t k = 0; k < 3; ++k) {
        const Vector6 off =
            scene.imager_from_robot[k].deltaFrom(result->imagers[k].imager_from_robot.target_from_source);
        EXPECT_LT(off.dot(result->imagers[k].imager_from_robot.covariance->ldlt().solve(off)), 27.9);
    }
}

TEST(HandEyeTest, NoiseBeyondWhatIsStatedInflatesTheCovariance) {
    Random random(80);
    HandEyeScene scene = handEyeScene({}, random);
    for (HandEyeObservation& one : scene.observations)
        *one.covariance /= 9;
    const Result<HandEyeCalibration> result = calibrateHandEye(scene.observations);
    ASSERT_OK(result);
    EXPECT_NEAR(result->noise_factor, 3, 1.1);
    EXPECT_THAT(result->warnings, testing::Contains(HasSubstr("disagree")));
    EXPECT_FALSE(accepted(result->acceptance));
}

TEST(HandEyeTest, OptionsThatMakeNoSenseAreRefused) {
    HandEyeOptions options;
    options.robot_place_mm = std::nan("");
    const Result<HandEyeCalibration> result = calibrateHandEye({}, options);
    ASSERT_FALSE(result);
    EXPECT_THAT(result.error().message(), HasSubstr("robot_place_mm"));
}

}  // namespace
}  // namespace fluorocut
