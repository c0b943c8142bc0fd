// register beads, chain and advise with the real program, on pictures drawn here and on measured poses.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>

#include "core/image/image.h"
#include "core/imaging/carm_file.h"
#include "core/io/image_file.h"
#include "core/io/pose_file.h"
#include "tests/app/cli.h"
#include "tests/core/registration/chain_scene.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

nlohmann::json rowsOf(const Eigen::MatrixXd& matrix) {
    nlohmann::json rows = nlohmann::json::array();
    for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
        rows.push_back(nlohmann::json::array());
        for (Eigen::Index c = 0; c < matrix.cols(); ++c)
            rows.back().push_back(matrix(r, c));
    }
    return rows;
}

nlohmann::json poseJson(const Pose& pose) {
    nlohmann::json json = {{"matrix", rowsOf(pose.target_from_source.matrix())}};
    if (pose.covariance) json["covariance"] = rowsOf(*pose.covariance);
    return json;
}

nlohmann::json fileOf(const ChainProblem& problem) {
    nlohmann::json json = {{"schema", "fluorocut/registration/1"},
                           {"flange_from_corkscrew", poseJson(problem.flange_from_corkscrew)},
                           {"points", {{{"name", "stem's tip"}, {"in_femur_mm", {0, 0, -120}}}}}};
    for (const ChainView& view : problem.views) {
        json["views"].push_back({{"name", view.name},
                                 {"time", "2026-03-01T09:30:00Z"},
                                 {"robot_from_flange", poseJson(view.robot_from_flange)},
                                 {"imager_from_corkscrew", poseJson(view.imager_from_corkscrew.pose)},
                                 {"imager_from_femur", poseJson(view.imager_from_femur.pose)}});
    }
    return json;
}

class RegisterTest : public testing::Test {
  protected:
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }

    void write(const std::string& name, const nlohmann::json& json) { std::ofstream(scratch_ / name) << json.dump(); }

    test::Finished chain(std::vector<std::string> more = {}) {
        std::vector<std::string> arguments{"register", "chain", "--measurements", path("m.json"), "--json"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return cli(arguments);
    }

    test::ScratchFolder scratch_;
};

// Without shared errors: those of the file are each pose's own.
test::ChainScene scene() {
    test::ChainScene scene;
    scene.focal_sigma = scene.center_sigma_px = 1e-12;
    return scene;
}

TEST_F(RegisterTest, ChainFromMeasuredPoses) {
    Random random(3);
    write("m.json", fileOf(scene().problem(&random)));
    const test::Finished finished = chain({"-o", path("pose.json")});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    const Result<Pose> pose = readPose(path("pose.json"), Frame::robot, Frame::femur);
    ASSERT_OK(pose);
    // Within four of the standard deviations that it states itself, at the point asked for.
    const Vector3 tip(0, 0, -120);
    const double error = (pose->target_from_source * tip - scene().robot_from_femur * tip).norm();
    EXPECT_LT(error, 2 * json["points"][0]["radius95_mm"].get<double>());
    EXPECT_LT(json["points"][0]["radius95_mm"], 1);
    EXPECT_THAT(json["points"][0]["sentence"].get<std::string>(), HasSubstr("stem's tip"));
    double shares = 0;
    for (const auto& term : json["points"][0]["budget"])
        shares += term["share"].get<double>();
    EXPECT_NEAR(shares, 1, 1e-6);
    EXPECT_EQ(json["views"].size(), 2);
    EXPECT_THAT(json["paths"][0].get<std::string>(), HasSubstr("2026-03-01T09:30:00Z"));
}

TEST_F(RegisterTest, InfoTellsOfAFileOfMeasurements) {
    write("m.json", fileOf(scene().problem(nullptr)));
    const nlohmann::json json = onlyJson(cli({"info", path("m.json"), "--json"}));
    EXPECT_EQ(json["kind"], "registration");
    EXPECT_EQ(json["views"].size(), 2);
    EXPECT_EQ(json["points"][0]["name"], "stem's tip");
}

TEST_F(RegisterTest, ChainJudgesItsLimits) {
    Random random(3);
    write("m.json", fileOf(scene().problem(&random)));
    const test::Finished finished = chain({"--max-error-mm", "0.01", "--at-mm", "a=0,0,0", "--at-mm", "10,-5,30"});
    EXPECT_EQ(finished.exit_code, 1) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_EQ(json["points"].size(), 2);
    EXPECT_EQ(json["accepted"], false);
}

