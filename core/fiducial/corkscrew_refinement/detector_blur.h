// The detector's blur of a predicted image: the discrete Gaussian of core/image/blur.h, without its last 2e-5, in the
// vectors of row_kernels.h. A fit blurs a dozen images at each step.
#pragma once

#include <vector>

#include "core/image/image.h"

namespace fluorocut::corkscrew {

class DetectorBlur {
  public:
    // `variance_px2` 0 to 16; left out of the kernel: its last `tail`.
    explicit DetectorBlur(double variance_px2, double tail = 2e-5);

    int radius() const { return static_cast<int>(kernel_.size()) - 1; }
    // Row y of the blurred image, columns [begin, end). The border is mirrored.
    void row(const Image& image, int y, int begin, int end, float* out) const;

  private:
    std::vector<float> kernel_;
};

Image detectorBlurred(const Image& image, double variance_px2);
// For those who blur many images.
void blur(const Image& image, const DetectorBlur& kernel, Image& result);

}  // namespace fluorocut::corkscrew
