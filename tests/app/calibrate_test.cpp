// calibrate imager with the real program, on pictures that the virtual operating room took and on pictures drawn here.
#include <cmath>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>

#include "core/image/image.h"
#include "core/imaging/carm_file.h"
#include "core/io/image_file.h"
#include "tests/app/cli.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

ImageWriteOptions bytes() {
    ImageWriteOptions options;
    options.type = PixelType::uint8;
    return options;
}

class CalibrateTest : public testing::Test {
  protected:
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }

    // 18 beads in two planes as hard black disks on grey: what any program can draw. f/p = 3300 px.
    void drawDisks(const std::string& name, double tilt_rad, double turn_rad, const CArm& carm) {
        const double xs[] = {-50, -38, -21, -9, 4, 18, 33, 47, 12}, ys[] = {13, -41, 29, -12, 44, -30, 21, -8, -52};
        std::string beads;
        Image image(carm.columns, carm.rows, 170);
        const Rigid3 pose = Rigid3::fromTranslation({3, -4, 830}) * Rigid3::fromRotationVector({tilt_rad, 0, 0}) *
                            Rigid3::fromRotationVector({0, 0, turn_rad});
        for (int i = 0; i < 18; ++i) {
            const Vector3 bead(i < 9 ? xs[i] : -ys[i - 9] + 2, i < 9 ? ys[i] : xs[i - 9] * 0.9 - 3, i < 9 ? -60 : 60);
            beads += std::string(beads.empty() ? "" : ",") + "{\"name\": \"b" + std::to_string(i) +
                     "\", \"center_mm\": [" + std::to_string(bead.x()) + "," + std::to_string(bead.y()) + "," +
                     std::to_string(bead.z()) + "], \"diameter_mm\": 3}";
            const Vector3 place = pose * bead;
            const Vector2 center = carm.project(place);
            const double radius = 1.5 * carm.focal_length_mm / place.z() / carm.pixel_mm.x();
            for (int y = 0; y < carm.rows; ++y) {
                for (int x = 0; x < carm.columns; ++x) {
                    if ((Vector2(x, y) - center).norm() <= radius) image(x, y) = 30;
                }
            }
        }
        std::ofstream(scratch_ / "disks.json")
            << R"({"schema": "fluorocut/beads/1", "frame": "phantom", "beads": [)" << beads << "]}";
        ASSERT_OK(writeImage(scratch_ / name, image, bytes()));
    }

    test::ScratchFolder scratch_;
};

TEST_F(CalibrateTest, DisksDrawnByAnotherProgram) {
    CArm truth;
    truth.columns = truth.rows = 600;
    truth.pixel_mm = {0.3, 0.3};
    truth.focal_length_mm = 990;
    truth.principal_point_px = {306, 291};
    drawDisks("a.png", 0.35, 0.2, truth);
    drawDisks("b.png", -0.3, 1.8, truth);
    drawDisks("c.png", 0.1, 3.9, truth);
    const test::Finished finished =
        cli({"calibrate", "imager", "--image", path("a.png"), "--image", path("b.png"), "--image", path("c.png"),
             "--phantom", path("disks.json"), "--pixel-mm", "0.3", "-o", path("carm.json"), "--json"});
    // Disks of whole pixels have their centres 0.1 px off: the centre's standard deviation is over the limit.
    ASSERT_TRUE(finished.exit_code == 0 || finished.exit_code == 1) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_EQ(json["accepted"], finished.exit_code == 0);
    EXPECT_NEAR(json["focal_length_mm"], truth.focal_length_mm, 5 * json["focal_length_sd_mm"].get<double>());
    EXPECT_LT(json["focal_length_sd_mm"], 0.005 * truth.focal_length_mm);
    EXPECT_EQ(json["pixel_mm_source"], "stated");
    ASSERT_EQ(json["views"].size(), 3U);
    for (const auto& view : json["views"]) {
        EXPECT_GE(view["beads_used"], 14);
        EXPECT_LT(view["rms_px"], 0.3);
        EXPECT_EQ(view["imager_from_phantom"].size(), 4U);
        EXPECT_EQ(view["covariance"].size(), 6U);
    }
    EXPECT_EQ(json["limits"].size(), 4U);
    const Result<CArm> carm = readCArm(scratch_ / "carm.json");
    ASSERT_OK(carm);
    EXPECT_EQ(carm->focal_length_mm, json["focal_length_mm"]);
    EXPECT_EQ(carm->columns, 600);

    // The same again is the same; a limit that is wide enough accepts it.
    const test::Finished again =
        cli({"calibrate", "imager",          "--image",   path("a.png"),         "--image",    path("b.png"),
             "--image",   path("c.png"),     "--phantom", path("disks.json"),    "--pixel-mm", "0.3",
             "-o",        path("carm.json"), "--json",    "--max-focal-percent", "2",          "--max-centre-mm",
             "50",        "--max-rms-px",    "1"});
    EXPECT_EQ(again.exit_code, 0) << again.err;
    EXPECT_EQ(onlyJson(again)["focal_length_mm"], json["focal_length_mm"]);

    // Without a pixel size one is assumed, and told so.
    const test::Finished assumed = cli({"calibrate", "imager", "--image", path("a.png"), "--phantom",
                                        path("disks.json"), "-o", path("one.json"), "--json"});
    ASSERT_LE(assumed.exit_code, 1) << assumed.err;
    const nlohmann::json one = onlyJson(assumed);
    EXPECT_EQ(one["pixel_mm_source"], "assumed");
    EXPECT_THAT(one["warnings"].dump(), HasSubstr("0.32 mm is assumed"));
    EXPECT_NEAR(one["focal_length_mm"].get<double>() / 0.32, 3300, 5 * one["focal_length_sd_mm"].get<double>() / 0.32);
}

