// What the two fits of a corkscrew share.
#pragma once

#include <optional>

#include "core/base/result.h"
#include "core/fiducial/corkscrew_refinement.h"
#include "core/fiducial/corkscrew_refinement/centre_lines.h"
#include "core/fiducial/corkscrew_refinement/ray_map.h"

namespace fluorocut::corkscrew {

// Image, C-arm, layout and start belong together and can be worked with.
Result<void> checkInputs(const char* step, const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                         const Rigid3& start);

// log of the image in a region; what is darker than a thousandth of its brightest is taken as that.
Image logarithm(const Image& image, const PixelRegion& region);

// Tukey's weight and loss of a residual e, in units of `scale`.
double tukeyWeight(double e, double scale);
double tukeyLoss(double e, double scale);

// score, rms_px, visible.
void rate(CorkscrewFit& fit, const SeenLines& lines);

constexpr double kLastSmoothingPx = 0.9, kLastReachPx = 4;  // of a look at the centre lines

}  // namespace fluorocut::corkscrew
