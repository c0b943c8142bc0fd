// phantom plate and phantom beads with the real program: the pictures against the truth that comes with them.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>

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

class PhantomImages : public testing::Test {
  protected:
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }

    // The picture of a run that must succeed.
    Image picture(std::vector<std::string> arguments, const std::string& name = "image.png") {
        arguments.insert(arguments.end(), {"-o", path(name), "--json"});
        finished_ = cli(arguments);
        EXPECT_EQ(finished_.exit_code, 0) << finished_.err;
        auto file = readImage(scratch_ / name);
        EXPECT_OK(file);
        return file ? file->image : Image(1, 1);
    }

    // The numbers of a CSV's rows, below the expected header; the last column may be text.
    std::vector<std::vector<double>> rows(const std::string& name, const std::string& header) const {
        std::ifstream file(scratch_ / name);
        std::string line;
        EXPECT_TRUE(std::getline(file, line));
        EXPECT_EQ(line, header);
        std::vector<std::vector<double>> all;
        while (std::getline(file, line)) {
            std::istringstream cells(line);
            std::string cell;
            all.emplace_back();
            while (std::getline(cells, cell, ',') && cell.front() != '"')
                all.back().push_back(std::stod(cell));
        }
        return all;
    }

    test::ScratchFolder scratch_;
    test::Finished finished_;
};

// Mean place of weight(value) within `reach` pixels.
template <class Weight>
Vector2 centroid(const Image& image, const Vector2& about, int reach, const Weight& weight) {
    Vector2 sum = Vector2::Zero();
    double total = 0;
    const int x0 = static_cast<int>(std::lround(about.x())), y0 = static_cast<int>(std::lround(about.y()));
    for (int y = y0 - reach; y <= y0 + reach; ++y)
        for (int x = x0 - reach; x <= x0 + reach; ++x) {
            const double w = weight(image(x, y));
            sum += w * Vector2(x, y);
            total += w;
        }
    return sum / total;
}

bool inside(const Image& image, double u, double v, double margin) {
    return u > margin && v > margin && u < image.width() - 1 - margin && v < image.height() - 1 - margin;
}

