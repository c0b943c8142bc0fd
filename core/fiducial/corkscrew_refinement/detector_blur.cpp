#include "core/fiducial/corkscrew_refinement/detector_blur.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "core/base/parallel.h"
#include "core/fiducial/corkscrew_refinement/row_kernels.h"

namespace fluorocut::corkscrew {
namespace {

// ... 2 1 0 | 0 1 2 ... n-1 | n-1 ...
int mirrored(int index, int size) {
    const int period = 2 * size;
    index = (index % period + period) % period;
    return index < size ? index : period - 1 - index;
}

std::vector<float> halfKernel(double variance) {
    std::vector<double> weights;
    double sum = 0;
    for (int n = 0; n < 40 && (n == 0 || 1 - sum > 2e-5); ++n) {
        weights.push_back(std::exp(-variance) * std::cyl_bessel_i(n, variance));
        sum += (n == 0 ? 1 : 2) * weights.back();
    }
    std::vector<float> kernel;
    for (const double weight : weights)
        kernel.push_back(static_cast<float>(weight / sum));
    return kernel;
}

}  // namespace

Image detectorBlurred(const Image& image, double variance_px2) {
    if (!(variance_px2 >= 0 && variance_px2 <= 16)) throw std::logic_error("detectorBlurred: variance outside 0 to 16");
    if (variance_px2 == 0 || image.empty()) return image;
    const std::vector<float> kernel = halfKernel(variance_px2);
    const int radius = static_cast<int>(kernel.size()) - 1, width = image.width(), height = image.height();
    Image result(width, height);
    parallelFor(static_cast<std::size_t>(height), 32, [&](std::size_t begin, std::size_t end) {
        std::vector<float> padded(static_cast<std::size_t>(width + 2 * radius));
        std::vector<const float*> rows(static_cast<std::size_t>(2 * radius + 1));
        float* const middle = padded.data() + radius;
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            for (int n = -radius; n <= radius; ++n)
                rows[static_cast<std::size_t>(n + radius)] = image.row(mirrored(y + n, height));
            rowKernels().blurDown(rows.data(), kernel.data(), radius, width, middle);
            for (int n = 1; n <= radius; ++n) {
                middle[-n] = middle[mirrored(-n, width)];
                middle[width - 1 + n] = middle[mirrored(width - 1 + n, width)];
            }
            rowKernels().blurAlong(middle, kernel.data(), radius, width, result.row(y));
        }
    });
    return result;
}

}  // namespace fluorocut::corkscrew
