#include "core/imaging/display_picture.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

// A body of line integrals from 1 (left) to 5 (right), with a thin rod (0.2 more) across its middle, between margins of
// open beam.
Image exposedBody() {
    Image levels(240, 120);
    for (int y = 0; y < 120; ++y) {
        for (int x = 0; x < 240; ++x) {
            const bool open = x < 30 || x >= 210;
            const double rod = y >= 58 && y < 62 ? 0.2 : 0.0;
            const double integral = open ? 0 : 1 + 4 * (x - 30) / 180.0 + rod;
            levels(x, y) = static_cast<float>(40000 * std::exp(-integral));
        }
    }
    return levels;
}

TEST(DisplayPicture, FillsBlackToWhiteAndKeepsBrightBright) {
    const Result<Image> picture = displayPicture(exposedBody());
    ASSERT_OK(picture);
    for (const float value : picture->pixels()) {
        ASSERT_GE(value, 0);
        ASSERT_LE(value, 1);
    }
    EXPECT_EQ((*picture)(5, 30), 1.0F);  // open beam
    EXPECT_GT((*picture)(70, 30), (*picture)(120, 30));
    EXPECT_GT((*picture)(120, 30), (*picture)(180, 30));
}

TEST(DisplayPicture, ShowsTheSameObjectAlikeInThinAndThickParts) {
    const Result<Image> picture = displayPicture(exposedBody());
    ASSERT_OK(picture);
    const auto contrast = [&](int x) { return (*picture)(x, 45) - (*picture)(x, 60); };
    EXPECT_GT(contrast(80), 0.02);
    // The logarithm makes the rod's contrast independent of what lies around it; 5 % for rounding and the blur's
    // border.
    EXPECT_NEAR(contrast(160) / contrast(80), 1, 0.05);
    // In the levels themselves it differs by exp(-4 * 80 / 180) = 0.17.
    const Image levels = exposedBody();
    EXPECT_LT((levels(160, 45) - levels(160, 60)) / (levels(80, 45) - levels(80, 60)), 0.2);
}

TEST(DisplayPicture, CompressesWideDifferencesMoreThanDetail) {
    const auto wideOverDetail = [](double compression) {
        DisplayOptions options;
        options.compression = compression;
        const Result<Image> picture = displayPicture(exposedBody(), options);
        return ((*picture)(80, 30) - (*picture)(160, 30)) / ((*picture)(120, 45) - (*picture)(120, 60));
    };
    EXPECT_LT(wideOverDetail(0.4), 0.6 * wideOverDetail(1));
}

TEST(DisplayPicture, TakesAConstantAndAnEmptyImage) {
    const Result<Image> constant = displayPicture(Image(16, 16, 100.0F));
    ASSERT_OK(constant);
    EXPECT_EQ((*constant)(3, 3), 0.5F);
    const Result<Image> dark = displayPicture(Image(16, 16, 0.0F));
    ASSERT_OK(dark);
    EXPECT_EQ((*dark)(3, 3), 0.5F);
    EXPECT_TRUE(displayPicture(Image())->empty());
}

TEST(DisplayPicture, RefusesPixelsAndOptionsThatAreNone) {
    Image broken(4, 4, 1.0F);
    broken(1, 1) = std::numeric_limits<float>::quiet_NaN();
    ASSERT_FALSE(displayPicture(broken).ok());
    EXPECT_EQ(displayPicture(broken).error().code, ErrorCode::invalidInput);
    DisplayOptions options;
    options.detail = std::numeric_limits<double>::quiet_NaN();
    ASSERT_FALSE(displayPicture(Image(4, 4), options).ok());
    EXPECT_NE(displayPicture(Image(4, 4), options).error().message().find("detail"), std::string::npos);
}

}  // namespace
}  // namespace fluorocut
