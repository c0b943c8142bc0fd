// From detector levels to the picture that a C-arm's monitor shows: logarithm, compression of the wide differences
// between thick and thin parts of the body, emphasis of detail, and a window that leaves the open beam out.
//
//     g = ln(max(I, floor)),   low = G_sigma * (m g) / G_sigma * m,   d = compression low + detail (g - low)
//
// with m = 1 where there is a body and 0 in the open beam (97 % of the brightest and more), which is shown white: the
// dynamic range compression of digital radiography (Kobayashi et al. 1993), black to white over the percentiles
// [black, white] of the body. For eyes only: nothing may be measured in it.
#pragma once

#include "core/base/result.h"
#include "core/image/image.h"

namespace fluorocut {

struct DisplayOptions {
    double compression = 0.45;      // of differences wider than the blur; 1: none
    double detail = 1.4;            // of differences narrower than the blur; 1: none
    double sigma_part = 1.0 / 24;   // standard deviation of the blur, of the image's longer side
    double black_percentile = 0.1;  // of the pixels that are not open beam
    double white_percentile = 92;

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

// Values in [0, 1]. `levels` are linear in the photons, larger is brighter; an empty or constant image comes out grey.
Result<Image> displayPicture(const Image& levels, const DisplayOptions& options = {});

}  // namespace fluorocut
