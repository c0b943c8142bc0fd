// Smoothing of images. The border is mirrored (... c b a | a b c ...), so that a constant stays constant and the sum of
// all pixels is kept. The results do not depend on the number of threads.
#pragma once

#include "core/image/image.h"

namespace fluorocut {

// Convolution with a Gaussian of standard deviation `sigma_px`, by the discrete Gaussian exp(-s^2) I_n(s^2) (Lindeberg
// 1990): its variance is sigma^2 exactly, however small, and two blurs after each other are one of the summed variance.
// From 8 px on the work is done on block means and interpolated back: the kernel's shape is then off by less than 1 %
// of its peak and, where the blocks do not divide the image, the sum is kept only to the border's share.
// Zero changes nothing; a negative sigma, or one that is not finite, throws std::logic_error.
Image gaussianBlurred(const Image& image, double sigma_px);

// Convolution with a small measured kernel of odd size, which is scaled to the sum 1. Its cost grows with the kernel's
// area. An even size or a sum that is not positive throws std::logic_error.
Image convolved(const Image& image, const Image& kernel);

}  // namespace fluorocut
