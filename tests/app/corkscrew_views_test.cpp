// calibrate robot and coregister with the real program, from pictures of a corkscrew.
#include <cmath>
#include <fstream>

#include <gmock/gmock.h>

#include "core/base/random.h"
#include "core/base/units.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/imaging/carm.h"
#include "core/imaging/carm_file.h"
#include "core/io/pose_file.h"
#include "core/io/resources.h"
#include "tests/app/cli.h"
#include "tests/app/poses.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::cli;
using test::errorMessage;
using test::Finished;
using test::onlyJson;
using test::rigidOf;
using test::rows;
using testing::HasSubstr;

class CorkscrewViewsTest : public testing::Test {
  protected:
    void SetUp() override {
        carm_.columns = carm_.rows = 512;
        carm_.pixel_mm = {0.32, 0.32};
        carm_.focal_length_mm = 1000;
        carm_.principal_point_px = {255.5, 255.5};
        ASSERT_OK(writeCArm(scratch_ / "carm.json", carm_, {}));
        const Result<std::filesystem::path> file = findResource("fiducials", "corkscrew");
        ASSERT_OK(file);
        const Result<CorkscrewLayout> layout = readCorkscrew(*file);
        ASSERT_OK(layout);
        layout_ = *layout;
        ASSERT_OK(writeCorkscrew(scratch_ / "nominal.json", layout_));
    }
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }

    // A picture by the virtual operating room: 1000 photons, 0.7 px.
    void picture(const std::string& name, const std::string& corkscrew, const Rigid3& imager_from_corkscrew,
                 int seed) const {
        ASSERT_OK(
            writePose(scratch_ / "pose.json", {Frame::imager, Frame::corkscrew, imager_from_corkscrew, std::nullopt}));
        const Finished made = cli({"phantom", "corkscrew", "-o", path(name), "--corkscrew", path(corkscrew), "--carm",
                                   path("carm.json"), "--pose", path("pose.json"), "--seed", std::to_string(seed)});
        ASSERT_EQ(made.exit_code, 0) << made.err;
    }

    test::ScratchFolder scratch_;
    CArm carm_;
    CorkscrewLayout layout_;
};

// Eight pictures of a corkscrew made with errors of 0.05 mm, analysed with its drawing.
TEST_F(CorkscrewViewsTest, CalibrateRobotFromPicturesOfAnImperfectCorkscrewSlow) {
    Random random(11);
    CorkscrewLayout made = layout_;
    // Too long by 0.05 mm on either side, which looks like 0.8 mm of depth; the radii as it happens.
    for (CorkscrewRing& ring : made.rings) {
        ring.x_mm += ring.x_mm > 0 ? 0.05 : -0.05;
        ring.radius_mm += 0.05 * random.normal();
    }
    made.helix.x_start_mm -= 0.05;
    made.helix.x_end_mm += 0.05;
    made.helix.radius_mm += 0.05 * random.normal();
    ASSERT_OK(writeCorkscrew(scratch_ / "made.json", made));
    const Rigid3 flange_from_corkscrew =
        Rigid3::fromTranslation({30, -20, 120}) * Rigid3::fromRotationVector({1, 0.5, -0.4});
    const Rigid3 imager_from_robot =
        Rigid3::fromTranslation({300, 100, 900}) * Rigid3::fromRotationVector({-1, 1.2, 0.3});
    nlohmann::json file = {{"schema", "fluorocut/hand-eye/1"},
                           {"carm", "carm.json"},
                           {"corkscrew", "nominal.json"},
                           {"observations", nlohmann::json::array()}};
    Rigid3 first;
    for (int i = 0; i < 8; ++i) {
        const Vector3 axis = Vector3(random.normal(), random.normal(), random.normal()).normalized();
        const Rigid3 seen(
            expRotation(axis * random.uniform(0.3, 0.6)) * Rigid3::fromTwistRollPitch(0.5, 0.3, 0.75).rotation(),
            Vector3(random.uniform(-6, 6), random.uniform(-6, 6), random.uniform(650, 740)));
        if (i == 0) first = seen;
        const std::string image = std::to_string(i) + ".png";
        picture(image, "made.json", seen, i);
        if (HasFatalFailure()) return;
        file["observations"].push_back(
            {{"image", image},
             {"robot_from_flange",
              rows((imager_from_robot.inverse() * seen * flange_from_corkscrew.inverse()).matrix())}});
    }
    std::ofstream(scratch_ / "images.json") << file;
    const auto depthError = [&](const nlohmann::json& json) {
        const Vector3 place = imager_from_robot.inverse() * first.translation();
        return std::abs((rigidOf(json["imagers"][0]["imager_from_robot"]) * place - first.translation()).z());
    };
    const Finished plain =
        cli({"--json", "calibrate", "robot", "--observations", path("images.json"), "-o", path("plain.json")});
    ASSERT_TRUE(plain.exit_code == 0 || plain.exit_code == 1) << plain.err;
    const Finished joint = cli({"--json", "calibrate", "robot", "--observations", path("images.json"), "-o",
                                path("joint.json"), "--refine-dimensions", path("measured.json")});
    ASSERT_TRUE(joint.exit_code == 0 || joint.exit_code == 1) << joint.err;
    const nlohmann::json json = onlyJson(joint);
    RecordProperty("depth_taken_as_drawn_mm", std::to_string(depthError(onlyJson(plain))));
    RecordProperty("depth_joint_mm", std::to_string(depthError(json)));
    EXPECT_GT(depthError(onlyJson(plain)), 0.4);
    EXPECT_EQ(json["used"], 8);
    EXPECT_LT(depthError(json), 0.15);
    const Result<CorkscrewLayout> measured = readCorkscrew(scratch_ / "measured.json");
    ASSERT_OK(measured);
    double before = 0, after = 0;
    for (std::size_t i = 0; i < made.rings.size(); ++i) {
        before += std::abs(layout_.rings[i].radius_mm - made.rings[i].radius_mm) / 4;
        after += std::abs(measured->rings[i].radius_mm - made.rings[i].radius_mm) / 4;
        // Taken between the ends: where the middle is said to be is free.
        EXPECT_NEAR(measured->rings[i].x_mm - measured->rings[0].x_mm, made.rings[i].x_mm - made.rings[0].x_mm, 0.02);
    }
    EXPECT_LT(after, 0.5 * before);
    EXPECT_THAT(json["next_pose"]["sentence"], HasSubstr("turn the flange"));
}

