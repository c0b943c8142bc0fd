// implant and plan predict, from the command line.
#include <fstream>

#include <gmock/gmock.h>

#include "core/io/image_file.h"
#include "core/io/mesh_file.h"
#include "tests/app/cli.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

class PlanPredictTest : public testing::Test {
  protected:
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }
    void write(const std::string& name, const std::string& text) { std::ofstream(scratch_ / name) << text; }

    // A flat picture of 256 x 256 with a stem in its middle, seen from the front.
    void writeView() {
        ASSERT_OK(writeImage(path("flat.tif"), Image(256, 256, 5000)));
        write("carm.json",
              R"({"schema": "fluorocut/carm/1", "name": "c", "columns": 256, "rows": 256, "pixel_mm": [1.2, 1.2],
                  "focal_length_mm": 1000, "principal_point_px": [127.5, 127.5], "distortion": null})");
        write("view.json", R"({"schema": "fluorocut/pose/1", "target": "imager", "source": "femur",
                               "matrix": [[1,0,0,0],[0,0,-1,-40],[0,1,0,650],[0,0,0,1]]})");
        write("stem.json", R"({"schema": "fluorocut/pose/1", "target": "femur", "source": "cavity",
                               "matrix": [[-1,0,0,0],[0,-1,0,0],[0,0,1,0],[0,0,0,1]]})");
    }
    std::string view() const { return path("flat.tif") + "," + path("carm.json") + "," + path("view.json"); }

    test::ScratchFolder scratch_;
};

TEST_F(PlanPredictTest, TheLibraryIsListedAndMadeAndImportedAgain) {
    const auto list = onlyJson(cli({"implant", "list", "--json"}));
    ASSERT_EQ(list["implants"].size(), 3U);
    EXPECT_EQ(list["implants"][2]["name"], "straight");
    EXPECT_EQ(list["implants"][2]["sizes"][0]["stem_length_mm"], 115);

    const auto made = onlyJson(
        cli({"implant", "make", "anatomic", "--size", "12", "--part", "stem", "-o", path("stem.stl"), "--json"}));
    EXPECT_EQ(made["stem_length_mm"], 125);
    const auto mesh = readMesh(path("stem.stl"));
    ASSERT_OK(mesh);
    EXPECT_NEAR(mesh->info.properties.min_corner.z(), -125, 1e-4);

    const auto imported =
        onlyJson(cli({"implant", "import", path("stem.stl"), "--side", "right", "-o", path("stem.json"), "--json"}));
    EXPECT_EQ(imported["mm_per_unit"], 1);
    EXPECT_EQ(imported["side"], "right");
    EXPECT_GE(imported["guessed"].size(), 4U);
    EXPECT_EQ(onlyJson(cli({"info", path("stem.json"), "--json"}))["side"], "right");
    const auto again = onlyJson(cli({"implant", "make", path("stem.json"), "-o", path("again.stl"), "--json"}));
    EXPECT_EQ(again["side"], "right");
    EXPECT_NEAR(again["parts"][0]["volume_mm3"].get<double>(), made["parts"][0]["volume_mm3"].get<double>(), 1);

    const auto wrong = cli({"implant", "make", "straight", "--size", "99", "-o", path("x.stl"), "--json"});
    EXPECT_EQ(wrong.exit_code, 2);
    EXPECT_THAT(errorMessage(wrong, "invalidOption"), HasSubstr("8, 9, 10"));
}

TEST_F(PlanPredictTest, AStemDarkensTheImageWhereItWillBe) {
    writeView();
    const auto done = cli({"plan", "predict", "--view", view(), "--implant", "straight", "--femur-from-cavity",
                           path("stem.json"), "-o", path("out.tif"), "--figure", path("figure.png"), "--json"});
    ASSERT_EQ(done.exit_code, 0) << done.err;
    const auto json = onlyJson(done);
    EXPECT_GT(json["views"][0]["most_change"].get<double>(), 10);  // 32 mm of cobalt-chrome
    EXPECT_GT(json["views"][0]["level_uncertainty"].get<double>(), 0);
    const auto image = readImage(path("out.tif"));
    ASSERT_OK(image);
    EXPECT_LT(image->image(127, 150), 1000);  // behind 10 mm of titanium; femur z = -70
    // Far from it only the smooth light changes: by less than the stem's share of the picture.
    EXPECT_NEAR(image->image(10, 250), 5000, 100);
    const auto figure = readImage(path("figure.png"));
    ASSERT_OK(figure);
    EXPECT_GT(figure->image.width(), 1000);
}

TEST_F(PlanPredictTest, SeveralViewsFillAFolder) {
    writeView();
    ASSERT_EQ(cli({"implant", "make", "straight", "--part", "in-bone", "-o", path("cavity.stl")}).exit_code, 0);
    const auto done = cli({"plan", "predict", "--view", view(), "--view", view(), "--cavity", path("cavity.stl"),
                           "--femur-from-cavity", path("stem.json"), "-o", path("out"), "--json"});
    ASSERT_EQ(done.exit_code, 0) << done.err;
    EXPECT_EQ(onlyJson(done)["views"].size(), 2U);
    const auto image = readImage((scratch_ / "out" / "predicted_2.tif").string());
    ASSERT_OK(image);
    EXPECT_GT(image->image(127, 150), 5000);  // fluid instead of bone: brighter
}

TEST_F(PlanPredictTest, SaysWhatIsMissing) {
    writeView();
    const auto nothing = cli({"plan", "predict", "--view", view(), "--femur-from-cavity", path("stem.json"), "-o",
                              path("out.tif"), "--json"});
    EXPECT_EQ(nothing.exit_code, 2);
    EXPECT_THAT(errorMessage(nothing, "invalidOption"), HasSubstr("--implant"));
    const auto half = cli({"plan", "predict", "--view", path("flat.tif"), "--implant", "straight",
                           "--femur-from-cavity", path("stem.json"), "-o", path("out.tif"), "--json"});
    EXPECT_EQ(half.exit_code, 2);
    EXPECT_THAT(errorMessage(half, "invalidOption"), HasSubstr("IMAGE,CARM,POSE"));
}

}  // namespace
}  // namespace fluorocut