TEST_F(RegisterTest, ChainRefusesViewsThatAreSwappedOrAlike) {
    Random random(3);
    test::ChainScene one = scene();
    one.angulation_deg = {0, 25};
    ChainProblem problem = one.problem(&random);
    std::swap(problem.views[0].imager_from_femur, problem.views[1].imager_from_femur);
    write("m.json", fileOf(problem));
    test::Finished finished = chain();
    EXPECT_EQ(finished.exit_code, 4);
    EXPECT_THAT(errorMessage(finished, "noSolution"), HasSubstr("exchange the poses of the femur of v1 and v2"));

    one.orbital_deg = {0, 4};
    one.angulation_deg = {0, 0};
    write("m.json", fileOf(one.problem(&random)));
    finished = chain();
    EXPECT_EQ(finished.exit_code, 4);
    EXPECT_THAT(errorMessage(finished, "noSolution"), HasSubstr("same direction"));
}

TEST_F(RegisterTest, ChainNamesWhatIsWrongWithItsFile) {
    const nlohmann::json good = fileOf(scene().problem(nullptr));
    const auto refused = [&](const nlohmann::json& json, const std::string& sentence) {
        write("m.json", json);
        const test::Finished finished = chain();
        EXPECT_EQ(finished.exit_code, 3) << finished.err;
        EXPECT_THAT(errorMessage(finished, "invalidInput"), HasSubstr(sentence));
    };
    nlohmann::json bad = good;
    bad["views"][1]["imager_from_femur"].erase("covariance");
    refused(bad, "view v2, imager_from_femur");
    bad = good;
    bad["views"][0]["time"] = "yesterday";
    refused(bad, "time");
    bad = good;
    bad["views"] = nlohmann::json::array();
    refused(bad, "0 views");
    bad = good;
    bad["views"][1]["name"] = "v1";
    refused(bad, "two views of the name");
    bad = good;
    bad["views"][0]["robot_from_flange"]["matrix"][0][0] = 2;
    refused(bad, "matrix");
    bad = good;
    bad["views"][0]["robot_from_flange"] = {{"file", "absent.json"}};
    refused(bad, "absent.json");
    bad = good;
    bad["focal"] = 3;
    refused(bad, "focal");
    EXPECT_EQ(cli({"register", "chain", "--json"}).exit_code, 2);
    EXPECT_EQ(cli({"register", "--json"}).exit_code, 2);
    write("m.json", good);
    EXPECT_EQ(chain({"--at-mm", "1,2"}).exit_code, 2);
    EXPECT_EQ(chain({"--at-mm", "a=1,2,nan"}).exit_code, 2);
    EXPECT_EQ(chain({"-o", path("m.json")}).exit_code, 2);
}

// The calibration's error of 1 % of depth is in both poses; the file may say so.
TEST_F(RegisterTest, ChainTakesSharedCalibrationErrors) {
    nlohmann::json json = fileOf(scene().problem(nullptr));
    const double before = onlyJson((write("m.json", json), chain()))["points"][0]["radius95_mm"];
    json["calibration"] = {{"focal_length", 0.01}, {"principal_point_mm", 0.3}, {"focal_length_mm", 1000}};
    write("m.json", json);
    const nlohmann::json result = onlyJson(chain());
    EXPECT_GT(result["points"][0]["radius95_mm"], before);
    // 7 mm of depth each, if they did not cancel.
    EXPECT_LT(result["points"][0]["radius95_mm"], 3);
}

