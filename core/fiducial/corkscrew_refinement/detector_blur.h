// The detector's blur of a predicted image: the discrete Gaussian of core/image/blur.h, without its last 2e-5, in the
// vectors of row_kernels.h. A fit blurs a dozen images at each step.
#pragma once

#include "core/image/image.h"

namespace fluorocut::corkscrew {

// `variance_px2` 0 to 16. The border is mirrored.
Image detectorBlurred(const Image& image, double variance_px2);

}  // namespace fluorocut::corkscrew