// A crossing is symmetric about its middle, so the picture around the true place is too.
TEST_F(PhantomImages, ThePlatesCrossingsAreWhereItsTruthSays) {
    for (const std::vector<std::string>& more :
         {std::vector<std::string>{"--pincushion-mm", "2", "--s-shape-rad", "0.03", "--rotation-deg", "7"},
          {"--orbital-deg", "40", "--angulation-deg", "-20", "--shift-mm", "1.3", "-2.1"},
          {"--mirrored", "--rotation-deg", "-30"}}) {
        std::vector<std::string> arguments{"phantom", "plate",   "--photons",       "0",         "--plain", "--blur-px",
                                           "0.5",     "--truth", path("truth.csv"), "--samples", "4"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Image image = picture(arguments);
        const auto crossings = rows("truth.csv", "u_px,v_px,x_mm,y_mm");
        EXPECT_EQ(crossings.size(), onlyJson(finished_)["crossings"].get<std::size_t>());
        int seen = 0;
        double worst = 0;
        for (const auto& row : crossings) {
            ASSERT_EQ(row.size(), 4u);
            if (!inside(image, row[0], row[1], 12)) continue;
            ++seen;
            const Vector2 truth(row[0], row[1]);
            const auto at = [&](const Vector2& p) {
                const int x = static_cast<int>(std::floor(p.x())), y = static_cast<int>(std::floor(p.y()));
                const double a = p.x() - x, b = p.y() - y;
                return (1 - b) * ((1 - a) * image(x, y) + a * image(x + 1, y)) +
                       b * ((1 - a) * image(x, y + 1) + a * image(x + 1, y + 1));
            };
            // Shift that makes the picture symmetric, by least squares: f(t + s) - f(t - s) = 2 grad . shift.
            Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
            Vector2 right = Vector2::Zero();
            for (double dy = -4; dy <= 4; dy += 0.5)
                for (double dx = -4; dx <= 4; dx += 0.5) {
                    const Vector2 s(dx, dy);
                    const double h = 0.5;
                    const auto slope = [&](const Vector2& p) {
                        return Vector2((at(p + Vector2(h, 0)) - at(p - Vector2(h, 0))) / (2 * h),
                                       (at(p + Vector2(0, h)) - at(p - Vector2(0, h))) / (2 * h));
                    };
                    const Vector2 g = slope(truth + s) - slope(truth - s);
                    normal += g * g.transpose();
                    right += g * (at(truth - s) - at(truth + s));
                }
            worst = std::max(worst, Vector2(normal.ldlt().solve(right)).norm());
        }
        EXPECT_GT(seen, 400);
        // Within 4 pixels the distortion, of some pixels over 256, is not quite even; levels are whole numbers.
        EXPECT_LT(worst, 0.05) << more[0];
    }
}

TEST_F(PhantomImages, GroovesAreAsBrightAsThePlateSays) {
    const Image image =
        picture({"phantom", "plate", "--photons", "0", "--plain", "--blur-px", "0", "--plate", "paper"});
    const double contrast = onlyJson(finished_)["groove_contrast"];
    const auto [least, most] = std::minmax_element(image.pixels().begin(), image.pixels().end());
    // Pixels wholly in a groove and wholly on a land; rays at the rim are 0.7 % longer, levels are whole numbers.
    EXPECT_NEAR(std::log(*most / *least), contrast, 0.01);
    EXPECT_LT(*most, 4095);
    EXPECT_GT(*most, 2000);
    const Image shallow = picture({"phantom", "plate", "--photons", "0", "--plate", "shallow"});
    EXPECT_NEAR(onlyJson(finished_)["groove_contrast"].get<double>(), 0.06, 0.001);
}

TEST_F(PhantomImages, NoiseIsThatOfItsPhotonsAndItsSeed) {
    const std::vector<std::string> base{"phantom", "plate",   "--no-plate", "--photons",
                                        "500",     "--plain", "--blur-px",  "0"};
    const auto with = [&](const std::string& seed, const std::string& name) {
        std::vector<std::string> arguments = base;
        arguments.insert(arguments.end(), {"--seed", seed});
        return picture(arguments, name);
    };
    const Image one = with("1", "a.png");
    EXPECT_EQ(with("1", "b.png"), one);
    EXPECT_NE(with("2", "c.png"), one);
    double sum = 0, squares = 0;
    for (const float level : one.pixels()) {
        sum += level;
        squares += double(level) * level;
    }
    const double mean = sum / static_cast<double>(one.size());
    const double variance = squares / static_cast<double>(one.size()) - mean * mean;
    // 262,144 pixels of Poisson noise: relative variance 1 / 500, known to 0.3 %; rounding adds nothing to speak of.
    EXPECT_NEAR(variance / (mean * mean), 1.0 / 500, 0.02 / 500);
}

TEST_F(PhantomImages, BeadsOverThePlateAreWhereTheJsonSays) {
    const Image image =
        picture({"phantom", "plate", "--no-plate", "--beads-spacing-mm", "20", "--photons", "0", "--plain", "--blur-px",
                 "0.5", "--pincushion-mm", "2", "--s-shape-rad", "-0.02", "--rotation-deg", "12"});
    const nlohmann::json json = onlyJson(finished_);
    EXPECT_NEAR(json["bead_height_mm"].get<double>(), 0.5 * 4.7625 + 1.5, 1e-12);
    const double open = *std::max_element(image.pixels().begin(), image.pixels().end());
    int seen = 0;
    for (const auto& bead : json["beads"]) {
        const Vector2 truth(bead["u_px"], bead["v_px"]);
        if (!inside(image, truth.x(), truth.y(), 12)) continue;
        ++seen;
        // Levels are whole numbers of 4095; a bead 80 mm off axis is an ellipse whose middle is 2e-5 px off.
        const Vector2 found = centroid(image, truth, 10, [&](float level) { return open - level; });
        EXPECT_LT((found - truth).norm(), 0.05) << bead["name"];
    }
    EXPECT_GE(seen, 45);
    EXPECT_FALSE(json["plate_left_on"].get<bool>());
}

// Clamps and screws hide some of the grooves, but no more than 15 %.
TEST_F(PhantomImages, OverlaysHideAPartOfThePlate) {
    const std::vector<std::string> base{"phantom", "plate", "--photons", "0", "--plain"};
    const Image bare = picture(base, "bare.png");
    double both = 0;
    for (const char* overlay : {"clamp", "screws"}) {
        std::vector<std::string> arguments = base;
        arguments.insert(arguments.end(), {"--overlay", overlay});
        const Image covered = picture(arguments, "covered.png");
        double hidden = 0;
        for (std::size_t i = 0; i < bare.size(); ++i)
            hidden += covered.pixels()[i] < 0.7 * bare.pixels()[i];  // a third of a millimetre of steel
        hidden /= static_cast<double>(bare.size());
        EXPECT_GT(hidden, 0.02) << overlay;
        both += hidden;
    }
    EXPECT_LT(both, 0.15);
    std::vector<std::string> with_limb = base;
    with_limb.insert(with_limb.end(), {"--overlay", "ham"});
    const Image limb = picture(with_limb);
    // 120 mm of soft tissue: exp(-2.4) and bone besides.
    EXPECT_LT(limb(256, 256), 0.12F * bare(256, 256));
    EXPECT_GT(limb(256, 256), 0.005F * bare(256, 256));
}

TEST_F(PhantomImages, AFemurCanLieOverThePlate) {
    const Image bare = picture({"phantom", "plate", "--photons", "0"}, "bare.png");
    const Image bone = picture({"phantom", "plate", "--photons", "0", "--overlay", "femur"}, "bone.png");
    int darker = 0;
    for (std::size_t i = 0; i < bare.size(); ++i)
        darker += bone.pixels()[i] < 0.8 * bare.pixels()[i];
    // A shaft of 30 mm, magnified 1.5 times, in a field of 164.
    EXPECT_NEAR(darker / double(bare.size()), 0.27, 0.12);
}

TEST_F(PhantomImages, BeadPhantomsAreSeenFromTheGivenPose) {
    std::ofstream(scratch_ / "layout.json") << R"({"schema": "fluorocut/beads/1", "frame": "phantom", "beads": [
        {"name": "a \"1\"", "center_mm": [-30, 10, -40], "diameter_mm": 3},
        {"name": "b,2", "center_mm": [25, -20, 40], "diameter_mm": 3},
        {"name": "far", "center_mm": [400, 0, 0], "diameter_mm": 3}]})";
    std::ofstream(scratch_ / "pose.json") << R"({"schema": "fluorocut/pose/1", "target": "imager", "source": "phantom",
        "matrix": [[0,-1,0,2],[1,0,0,-3],[0,0,1,800],[0,0,0,1]]})";
    const Image image = picture({"phantom", "beads", "--layout", path("layout.json"), "--pose", path("pose.json"),
                                 "--photons", "0", "--plain", "--blur-px", "0.5", "--truth", path("truth.csv")});
    const nlohmann::json json = onlyJson(finished_);
    EXPECT_EQ(json["beads"], 3);
    EXPECT_EQ(json["seen"], 2);
    const auto truth = rows("truth.csv", "u_px,v_px,x_mm,y_mm,z_mm,name");
    ASSERT_EQ(truth.size(), 2u);
    // By hand: (x, y, z) in the imager = (-10 + 2, -30 - 3, 760), f / p = 3125 px.
    EXPECT_NEAR(truth[0][0], 255.5 - 8 * 3125.0 / 760, 1e-6);
    EXPECT_NEAR(truth[0][1], 255.5 - 33 * 3125.0 / 760, 1e-6);
    const double open = *std::max_element(image.pixels().begin(), image.pixels().end());
    for (const auto& row : truth) {
        const Vector2 found =
            centroid(image, {row[0], row[1]}, 14, [&](float level) { return std::log(open / std::max(level, 1.0F)); });
        EXPECT_LT((found - Vector2(row[0], row[1])).norm(), 0.02);
    }
}

