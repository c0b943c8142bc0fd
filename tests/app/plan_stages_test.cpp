// plan stages with the real program: what lands in the folder, held against closed forms.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <optional>

#include <gmock/gmock.h>

#include "core/cutting/tool_path_file.h"
#include "core/geometry/primitives.h"
#include "core/io/mesh_file.h"
#include "core/io/pose_file.h"
#include "tests/app/cli.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;
constexpr double kPi = std::numbers::pi;

class PlanStages : public testing::Test {
  protected:
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }

    void SetUp() override {
        ASSERT_OK(writeMesh(path("stem.stl"), makeCylinder(8, 30, 180)));
        write("plan.json", Frame::femur, Frame::cavity, std::nullopt);
    }

    void write(const std::string& name, Frame target, Frame source, std::optional<Matrix6> covariance) const {
        ASSERT_OK(writePose(path(name), Pose{target, source, Rigid3(expRotation({0.1, 0.2, 0.3}), {10, -20, 30}),
                                             std::move(covariance)}));
    }

    std::vector<std::string> command(std::vector<std::string> more = {}) const {
        std::vector<std::string> all{"plan",
                                     "stages",
                                     "--implant",
                                     path("stem.stl"),
                                     "--femur-from-cavity",
                                     path("plan.json"),
                                     "--cutter-radius-mm",
                                     "3",
                                     "-o",
                                     path("out"),
                                     "--json"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }

    // A cylinder of radius r and length l with its bottom edge rounded by the cutter.
    static double roundedCylinder(double r, double l) {
        const double R = 3;
        return kPi * r * r * l - (1 - kPi / 4) * R * R * 2 * kPi * (r - (10 - 3 * kPi) / (12 - 3 * kPi) * R);
    }

    test::ScratchFolder scratch_;
};

TEST_F(PlanStages, OfACylinderAreCylindersInsideOneAnother) {
    const test::Finished finished = cli(command({"--insets-mm", "2,1,0"}));
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    ASSERT_EQ(json["stages"].size(), 3u);
    for (int k = 1; k <= 3; ++k) {
        const nlohmann::json& stage = json["stages"][static_cast<std::size_t>(k - 1)];
        const double inset = 3 - k;
        EXPECT_EQ(stage["inset_mm"], inset);
        EXPECT_EQ(stage["mesh"], "stage_" + std::to_string(k) + ".stl");
        // round walls' facets lie 3 h^2 / (8 r) = 0.02 mm inside at most: 0.6 % of the volume
        EXPECT_NEAR(stage["volume_mm3"].get<double>() / roundedCylinder(8 - inset, 30 - inset), 1, 0.006);
        EXPECT_NEAR(stage["depth_mm"].get<double>(), 30 - inset, 0.005);
        EXPECT_TRUE(stage["checked"].get<bool>());
        EXPECT_LT(stage["worst_by_mesh_mm"].get<double>(), 0.05);
        const auto mesh = readMesh(scratch_ / "out" / stage["mesh"].get<std::string>());
        ASSERT_OK(mesh);
        EXPECT_TRUE(mesh->info.properties.closedManifold());
        EXPECT_NEAR(mesh->info.properties.volume_mm3 / stage["volume_mm3"].get<double>(), 1, 1e-5);  // STL: floats
        EXPECT_NEAR(mesh->info.properties.max_corner.z(), 15, 1e-5);
        const auto read = readToolPath(scratch_ / "out" / stage["tool_path"].get<std::string>());
        ASSERT_OK(read);
        EXPECT_EQ(read->layers, stage["layers"].get<int>());
        EXPECT_EQ(read->time_s, stage["cutting_time_s"].get<double>());
        EXPECT_GT(read->time_s, 10);
        EXPECT_GE(read->layers, 27 - inset);  // 1 mm each
    }
    EXPECT_EQ(json["files"].size(), 7u);
    std::size_t files = 0;
    for (const auto& file : fs::directory_iterator(scratch_ / "out"))
        files += static_cast<std::size_t>(file.is_regular_file());
    EXPECT_EQ(files, 7u);
    // the folder's own table says the same
    const nlohmann::json table = nlohmann::json::parse(std::ifstream(scratch_ / "out" / "stages.json"));
    EXPECT_EQ(table["schema"], "fluorocut/stages/1");
    EXPECT_EQ(table["frame"], "cavity");
    EXPECT_EQ(table["stages"], json["stages"]);
    EXPECT_EQ(table["undercut_mm3"], json["undercut_mm3"]);
    EXPECT_NEAR(json["undercut_mm3"].get<double>(), 0, 0.01);
    EXPECT_NEAR(json["unreachable_mm3"].get<double>(), kPi * 64 * 30 - roundedCylinder(8, 30), 4);
    EXPECT_TRUE(json["inset_asked_mm"].is_null());
}

