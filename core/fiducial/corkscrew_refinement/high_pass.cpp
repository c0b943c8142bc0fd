#include "core/fiducial/corkscrew_refinement/high_pass.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "core/base/parallel.h"
#include "core/fiducial/corkscrew_refinement/detector_blur.h"

namespace fluorocut::corkscrew {
namespace {

constexpr int kBlock = 4;

Image blockMeans(const Image& image) {
    Image coarse(image.width() / kBlock, image.height() / kBlock);
    for (int y = 0; y < coarse.height(); ++y) {
        for (int x = 0; x < coarse.width(); ++x) {
            float sum = 0;
            for (int dy = 0; dy < kBlock; ++dy) {
                const float* in = image.row(y * kBlock + dy) + x * kBlock;
                sum += (in[0] + in[1]) + (in[2] + in[3]);
            }
            coarse(x, y) = sum / (kBlock * kBlock);
        }
    }
    return coarse;
}

// Row y of the image that a coarse one stands for, at the middles of its blocks; its ends twice.
void mixed(const Image& coarse, int y, std::vector<float>& row) {
    const float place =
        std::clamp((static_cast<float>(y) + 0.5f) / kBlock - 0.5f, 0.0f, static_cast<float>(coarse.height() - 1));
    const int above = std::min(static_cast<int>(place), std::max(0, coarse.height() - 2));
    const int below = std::min(above + 1, coarse.height() - 1);
    const float down = place - static_cast<float>(above);
    const float *top = coarse.row(above), *bottom = coarse.row(below);
    for (int x = 0; x < coarse.width(); ++x)
        row[static_cast<std::size_t>(x + 1)] = top[x] + down * (bottom[x] - top[x]);
    row.front() = row[1];
    row.back() = row[row.size() - 2];
}

// Coarse.
Image background(const Image& image) {
    if (image.width() % kBlock != 0 || image.height() % kBlock != 0 || image.empty())
        throw std::logic_error("highPassed: width and height must be multiples of 4");
    // Block means and the interpolation between them add (16 - 1) / 4 px^2 to the variance.
    static const DetectorBlur kernel((kHighPassPx * kHighPassPx - (kBlock * kBlock - 1) / 4.0) / (kBlock * kBlock));
    Image coarse;
    blur(blockMeans(image), kernel, coarse);
    return coarse;
}

}  // namespace

void highPassedAt(const Image& image, const std::vector<std::uint32_t>& pixels, std::size_t stride, float* out) {
    const Image coarse = background(image);
    const int width = image.width();
    std::vector<float> row(static_cast<std::size_t>(coarse.width() + 2));
    for (std::size_t i = 0; i < pixels.size();) {
        const int y = static_cast<int>(pixels[i]) / width;
        mixed(coarse, y, row);
        const float* in = image.row(y);
        const std::uint32_t first = static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(width);
        for (; i < pixels.size() && pixels[i] < first + static_cast<std::uint32_t>(width); ++i) {
            constexpr float kShare[kBlock] = {0.375f, 0.125f, 0.125f, 0.375f};
            const std::uint32_t x = pixels[i] - first, block = x / kBlock, within = x % kBlock;
            const float here = row[block + 1], other = row[within < kBlock / 2 ? block : block + 2];
            out[i * stride] = in[x] - (here + kShare[within] * (other - here));
        }
    }
}

Image highPassed(const Image& image) {
    const Image coarse = background(image);
    Image result(image.width(), image.height());
    parallelFor(static_cast<std::size_t>(image.height()), 32, [&](std::size_t begin, std::size_t end) {
        std::vector<float> row(static_cast<std::size_t>(coarse.width() + 2));
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            mixed(coarse, y, row);
            const float* in = image.row(y);
            float* out = result.row(y);
            for (int x = 0; x < coarse.width(); ++x) {
                const float before = row[static_cast<std::size_t>(x)], here = row[static_cast<std::size_t>(x + 1)];
                const float after = row[static_cast<std::size_t>(x + 2)];
                const int at = x * kBlock;
                out[at] = in[at] - (here + 0.375f * (before - here));
                out[at + 1] = in[at + 1] - (here + 0.125f * (before - here));
                out[at + 2] = in[at + 2] - (here + 0.125f * (after - here));
                out[at + 3] = in[at + 3] - (here + 0.375f * (after - here));
            }
        }
    });
    return result;
}

}  // namespace fluorocut::corkscrew
