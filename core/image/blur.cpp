#include "core/image/blur.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "core/base/parallel.h"

namespace fluorocut {
namespace {

constexpr double kWideSigmaPx = 8;  // wider blurs are done on block means
constexpr std::size_t kRowsPerPiece = 16;

// ... 2 1 0 | 0 1 2 ... n-1 | n-1 ...
int mirrored(int index, int size) {
    const int period = 2 * size;
    index %= period;
    if (index < 0) index += period;
    return index < size ? index : period - 1 - index;
}

// Weights 0..radius of the discrete Gaussian with variance sigma^2; its tails below 1e-7 are dropped.
std::vector<float> halfKernel(double sigma_px) {
    const double variance = sigma_px * sigma_px;
    std::vector<double> weights;
    for (int n = 0; n < 200; ++n) {
        const double weight = std::exp(-variance) * std::cyl_bessel_i(n, variance);
        if (n > 0 && weight < 1e-7) break;
        weights.push_back(weight);
    }
    const double sum = 2 * std::accumulate(weights.begin(), weights.end(), 0.0) - weights[0];
    std::vector<float> kernel;
    for (const double weight : weights)
        kernel.push_back(static_cast<float>(weight / sum));
    return kernel;
}

Image separable(const Image& image, const std::vector<float>& kernel) {
    const int width = image.width(), height = image.height(), radius = static_cast<int>(kernel.size()) - 1;
    Image result(width, height);
    parallelFor(static_cast<std::size_t>(height), kRowsPerPiece, [&](std::size_t begin, std::size_t end) {
        std::vector<float> padded(static_cast<std::size_t>(width + 2 * radius));
        float* const column_sum = padded.data() + radius;
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            const float* center = image.row(y);
            for (int x = 0; x < width; ++x)
                column_sum[x] = kernel[0] * center[x];
            for (int n = 1; n <= radius; ++n) {
                const float* above = image.row(mirrored(y - n, height));
                const float* below = image.row(mirrored(y + n, height));
                const float weight = kernel[static_cast<std::size_t>(n)];
                for (int x = 0; x < width; ++x)
                    column_sum[x] += weight * (above[x] + below[x]);
            }
            for (int n = 1; n <= radius; ++n) {
                column_sum[-n] = column_sum[mirrored(-n, width)];
                column_sum[width - 1 + n] = column_sum[mirrored(width - 1 + n, width)];
            }
            float* out = result.row(y);
            for (int x = 0; x < width; ++x)
                out[x] = kernel[0] * column_sum[x];
            for (int n = 1; n <= radius; ++n) {
                const float weight = kernel[static_cast<std::size_t>(n)];
                for (int x = 0; x < width; ++x)
                    out[x] += weight * (column_sum[x - n] + column_sum[x + n]);
            }
        }
    });
    return result;
}

// Means of factor x factor blocks; the last ones reach into the mirrored border.
Image blockMeans(const Image& image, int factor) {
    const int width = (image.width() + factor - 1) / factor, height = (image.height() + factor - 1) / factor;
    Image result(width, height);
    parallelFor(static_cast<std::size_t>(height), 4, [&](std::size_t begin, std::size_t end) {
        std::vector<double> sums(static_cast<std::size_t>(width));
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            std::fill(sums.begin(), sums.end(), 0.0);
            for (int dy = 0; dy < factor; ++dy) {
                const float* in = image.row(mirrored(y * factor + dy, image.height()));
                for (int x = 0; x < width; ++x) {
                    double sum = 0;
                    if ((x + 1) * factor <= image.width()) {
                        for (int dx = 0; dx < factor; ++dx)
                            sum += in[x * factor + dx];
                    } else {
                        for (int dx = 0; dx < factor; ++dx)
                            sum += in[mirrored(x * factor + dx, image.width())];
                    }
                    sums[static_cast<std::size_t>(x)] += sum;
                }
            }
            for (int x = 0; x < width; ++x)
                result(x, y) = static_cast<float>(sums[static_cast<std::size_t>(x)] / (factor * factor));
        }
    });
    return result;
}