TEST_F(RegisterTest, AdviseTellsWhereToLookFromNext) {
    test::ChainScene one = scene();
    one.orbital_deg = {0};
    write("m.json", fileOf(one.problem(nullptr)));
    const test::Finished finished = cli({"register", "advise", "--measurements", path("m.json"), "--step-deg", "10",
                                         "--max-orbital-deg", "100", "--max-angulation-deg", "30", "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_LT(json["next"]["worst_sd_mm"], 0.7 * json["worst_sd_mm"].get<double>());
    EXPECT_GT(json["next"]["turn_deg"], 45);
    EXPECT_EQ(json["grid"].size(), 21 * 7);
    EXPECT_THAT(json["sentence"].get<std::string>(), HasSubstr("stem's tip"));
    EXPECT_EQ(cli({"register", "advise", "--measurements", path("m.json"), "--reference", "2"}).exit_code, 2);
}

// Black disks on grey: what any program can draw.
class RegisterBeadsTest : public RegisterTest {
  protected:
    const std::vector<Vector3> beads_{{14, -6, 42},   {22, 9, 33},  {8, 14, 20},   {-9, 12, 6},   {12, -13, 0},
                                      {-11, -9, -13}, {13, 4, -24}, {-4, 15, -36}, {6, -14, -48}, {-12, 3, -56}};

    static Rigid3 view(double orbital_rad) {
        Matrix3 ap;
        ap << 1, 0, 0, 0, 0, -1, 0, 1, 0;
        return Rigid3::fromTranslation({1, -7, 690}) * Rigid3::fromRotationVector({0, orbital_rad, 0}) *
               Rigid3(ap, Vector3::Zero());
    }

    void SetUp() override {
        nlohmann::json layout = {{"schema", "fluorocut/beads/1"}, {"frame", "femur"}};
        for (std::size_t i = 0; i < beads_.size(); ++i) {
            layout["beads"].push_back({{"name", std::string("b").append(std::to_string(i))},
                                       {"center_mm", {beads_[i].x(), beads_[i].y(), beads_[i].z()}},
                                       {"diameter_mm", 2.0}});
        }
        write("beads.json", layout);
        CArm carm;
        ASSERT_OK(writeCArm(path("carm.json"), carm));
        draw("ap.png", carm, view(0));
        draw("lateral.png", carm, view(1.4));
    }

    void draw(const std::string& name, const CArm& carm, const Rigid3& pose) {
        Image image(carm.columns, carm.rows, 170);
        for (const Vector3& bead : beads_) {
            const Vector3 place = pose * bead;
            const Vector2 center = carm.project(place);
            const double radius = carm.focal_length_mm / place.z() / carm.pixel_mm.x();
            for (int y = 0; y < carm.rows; ++y) {
                for (int x = 0; x < carm.columns; ++x) {
                    // Share of the pixel that is covered, across the edge.
                    const double inside = std::clamp(radius - (Vector2(x, y) - center).norm() + 0.5, 0.0, 1.0);
                    if (inside > 0) image(x, y) = static_cast<float>(170 - 140 * inside);
                }
            }
        }
        ImageWriteOptions bytes;
        bytes.type = PixelType::uint8;
        ASSERT_OK(writeImage(scratch_ / name, image, bytes));
    }

    std::string viewOf(const std::string& image) const { return path(image) + "," + path("carm.json"); }
};

TEST_F(RegisterBeadsTest, FindsTheFemurInBothViews) {
    const test::Finished finished =
        cli({"register", "beads", "--view", viewOf("ap.png"), "--view", viewOf("lateral.png"), "--beads",
             path("beads.json"), "-o", path("poses"), "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err << finished.out;
    const nlohmann::json json = onlyJson(finished);
    ASSERT_EQ(json["views"].size(), 2);
    for (int k = 0; k < 2; ++k) {
        const Result<Pose> pose =
            readPose(scratch_ / "poses" / ("femur_" + std::to_string(k + 1) + ".json"), Frame::imager, Frame::femur);
        ASSERT_OK(pose);
        const Vector6 off = pose->target_from_source.deltaFrom(view(k == 0 ? 0 : 1.4));
        // Disks are centred to some 0.03 px: 0.01 mm across, and 690 / 40 times as much in depth.
        EXPECT_LT(off.head<2>().norm(), 0.03);
        EXPECT_LT(std::abs(off[2]), 0.3);
        EXPECT_LT(off.tail<3>().norm(), 0.001);
        EXPECT_EQ(json["views"][static_cast<std::size_t>(k)]["beads"].size(), 10);
        EXPECT_LT(json["views"][static_cast<std::size_t>(k)]["fre_mm"], 0.05);
    }
}

TEST_F(RegisterBeadsTest, RefusesWhatDoesNotBelongTogether) {
    nlohmann::json other = nlohmann::json::parse(std::ifstream(scratch_ / "beads.json"));
    for (std::size_t i = 0; i < other["beads"].size(); ++i)
        other["beads"][i]["center_mm"] = {3.0 * std::sin(5.0 * double(i)) * 7, 20 * std::cos(3.0 * double(i)),
                                          11.0 * double(i) - 55};
    write("other.json", other);
    test::Finished finished = cli({"register", "beads", "--view", viewOf("ap.png"), "--view", viewOf("lateral.png"),
                                   "--beads", path("other.json"), "--json"});
    EXPECT_EQ(finished.exit_code, 4);
    EXPECT_THAT(errorMessage(finished, "noSolution"), HasSubstr("check that this is the femur's beads file"));

    other["frame"] = "phantom";
    write("other.json", other);
    finished = cli({"register", "beads", "--view", viewOf("ap.png"), "--beads", path("other.json"), "--json"});
    EXPECT_EQ(finished.exit_code, 3);
    EXPECT_THAT(errorMessage(finished, "invalidInput"), HasSubstr("beads of the femur"));

    ASSERT_OK(writeImage(scratch_ / "empty.png", Image(512, 512, 170), {}));
    finished = cli({"register", "beads", "--view", viewOf("empty.png"), "--beads", path("beads.json"), "--json"});
    EXPECT_EQ(finished.exit_code, 4);
    EXPECT_THAT(errorMessage(finished, "noSolution"), HasSubstr("0 bead shadows"));

    EXPECT_EQ(cli({"register", "beads", "--view", path("ap.png"), "--beads", path("beads.json")}).exit_code, 2);
    EXPECT_EQ(cli({"register", "beads", "--view", viewOf("ap.png"), "--view", viewOf("ap.png"), "--beads",
                   path("beads.json")})
                  .exit_code,
              2);
}

}  // namespace
}  // namespace fluorocut
