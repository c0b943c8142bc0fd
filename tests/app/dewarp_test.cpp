// dewarp and paper-tables with the real program, on pictures that `phantom plate` makes.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>

#include <gmock/gmock.h>

#include "core/distortion/grooved_plate.h"
#include "core/io/image_file.h"
#include "core/io/resources.h"
#include "tests/app/cli.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

std::vector<std::vector<double>> readTable(const fs::path& path) {
    std::ifstream stream(path);
    std::string line;
    std::getline(stream, line);
    std::vector<std::vector<double>> rows;
    while (std::getline(stream, line)) {
        std::istringstream fields(line);
        std::string field;
        rows.emplace_back();
        while (std::getline(fields, field, ','))
            rows.back().push_back(std::stod(field));
    }
    return rows;
}

class DewarpTest : public testing::Test {
  protected:
    static void SetUpTestSuite() {
        folder_ = std::make_unique<test::ScratchFolder>();
        run({"phantom",
             "plate",
             "--plate",
             "shallow",
             "-o",
             path("plate.png"),
             "--truth",
             path("truth.csv"),
             "--pincushion-mm",
             "1.8",
             "--s-shape-rad",
             "0.02",
             "--rotation-deg",
             "7",
             "--field-radius-mm",
             "80",
             "--samples",
             "2",
             "--seed",
             "3"});
        run({"phantom",
             "plate",
             "--plate",
             "shallow",
             "-o",
             path("beads.png"),
             "--beads-spacing-mm",
             "20",
             "--pincushion-mm",
             "1.8",
             "--s-shape-rad",
             "0.02",
             "--rotation-deg",
             "7",
             "--field-radius-mm",
             "80",
             "--samples",
             "2",
             "--seed",
             "4"});
        run({"dewarp", "fit", "--image", path("plate.png"), "--plate", "shallow", "-o", path("map.json"),
             "--orbital-deg", "30", "--angulation-deg", "0"});
    }
    static void TearDownTestSuite() { folder_.reset(); }

    static std::string path(const std::string& name) { return (*folder_ / name).string(); }
    static void run(const std::vector<std::string>& arguments) {
        const test::Finished finished = cli(arguments);
        ASSERT_EQ(finished.exit_code, 0) << finished.out << finished.err;
    }

    // Of the beads' centres.
    static std::string height() {
        const auto plate = readGroovedPlate(findResource("plates", "shallow").value());
        return std::to_string(1.5 + plate->groove_depth_mm / 2);
    }

    static std::unique_ptr<test::ScratchFolder> folder_;
};
std::unique_ptr<test::ScratchFolder> DewarpTest::folder_;

TEST_F(DewarpTest, FitTellsWhatItFoundAndDrawsIt) {
    for (const std::string model : {"polynomial", "bernstein", "thin-plate-spline"}) {
        const test::Finished finished =
            cli({"dewarp", "fit", "--image", path("plate.png"), "--plate", "shallow", "-o", path(model + ".json"),
                 "--model", model, "--figure", path("figure.png"), "--json"});
        ASSERT_EQ(finished.exit_code, 0) << finished.err;
        const nlohmann::json json = onlyJson(finished);
        EXPECT_EQ(json["model"], model);
        EXPECT_EQ(json["accepted"], true);
        EXPECT_LT(json["residual_mm"].get<double>(), 0.1);
        EXPECT_NEAR(json["residual_px"].get<double>() * 0.32, json["residual_mm"].get<double>(), 0.02);
        // 160 mm of field hold 25 grooves each way.
        EXPECT_NEAR(json["grooves_found"][0].get<int>(), 24, 2);
        EXPECT_NEAR(json["grooves_found"][1].get<int>(), 24, 2);
        EXPECT_GT(json["coverage"].get<double>(), 0.5);
        EXPECT_NEAR(std::abs(json["rotation_deg"].get<double>()), 7, 1);
        const Result<ImageFile> figure = readImage(path("figure.png"));
        ASSERT_OK(figure);
        EXPECT_GT(figure->info.most - figure->info.least, 200);
        EXPECT_GT(figure->image.width(), 1500);
    }
}