// A cone, with a cement mantle, cut at a resection below its top: a wider cone.
TEST_F(PlanStages, OfAConeWithAMantleAreCutAtTheResection) {
    ASSERT_OK(writeMesh(path("stem.stl"), makeFrustum(4, 12, 40, 360)));
    const test::Finished finished =
        cli(command({"--stages", "1", "--offset-mm", "1", "--top-mm", "10", "--mesh-unit", "mm"}));
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    ASSERT_EQ(json["stages"].size(), 1u);
    EXPECT_EQ(json["top_mm"], 10);
    const auto mesh = readMesh(scratch_ / "out" / "stage_1.stl");
    ASSERT_OK(mesh);
    EXPECT_NEAR(mesh->info.properties.max_corner.z(), 10, 1e-5);
    // the flank moves out by 1 mm across itself: by 1 / cos(slope) in the plane of the resection
    const double slope = std::atan(8.0 / 40), radius = 4 + 30 * std::tan(slope) + 1 / std::cos(slope);
    EXPECT_NEAR(mesh->info.properties.max_corner.x(), radius, 0.03);
    EXPECT_NEAR(mesh->info.properties.min_corner.z(), -21, 0.03);
}

// One error only, across: the worst place's is that error, whatever the pose; 99 % of |normal| lie within 2.576 sigma.
TEST_F(PlanStages, FirstInsetIsWhatTheCovariancesAskFor) {
    Matrix6 own = Matrix6::Zero(), registered = Matrix6::Zero();
    own(0, 0) = 0.09;
    registered(0, 0) = 0.16;
    const auto asked = [&](const std::vector<std::string>& more) {
        fs::remove_all(scratch_ / "out");
        const test::Finished finished = cli(command(more));
        EXPECT_EQ(finished.exit_code, 0) << finished.err;
        const nlohmann::json json = onlyJson(finished);
        EXPECT_EQ(json["stages"][0]["inset_mm"], json["inset_asked_mm"]);
        EXPECT_EQ(json["stages"].back()["inset_mm"], 0);
        return json["inset_asked_mm"].get<double>();
    };
    // 20000 draws know the quantile to 1.5 %; the cylinder's facets look every way in x and y within 1 degree, and
    // the translation is mostly across its axis (turned by 0.37 rad from it: 0.92 at the least, down the floor's edge
    // more).
    write("plan.json", Frame::femur, Frame::cavity, own);
    const double alone = asked({"--stages", "2"});
    EXPECT_NEAR(alone, 0.3 * 2.576, 0.06);
    write("robot.json", Frame::robot, Frame::femur, registered);
    const double both = asked({"--stages", "2", "--registration", path("robot.json")});
    EXPECT_GT(both, 0.4 * 2.3);
    EXPECT_LT(both, 0.5 * 2.7);
    EXPECT_GT(asked({"--stages", "2", "--probability", "0.999"}), alone * 1.15);  // 3.29 / 2.576
}