TEST_F(CalibrateTest, TellsWhatIsWrong) {
    Image plain(200, 200, 100);
    plain(100, 100) = 90;
    ASSERT_OK(writeImage(scratch_ / "plain.png", plain, bytes()));
    const auto run = [&](const std::vector<std::string>& more) {
        std::vector<std::string> all{"calibrate", "imager", "-o", path("carm.json"), "--json"};
        all.insert(all.end(), more.begin(), more.end());
        return cli(all);
    };
    const test::Finished nothing = run({"--image", path("plain.png")});
    EXPECT_EQ(nothing.exit_code, 4);
    EXPECT_THAT(errorMessage(nothing, "noSolution"),
                testing::AllOf(HasSubstr("plain.png"), HasSubstr("0 bead shadows")));
    const test::Finished missing = run({"--image", path("none.png")});
    EXPECT_EQ(missing.exit_code, 3);
    EXPECT_THAT(errorMessage(missing, "invalidInput"), HasSubstr("none.png"));
    const test::Finished phantom = run({"--image", path("plain.png"), "--phantom", "moon"});
    EXPECT_EQ(phantom.exit_code, 3);
    EXPECT_THAT(errorMessage(phantom, "invalidInput"), HasSubstr("two-plane"));
    EXPECT_EQ(run({"--image", path("plain.png"), "--pixel-mm", "nan"}).exit_code, 2);
    EXPECT_EQ(run({}).exit_code, 2);
    EXPECT_EQ(cli({"calibrate", "--json"}).exit_code, 2);
    EXPECT_FALSE(fs::exists(scratch_ / "carm.json"));
}

TEST_F(CalibrateTest, PicturesOfTheVirtualOperatingRoom) {
    std::vector<std::string> arguments{"calibrate", "imager", "-o", path("carm.json"), "--json"};
    const std::vector<std::vector<std::string>> turns{{"20", "0", "10"}, {"-12", "16", "100"}, {"-8", "-18", "200"}};
    for (std::size_t i = 0; i < turns.size(); ++i) {
        const std::string image = path("view" + std::to_string(i) + ".png");
        std::vector<std::string> take{"phantom", "beads", "--layout", "two-plane", "-o", image, "--turn-deg"};
        take.insert(take.end(), turns[i].begin(), turns[i].end());
        const test::Finished taken = cli(take);
        ASSERT_EQ(taken.exit_code, 0) << taken.err;
        arguments.insert(arguments.end(), {"--image", image});
    }
    arguments.insert(arguments.end(), {"--pixel-mm", "0.32"});
    const test::Finished finished = cli(arguments);
    ASSERT_LE(finished.exit_code, 1) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_NEAR(json["focal_length_mm"], 1000, 5 * json["focal_length_sd_mm"].get<double>() + 1);
    EXPECT_EQ(json["views"].size(), 3U);
}

}  // namespace
}  // namespace fluorocut
