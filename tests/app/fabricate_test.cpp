// fabricate with the real program: what lands in the folder reads back as what was asked for.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>

#include "core/distortion/grooved_plate.h"
#include "core/fiducial/bead_layout.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/io/mesh_file.h"
#include "tests/app/cli.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

class Fabricate : public testing::Test {
  protected:
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }
    std::size_t files(const fs::path& folder) const {
        return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
    }
    std::string text(const std::string& name) const {
        std::ostringstream all;
        all << std::ifstream(scratch_ / name).rdbuf();
        return all.str();
    }
    test::ScratchFolder scratch_;
};

TEST_F(Fabricate, ThePapersPlate) {
    const test::Finished finished = cli({"fabricate", "plate", "-o", path("out"), "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    ASSERT_EQ(json["files"].size(), 4u);
    EXPECT_EQ(files(scratch_ / "out"), 4u);
    const auto plate = readGroovedPlate(scratch_ / "out" / "plate.json");
    ASSERT_OK(plate);
    EXPECT_EQ(plate->pitch_mm, 6.35);
    const auto solid = readMesh(scratch_ / "out" / "plate.stl");
    ASSERT_OK(solid);
    EXPECT_TRUE(solid->info.properties.closedManifold());
    // 311.15 mm square, a quarter inch thick, 49 + 49 grooves; STL holds floats.
    const double width = 49 * 6.35, w = 1.5875;
    const double expected = width * width * 6.35 - 4.7625 * (2 * 49 * w * width - 49 * 49 * w * w);
    EXPECT_NEAR(solid->info.properties.volume_mm3, expected, 1e-5 * expected);
    EXPECT_NEAR(json["volume_mm3"].get<double>(), expected, 1e-9 * expected);
    EXPECT_THAT(text("out/plate.svg"), HasSubstr("4.7625 [3/16&quot;]"));
    EXPECT_TRUE(text("out/plate.dxf").ends_with("EOF\n"));
}

TEST_F(Fabricate, TheCorkscrew) {
    const test::Finished finished = cli({"fabricate", "corkscrew", "-o", path("out"), "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_EQ(json["files"].size(), 6u);
    EXPECT_EQ(files(scratch_ / "out"), 6u);
    // Four rings and a helix of 1.25 turns over 74 mm, all of radius 14.
    EXPECT_NEAR(json["wire_mm"].get<double>(), 4 * 87.9646 + std::hypot(74, 1.25 * 87.9646), 1e-3);
    const auto layout = readCorkscrew(scratch_ / "out" / "corkscrew.json");
    ASSERT_OK(layout);
    EXPECT_EQ(layout->rings.size(), 4u);
    const auto rod = readMesh(scratch_ / "out" / "rod.stl");
    ASSERT_OK(rod);
    EXPECT_TRUE(rod->info.properties.closedManifold());
    EXPECT_NEAR(rod->info.properties.volume_mm3, json["volume_mm3"].get<double>(), 1e-4 * 73500);
    EXPECT_TRUE(text("out/template.dxf").ends_with("EOF\n"));
}

TEST_F(Fabricate, ABeadPhantom) {
    std::ofstream(scratch_ / "layout.json") << R"({"schema": "fluorocut/beads/1", "frame": "phantom", "beads": [
        {"name": "a", "center_mm": [0, 0, 0], "diameter_mm": 3}, {"name": "b", "center_mm": [30, 5, 0], "diameter_mm": 3},
        {"name": "c", "center_mm": [10, 20, 60], "diameter_mm": 2}]})";
    const test::Finished finished =
        cli({"fabricate", "phantom", "--layout", path("layout.json"), "-o", path("out/"), "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_EQ(json["sheets"], 2);
    EXPECT_EQ(files(scratch_ / "out"), json["files"].size());
    double volume = 0;
    for (const std::string file : json["files"]) {
        EXPECT_TRUE(fs::is_regular_file(scratch_ / "out" / file)) << file;
        if (!file.ends_with(".stl")) continue;
        const auto solid = readMesh(scratch_ / "out" / file);
        ASSERT_OK(solid);
        EXPECT_TRUE(solid->info.properties.closedManifold());
        volume += solid->info.properties.volume_mm3;
    }
    EXPECT_NEAR(json["volume_mm3"].get<double>(), volume, 1e-5 * volume);
    const auto layout = readBeadLayout(scratch_ / "out" / "phantom.json");
    ASSERT_OK(layout);
    EXPECT_EQ(layout->beads[2].center_mm, Vector3(10, 20, 60));
}

TEST_F(Fabricate, OverwritesNothingAndRefusesInWords) {
    const auto message = [&](std::vector<std::string> arguments, int exit_code) {
        arguments.insert(arguments.begin(), "fabricate");
        arguments.emplace_back("--json");
        const test::Finished finished = cli(arguments);
        EXPECT_EQ(finished.exit_code, exit_code) << finished.err;
        return errorMessage(finished, exit_code == 2 ? "invalidOption" : "invalidInput");
    };
    fs::create_directory(scratch_ / "mine");
    std::ofstream(scratch_ / "mine" / "thesis") << "years";
    EXPECT_THAT(message({"plate", "-o", path("mine")}, 2), HasSubstr("not empty"));
    EXPECT_EQ(files(scratch_ / "mine"), 1u);
    EXPECT_THAT(message({"plate", "--plate", "nosuch", "-o", path("out")}, 3), HasSubstr("paper"));
    EXPECT_THAT(message({"phantom", "-o", path("out")}, 2), HasSubstr("--layout"));
    EXPECT_THAT(message({}, 2), HasSubstr("plate, phantom or corkscrew"));
    std::ofstream(scratch_ / "tower.json") << R"({"schema": "fluorocut/beads/1", "frame": "phantom", "beads": [
        {"name": "a", "center_mm": [0, 0, 0], "diameter_mm": 3}, {"name": "b", "center_mm": [30, 5, 4], "diameter_mm": 3}]})";
    EXPECT_THAT(message({"phantom", "--layout", path("tower.json"), "-o", path("out")}, 3),
                HasSubstr("planes at z = 0 and 4 mm"));
    EXPECT_FALSE(fs::exists(scratch_ / "out"));
}

}  // namespace
}  // namespace fluorocut