TEST_F(PlanStages, WarnOfInsetsThatAreNotEnoughAndOfUnknownErrors) {
    const test::Finished unknown = cli(command({"--stages", "2"}));
    ASSERT_EQ(unknown.exit_code, 0) << unknown.err;
    EXPECT_THAT(onlyJson(unknown)["warnings"].dump(), HasSubstr("tells a covariance"));
    EXPECT_EQ(onlyJson(unknown)["stages"][0]["inset_mm"], 1);
    Matrix6 covariance = Matrix6::Zero();
    covariance(0, 0) = 0.09;
    write("plan.json", Frame::femur, Frame::cavity, covariance);
    const test::Finished known =
        cli({"plan", "stages", "--implant", path("stem.stl"), "--femur-from-cavity", path("plan.json"),
             "--cutter-radius-mm", "3", "-o", path("other"), "--insets-mm", "0.2,0", "--json"});
    ASSERT_EQ(known.exit_code, 0) << known.err;
    EXPECT_THAT(onlyJson(known)["warnings"].dump(), HasSubstr("to stay inside it with a probability of 0.99"));
}

TEST_F(PlanStages, RefusesInOneSentenceAndLeavesNothingBehind) {
    const auto refused = [&](const std::vector<std::string>& arguments, int exit_code, const std::string& code) {
        const test::Finished finished = cli(arguments);
        EXPECT_EQ(finished.exit_code, exit_code) << finished.err;
        EXPECT_FALSE(fs::exists(scratch_ / "out"));
        return errorMessage(finished, code);
    };
    EXPECT_THAT(refused(command({"--insets-mm", "1,2,0"}), 2, "invalidOption"), HasSubstr("insets that fall to 0"));
    EXPECT_THAT(refused(command({"--insets-mm", "2,1"}), 2, "invalidOption"), HasSubstr("1 at the end"));
    EXPECT_THAT(refused(command({"--insets-mm", "6,0"}), 4, "noSolution"), HasSubstr("stage 1 of 2: the stage"));
    EXPECT_THAT(refused(command({"--offset-mm", "nan"}), 2, "invalidOption"), HasSubstr("offset_mm"));
    EXPECT_THAT(refused(command({"--top-mm", "-40"}), 2, "invalidOption"), HasSubstr("top_mm"));
    std::vector<std::string> thick = command();
    thick[7] = "9";
    EXPECT_THAT(refused(thick, 4, "noSolution"), HasSubstr("take a smaller cutter"));
    EXPECT_THAT(refused(command({"--mesh-unit", "m"}), 3, "invalidInput"), HasSubstr("stem.stl"));

    write("plan.json", Frame::imager, Frame::femur, std::nullopt);
    EXPECT_THAT(refused(command(), 3, "invalidInput"), HasSubstr("plan.json"));
    write("plan.json", Frame::femur, Frame::cavity, std::nullopt);
    EXPECT_THAT(refused(command({"--registration", path("plan.json")}), 3, "invalidInput"), HasSubstr("plan.json"));

    TriangleMesh open = makeCylinder(8, 30, 60);
    open.triangles.pop_back();
    ASSERT_OK(writeMesh(path("stem.stl"), open));
    EXPECT_THAT(refused(command(), 3, "invalidInput"), HasSubstr("hole"));
}

TEST_F(PlanStages, OverwritesNoFolder) {
    fs::create_directory(scratch_ / "out");
    std::ofstream(scratch_ / "out" / "mine.txt") << "mine";
    const test::Finished finished = cli(command({"--stages", "1"}));
    EXPECT_EQ(finished.exit_code, 2);
    EXPECT_THAT(errorMessage(finished, "invalidOption"), HasSubstr("a folder that is not empty"));
    EXPECT_EQ(std::distance(fs::directory_iterator(scratch_ / "out"), fs::directory_iterator()), 1);
}

}  // namespace
}  // namespace fluorocut
