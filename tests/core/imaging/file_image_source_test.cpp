#include "core/imaging/file_image_source.h"

#include <gtest/gtest.h>

#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

Image gradientImage() {
    Image image(40, 30);
    for (int y = 0; y < 30; ++y)
        for (int x = 0; x < 40; ++x)
            image(x, y) = static_cast<float>(100 * x + y);
    return image;
}

TEST(FileImageSource, HandsOverWhatTheFileStatesAndNoMore) {
    const test::ScratchFolder scratch;
    ImageWriteOptions options;
    options.pixel_spacing_mm = Vector2(0.25, 0.5);
    ASSERT_OK(writeImage(scratch / "view.dcm", gradientImage(), options));
    auto source = FileImageSource::open(scratch / "view.dcm");
    ASSERT_OK(source);
    const auto acquired = source->acquire({}, Progress::none());
    ASSERT_OK(acquired);
    EXPECT_EQ(acquired->image, gradientImage());
    ASSERT_TRUE(acquired->pixel_spacing.has_value());
    EXPECT_EQ(acquired->pixel_spacing->mm, Vector2(0.25, 0.5));
    EXPECT_EQ(acquired->pixel_spacing->plane, SpacingPlane::detector);
    EXPECT_FALSE(acquired->nominal_carm.has_value());
    EXPECT_FALSE(acquired->time.has_value());
    EXPECT_FALSE(acquired->nominal_position.has_value());
    EXPECT_EQ(acquired->provenance.identity, (scratch / "view.dcm").string());
}

TEST(FileImageSource, HandsOverTheFrameThatIsAskedFor) {
    SKIP_WITHOUT_SHARED_DATA();
    auto source = FileImageSource::open(test::sharedData() / "biplane/rad_dcm_cropped.tif");
    ASSERT_OK(source);
    EXPECT_EQ(source->capabilities().frames, 128);
    const auto first = source->acquire({}, Progress::none());
    const auto last = source->acquire({std::nullopt, 128}, Progress::none());
    ASSERT_OK(first);
    ASSERT_OK(last);
    EXPECT_NE(first->image, last->image);
    EXPECT_TRUE(last->provenance.identity.ends_with(", frame 128"));
    EXPECT_EQ(source->acquire({std::nullopt, 129}, Progress::none()).error().code, ErrorCode::invalidOption);
}

TEST(FileImageSource, HandsOverWhatARealFluoroscopyFileStates) {
    SKIP_WITHOUT_SHARED_DATA();
    auto source = FileImageSource::open(test::sharedData() / "xray/RF_na_expl_1.dcm");
    ASSERT_OK(source);
    const auto acquired = source->acquire({}, Progress::none());
    ASSERT_OK(acquired);
    EXPECT_EQ(acquired->source_detector_mm, 1150);
    ASSERT_TRUE(acquired->pixel_spacing.has_value());
    EXPECT_EQ(acquired->pixel_spacing->plane, SpacingPlane::detector);
    EXPECT_FALSE(acquired->provenance.warnings.empty());
}

TEST(FileImageSource, SaysAtOnceWhatIsWrong) {
    const auto missing = FileImageSource::open("/no/such/file.png");
    ASSERT_FALSE(missing.ok());
    EXPECT_EQ(missing.error().code, ErrorCode::invalidInput);
}

}  // namespace
}  // namespace fluorocut
