// An image without what changes slowly: minus its mean over a Gaussian neighbourhood of standard deviation kHighPassPx,
// taken on block means of 4 x 4 pixels. Linear; the border is mirrored. Background, veiling glare, scatter and soft
// tissue go; wires stay.
#pragma once

#include <cstdint>
#include <vector>

#include "core/image/image.h"

namespace fluorocut::corkscrew {

constexpr double kHighPassPx = 5;

// Width and height are multiples of 4.
Image highPassed(const Image& image);

// The same at some pixels (their numbers, row by row) only, into out[0], out[stride], ...
void highPassedAt(const Image& image, const std::vector<std::uint32_t>& pixels, std::size_t stride, float* out);

}  // namespace fluorocut::corkscrew
