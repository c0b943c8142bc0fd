#include "core/cutting/tool_path_file.h"

#include <cmath>
#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "tests/core/cutting/cavities.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

std::string textOf(const std::filesystem::path& path) {
    std::ostringstream text;
    text << std::ifstream(path).rdbuf();
    return text.str();
}

// The file with one piece of its text replaced.
Result<ToolPath> readWith(const std::filesystem::path& file, const std::string& text, const std::string& from,
                          const std::string& to) {
    std::string changed = text;
    const std::size_t at = changed.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    changed.replace(at, from.size(), to);
    std::ofstream(file) << changed;
    return readToolPath(file);
}

TEST(ToolPathFile, ComesBackAsItWas) {
    ToolPathOptions options;
    options.most_tilt_rad = 0.2;
    const Result<ToolPath> path = planToolPath(fieldOf(bowedCavity(4.5, 30, 120), 0.5), 0, options);
    ASSERT_TRUE(path);
    const test::ScratchFolder folder;
    const std::filesystem::path file = folder / "path.json";
    ASSERT_TRUE(writeToolPath(file, *path));
    const Result<ToolPath> back = readToolPath(file);
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_EQ(back->cutter.radius_mm, path->cutter.radius_mm);
    EXPECT_EQ(back->cutter.length_mm, path->cutter.length_mm);
    EXPECT_EQ(back->most_cusp_mm, path->most_cusp_mm);
    EXPECT_EQ(back->layers, path->layers);
    EXPECT_EQ(back->cutting_mm, path->cutting_mm);
    EXPECT_EQ(back->time_s, path->time_s);
    EXPECT_EQ(back->unreached, path->unreached);
    EXPECT_EQ(back->warnings, path->warnings);
    ASSERT_EQ(back->moves.size(), path->moves.size());
    for (std::size_t i = 0; i < path->moves.size(); ++i) {
        EXPECT_EQ(back->moves[i].segment.from_mm, path->moves[i].segment.from_mm);
        EXPECT_EQ(back->moves[i].segment.to_mm, path->moves[i].segment.to_mm);
        EXPECT_EQ(back->moves[i].segment.spindle, path->moves[i].segment.spindle);
        EXPECT_EQ(back->moves[i].motion, path->moves[i].motion);
        EXPECT_EQ(back->moves[i].feed_mm_s, path->moves[i].feed_mm_s);
    }
}

TEST(ToolPathFile, RefusesWhatIsNoPath) {
    ToolPath path;
    path.moves.push_back({{{0, 0, 8}, {0, 0, -5}, {0, 0, 1}}, ToolMotion::entry, 2});
    path.moves.push_back({{{0, 0, -5}, {4, 0, -5}, {0, 0, 1}}, ToolMotion::cut, 2});
    path.cutting_mm = 4;
    path.time_s = 8.5;
    const test::ScratchFolder folder;
    const std::filesystem::path file = folder / "path.json";
    ASSERT_TRUE(writeToolPath(file, path));
    const std::string text = textOf(file);
    ASSERT_TRUE(readToolPath(file));

    const auto wrong = [&](const std::string& from, const std::string& to) {
        const Result<ToolPath> read = readWith(file, text, from, to);
        EXPECT_FALSE(read) << from << " -> " << to;
        return read ? std::string() : read.error().message();
    };
    EXPECT_NE(wrong("[0.0,0.0,1.0]", "[0.0,0.1,1.0]").find("unit vector"), std::string::npos);
    EXPECT_NE(wrong("\"feed_mm_s\":2.0", "\"feed_mm_s\":-2.0").find("feed_mm_s"), std::string::npos);
    EXPECT_NE(wrong("[4.0,0.0,-5.0]", "[3.0,0.0,-5.0]").find("cutting_mm"), std::string::npos);
    EXPECT_NE(wrong("\"entry\"", "\"plunge\"").find("motion"), std::string::npos);
    EXPECT_NE(wrong("\"cavity\"", "\"femur\"").find("frame"), std::string::npos);
    EXPECT_NE(wrong("\"radius_mm\":3.0", "\"radius_mm\":300.0").find("radius_mm"), std::string::npos);
    EXPECT_NE(wrong("\"radius_mm\":3.0", "\"radius_mm\":30.0,\"colour\":1").find("colour"), std::string::npos);
    EXPECT_FALSE(wrong("tool-path/1", "tool-path/2").empty());
    EXPECT_FALSE(wrong("[4.0,0.0,-5.0]", "[4.0,0.0]").empty());
    EXPECT_FALSE(wrong("]}", "").empty());
    EXPECT_FALSE(readToolPath(folder / "none.json"));

    // A path whose figures were never worked out has none in its file either.
    path.time_s = path.cutting_mm = std::nan("");
    ASSERT_TRUE(writeToolPath(file, path));
    ASSERT_TRUE(readToolPath(file));
    EXPECT_TRUE(std::isnan(readToolPath(file)->time_s));
}

}  // namespace
}  // namespace fluorocut
