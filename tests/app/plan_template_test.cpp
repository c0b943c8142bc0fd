// plan template with the real program.
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>

#include "core/imaging/standard_views.h"
#include "core/io/image_file.h"
#include "core/io/mesh_file.h"
#include "core/io/pose_file.h"
#include "core/io/volume_file.h"
#include "core/simulation/femur_phantom.h"
#include "tests/app/cli.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

class PlanTemplateTest : public testing::Test {
  protected:
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }
    test::ScratchFolder scratch_;
};

TEST_F(PlanTemplateTest, FromACtItsPoseAndStemGoOnToPlanStages) {
    FemurOptions options;
    options.side = BodySide::right;
    options.soft_tissue = false;
    options.pelvis = false;
    options.voxel_mm = 1.2;
    options.head_diameter_mm = 50;
    options.isthmus_canal_mm = 15;
    const auto femur = generateFemur(options);
    ASSERT_OK(femur);
    ASSERT_OK(writeVolume(path("ct.mha"), femur->ct));
    const test::Finished finished =
        cli({"plan", "template", "--ct", path("ct.mha"), "--family", "straight", "-o", path("pose.json"), "--proposal",
             path("proposal.json"), "--stem", path("stem.stl"), "--figure", path("figure.png"), "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_EQ(json["side"], "right");
    EXPECT_FALSE(json["fill"].empty());
    EXPECT_GE(json["room_mm"].get<double>(), -0.05);
    const auto pose = readPose(path("pose.json"), Frame::femur, Frame::cavity);
    ASSERT_OK(pose);
    EXPECT_NEAR(pose->target_from_source.matrix()(0, 3), json["femur_from_cavity"][0][3].get<double>(), 1e-6);
    // The head of the proposed stem lies on the side of the bone's own.
    EXPECT_GT(json["head_center_in_femur_mm"][0].get<double>(), 20);
    EXPECT_LT((pose->target_from_source.translation() - femur->landmarks.shaft_axis_mm.front()).head<2>().norm(), 10);
    std::ifstream written(path("proposal.json"));
    EXPECT_EQ(nlohmann::json::parse(written)["schema"], "fluorocut/template/1");
    EXPECT_OK(readMesh(path("stem.stl")));
    EXPECT_OK(readImage(path("figure.png")));

    const test::Finished staged =
        cli({"plan", "stages", "--implant", path("stem.stl"), "--femur-from-cavity", path("pose.json"),
             "--cutter-radius-mm", "2", "--stages", "1", "--spacing-mm", "1", "-o", path("stages"), "--json"});
    EXPECT_EQ(staged.exit_code, 0) << staged.err;

    // A wrong side, and an axis in the air.
    const test::Finished wrong = cli({"plan", "template", "--ct", path("ct.mha"), "--family", "straight", "--side",
                                      "left", "-o", path("x.json"), "--json"});
    EXPECT_EQ(wrong.exit_code, 3);
    EXPECT_THAT(errorMessage(wrong, "invalidInput"), HasSubstr("--side"));
    const test::Finished air = cli({"plan", "template", "--ct", path("ct.mha"), "--family", "straight", "--axis-mm",
                                    "500,0,0,500,0,-100", "-o", path("x.json"), "--json"});
    EXPECT_EQ(air.exit_code, 4);
    EXPECT_THAT(errorMessage(air, "noSolution"), HasSubstr("ring of cortex"));
    EXPECT_FALSE(std::filesystem::exists(path("x.json")));
}

TEST_F(PlanTemplateTest, FromTwoViewsOfDrawnWalls) {
    // A cylindrical canal of 15 mm along z, widening to 34 mm medially at the top: drawn in AP and lateral view.
    const CArm carm = standardCArm();
    ASSERT_OK(writeImage(path("image.png"), Image(carm.columns, carm.rows, 100)));
    std::ofstream(scratch_ / "carm.json")
        << nlohmann::json{{"schema", "fluorocut/carm/1"},
                          {"name", "standard"},
                          {"columns", carm.columns},
                          {"rows", carm.rows},
                          {"pixel_mm", {carm.pixel_mm.x(), carm.pixel_mm.y()}},
                          {"focal_length_mm", carm.focal_length_mm},
                          {"principal_point_px", {carm.principal_point_px.x(), carm.principal_point_px.y()}},
                          {"distortion", nullptr}};
    std::vector<std::string> arguments{"plan", "template", "--family", "straight", "-o", path("pose.json"), "--json"};
    for (const StandardView kind : {StandardView::ap, StandardView::lateral}) {
        const bool ap = kind == StandardView::ap;
        const std::string name = ap ? "ap" : "lateral";
        const Rigid3 pose = standardView(kind, {0, 0, -70}, kStandardObjectDepthMm);
        ASSERT_OK(writePose(scratch_ / (name + ".json"), {Frame::imager, Frame::femur, pose, std::nullopt}));
        nlohmann::json walls = nlohmann::json::array();
        for (const bool first : {true, false}) {
            nlohmann::json u = nlohmann::json::array(), v = nlohmann::json::array();
            for (double z = 0; z > -190; z -= 8) {
                const double flare = ap && first ? 12 * std::pow(std::max(0.0, 1 + z / 70), 2) : 0;
                const double across = (first ? -1 : 1) * (9 + flare);  // medial of a left femur and anterior: - in LPS
                const Vector2 pixel = carm.project(pose * (ap ? Vector3(across, 0, z) : Vector3(0, across, z)));
                u.push_back(pixel.x());
                v.push_back(pixel.y());
            }
            walls.push_back({{"side", ap ? (first ? "medial" : "lateral") : (first ? "anterior" : "posterior")},
                             {"surface", "canal"},
                             {"u_px", u},
                             {"v_px", v}});
        }
        std::ofstream(scratch_ / (name + "_walls.json"))
            << nlohmann::json{{"schema", "fluorocut/contours/1"}, {"walls", walls}};
        arguments.insert(arguments.end(), {"--view", path("image.png") + "," + path("carm.json") + "," +
                                                         path(name + ".json") + "," + path(name + "_walls.json")});
    }
    const test::Finished finished = cli(arguments);
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_EQ(json["side"], "left");
    EXPECT_TRUE(json["least_wall"].is_null());  // no outer wall drawn
    const auto pose = readPose(path("pose.json"), Frame::femur, Frame::cavity);
    ASSERT_OK(pose);
    EXPECT_LT(pose->target_from_source.rotate(Vector3::UnitX()).x(), -0.9);
    // The tip of a stem no wider than the canal lies in its middle.
    EXPECT_NEAR(pose->target_from_source.translation().z(), 0, 1);

    arguments.erase(arguments.end() - 2, arguments.end());
    EXPECT_EQ(cli(arguments).exit_code, 2);
    EXPECT_EQ(cli({"plan", "template", "--family", "straight", "-o", path("p.json")}).exit_code, 2);
}

}  // namespace
}  // namespace fluorocut
