// info with the real program, on files written by the library and on broken ones.
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>

#include "core/cutting/tool_path_file.h"
#include "core/geometry/primitives.h"
#include "core/imaging/carm_file.h"
#include "core/io/image_file.h"
#include "core/io/mesh_file.h"
#include "core/io/pose_file.h"
#include "core/io/volume_file.h"
#include "tests/app/cli.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

class InfoTest : public testing::Test {
  protected:
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }
    nlohmann::json infoOf(const std::string& name) const {
        const test::Finished finished = cli({"info", path(name), "--json"});
        EXPECT_EQ(finished.exit_code, 0) << finished.err;
        EXPECT_EQ(cli({"info", path(name)}).exit_code, 0);
        return onlyJson(finished);
    }
    test::ScratchFolder scratch_;
};

TEST_F(InfoTest, Images) {
    Image image(7, 5, 12.0F);
    image(3, 2) = 4000;
    for (const char* name : {"a.png", "a.tiff", "a.mha", "a.nrrd", "a.dcm"}) {
        ASSERT_OK(writeImage(scratch_ / name, image));
        const nlohmann::json info = infoOf(name);
        EXPECT_EQ(info["kind"], "image") << name;
        EXPECT_EQ(info["size"], nlohmann::json({7, 5})) << name;
        EXPECT_EQ(info["least"], 12.0) << name;
        EXPECT_EQ(info["most"], 4000.0) << name;
    }
    EXPECT_EQ(infoOf("a.png")["format"], "PNG");
    EXPECT_EQ(infoOf("a.png")["bits"], 16);
}

TEST_F(InfoTest, Volumes) {
    VolumeGrid grid;
    grid.size = {4, 5, 6};
    grid.spacing_mm = {0.5, 0.75, 2};
    grid.origin_mm = {-10, 20, 30};
    Volume volume(grid, -1000.0F);
    volume(1, 2, 3) = 700;
    for (const char* name : {"a.mha", "a.nrrd", "a.nii.gz"}) {
        ASSERT_OK(writeVolume(scratch_ / name, volume, VoxelType::int16));
        const nlohmann::json info = infoOf(name);
        EXPECT_EQ(info["kind"], "volume") << name;
        EXPECT_EQ(info["size"], nlohmann::json({4, 5, 6})) << name;
        EXPECT_NEAR(info["spacing_mm"][2].get<double>(), 2, 1e-6) << name;  // NIfTI holds floats
        EXPECT_NEAR(info["origin_mm"][1].get<double>(), 20, 1e-5) << name;  // and is RAS: y changes its sign twice
        EXPECT_EQ(info["most"], 700.0) << name;
    }
}

TEST_F(InfoTest, Meshes) {
    TriangleMesh box = makeBox({10, 20, 30});
    ASSERT_OK(writeMesh(scratch_ / "box.stl", box));
    nlohmann::json info = infoOf("box.stl");
    EXPECT_EQ(info["kind"], "mesh");
    EXPECT_EQ(info["watertight"], true);
    EXPECT_EQ(info["triangles"], 12);
    EXPECT_NEAR(info["volume_mm3"].get<double>(), meshProperties(box).volume_mm3, 1e-3);
    box.triangles.pop_back();
    ASSERT_OK(writeMesh(scratch_ / "open.stl", box));
    info = infoOf("open.stl");
    EXPECT_EQ(info["watertight"], false);
    EXPECT_EQ(info["open_edges"], 3);
}

TEST_F(InfoTest, PosesAndCArms) {
    const Pose pose{Frame::imager, Frame::femur, Rigid3::fromTranslation({1, 2, 700}), Matrix6::Identity()};
    ASSERT_OK(writePose(scratch_ / "pose.json", pose));
    const nlohmann::json info = infoOf("pose.json");
    EXPECT_EQ(info["kind"], "pose");
    EXPECT_EQ(info["target"], "imager");
    EXPECT_EQ(info["matrix"][2][3], 700.0);
    EXPECT_EQ(info["covariance"][5][5], 1.0);
    CArm carm;
    carm.name = "Polarix";
    ASSERT_OK(writeCArm(scratch_ / "carm.json", carm));
    EXPECT_EQ(infoOf("carm.json")["kind"], "carm");
    EXPECT_EQ(infoOf("carm.json")["name"], "Polarix");
}

TEST_F(InfoTest, ToolPaths) {
    ToolPath path;
    path.moves.push_back({{{0, 0, 8}, {0, 0, -5}, {0, 0, 1}}, ToolMotion::entry, 2});
    path.moves.push_back({{{0, 0, -5}, {4, 0, -5}, {0, 0, 1}}, ToolMotion::cut, 2});
    path.layers = 1;
    ASSERT_OK(writeToolPath(scratch_ / "path.json", path));
    const nlohmann::json info = infoOf("path.json");
    EXPECT_EQ(info["kind"], "tool-path");
    EXPECT_EQ(info["moves"], 2);
    EXPECT_TRUE(info["time_s"].is_null());  // never worked out
}

TEST_F(InfoTest, WhatCannotBeReadIsNamed) {
    std::ofstream(scratch_ / "text.txt") << "hello, this is no image";
    std::ofstream(scratch_ / "other.json") << R"({"schema": "somebody/else/1"})";
    std::ofstream(scratch_ / "empty.png");
    std::ofstream(scratch_ / "cut.png") << "\x89PNG\r\n\x1a\n....";
    for (const char* name : {"text.txt", "other.json", "empty.png", "cut.png", "absent.nii"}) {
        const test::Finished finished = cli({"info", path(name), "--json"});
        EXPECT_EQ(finished.exit_code, 3) << name;
        EXPECT_THAT(errorMessage(finished, "invalidInput"), HasSubstr(name));
    }
}

TEST_F(InfoTest, RealFiles) {
    SKIP_WITHOUT_SHARED_DATA();
    const std::filesystem::path data = test::sharedData();
    const nlohmann::json femur = onlyJson(cli({"info", (data / "ct/femur_m3_left_0.8mm.nii.gz").string(), "--json"}));
    EXPECT_EQ(femur["format"], "NIfTI");
    EXPECT_NEAR(femur["spacing_mm"][0].get<double>(), 0.8, 1e-6);
    const nlohmann::json series = onlyJson(cli({"info", (data / "ct/ct_abdomen_j2k_dicom").string(), "--json"}));
    EXPECT_EQ(series["format"], "DICOM");
    EXPECT_EQ(series["modality"], "CT");
    const nlohmann::json mesh = onlyJson(cli({"info", (data / "mesh/m3_lfemur_mm.stl").string(), "--json"}));
    EXPECT_EQ(mesh["watertight"], true);
}

}  // namespace
}  // namespace fluorocut