struct Neighbours {
    int low, high;
    float weight;  // of `high`
};

std::vector<Neighbours> interpolationTable(int size, int coarse_size, int factor) {
    std::vector<Neighbours> table;
    for (int i = 0; i < size; ++i) {
        const double position = std::clamp((i + 0.5) / factor - 0.5, 0.0, coarse_size - 1.0);
        const int low = std::min(static_cast<int>(position), std::max(coarse_size - 2, 0));
        table.push_back({low, std::min(low + 1, coarse_size - 1), static_cast<float>(position - low)});
    }
    return table;
}

Image enlarged(const Image& coarse, int factor, int width, int height) {
    const auto columns = interpolationTable(width, coarse.width(), factor);
    const auto rows = interpolationTable(height, coarse.height(), factor);
    Image result(width, height);
    parallelFor(static_cast<std::size_t>(height), kRowsPerPiece, [&](std::size_t begin, std::size_t end) {
        std::vector<float> mixed(static_cast<std::size_t>(coarse.width()));
        for (std::size_t y = begin; y < end; ++y) {
            const float* low = coarse.row(rows[y].low);
            const float* high = coarse.row(rows[y].high);
            for (std::size_t x = 0; x < mixed.size(); ++x)
                mixed[x] = low[x] + rows[y].weight * (high[x] - low[x]);
            float* out = result.row(static_cast<int>(y));
            for (std::size_t x = 0; x < columns.size(); ++x) {
                const float a = mixed[static_cast<std::size_t>(columns[x].low)];
                const float b = mixed[static_cast<std::size_t>(columns[x].high)];
                out[x] = a + columns[x].weight * (b - a);
            }
        }
    });
    return result;
}

}  // namespace

Image gaussianBlurred(const Image& image, double sigma_px) {
    if (!(sigma_px >= 0 && sigma_px <= 1e6)) throw std::logic_error("gaussianBlurred: sigma outside [0, 1e6] px");
    if (sigma_px == 0 || image.empty()) return image;
    if (sigma_px < kWideSigmaPx) return separable(image, halfKernel(sigma_px));
    // The mean over blocks of f and the interpolation between them add the variances (f^2 - 1) / 12 and (f^2 - 1) / 6.
    const int factor = 1 << std::min(static_cast<int>(std::log2(sigma_px / 4)), 6);
    const double added = (factor * factor - 1) / 4.0;
    const double coarse_sigma = std::sqrt(sigma_px * sigma_px - added) / factor;
    return enlarged(gaussianBlurred(blockMeans(image, factor), coarse_sigma), factor, image.width(), image.height());
}

Image convolved(const Image& image, const Image& kernel) {
    if (kernel.width() % 2 == 0 || kernel.height() % 2 == 0) throw std::logic_error("convolved: kernel of even size");
    const double sum = std::accumulate(kernel.pixels().begin(), kernel.pixels().end(), 0.0);
    if (!(sum > 0 && std::isfinite(sum))) throw std::logic_error("convolved: the kernel's sum is not positive");
    const int width = image.width(), height = image.height();
    const int radius_x = kernel.width() / 2, radius_y = kernel.height() / 2;
    Image result(width, height);
    parallelFor(static_cast<std::size_t>(height), 4, [&](std::size_t begin, std::size_t end) {
        std::vector<float> padded(static_cast<std::size_t>(width + 2 * radius_x));
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            float* out = result.row(y);
            for (int dy = -radius_y; dy <= radius_y; ++dy) {
                const float* in = image.row(mirrored(y - dy, height));
                for (int x = -radius_x; x < width + radius_x; ++x)
                    padded[static_cast<std::size_t>(x + radius_x)] = in[mirrored(x, width)];
                for (int dx = -radius_x; dx <= radius_x; ++dx) {
                    const auto weight = static_cast<float>(kernel(dx + radius_x, dy + radius_y) / sum);
                    const float* shifted = padded.data() + radius_x - dx;
                    for (int x = 0; x < width; ++x)
                        out[x] += weight * shifted[x];
                }
            }
        }
    });
    return result;
}

}  // namespace fluorocut
