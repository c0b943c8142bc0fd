// phantom and cut-volume with the real program.
#include <csignal>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <thread>

#include <gmock/gmock.h>

#include "core/geometry/primitives.h"
#include "core/io/mesh_file.h"
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

class PhantomTest : public testing::Test {
  protected:
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }
    std::size_t files() const {
        return static_cast<std::size_t>(
            std::distance(fs::directory_iterator(scratch_.path()), fs::directory_iterator()));
    }
    void writePose(const std::string& name, const std::string& target, const std::string& source) const {
        std::ofstream(scratch_ / name) << R"({"schema": "fluorocut/pose/1", "target": ")" << target
                                       << R"(", "source": ")" << source
                                       << R"(", "matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,5],[0,0,0,1]]})";
    }
    test::ScratchFolder scratch_;
};

TEST_F(PhantomTest, AnAcrylicBlockIsWhatWasAskedFor) {
    const test::Finished finished = cli({"phantom", "acrylic", "--size-mm", "40", "30", "60", "--voxel-mm", "1",
                                         "--beads", "3", "-o", path("b.nrrd"), "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    EXPECT_EQ(onlyJson(finished)["bead_centers_mm"].size(), 3u);
    const Result<VolumeFile> block = readVolume(scratch_ / "b.nrrd");
    ASSERT_OK(block);
    double acrylic_mm3 = 0;  // every voxel's share of acrylic, beads counted as acrylic
    for (const float hu : block->volume.voxels())
        acrylic_mm3 += std::min(1.0, (hu + 1000) / 1125.0);
    // int16 voxels round the share by up to 0.5 / 1125 on the faces only: 0.1 %.
    EXPECT_NEAR(acrylic_mm3, 40.0 * 30 * 60, 0.001 * 40 * 30 * 60);
}

TEST_F(PhantomTest, ASmallFemurHasItsSideAndItsLandmarks) {
    const auto headOf = [&](const std::string& side) {
        const test::Finished finished =
            cli({"phantom", "femur", "--side", side, "--voxel-mm", "3", "--dry", "-o", path(side + ".mha"), "--json"});
        EXPECT_EQ(finished.exit_code, 0) << finished.err;
        return onlyJson(finished)["landmarks"]["head_center_mm"][0].get<double>();
    };
    // DICOM LPS: x to the patient's left. The head lies toward the middle of the body.
    EXPECT_LT(headOf("left"), -20);
    EXPECT_NEAR(headOf("right"), -headOf("left"), 1e-9);
    EXPECT_OK(readVolume(scratch_ / "left.mha"));
}

TEST_F(PhantomTest, RefusesOptionsOutsideTheirLimitsByName) {
    const auto messageOf = [&](std::vector<std::string> arguments) {
        arguments.insert(arguments.end(), {"-o", path("x.mha"), "--json"});
        const test::Finished finished = cli(arguments);
        EXPECT_EQ(finished.exit_code, 2) << finished.err;
        return errorMessage(finished, "invalidOption");
    };
    EXPECT_THAT(messageOf({"phantom", "femur", "--voxel-mm", "0.001"}), HasSubstr("voxel"));
    EXPECT_THAT(messageOf({"phantom", "femur", "--head-diameter-mm", "nan"}), HasSubstr("head_diameter"));
    EXPECT_THAT(messageOf({"phantom", "femur", "--side", "middle"}), HasSubstr("side"));
    EXPECT_THAT(messageOf({"phantom", "acrylic", "--beads", "-1"}), HasSubstr("bead"));
    EXPECT_THAT(messageOf({"phantom", "acrylic", "--size-mm", "1", "2"}), HasSubstr("size-mm"));
    EXPECT_THAT(messageOf({"phantom", "cheese"}), HasSubstr("cheese"));
    EXPECT_EQ(cli({"phantom"}).exit_code, 2);
    EXPECT_EQ(files(), 0u);
}

TEST_F(PhantomTest, StoppedByCtrlCItLeavesNothingBehind) {
    test::RunningProgram program(FLUOROCUT_CLI,
                                 {"phantom", "femur", "--voxel-mm", "0.5", "-o", path("femur.mha"), "--json"});
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    ASSERT_TRUE(program.isRunning());
    program.signal(SIGINT);
    const test::Finished finished = program.wait();
    EXPECT_EQ(finished.exit_code, 5) << finished.err;
    errorMessage(finished, "cancelled");
    EXPECT_EQ(files(), 0u);
}

TEST_F(PhantomTest, CutVolumeRemovesTheMeshsVolume) {
    ASSERT_EQ(cli({"phantom", "acrylic", "--voxel-mm", "1", "-o", path("block.mha")}).exit_code, 0);
    const TriangleMesh box = makeBox({10, 12, 20});
    ASSERT_OK(writeMesh(scratch_ / "box.stl", box));
    writePose("pose.json", "femur", "cavity");
    const test::Finished finished = cli({"cut-volume", "--ct", path("block.mha"), "--mesh", path("box.stl"),
                                         "--femur-from-cavity", path("pose.json"), "-o", path("cut.mha"), "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const double volume = meshProperties(box).volume_mm3;
    EXPECT_NEAR(onlyJson(finished)["removed_mm3"].get<double>(), volume, 0.002 * volume);  // the issue's 0.2 %
    const Result<VolumeFile> before = readVolume(scratch_ / "block.mha");
    const Result<VolumeFile> after = readVolume(scratch_ / "cut.mha");
    ASSERT_OK(before);
    ASSERT_OK(after);
    double removed_hu = 0;
    for (std::size_t i = 0; i < before->volume.voxels().size(); ++i) {
        removed_hu += before->volume.voxels()[i] - after->volume.voxels()[i];
    }
    EXPECT_NEAR(removed_hu / 1125, volume, 0.002 * volume);  // voxels of 1 mm3, acrylic at 125 HU
}

TEST_F(PhantomTest, CutVolumeRefusesWhatDoesNotFit) {
    ASSERT_EQ(cli({"phantom", "acrylic", "--voxel-mm", "2", "-o", path("block.mha")}).exit_code, 0);
    TriangleMesh box = makeBox({10, 12, 20});
    ASSERT_OK(writeMesh(scratch_ / "box.stl", box));
    box.triangles.pop_back();
    ASSERT_OK(writeMesh(scratch_ / "open.stl", box));
    writePose("pose.json", "femur", "cavity");
    writePose("wrong.json", "imager", "femur");
    const auto run = [&](const std::string& mesh, const std::string& pose, const std::string& output) {
        return cli({"cut-volume", "--ct", path("block.mha"), "--mesh", path(mesh), "--femur-from-cavity", path(pose),
                    "-o", path(output), "--json"});
    };
    EXPECT_EQ(run("open.stl", "pose.json", "cut.mha").exit_code, 3);
    EXPECT_THAT(errorMessage(run("box.stl", "wrong.json", "cut.mha"), "invalidInput"), HasSubstr("wrong.json"));
    EXPECT_EQ(run("box.stl", "pose.json", "block.mha").exit_code, 2);
    EXPECT_EQ(run("box.stl", "pose.json", "cut.stl").exit_code, 2);
    EXPECT_FALSE(fs::exists(scratch_ / "cut.mha"));
}

}  // namespace
}  // namespace fluorocut
