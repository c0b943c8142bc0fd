#include "core/image/blur.h"

#include <cmath>
#include <numeric>
#include <stdexcept>

#include <gtest/gtest.h>

#include "core/base/parallel.h"
#include "core/base/random.h"

namespace fluorocut {
namespace {

double sum(const Image& image) {
    return std::accumulate(image.pixels().begin(), image.pixels().end(), 0.0);
}

Image impulse(int size, float value) {
    Image image(size, size);
    image(size / 2, size / 2) = value;
    return image;
}

// Second moment along x about the centre, over the sum.
double varianceX(const Image& image) {
    double moment = 0;
    for (int y = 0; y < image.height(); ++y)
        for (int x = 0; x < image.width(); ++x)
            moment += std::pow(x - image.width() / 2, 2) * image(x, y);
    return moment / sum(image);
}

Image noise(int width, int height) {
    Random random(5);
    Image image(width, height);
    for (float& pixel : image.pixels())
        pixel = static_cast<float>(random.uniform(0, 100));
    return image;
}

// The discrete Gaussian's variance is sigma^2 by construction; 1e-4 relative covers float sums and tails below 1e-7.
TEST(GaussianBlurred, HasItsVarianceExactly) {
    for (const double sigma : {0.1, 0.29, 0.7, 1.5, 4.0, 7.9}) {
        const Image blurred = gaussianBlurred(impulse(129, 1000), sigma);
        EXPECT_NEAR(sum(blurred), 1000, 1e-2);
        EXPECT_NEAR(varianceX(blurred), sigma * sigma, 1e-4 * sigma * sigma + 1e-6) << sigma;
    }
}

TEST(GaussianBlurred, TwoBlursAreOneOfTheSummedVariance) {
    const Image once = gaussianBlurred(noise(60, 50), std::hypot(1.2, 0.9));
    const Image twice = gaussianBlurred(gaussianBlurred(noise(60, 50), 1.2), 0.9);
    for (std::size_t i = 0; i < once.size(); ++i)
        ASSERT_NEAR(once.pixels()[i], twice.pixels()[i], 1e-3);  // floats up to 100
}

// Wide blurs go through block means: same variance to 1 %, same peak to 1 %, same sum where the blocks divide the
// image.
TEST(GaussianBlurred, WideBlurKeepsItsShape) {
    for (const double sigma : {8.0, 13.0, 25.0, 60.0}) {
        const Image blurred = gaussianBlurred(impulse(768, 1e6f), sigma);
        EXPECT_NEAR(sum(blurred), 1e6, 10) << sigma;
        EXPECT_NEAR(varianceX(blurred), sigma * sigma, 0.017 * sigma * sigma) << sigma;
    }
}

TEST(GaussianBlurred, WideBlurOfASmoothImageIsTheExactOne) {
    // A cosine mirrored at the border stays a cosine, lower by exp(-w^2 sigma^2 / 2): the transfer function.
    const int n = 512;
    for (const double sigma : {10.0, 30.0, 62.5}) {
        for (const int half_waves : {1, 2, 5}) {
            const double w = M_PI * half_waves / n;
            Image image(n, n);
            for (int y = 0; y < n; ++y)
                for (int x = 0; x < n; ++x)
                    image(x, y) = static_cast<float>(std::cos(w * (x + 0.5)));
            const Image blurred = gaussianBlurred(image, sigma);
            const double transfer = std::exp(-0.5 * w * w * sigma * sigma);
            for (int x = 0; x < n; ++x)  // 1 % of the kernel's peak transfer, as the header says
                ASSERT_NEAR(blurred(x, 100), transfer * image(x, 100), 0.01) << sigma << " " << half_waves;
        }
    }
}

TEST(GaussianBlurred, KeepsConstantsAndSums) {
    for (const double sigma : {0.5, 3.0, 20.0, 300.0, 1e6}) {  // also wider than the image
        const Image flat = gaussianBlurred(Image(37, 21, 7.0f), sigma);
        for (const float value : flat.pixels())
            ASSERT_NEAR(value, 7, 1e-4);
    }
    EXPECT_NEAR(sum(gaussianBlurred(noise(37, 21), 3)), sum(noise(37, 21)), 0.1);
    EXPECT_NEAR(sum(gaussianBlurred(noise(64, 128), 20)), sum(noise(64, 128)), 0.5);  // 4e5 in floats
    EXPECT_EQ(gaussianBlurred(noise(9, 9), 0), noise(9, 9));
}

TEST(GaussianBlurred, DoesNotDependOnThreads) {
    const Image image = noise(200, 150);
    const Image narrow = gaussianBlurred(image, 1.3), wide = gaussianBlurred(image, 18);
    const ThreadLimit one(1);
    EXPECT_EQ(gaussianBlurred(image, 1.3), narrow);
    EXPECT_EQ(gaussianBlurred(image, 18), wide);
}

TEST(Convolved, IsAConvolutionWithAUnitSum) {
    Image kernel(3, 1);
    kernel(0, 0) = 1;
    kernel(1, 0) = 3;
    Image image(9, 5);
    image(4, 2) = 8;
    const Image result = convolved(image, kernel);
    EXPECT_FLOAT_EQ(result(3, 2), 2);  // the kernel's left weight falls to the left: not a correlation
    EXPECT_FLOAT_EQ(result(4, 2), 6);
    EXPECT_FLOAT_EQ(result(5, 2), 0);
    EXPECT_NEAR(sum(convolved(noise(20, 20), Image(5, 3, 1.0f))), sum(noise(20, 20)),
                0.05);  // symmetric: mirrored sums
}

TEST(Blur, RefusesWhatIsNoKernel) {
    EXPECT_THROW(gaussianBlurred(Image(3, 3), -1), std::logic_error);
    EXPECT_THROW(gaussianBlurred(Image(3, 3), NAN), std::logic_error);
    EXPECT_THROW(convolved(Image(3, 3), Image(2, 3, 1.0f)), std::logic_error);
    EXPECT_THROW(convolved(Image(3, 3), Image(3, 3)), std::logic_error);
}

}  // namespace
}  // namespace fluorocut