TEST_F(PhantomImages, RefusesInWords) {
    const auto message = [&](std::vector<std::string> arguments, int exit_code) {
        arguments.insert(arguments.end(), {"-o", path("x.png"), "--json"});
        const test::Finished finished = cli(arguments);
        EXPECT_EQ(finished.exit_code, exit_code) << finished.err;
        return errorMessage(finished, exit_code == 2 ? "invalidOption" : "invalidInput");
    };
    EXPECT_THAT(message({"phantom", "plate", "--plate", "nosuch"}, 3), HasSubstr("paper"));
    EXPECT_THAT(message({"phantom", "plate", "--overlay", "cheese"}, 2), HasSubstr("cheese"));
    EXPECT_THAT(message({"phantom", "plate", "--photons", "nan"}, 2), HasSubstr("photons"));
    EXPECT_THAT(message({"phantom", "plate", "--pincushion-mm", "-19", "--s-shape-rad", "0"}, 2),
                HasSubstr("pincushion"));
    EXPECT_THAT(message({"phantom", "plate", "--beads-spacing-mm", "2"}, 2), HasSubstr("spacing_mm"));
    EXPECT_THAT(message({"phantom", "plate", "--truth", path("x.txt")}, 2), HasSubstr("x.txt"));
    std::ofstream(scratch_ / "layout.json")
        << R"({"schema": "fluorocut/beads/1", "frame": "phantom", "beads": [{"name": "a", "center_mm": [0, 0, 0], "diameter_mm": 3}]})";
    EXPECT_THAT(message({"phantom", "beads", "--layout", path("layout.json"), "--depth-mm", "1500"}, 2),
                HasSubstr("between source and detector"));
    EXPECT_THAT(message({"phantom", "beads", "--layout", path("none.json")}, 3), HasSubstr("none.json"));
    EXPECT_FALSE(fs::exists(scratch_ / "x.png"));
}

}  // namespace
}  // namespace fluorocut