TEST_F(DewarpTest, PointsComeOutInThePlatesMillimetres) {
    const test::Finished finished =
        cli({"dewarp", "points", "--map", path("map.json"), path("truth.csv"), "-o", path("mm.csv")});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const auto truth = readTable(path("truth.csv"));
    const auto mapped = readTable(path("mm.csv"));
    ASSERT_EQ(truth.size(), mapped.size());
    // Distances between covered crossings are those of the plate, whatever the frame.
    double sum = 0;
    int pairs = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
        for (std::size_t j = 0; j < i; ++j) {
            if (mapped[i][3] == 0 || mapped[j][3] == 0) continue;
            const double seen = std::hypot(mapped[i][0] - mapped[j][0], mapped[i][1] - mapped[j][1]);
            const double real = std::hypot(truth[i][2] - truth[j][2], truth[i][3] - truth[j][3]);
            sum += std::abs(seen - real);
            ++pairs;
        }
    }
    ASSERT_GT(pairs, 10000);
    EXPECT_LT(sum / pairs, 0.02);
    // The same on stdout, as a table and as JSON.
    const test::Finished table = cli({"dewarp", "points", "--map", path("map.json"), path("truth.csv")});
    std::ifstream written(path("mm.csv"));
    EXPECT_EQ(table.out, std::string(std::istreambuf_iterator<char>(written), {}));
    const nlohmann::json json =
        onlyJson(cli({"dewarp", "points", "--map", path("map.json"), path("truth.csv"), "--json"}));
    EXPECT_NEAR(json["points"][5]["x_mm"].get<double>(), mapped[5][0], 1e-5);
}

TEST_F(DewarpTest, AxesOfTheImageAreThoseOfThePlateTurned) {
    std::ofstream(path("two.csv")) << "255.5;255.5\n355.5 255.5\n";
    const auto plate = onlyJson(cli({"dewarp", "points", "--map", path("map.json"), path("two.csv"), "--json"}));
    const auto image =
        onlyJson(cli({"dewarp", "points", "--map", path("map.json"), path("two.csv"), "--axes", "image", "--json"}));
    EXPECT_NEAR(image["points"][0]["x_mm"].get<double>(), 0, 1e-9);
    EXPECT_NEAR(image["points"][0]["y_mm"].get<double>(), 0, 1e-9);
    EXPECT_NEAR(image["points"][1]["y_mm"].get<double>(), 0, 1.0);
    EXPECT_NEAR(image["points"][1]["x_mm"].get<double>(), 32, 1.5);
    const auto length = [](const nlohmann::json& p) {
        return std::hypot(p[1]["x_mm"].get<double>() - p[0]["x_mm"].get<double>(),
                          p[1]["y_mm"].get<double>() - p[0]["y_mm"].get<double>());
    };
    EXPECT_NEAR(length(plate["points"]), length(image["points"]), 1e-9);
}

