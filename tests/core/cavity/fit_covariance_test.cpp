#include "core/cavity/fit_covariance.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/image/blur.h"

namespace fluorocut::cavity {
namespace {

constexpr int kWidth = 96, kHeight = 120;

// White noise and noise that is alike over some ten pixels, as a detector and a badly known bone make them.
Image noiseField(std::uint64_t seed, double white, double smooth) {
    Random random(seed);
    Image fine(kWidth, kHeight), coarse(kWidth, kHeight);
    for (std::size_t i = 0; i < fine.size(); ++i) {
        fine.pixels()[i] = static_cast<float>(white * random.normal());
        coarse.pixels()[i] = static_cast<float>(smooth * random.normal());
    }
    coarse = gaussianBlurred(coarse, 4);
    for (std::size_t i = 0; i < fine.size(); ++i)
        fine.pixels()[i] += coarse.pixels()[i];
    return fine;
}

// An edge (from side to side) and its inclination.
Eigen::MatrixXf influences() {
    Eigen::MatrixXf influence(kWidth * kHeight, 2);
    for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
            const double edge = std::exp(-0.5 * std::pow((x - 40) / 1.5, 2)), along = 2.0 * y / (kHeight - 1) - 1;
            influence(y * kWidth + x, 0) = static_cast<float>(edge);
            influence(y * kWidth + x, 1) = static_cast<float>(edge * along);
        }
    }
    return influence;
}

Eigen::Map<const Eigen::VectorXf> vectorOf(const Image& image) {
    return {image.pixels().data(), static_cast<Eigen::Index>(image.size())};
}

// What the unknowns' errors are over many images, against what one image says of them.
TEST(FitCovariance, IsThatOfTheErrorsWhenResidualsAreCorrelated) {
    const Eigen::MatrixXf influence = influences();
    for (const double smooth : {0.0, 6.0}) {
        Eigen::Matrix2d seen = Eigen::Matrix2d::Zero(), said = seen;
        constexpr int kImages = 400;
        for (int n = 0; n < kImages; ++n) {
            const Image noise = noiseField(static_cast<std::uint64_t>(n) + 1, 1, smooth);
            const Eigen::Vector2d error = (influence.transpose() * vectorOf(noise)).cast<double>();
            seen += error * error.transpose() / kImages;
            if (n % 20 == 0) said += correlatedCovariance(influence, vectorOf(noise), kWidth, kHeight) / (kImages / 20);
        }
        // 400 draws give a variance to 7 %; the lag window leaves out a little of long correlations.
        for (int i = 0; i < 2; ++i)
            EXPECT_NEAR(said(i, i) / seen(i, i), 1, 0.25) << smooth << " " << i;
        EXPECT_LT(std::abs(said(0, 1)), 0.2 * std::sqrt(said(0, 0) * said(1, 1)));
        // Taken as independent from pixel to pixel, the smooth part would be missed by far: the test can fail.
        if (smooth > 0) {
            const Image noise = noiseField(1, 1, smooth);
            const double variance = vectorOf(noise).squaredNorm() / static_cast<double>(noise.size());
            EXPECT_GT(seen(0, 0), 3 * variance * influence.col(0).squaredNorm());
        }
    }
}

}  // namespace
}  // namespace fluorocut::cavity
