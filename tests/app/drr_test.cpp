// drr with the real program: its numbers against closed forms, its pictures, its refusals.
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <thread>

#include <gmock/gmock.h>

#include "core/image/volume.h"
#include "core/io/image_file.h"
#include "core/io/volume_file.h"
#include "tests/app/cli.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

// A block of water, 40 mm each way, in air, and the files of a C-arm and a pose that see it in the middle.
class DrrTest : public testing::Test {
  protected:
    static constexpr double kMu = 0.02;
    static constexpr double kEdge = 40;

    DrrTest() {
        VolumeGrid grid;
        grid.size = {44, 44, 44};
        grid.origin_mm = Vector3::Constant(-21.5);
        Volume ct(grid, -1000.0F);
        for (int k = 2; k < 42; ++k) {
            for (int j = 2; j < 42; ++j) {
                for (int i = 2; i < 42; ++i)
                    ct(i, j, k) = 0;
            }
        }
        EXPECT_OK(writeVolume(scratch_ / "block.mha", ct, VoxelType::int16));
        write("carm.json", R"({"schema": "fluorocut/carm/1", "name": "test", "columns": 65, "rows": 33,
            "pixel_mm": [1.0, 1.0], "focal_length_mm": 1000.0, "principal_point_px": [32, 16], "distortion": null})");
        write("pose.json", R"({"schema": "fluorocut/pose/1", "target": "imager", "source": "femur",
            "matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 700], [0, 0, 0, 1]]})");
    }

    void write(const std::string& name, const std::string& text) const { std::ofstream(scratch_ / name) << text; }
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }
    std::vector<std::string> command(const std::string& output, const std::vector<std::string>& more = {}) const {
        std::vector<std::string> all{
            "drr", "--ct",       path("block.mha"), "--carm", path("carm.json"), "--pose", path("pose.json"),
            "-o",  path(output), "--json"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }
    std::size_t files() const {
        return static_cast<std::size_t>(
            std::distance(fs::directory_iterator(scratch_.path()), fs::directory_iterator()));
    }

    test::ScratchFolder scratch_;
};

TEST_F(DrrTest, LineIntegralsOfABlockAreItsThicknessTimesMu) {
    const test::Finished finished = cli(command("out.mha"));
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_EQ(json["size"], nlohmann::json({65, 33}));
    EXPECT_EQ(json["output"], "line-integral");
    EXPECT_GT(json["prepare_ms"], 0);
    EXPECT_GT(json["elapsed_ms"], 0);
    const Result<ImageFile> image = readImage(scratch_ / "out.mha");
    ASSERT_OK(image);
    EXPECT_TRUE(image->info.is_float);
    // The central ray crosses 40 voxels of water; int16 storage of mu in the fast method costs less than 1e-3.
    EXPECT_NEAR(image->image(32, 16), kMu * kEdge, 1e-3 * kMu * kEdge);
    // A ray 20 mm off the axis at the detector (14 mm at the block) is longer by sqrt(1 + 0.02^2).
    EXPECT_NEAR(image->image(12, 16), kMu * kEdge * std::sqrt(1 + 0.02 * 0.02), 1e-3 * kMu * kEdge);
    EXPECT_NEAR(image->image(0, 16), 0, 1e-3 * kMu * kEdge);  // 32 mm off the axis: beside the block
}

TEST_F(DrrTest, MuOfWaterScalesTheLineIntegrals) {
    ASSERT_EQ(cli(command("out.nrrd", {"--mu-water", "0.03", "--method", "exact"})).exit_code, 0);
    const Result<ImageFile> image = readImage(scratch_ / "out.nrrd");
    ASSERT_OK(image);
    EXPECT_NEAR(image->image(32, 16), 0.03 * kEdge, 1e-5);  // float32
}

TEST_F(DrrTest, BinningAveragesPixels) {
    const test::Finished finished = cli(command("out.tiff", {"--binning", "4"}));
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    EXPECT_EQ(onlyJson(finished)["size"], nlohmann::json({16, 8}));
    EXPECT_NEAR(onlyJson(finished)["pixel_mm"][0].get<double>(), 4, 1e-12);
}

