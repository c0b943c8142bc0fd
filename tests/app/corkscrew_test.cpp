// corkscrew pose with the real program, on pictures that it makes itself.
#include <cmath>
#include <string>

#include <gmock/gmock.h>

#include "core/base/units.h"
#include "core/imaging/carm_file.h"
#include "core/io/image_file.h"
#include "core/io/pose_file.h"
#include "tests/app/cli.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

class CorkscrewCommand : public testing::Test {
  protected:
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }
    std::string carm(double pixel_mm = CArm().pixel_mm.x()) const {
        CArm carm;
        carm.pixel_mm = Vector2::Constant(pixel_mm);
        EXPECT_OK(writeCArm(scratch_ / "carm.json", carm));
        return path("carm.json");
    }
    Rigid3 makePicture(const std::vector<std::string>& more = {}) const {
        std::vector<std::string> arguments{"phantom",        "corkscrew", "-o",
                                           path("shot.png"), "--truth",   path("truth.json")};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const auto made = cli(arguments);
        EXPECT_EQ(made.exit_code, 0) << made.err;
        const auto truth = readPose(scratch_ / "truth.json", Frame::imager, Frame::corkscrew);
        return truth ? truth->target_from_source : Rigid3();
    }
    test::ScratchFolder scratch_;
};

TEST_F(CorkscrewCommand, FindsThePoseAndFollowsIt) {
    const Rigid3 truth = makePicture({"--roll-deg", "-30", "--pitch-deg", "170", "--inverted"});
    const std::string carm_file = carm();
    const auto found = cli({"corkscrew", "pose", path("shot.png"), "--carm", carm_file, "-o", path("pose.json"),
                            "--figure", path("overlay.png"), "--json"});
    ASSERT_EQ(found.exit_code, 0) << found.err << found.out;
    const auto json = onlyJson(found);
    EXPECT_EQ(json["metal_is_bright"], true);
    EXPECT_EQ(json["tracked"], false);
    EXPECT_LT(json["rms_px"], 0.3);
    const auto pose = readPose(scratch_ / "pose.json", Frame::imager, Frame::corkscrew);
    ASSERT_OK(pose);
    ASSERT_TRUE(pose->covariance);
    const Vector6 error = truth.deltaFrom(pose->target_from_source);
    // One picture without clutter at 1000 photons: five times the mean errors of such scenes.
    EXPECT_LT(error.head<2>().norm(), 0.02);
    EXPECT_LT(std::abs(error[2]), 0.3);
    EXPECT_LT(error.tail<3>().norm(), radiansFromDegrees(0.1));
    for (int r = 0; r < 4; ++r)
        for (int c = 0; c < 4; ++c)
            EXPECT_NEAR(json["imager_from_corkscrew"][r][c], pose->target_from_source.matrix()(r, c), 1e-12);
    const auto overlay = readImage(scratch_ / "overlay.png");
    ASSERT_OK(overlay);

    const auto followed =
        cli({"corkscrew", "pose", path("shot.png"), "--carm", carm_file, "--initial", path("pose.json"), "--json"});
    ASSERT_EQ(followed.exit_code, 0) << followed.err;
    EXPECT_EQ(onlyJson(followed)["tracked"], true);
}

TEST_F(CorkscrewCommand, RefusesASymmetricCorkscrewUnlessAStartDecides) {
    const Rigid3 truth = makePicture({"--corkscrew", "corkscrew-paper"});
    const std::string carm_file = carm();
    const auto refused =
        cli({"corkscrew", "pose", path("shot.png"), "--carm", carm_file, "--corkscrew", "corkscrew-paper", "--json"});
    EXPECT_EQ(refused.exit_code, 4);
    EXPECT_THAT(errorMessage(refused, "noSolution"), HasSubstr("looks the same from both sides"));
    const auto found = cli({"corkscrew", "pose", path("shot.png"), "--carm", carm_file, "--corkscrew",
                            "corkscrew-paper", "--initial", path("truth.json"), "-o", path("pose.json"), "--json"});
    ASSERT_EQ(found.exit_code, 0) << found.err;
    const auto pose = readPose(scratch_ / "pose.json", Frame::imager, Frame::corkscrew);
    ASSERT_OK(pose);
    EXPECT_LT((truth * pose->target_from_source.inverse()).rotationAngle(), radiansFromDegrees(0.3));
}

TEST_F(CorkscrewCommand, RefusesWhatIsNoPictureOfThisCorkscrew) {
    makePicture();
    const std::string carm_file = carm();
    const auto other =
        cli({"corkscrew", "pose", path("shot.png"), "--carm", carm_file, "--corkscrew", "corkscrew-paper", "--json"});
    EXPECT_EQ(other.exit_code, 4);
    EXPECT_THAT(errorMessage(other, "noSolution"), HasSubstr("layout"));
    const auto drr = cli({"drr", "--ct", "acrylic", "--view", "ap", "--carm", carm_file, "-o", path("ap.png")});
    ASSERT_EQ(drr.exit_code, 0) << drr.err;
    const auto none = cli({"corkscrew", "pose", path("ap.png"), "--carm", carm_file, "--json"});
    EXPECT_EQ(none.exit_code, 4);
    EXPECT_THAT(errorMessage(none, "noSolution"), HasSubstr("corkscrew"));
}

// A fifth off the fits still hold together; by a factor of 2 already the search finds nothing, or nonsense.
TEST_F(CorkscrewCommand, RefusesAPixelSizeThatThePerspectiveContradicts) {
    makePicture({"--roll-deg", "25", "--clutter"});
    for (const double pixel_mm : {0.16, 0.25, 0.39, 0.64}) {
        const auto found = cli({"corkscrew", "pose", path("shot.png"), "--carm", carm(pixel_mm), "--json"});
        EXPECT_EQ(found.exit_code, 4) << found.out;
        const std::string message = errorMessage(found, "noSolution");
        EXPECT_THAT(message, HasSubstr("pixel's size"));
        const std::string before = "a pixel of about ";
        const auto at = message.find(before);
        ASSERT_NE(at, std::string::npos) << message;
        // To two digits, and as well as one picture's perspective tells.
        EXPECT_NEAR(std::stod(message.substr(at + before.size())), CArm().pixel_mm.x(), 0.025) << pixel_mm;
    }
}

TEST_F(CorkscrewCommand, NamesTheFileThatDoesNotFit) {
    makePicture();
    const auto nothing = cli({"corkscrew", "--json"});
    EXPECT_EQ(nothing.exit_code, 2);
    const auto missing = cli({"corkscrew", "pose", path("none.png"), "--carm", carm(), "--json"});
    EXPECT_EQ(missing.exit_code, 3);
    EXPECT_THAT(errorMessage(missing, "invalidInput"), HasSubstr("none.png"));
    const auto overwrite = cli({"corkscrew", "pose", path("shot.png"), "--carm", carm(), "-o", carm(), "--json"});
    EXPECT_EQ(overwrite.exit_code, 2);
}

}  // namespace
}  // namespace fluorocut