TEST_F(DewarpTest, TheBeadTestIsBetterThanThePapers) {
    // Beads of 3 mm on the plate's land: their radius and half the grooves' depth above the plate's plane.
    const test::Finished finished = cli({"dewarp", "verify", "--map", path("map.json"), "--image", path("beads.png"),
                                         "--spacing-mm", "20", "--bead-height-mm", height(), "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err << finished.out;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_GT(json["beads"].get<int>(), 35);
    EXPECT_LT(json["centre"]["mean_mm"].get<double>(), 0.02);
    EXPECT_LT(json["margin"]["mean_mm"].get<double>(), 0.03);
    EXPECT_NEAR(json["scale"].get<double>(), 1, 5e-4);
    // A limit that can not be met is exit code 1, and the JSON says which.
    const test::Finished strict =
        cli({"dewarp", "verify", "--map", path("map.json"), "--image", path("beads.png"), "--spacing-mm", "20",
             "--bead-height-mm", height(), "--max-centre-mm", "0.0001", "--json"});
    EXPECT_EQ(strict.exit_code, 1);
    EXPECT_EQ(onlyJson(strict)["accepted"], false);
    EXPECT_EQ(onlyJson(strict)["limits"][0]["accepted"], false);
}

TEST_F(DewarpTest, AStraightImageIsDistortedNoMore) {
    for (const std::string method : {"bspline", "two-pass", "linear"}) {
        run({"dewarp", "apply", "--map", path("map.json"), path("plate.png"), "-o", path("straight.png"),
             "--resampling", method});
        const test::Finished finished =
            cli({"dewarp", "fit", "--image", path("straight.png"), "-o", path("again.json"), "--json"});
        ASSERT_EQ(finished.exit_code, 0) << finished.err;
        // What a second map finds left: straight lines to 0.05 mm, where the first moved the rim by 1.8 mm.
        std::ofstream(path("rim.csv")) << "55.5,255.5\n255.5,255.5\n455.5,255.5\n";
        const auto points = onlyJson(cli({"dewarp", "points", "--map", path("again.json"), path("rim.csv"), "--json"}));
        const auto at = [&](int i, const char* axis) { return points["points"][i][axis].get<double>(); };
        EXPECT_NEAR(at(0, "x_mm") + at(2, "x_mm"), 2 * at(1, "x_mm"), 0.1) << method;
        EXPECT_NEAR(at(0, "y_mm") + at(2, "y_mm"), 2 * at(1, "y_mm"), 0.1) << method;
    }
}

TEST_F(DewarpTest, AnImageWithThePlateStraightensItself) {
    run({"dewarp", "apply", "--plate", "shallow", path("plate.png"), "-o", path("self.mha")});
    run({"dewarp", "apply", "--map", path("map.json"), path("plate.png"), "-o", path("mapped.mha")});
    const Result<ImageFile> self = readImage(path("self.mha"));
    const Result<ImageFile> mapped = readImage(path("mapped.mha"));
    ASSERT_OK(self);
    ASSERT_OK(mapped);
    EXPECT_EQ(self->image, mapped->image);
    ASSERT_TRUE(self->info.pixel_spacing_mm.has_value());
    EXPECT_NEAR(self->info.pixel_spacing_mm->x(), 0.32, 0.01);
}

TEST_F(DewarpTest, MapsAreChosenByAngle) {
    run({"dewarp", "collect", path("map.json"), "-o", path("maps.json")});
    run({"dewarp", "apply", "--maps", path("maps.json"), "--orbital-deg", "30", "--angulation-deg", "0",
         path("plate.png"), "-o", path("by_angle.mha")});
    run({"dewarp", "apply", "--map", path("map.json"), path("plate.png"), "-o", path("mapped.mha")});
    EXPECT_EQ(readImage(path("by_angle.mha"))->image, readImage(path("mapped.mha"))->image);

    const test::Finished far = cli({"dewarp", "apply", "--maps", path("maps.json"), "--orbital-deg", "90",
                                    "--angulation-deg", "0", path("plate.png"), "-o", path("far.mha")});
    EXPECT_EQ(far.exit_code, 4) << far.err;
    EXPECT_THAT(far.err, HasSubstr("60"));
    EXPECT_FALSE(fs::exists(path("far.mha")));
    const test::Finished nowhere =
        cli({"dewarp", "apply", "--maps", path("maps.json"), path("plate.png"), "-o", path("far.mha")});
    EXPECT_EQ(nowhere.exit_code, 2);
    EXPECT_THAT(nowhere.err, HasSubstr("--orbital-deg"));
}

TEST_F(DewarpTest, WhatIsNoPlateIsRefusedInWords) {
    run({"phantom", "plate", "--no-plate", "--overlay", "femur", "-o", path("femur.png"), "--field-radius-mm", "80"});
    const test::Finished finished =
        cli({"dewarp", "fit", "--image", path("femur.png"), "-o", path("none.json"), "--json"});
    EXPECT_EQ(finished.exit_code, 4);
    EXPECT_THAT(errorMessage(finished, "noSolution"), HasSubstr("groove"));
    EXPECT_FALSE(fs::exists(path("none.json")));

    EXPECT_EQ(cli({"dewarp", "fit", "--image", path("nothing.png"), "-o", path("none.json")}).exit_code, 3);
    EXPECT_EQ(cli({"dewarp", "fit", "--image", path("plate.png"), "-o", path("plate.png")}).exit_code, 2);
    EXPECT_EQ(cli({"dewarp", "fit", "--image", path("plate.png"), "--model", "magic", "-o", path("x.json")}).exit_code,
              2);
    EXPECT_EQ(cli({"dewarp"}).exit_code, 2);
    // Beads where there are none.
    EXPECT_EQ(cli({"dewarp", "verify", "--map", path("map.json"), "--image", path("plate.png")}).exit_code, 4);
    std::ofstream(path("bad.csv")) << "u_px,v_px\n12,abc\n";
    const test::Finished bad = cli({"dewarp", "points", "--map", path("map.json"), path("bad.csv")});
    EXPECT_EQ(bad.exit_code, 3);
    EXPECT_THAT(bad.err, HasSubstr("bad.csv, line 2: found \"12,abc\""));
}

TEST(PaperTablesTest, StandBesideThePapersFigures) {
    const test::Finished finished = cli({"paper-tables", "--only", "dewarp", "--trials", "1", "--seed", "5", "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json dewarp = onlyJson(finished)["dewarp"];
    EXPECT_EQ(dewarp["paper"]["centre_mm"], 0.12);
    ASSERT_EQ(dewarp["runs"].size(), 2u);
    for (const nlohmann::json& run : dewarp["runs"]) {
        EXPECT_EQ(run["wrong"], 0);
        EXPECT_EQ(run["models"].size(), 3u);
    }
    const nlohmann::json& best = dewarp["runs"][0]["models"][0];
    EXPECT_LT(best["bead_distance_error_mm"]["centre"]["mean"].get<double>(), 0.03);
}

// One C-arm, 31 images without clutter, 1000 photons, seed 5; two scenes in clutter.
TEST(PaperTablesTest, SlowTheCorkscrewsStandBesideThePapersToo) {
    const test::Finished finished =
        cli({"paper-tables", "--only", "corkscrew", "--carms", "1", "--scenes", "2", "--seed", "5", "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_FALSE(json.contains("dewarp"));
    const nlohmann::json corkscrew = json["corkscrew"];
    EXPECT_EQ(corkscrew["images"], 31);
    EXPECT_EQ(corkscrew["refused"]["fluorocut"], 0);
    // Differences of two images of one C-arm: a tenth of the paper's errors is far more than they have (0.02 degrees,
    // 0.04 mm).
    for (const char* motion : {"twist", "roll", "pitch"}) {
        const nlohmann::json& row = corkscrew["table_1_deg"][motion];
        EXPECT_EQ(row["trials"].size(), 5u);
        EXPECT_LT(row["fluorocut"]["mean"].get<double>(), 0.1 * row["paper_mean"].get<double>()) << motion;
    }
    for (const char* motion : {"x", "y", "z"}) {
        const nlohmann::json& row = corkscrew["table_2_mm"][motion];
        EXPECT_LT(row["fluorocut"]["mean"].get<double>(), 0.1 * row["paper_mean"].get<double>()) << motion;
        EXPECT_GT(row["closed_form"]["mean"].get<double>(), row["fluorocut"]["mean"].get<double>()) << motion;
    }
    EXPECT_EQ(corkscrew["accuracy"]["answered"], 2);
    EXPECT_EQ(corkscrew["accuracy"]["gross_accepted"], 0);
}

}  // namespace
}  // namespace fluorocut
