// An image without what changes slowly: minus its mean over a Gaussian neighbourhood of standard deviation kHighPassPx,
// taken on block means of 4 x 4 pixels. Linear; the border is mirrored. Background, veiling glare, scatter and soft
// tissue go; wires stay.
#pragma once

#include "core/image/image.h"

namespace fluorocut::corkscrew {

constexpr double kHighPassPx = 5;

// Width and height are multiples of 4.
Image highPassed(const Image& image);

}  // namespace fluorocut::corkscrew
