// What groove detection reads: the log intensity of an image, where it can be read, and a coarser copy of both.
#pragma once

#include "core/base/result.h"
#include "core/image/image.h"

namespace fluorocut::grooves {

enum class Seen : std::uint8_t {
    lit,
    outside,
    unreadable
};  // unreadable: dark within the field, saturated, not finite

struct PreparedImage {
    Image log;  // 0 where nothing is lit
    BasicImage<Seen> seen;
    int factor = 1;        // a coarse pixel is the mean of factor x factor pixels
    Image coarse;          // log of the mean intensity of the lit pixels
    Image coarse_lit;      // share of lit pixels, 0 to 1
    double lit_share = 0;  // of all pixels
};

// Dark surround: darker than 3 % of the range, where that is far below the field's level and reaches the image's
// border. Its level, or the least value when that is negative, is taken off before the log. Coarse pixels keep
// `min_pitch_px` above 4 of them. Fails with noSolution when nothing can be read.
Result<PreparedImage> prepare(const Image& image, double min_pitch_px);

// Log intensity minus its mean under a Gaussian over the lit part; 0 where less than half of a coarse pixel is lit, and
// where it exceeds `limit` of its robust standard deviations: metal, flanks of bone. Those have no part in the mean
// either, so that grooves beside them are seen.
Image highPassed(const PreparedImage& image, double sigma_coarse_px, double limit);

}  // namespace fluorocut::grooves
