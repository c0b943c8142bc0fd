// The real desktop program without a screen.
#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include <gmock/gmock.h>

#include "core/io/image_file.h"
#include "tests/support/fixtures.h"
#include "tests/support/program.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// Grey levels of a part of a picture, given by fractions of its size.
double meanOf(const Image& image, double left, double top, double right, double bottom) {
    double sum = 0;
    int count = 0;
    for (int y = static_cast<int>(top * image.height()); y < static_cast<int>(bottom * image.height()); ++y) {
        for (int x = static_cast<int>(left * image.width()); x < static_cast<int>(right * image.width()); ++x) {
            sum += image(x, y);
            ++count;
        }
    }
    return sum / count;
}

TEST(Desktop, SavesAPictureOfTheFilesItOpened) {
    const test::ScratchFolder scratch;
    Image image(64, 64);
    for (int y = 0; y < 64; ++y) {
        for (int x = 0; x < 64; ++x)
            image(x, y) = static_cast<float>(16 * x);
    }
    ASSERT_OK(writeImage(scratch / "ramp.png", image));
    const test::Finished finished = test::runProgram(
        FLUOROCUT_DESKTOP,
        {(scratch / "ramp.png").string(), "--screenshot", (scratch / "w.png").string(), "--size", "1400x800"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const Result<ImageFile> window = readImage(scratch / "w.png");
    ASSERT_OK(window);
    EXPECT_EQ(window->image.width(), 1400);
    EXPECT_EQ(window->image.height(), 800);
    // Somewhere in it the ramp is seen, from black to white.
    const auto [least, most] = std::minmax_element(window->image.pixels().begin(), window->image.pixels().end());
    EXPECT_LT(*least, 10);
    EXPECT_GT(*most, 200);
}

TEST(Desktop, SlowEveryStateOfTheSampleCaseCanBePictured) {
    const test::ScratchFolder scratch;
    const std::string cache = (scratch / "cache").string();
    setenv("XDG_CACHE_HOME", cache.c_str(), 1);
    for (const char* name : {"start", "spreadsheet", "planning", "scene", "procedure", "or-mode"}) {
        const auto file = scratch / (std::string(name) + ".png");
        const test::Finished finished =
            test::runProgram(FLUOROCUT_DESKTOP, {"--screenshot", name, file.string(), "--size", "1400x800"});
        ASSERT_EQ(finished.exit_code, 0) << name << ": " << finished.err;
        const Result<ImageFile> window = readImage(file);
        ASSERT_OK(window);
        EXPECT_GE(window->image.width(), 1400);
        // The start page is dark in its middle; X-rays are not: an empty view is 10 of 255.
        if (std::string(name) != "start") {
            EXPECT_GT(meanOf(window->image, 0.2, 0.1, 0.7, 0.9), 25) << name;
        }
    }
    unsetenv("XDG_CACHE_HOME");
    EXPECT_TRUE(fs::exists(scratch / "cache" / "fluorocut"));
}

TEST(Desktop, SaysWhatItCannotRead) {
    const test::ScratchFolder scratch;
    const test::Finished finished =
        test::runProgram(FLUOROCUT_DESKTOP, {"/nowhere/x.png", "--screenshot", (scratch / "w.png").string()});
    EXPECT_EQ(finished.exit_code, 3);
    EXPECT_THAT(finished.err, HasSubstr("/nowhere/x.png"));
}

TEST(Desktop, WithoutAScreenItNeedsToKnowWhereThePictureGoes) {
    const test::Finished finished = test::runProgram(FLUOROCUT_DESKTOP, {});
    EXPECT_EQ(finished.exit_code, 2);
    EXPECT_THAT(finished.err, HasSubstr("--screenshot"));
    EXPECT_EQ(test::runProgram(FLUOROCUT_DESKTOP, {"--nonsense"}).exit_code, 2);
    const test::Finished unknown = test::runProgram(FLUOROCUT_DESKTOP, {"--screenshot", "nothing"});
    EXPECT_EQ(unknown.exit_code, 2);
    EXPECT_THAT(unknown.err, HasSubstr("or-mode"));
    EXPECT_EQ(test::runProgram(FLUOROCUT_DESKTOP, {"--screenshot", "x.png", "--size", "10x10"}).exit_code, 2);
}

}  // namespace
}  // namespace fluorocut
