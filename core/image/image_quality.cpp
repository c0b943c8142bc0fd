#include "core/image/image_quality.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/image/blur.h"

namespace fluorocut {
namespace {

// Two smoothings: the finer one takes the noise of single pixels away, the coarser one is far enough from it for a
// ratio that means something up to a blur of 5 px.
constexpr double kFine = 1.0, kCoarse = 2.5;
// A difference over two pixels is a derivative under a box of this variance, at both smoothings alike.
constexpr double kDifference_2 = 1.0 / 3;
constexpr double kOutOfNoise = 6;  // times the median gradient, which is the noise's in all but the busiest pictures
constexpr std::size_t kFewestEdges = 30;
constexpr double kSharpest = 0.2;

double slope(const Image& image, int x, int y) {
    return std::hypot(image(x + 1, y) - image(x - 1, y), image(x, y + 1) - image(x, y - 1)) / 2;
}

double quantile(std::vector<double>& values, double share) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

}  // namespace

ImageQuality imageQuality(const Image& image) {
    ImageQuality quality;
    const auto& pixels = image.pixels();
    if (image.empty() || !std::all_of(pixels.begin(), pixels.end(), [](float v) { return std::isfinite(v); }))
        return quality;
    const float most = *std::max_element(pixels.begin(), pixels.end());
    const auto at_most = static_cast<double>(std::count(pixels.begin(), pixels.end(), most));
    quality.saturated_share = at_most <= 1 ? 0 : at_most / static_cast<double>(pixels.size());

    // Within this of the border the mirrored picture has edges of its own.
    const int border = static_cast<int>(std::ceil(3 * kCoarse));
    const int width = image.width(), height = image.height();
    if (width < 4 * border || height < 4 * border) return quality;
    const Image fine = gaussianBlurred(image, kFine), coarse = gaussianBlurred(image, kCoarse);
    Image gradient(width, height);
    std::vector<double> all;
    all.reserve(pixels.size());
    for (int y = border; y < height - border; ++y)
        for (int x = border; x < width - border; ++x) {
            gradient(x, y) = static_cast<float>(slope(fine, x, y));
            all.push_back(gradient(x, y));
        }
    // Also of the strongest: rounding leaves a picture without noise a median of nearly nothing.
    const double strongest = *std::max_element(all.begin(), all.end());
    const double threshold = std::max(kOutOfNoise * quantile(all, 0.5), 0.05 * strongest);
    if (!(threshold > 0)) return quality;
    std::vector<double> blurs;
    for (int y = border + 1; y < height - border - 1; ++y)
        for (int x = border + 1; x < width - border - 1; ++x) {
            const float here = gradient(x, y);
            if (!(here > threshold)) continue;
            // On the ridge: no less than its neighbours across the edge.
            const float along_x = std::abs(fine(x + 1, y) - fine(x - 1, y));
            const float along_y = std::abs(fine(x, y + 1) - fine(x, y - 1));
            const bool upright = along_x >= along_y;
            const float before = upright ? gradient(x - 1, y) : gradient(x, y - 1);
            const float after = upright ? gradient(x + 1, y) : gradient(x, y + 1);
            if (here < before || here < after) continue;
            const double ratio_2 = std::pow(here / slope(coarse, x, y), 2);
            // A perfect step has R = b / a at most; noise, thin lines and corners go beyond.
            const double blur_2 =
                ratio_2 > 1 ? (kCoarse * kCoarse - ratio_2 * kFine * kFine) / (ratio_2 - 1) : kCoarse * 1e3;
            blurs.push_back(std::sqrt(std::max(0.0, blur_2 - kDifference_2)));
        }
    if (blurs.size() < kFewestEdges) return quality;
    quality.edges = static_cast<int>(blurs.size());
    quality.blur_px = quantile(blurs, kSharpest);
    return quality;
}

Acceptance judge(const ImageQuality& quality, const ImageQualityLimits& limits) {
    return {
        atMost("saturated part of the picture", 100 * quality.saturated_share, 100 * limits.most_saturated_share, "%"),
        atMost("blur", quality.blur_px, limits.most_blur_px, "px")};
}

}  // namespace fluorocut
