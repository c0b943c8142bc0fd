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
    ASSERT_OK(writeImage(scratch / "view.mha", gradientImage(), options));
    auto source = FileImageSource::open(scratch / "view.mha");
    ASSERT_OK(source);
    const auto acquired = source->acquire({}, Progress::none());
    ASSERT_OK(acquired);
    EXPECT_EQ(acquired->image, gradientImage());
    ASSERT_TRUE(acquired->pixel_spacing.has_value());
    EXPECT_EQ(acquired->pixel_spacing->mm, Vector2(0.25, 0.5));
    EXPECT_EQ(acquired->pixel_spacing->plane, SpacingPlane::unstated);
    EXPECT_FALSE(acquired->nominal_carm.has_value());
    EXPECT_FALSE(acquired->time.has_value());
    EXPECT_FALSE(acquired->nominal_position.has_value());
    EXPECT_EQ(acquired->provenance.identity, (scratch / "view.mha").string());
}

TEST(FileImageSource, SaysAtOnceWhatIsWrong) {
    const auto missing = FileImageSource::open("/no/such/file.png");
    ASSERT_FALSE(missing.ok());
    EXPECT_EQ(missing.error().code, ErrorCode::invalidInput);
}

}  // namespace
}  // namespace fluorocut
