#include "core/image/image_quality.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/image/blur.h"

namespace fluorocut {
namespace {

// A step along a slanted line through the middle, under a Gaussian of `sigma` px, in closed form.
Image step(double sigma, double low, double high, double slant_rad = 0.1) {
    Image image(128, 120);
    const double c = std::cos(slant_rad), s = std::sin(slant_rad);
    for (int y = 0; y < image.height(); ++y)
        for (int x = 0; x < image.width(); ++x) {
            const double across = c * (x - 64) + s * (y - 60);
            image(x, y) = static_cast<float>(low + (high - low) * 0.5 * std::erfc(-across / (sigma * std::sqrt(2.0))));
        }
    return image;
}

Image noisy(Image image, double sigma) {
    Random random(3);
    for (float& pixel : image.pixels())
        pixel += static_cast<float>(sigma * random.normal());
    return image;
}

// The ridge is met to half a pixel, where the two gradients have fallen by different parts: 10 % of their ratio for an
// edge as sharp as a pixel (0.2 px of blur at 0.7 px), less than 4 % from 1 px on.
TEST(ImageQuality, TellsTheBlurOfAStepWhateverItsHeightAndDirection) {
    for (const double sigma : {0.7, 1.0, 1.5, 2.0, 3.0, 4.0})
        for (const double slant : {0.0, 0.1, 0.7, 1.5})
            for (const double high : {200.0, 3000.0}) {
                const ImageQuality quality = imageQuality(step(sigma, 100, high, slant));
                EXPECT_NEAR(quality.blur_px, sigma, sigma < 1 ? 0.2 : 0.1)
                    << sigma << " px, " << slant << " rad, " << high;
                EXPECT_GE(quality.edges, 30);
            }
}

// 2 % noise: what stands out of it is biased to the sharp side by the choice of the sharpest fifth.
TEST(ImageQuality, TellsSharpFromBlurredInNoise) {
    double before = 0;
    for (const double sigma : {1.0, 2.0, 3.0}) {
        const double blur = imageQuality(noisy(step(sigma, 100, 1000), 20)).blur_px;
        EXPECT_NEAR(blur, sigma, 0.5);
        EXPECT_GT(blur, before + 0.5);
        before = blur;
    }
}

TEST(ImageQuality, AFurtherBlurAddsItsVariance) {
    const Image sharp = step(1, 100, 1000);
    EXPECT_NEAR(imageQuality(gaussianBlurred(sharp, 2)).blur_px, std::sqrt(5.0), 0.1);
}

TEST(ImageQuality, HasNoBlurWithoutAnEdge) {
    EXPECT_TRUE(std::isnan(imageQuality(Image(100, 100, 5.0f)).blur_px));
    EXPECT_TRUE(std::isnan(imageQuality(noisy(Image(100, 100, 500.0f), 10)).blur_px));
    EXPECT_TRUE(std::isnan(imageQuality(Image(8, 8, 5.0f)).blur_px));
    EXPECT_TRUE(std::isnan(imageQuality(Image()).saturated_share));
    EXPECT_FALSE(accepted(judge(imageQuality(Image(100, 100, 5.0f)))));
}

TEST(ImageQuality, CountsWhatLiesAtTheTop) {
    Image image = noisy(step(1, 100, 1000), 20);
    EXPECT_EQ(imageQuality(image).saturated_share, 0);
    // A quarter of the rows clipped at what nobody else reaches.
    for (int y = 0; y < 30; ++y)
        for (int x = 0; x < image.width(); ++x)
            image(x, y) = 4095;
    EXPECT_DOUBLE_EQ(imageQuality(image).saturated_share, 0.25);
    EXPECT_FALSE(judge(imageQuality(image))[0].accepted());
}

TEST(ImageQuality, RefusesWhatIsNoNumber) {
    Image image = step(1, 100, 1000);
    image(3, 4) = std::numeric_limits<float>::quiet_NaN();
    EXPECT_TRUE(std::isnan(imageQuality(image).saturated_share));
    EXPECT_FALSE(accepted(judge(imageQuality(image))));
}

}  // namespace
}  // namespace fluorocut
