#include "ui/spreadsheet/gray_levels.h"

#include <limits>

#include <gtest/gtest.h>

namespace fluorocut::ui {
namespace {

TEST(GrayLevels, ShowsTheWindowFromBlackToWhite) {
    const Image image(5, 1, std::vector<float>{-10, 0, 50, 100, 110});
    const QImage shown = GrayLevels(image).render({50, 100});
    EXPECT_EQ(qRed(shown.pixel(0, 0)), 0);
    EXPECT_EQ(qRed(shown.pixel(1, 0)), 0);
    EXPECT_NEAR(qRed(shown.pixel(2, 0)), 128, 1);  // half of 255, rounded either way
    EXPECT_EQ(qRed(shown.pixel(3, 0)), 255);
    EXPECT_EQ(qRed(shown.pixel(4, 0)), 255);
    EXPECT_EQ(qBlue(shown.pixel(2, 0)), qRed(shown.pixel(2, 0)));
}

TEST(GrayLevels, KeepsFineStepsOfAWideRange) {
    // Two values a 10,000th of the range apart must differ in a window of their size: 65535 steps are enough for that.
    const Image image(4, 1, std::vector<float>{0, 5000, 5001, 10000});
    const QImage shown = GrayLevels(image).render({5000.5, 2});
    EXPECT_GT(qRed(shown.pixel(2, 0)), qRed(shown.pixel(1, 0)) + 100);
}

TEST(GrayLevels, TheFittingWindowIgnoresAFewExtremePixels) {
    Image image(100, 100);
    for (int y = 0; y < 100; ++y) {
        for (int x = 0; x < 100; ++x)
            image(x, y) = static_cast<float>(x);
    }
    image(3, 3) = 1e6F;
    const DisplayWindow window = GrayLevels(image).fittingWindow();
    // 0.5 to 99.5 % of 0 ... 99; one step of the table is 1e6 / 65534 = 15.
    EXPECT_NEAR(window.center - 0.5 * window.width, 0, 16);
    EXPECT_NEAR(window.center + 0.5 * window.width, 99, 16);
}

TEST(GrayLevels, MarksPixelsThatAreNotFinite) {
    const Image image(3, 1, std::vector<float>{std::numeric_limits<float>::quiet_NaN(), 0, 1});
    const QImage shown = GrayLevels(image).render({0.5, 1});
    EXPECT_EQ(shown.pixel(0, 0), kNotFinite);
    EXPECT_EQ(qRed(shown.pixel(1, 0)), 0);
    EXPECT_EQ(qRed(shown.pixel(2, 0)), 255);
}

TEST(GrayLevels, ShowsAConstantImageAndAnEmptyOne) {
    const GrayLevels constant(Image(4, 4, 7.0F));
    const QImage shown = constant.render(constant.fittingWindow());
    EXPECT_EQ(shown.pixel(0, 0), shown.pixel(3, 3));
    EXPECT_TRUE(GrayLevels(Image()).render({0, 1}).isNull());
}

}  // namespace
}  // namespace fluorocut::ui
