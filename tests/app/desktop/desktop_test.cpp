// The real desktop program without a screen.
#include <filesystem>

#include <gmock/gmock.h>

#include "core/io/image_file.h"
#include "tests/support/fixtures.h"
#include "tests/support/program.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

TEST(Desktop, SavesAPictureOfItsWindow) {
    const test::ScratchFolder scratch;
    Image image(64, 64);
    for (int y = 0; y < 64; ++y) {
        for (int x = 0; x < 64; ++x)
            image(x, y) = static_cast<float>(16 * x);
    }
    ASSERT_OK(writeImage(scratch / "ramp.png", image));
    const test::Finished finished = test::runProgram(
        FLUOROCUT_DESKTOP, {(scratch / "ramp.png").string(), "--screenshot", (scratch / "w.png").string()});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const Result<ImageFile> window = readImage(scratch / "w.png");
    ASSERT_OK(window);
    const int middle = window->image.height() / 2;
    const int width = window->image.width();
    // The ramp fills the window's height in its middle: dark on the left of it, bright on the right.
    EXPECT_GT(window->image(width / 2 + 150, middle), window->image(width / 2 - 150, middle) + 100);
}

TEST(Desktop, SlowBuiltInFemurFillsBothViews) {
    const test::ScratchFolder scratch;
    const test::Finished finished = test::runProgram(FLUOROCUT_DESKTOP, {"--screenshot", (scratch / "w.png").string()});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const Result<ImageFile> window = readImage(scratch / "w.png");
    ASSERT_OK(window);
    // Without pictures the views are almost black: 10 of 255.
    for (const double part : {0.25, 0.75}) {
        double sum = 0;
        int count = 0;
        for (int y = window->image.height() / 4; y < window->image.height() * 3 / 4; ++y) {
            for (int x = -50; x < 50; ++x) {
                sum += window->image(static_cast<int>(part * window->image.width()) + x, y);
                ++count;
            }
        }
        EXPECT_GT(sum / count, 40) << part;
    }
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
}

}  // namespace
}  // namespace fluorocut
