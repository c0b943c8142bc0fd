// calibrate robot with the real program, on poses of random robots.
#include <fstream>

#include <gmock/gmock.h>

#include "core/io/pose_file.h"
#include "tests/app/cli.h"
#include "tests/app/poses.h"
#include "tests/core/registration/hand_eye_scene.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::cli;
using test::errorMessage;
using test::Finished;
using test::onlyJson;
using test::rows;
using testing::HasSubstr;

class CalibrateRobotTest : public testing::Test {
  protected:
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }
    void write(const std::vector<HandEyeObservation>& observations) const {
        nlohmann::json json = {{"schema", "fluorocut/hand-eye/1"}, {"observations", nlohmann::json::array()}};
        for (const HandEyeObservation& one : observations) {
            nlohmann::json entry = {{"name", one.name},
                                    {"imager", one.imager},
                                    {"robot_from_flange", rows(one.robot_from_flange.matrix())},
                                    {"imager_from_corkscrew", rows(one.imager_from_corkscrew.matrix())}};
            if (one.covariance) entry["covariance"] = rows(*one.covariance);
            json["observations"].push_back(entry);
        }
        std::ofstream(scratch_ / "poses.json") << json;
    }
    Finished run(const std::vector<std::string>& more = {}) const {
        std::vector<std::string> arguments{"--json",           "calibrate", "robot",          "--observations",
                                           path("poses.json"), "-o",        path("pose.json")};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return cli(arguments);
    }
    test::ScratchFolder scratch_;
};

TEST_F(CalibrateRobotTest, EightPosesGiveTheMountAndTheNextPose) {
    Random random(1);
    const test::HandEyeScene scene = test::handEyeScene({}, random);
    write(scene.observations);
    const Finished finished = run();
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_EQ(json["used"], 8);
    EXPECT_EQ(json["residuals"].size(), 8u);
    EXPECT_EQ(json["covariance"].size(), 6u);
    EXPECT_LT(json["rms_mm"], 0.3);
    EXPECT_THAT(json["next_pose"]["sentence"], HasSubstr("turn the flange by"));
    EXPECT_LT(json["next_pose"]["place_sd_after_mm"], json["next_pose"]["place_sd_before_mm"]);
    const Result<Pose> pose = readPose(path("pose.json"), Frame::flange, Frame::corkscrew);
    ASSERT_OK(pose);
    ASSERT_TRUE(pose->covariance);
    // Four times the mean error of 8 poses.
    EXPECT_LT((pose->target_from_source.translation() - scene.flange_from_corkscrew.translation()).norm(), 0.1);
}

TEST_F(CalibrateRobotTest, InvertedPosesOneAxisAndTooFewAreToldInWords) {
    Random random(2);
    const test::HandEyeScene scene = test::handEyeScene({}, random);
    std::vector<HandEyeObservation> wrong = scene.observations;
    for (HandEyeObservation& one : wrong)
        one.robot_from_flange = one.robot_from_flange.inverse();
    write(wrong);
    Finished finished = run();
    EXPECT_EQ(finished.exit_code, 3);
    EXPECT_THAT(errorMessage(finished, "invalidInput"), HasSubstr("flange_from_robot"));
    wrong = scene.observations;
    for (std::size_t i = 0; i < wrong.size(); ++i) {
        wrong[i].robot_from_flange =
            scene.observations[0].robot_from_flange * Rigid3::fromRotationVector({0, 0.2 * static_cast<double>(i), 0});
        wrong[i].imager_from_corkscrew =
            scene.imager_from_robot[0] * wrong[i].robot_from_flange * scene.flange_from_corkscrew;
    }
    write(wrong);
    finished = run();
    EXPECT_EQ(finished.exit_code, 4);
    EXPECT_THAT(errorMessage(finished, "noSolution"), HasSubstr("rotate about a second axis"));
    wrong.resize(2);
    write(wrong);
    finished = run();
    EXPECT_EQ(finished.exit_code, 4);
    EXPECT_THAT(errorMessage(finished, "noSolution"), HasSubstr("2 poses"));
    EXPECT_FALSE(std::filesystem::exists(path("pose.json")));
}

TEST_F(CalibrateRobotTest, AnOutlierIsNamedAndALimitFails) {
    Random random(3);
    test::HandEyeScene scene = test::handEyeScene({}, random);
    HandEyeObservation& one = scene.observations[4];
    one.imager_from_corkscrew = one.imager_from_corkscrew * Rigid3::fromRotationVector({0.3, 0, 0});
    write(scene.observations);
    const Finished finished = run({"--max-place-mm", "0.0001"});
    EXPECT_EQ(finished.exit_code, 1) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_EQ(json["rejected"], nlohmann::json::array({"image 5"}));
    EXPECT_FALSE(json["weak_directions"].empty());
}

}  // namespace
}  // namespace fluorocut