TEST_F(DrrTest, IntensityIsBeerLambertWithPoissonNoise) {
    ASSERT_EQ(cli(command("clean.mha", {"--output", "intensity"})).exit_code, 0);
    const Result<ImageFile> clean = readImage(scratch_ / "clean.mha");
    ASSERT_OK(clean);
    EXPECT_NEAR(clean->image(32, 16), std::exp(-kMu * kEdge), 1e-3);

    constexpr double kPhotons = 10000;
    ASSERT_EQ(cli(command("noisy.mha", {"--photons", "10000", "--seed", "7"})).exit_code, 0);
    const Result<ImageFile> noisy = readImage(scratch_ / "noisy.mha");
    ASSERT_OK(noisy);
    double sum = 0;
    double squares = 0;
    int count = 0;
    for (int y = 4; y < 29; ++y) {
        for (int x = 14; x < 51; ++x) {
            const double expected = kPhotons * clean->image(x, y);
            const double normalised = (noisy->image(x, y) - expected) / std::sqrt(expected);
            sum += normalised;
            squares += normalised * normalised;
            ++count;
        }
    }
    // Mean 0 and variance 1 of 925 pixels, within four standard errors.
    EXPECT_NEAR(sum / count, 0, 4 / std::sqrt(count));
    EXPECT_NEAR(squares / count, 1, 4 * std::sqrt(2.0 / count));

    ASSERT_EQ(cli(command("again.mha", {"--photons", "10000", "--seed", "7"})).exit_code, 0);
    EXPECT_EQ(readImage(scratch_ / "again.mha")->image, noisy->image);
    ASSERT_EQ(cli(command("other.mha", {"--photons", "10000", "--seed", "8"})).exit_code, 0);
    EXPECT_NE(readImage(scratch_ / "other.mha")->image, noisy->image);
}

