// The noise of an X-ray image, from the image alone: variance of its logarithm at a level L,
//
//     var = a / L + b / L^2,          quanta and electronics,
//
// and the number of pixels over which it is alike (the detector spreads quanta). From second differences along rows, at
// distances of one and three pixels; medians, so that edges do not count.
#pragma once

#include "core/image/image.h"

namespace fluorocut::corkscrew {

struct ImageNoise {
    double a = 1, b = 0;
    double alike_px = 1;  // sum of the noise's autocorrelation over the plane

    double variance(double level) const { return (a + b / level) / level; }
};

ImageNoise noiseOf(const Image& image);

}  // namespace fluorocut::corkscrew