TEST_F(CorkscrewViewsTest, TwoViewsAreCoregisteredAndWrittenSlow) {
    const Rigid3 middle = Rigid3::fromTwistRollPitch(0.4, 0.1, 0.8);
    const auto view = [&](double orbital_deg) {
        return Rigid3::fromTranslation({1, 2, 700}) *
               Rigid3::fromRotationVector({0, radiansFromDegrees(orbital_deg), 0}) * middle;
    };
    picture("a.png", "nominal.json", view(-20), 1);
    picture("b.png", "nominal.json", view(30), 2);
    picture("c.png", "nominal.json", view(-19), 3);
    const Finished finished =
        cli({"--json", "coregister", "--view", path("a.png") + "," + path("carm.json"), "--view",
             path("b.png") + "," + path("carm.json"), "--corkscrew", path("nominal.json"), "-o", path("views")});
    ASSERT_EQ(finished.exit_code, 0) << finished.err << finished.out;
    const nlohmann::json json = onlyJson(finished);
    ASSERT_EQ(json["views"].size(), 2u);
    const Rigid3 truth = view(30) * view(-20).inverse();
    const Result<Pose> pose = readPose(scratch_ / "views" / "view_2.json", Frame::imager, Frame::imager);
    ASSERT_OK(pose);
    ASSERT_TRUE(pose->covariance);
    const Vector6 error = truth.deltaFrom(pose->target_from_source);
    // 99.99 % of chi squared with 6 degrees of freedom.
    EXPECT_LT(error.dot(pose->covariance->ldlt().solve(error)), 27.9);
    EXPECT_LT(degreesFromRadians(error.tail<3>().norm()), 0.1);
    // What a point at the corkscrew is off after it was carried over.
    const Vector3 place = view(-20).translation();
    EXPECT_LT((pose->target_from_source * place - truth * place).norm(), 0.3);
    EXPECT_NEAR(json["views"][1]["angle_to_first_deg"], 50, 0.1);

    const Finished same = cli({"--json", "coregister", "--view", path("a.png") + "," + path("carm.json"), "--view",
                               path("c.png") + "," + path("carm.json"), "--corkscrew", path("nominal.json")});
    EXPECT_EQ(same.exit_code, 4);
    EXPECT_THAT(errorMessage(same, "noSolution"), HasSubstr("look from the same direction"));
    std::filesystem::copy_file(scratch_ / "a.png", scratch_ / "again.png");
    const Finished twice = cli({"--json", "coregister", "--view", path("a.png") + "," + path("carm.json"), "--view",
                                path("again.png") + "," + path("carm.json"), "--corkscrew", path("nominal.json")});
    EXPECT_EQ(twice.exit_code, 3);
    EXPECT_THAT(errorMessage(twice, "invalidInput"), HasSubstr("the same picture as"));
    const Finished odd = cli({"--json", "coregister", "--view", path("a.png")});
    EXPECT_EQ(odd.exit_code, 2);
    EXPECT_THAT(errorMessage(odd, "invalidOption"), HasSubstr("IMAGE,CARM"));
}

}  // namespace
}  // namespace fluorocut