TEST_F(DrrTest, APngIsAPictureForTheEye) {
    const test::Finished finished =
        cli({"drr", "--ct", path("block.mha"), "--view", "ap", "-o", path("ap.png"), "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    EXPECT_EQ(onlyJson(finished)["output"], "fluoroscopy");
    const Result<ImageFile> image = readImage(scratch_ / "ap.png");
    ASSERT_OK(image);
    EXPECT_EQ(image->info.bits, 16);
    EXPECT_EQ(image->image(2, 2), 65535);  // open beam
    EXPECT_LT(image->image(512, 512), 0.75 * 65535);
}

TEST_F(DrrTest, AimMovesWhatAStandardViewLooksAt) {
    const auto centreOf = [&](const std::string& output, const std::vector<std::string>& more) {
        std::vector<std::string> all{"drr", "--ct", path("block.mha"), "--view", "ap", "-o", path(output)};
        all.insert(all.end(), more.begin(), more.end());
        EXPECT_EQ(cli(all).exit_code, 0);
        return readImage(scratch_ / output)->image(511, 511);
    };
    EXPECT_NEAR(centreOf("a.mha", {}), kMu * kEdge, 1e-3);
    EXPECT_NEAR(centreOf("b.mha", {"--aim-mm", "0", "0", "60"}), 0, 1e-3);
}

TEST_F(DrrTest, SaysThatTheCtLiesNowhereInThePicture) {
    write("pose.json", R"({"schema": "fluorocut/pose/1", "target": "imager", "source": "femur",
        "matrix": [[1, 0, 0, 5000], [0, 1, 0, 0], [0, 0, 1, 700], [0, 0, 0, 1]]})");
    const test::Finished finished = cli(command("out.mha"));
    EXPECT_EQ(finished.exit_code, 0);
    EXPECT_EQ(onlyJson(finished)["warnings"].size(), 1u);
}

TEST_F(DrrTest, NeverOverwritesAnInput) {
    fs::create_symlink(scratch_ / "block.mha", scratch_ / "link.mha");
    const auto before = fs::file_size(scratch_ / "block.mha");
    for (const char* output : {"block.mha", "link.mha", "./block.mha"}) {
        const test::Finished finished = cli(command(output));
        EXPECT_EQ(finished.exit_code, 2) << output;
        EXPECT_THAT(errorMessage(finished, "invalidOption"), HasSubstr("never overwritten"));
    }
    EXPECT_EQ(fs::file_size(scratch_ / "block.mha"), before);
}

TEST_F(DrrTest, RefusesUsageThatMakesNoSense) {
    const auto messageOf = [](const std::vector<std::string>& arguments) {
        const test::Finished finished = cli(arguments);
        EXPECT_EQ(finished.exit_code, 2) << finished.err;
        return errorMessage(finished, "invalidOption");
    };
    EXPECT_THAT(messageOf(command("out.jpg")), HasSubstr(".jpg"));
    EXPECT_THAT(messageOf(command("out")), HasSubstr("no extension"));
    EXPECT_THAT(messageOf(command("nowhere/out.mha")), HasSubstr("nowhere"));
    EXPECT_THAT(messageOf(command("out.png", {"--output", "line-integral"})), HasSubstr("real numbers"));
    EXPECT_THAT(messageOf(command("out.mha", {"--output", "line-integral", "--photons", "5"})), HasSubstr("photons"));
    EXPECT_THAT(messageOf(command("out.mha", {"--view", "ap"})), HasSubstr("both"));
    EXPECT_THAT(messageOf({"drr", "--ct", path("block.mha"), "-o", path("o.mha"), "--json"}), HasSubstr("neither"));
    EXPECT_THAT(
        messageOf({"drr", "--ct", path("block.mha"), "--pose", path("pose.json"), "-o", path("o.mha"), "--json"}),
        HasSubstr("--carm"));
    for (const std::vector<std::string>& bad : std::vector<std::vector<std::string>>{{"--binning", "3"},
                                                                                     {"--method", "magic"},
                                                                                     {"--photons", "-5"},
                                                                                     {"--photons", "many"},
                                                                                     {"--photons", "nan"},
                                                                                     {"--blur-px", "-1"},
                                                                                     {"--blur-px", "nan"},
                                                                                     {"--repeat", "0"},
                                                                                     {"--mu-water", "-1"},
                                                                                     {"--mu-water", "nan"},
                                                                                     {"--seed", "-1"}}) {
        EXPECT_EQ(cli(command("out.mha", bad)).exit_code, 2) << bad[0] << " " << bad[1];
    }
    EXPECT_FALSE(fs::exists(scratch_ / "out.mha"));
}

TEST_F(DrrTest, NamesTheFileAndFieldOfABadInput) {
    const auto messageOf = [&](const std::vector<std::string>& arguments) {
        const test::Finished finished = cli(arguments);
        EXPECT_EQ(finished.exit_code, 3) << finished.err;
        return errorMessage(finished, "invalidInput");
    };
    write("pose.json", R"({"schema": "fluorocut/pose/1", "target": "robot", "source": "femur",
        "matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 700], [0, 0, 0, 1]]})");
    EXPECT_THAT(messageOf(command("out.mha")), testing::AllOf(HasSubstr("pose.json"), HasSubstr("imager")));
    write("carm.json", R"({"schema": "fluorocut/carm/1", "name": "test", "columns": -4, "rows": 33,
            "pixel_mm": [1.0, 1.0], "focal_length_mm": 1000.0, "principal_point_px": [32, 16], "distortion": null})");
    EXPECT_THAT(messageOf(command("out.mha")), testing::AllOf(HasSubstr("carm.json"), HasSubstr("columns")));
    EXPECT_THAT(messageOf({"drr", "--ct", path("none.mha"), "--view", "ap", "-o", path("out.mha"), "--json"}),
                HasSubstr("none.mha"));
    EXPECT_FALSE(fs::exists(scratch_ / "out.mha"));
}

TEST_F(DrrTest, StoppedByCtrlCItLeavesNothingBehind) {
    const std::size_t before = files();
    test::RunningProgram program(FLUOROCUT_CLI, command("out.mha", {"--repeat", "1000000", "--method", "exact"}));
    std::this_thread::sleep_for(std::chrono::milliseconds(700));
    ASSERT_TRUE(program.isRunning());
    program.signal(SIGINT);
    const test::Finished finished = program.wait();
    EXPECT_EQ(finished.exit_code, 5);
    errorMessage(finished, "cancelled");
    EXPECT_EQ(files(), before);
}

TEST_F(DrrTest, PrintsNothingButItsLinesWhereStderrIsNoTerminal) {
    std::vector<std::string> arguments = command("out.mha");
    arguments.erase(std::find(arguments.begin(), arguments.end(), "--json"));
    const test::Finished finished = cli(arguments);
    EXPECT_EQ(finished.exit_code, 0);
    EXPECT_EQ(finished.err, "");
    EXPECT_THAT(finished.out, HasSubstr("65 x 33 px"));
}

}  // namespace
}  // namespace fluorocut
