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

}  // namespace

DetectorBlur::DetectorBlur(double variance_px2, double tail) {
    if (!(variance_px2 >= 0 && variance_px2 <= 16)) throw std::logic_error("DetectorBlur: variance outside 0 to 16");
    std::vector<double> weights;
    double sum = 0;
    for (int n = 0; n < 40 && (n == 0 || 1 - sum > tail); ++n) {
        weights.push_back(std::exp(-variance_px2) * std::cyl_bessel_i(n, variance_px2));
        sum += (n == 0 ? 1 : 2) * weights.back();
    }
    for (const double weight : weights)
        kernel_.push_back(static_cast<float>(weight / sum));
}

void DetectorBlur::row(const Image& image, int y, int begin, int end, float* out) const {
    // Kept by each thread from row to row.
    static thread_local std::vector<float> padded;
    static thread_local std::vector<const float*> rows;
    const int reach = radius(), width = image.width(), count = end - begin;
    if (count <= 0) return;
    padded.resize(static_cast<std::size_t>(count + 2 * reach));
    rows.resize(static_cast<std::size_t>(2 * reach + 1));
    // What lies inside of the image is summed up; what lies outside is mirrored.
    const int first = std::max(0, begin - reach), last = std::min(width, end + reach);
    for (int n = -reach; n <= reach; ++n)
        rows[static_cast<std::size_t>(n + reach)] = image.row(mirrored(y + n, image.height())) + first;
    float* const from = padded.data() + (first - (begin - reach));
    rowKernels().blurDown(rows.data(), kernel_.data(), reach, last - first, from);
    for (int x = begin - reach; x < first; ++x)
        padded[static_cast<std::size_t>(x - (begin - reach))] =
            from[std::clamp(mirrored(x, width), first, last - 1) - first];
    for (int x = last; x < end + reach; ++x)
        padded[static_cast<std::size_t>(x - (begin - reach))] =
            from[std::clamp(mirrored(x, width), first, last - 1) - first];
    rowKernels().blurAlong(padded.data() + reach, kernel_.data(), reach, count, out);
}

void blur(const Image& image, const DetectorBlur& kernel, Image& result) {
    if (result.width() != image.width() || result.height() != image.height())
        result = Image(image.width(), image.height());
    parallelFor(static_cast<std::size_t>(image.height()), 32, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
            kernel.row(image, y, 0, image.width(), result.row(y));
    });
}

Image detectorBlurred(const Image& image, double variance_px2) {
    Image result;
    blur(image, DetectorBlur(variance_px2), result);
    return result;
}

}  // namespace fluorocut::corkscrew
