// What a fresh picture is worth, before anything is looked for in it: how much of it is saturated, and how sharp it is.
// Pixels of any scale; lengths in px.
//
// Saturation. A detector that is over its range writes its largest value; a picture below it has that value in a pixel
// or two, since there is noise. So the share of the pixels at the largest value is taken.
//
// Sharpness. A step edge under a Gaussian blur s, smoothed by a further Gaussian a, has the largest gradient
// proportional to 1 / sqrt(s^2 + a^2). The same edge smoothed by a and by b > a has gradients in the ratio
//
//     R = sqrt((s^2 + b^2) / (s^2 + a^2)),  hence  s^2 = (b^2 - R^2 a^2) / (R^2 - 1)
//
// whatever its height (after Zhuo and Sim 2011). It is asked of the ridges of the gradient that stand out of the noise;
// bone's own borders are soft, so the sharpest fifth of them tells the blur. A line that is thinner than the blur
// reads sharper than it is, by up to a half. NaN when no edge stands out.
#pragma once

#include <limits>

#include "core/base/acceptance.h"
#include "core/image/image.h"

namespace fluorocut {

struct ImageQuality {
    double saturated_share = std::numeric_limits<double>::quiet_NaN();
    double blur_px = std::numeric_limits<double>::quiet_NaN();  // Gaussian's standard deviation
    int edges = 0;                                              // pixels that it was asked of
};

// An image with a value that is not finite has no quality: NaN.
ImageQuality imageQuality(const Image& image);

struct ImageQualityLimits {
    double most_saturated_share = 0.02;
    // A C-arm's own blur, focal spot and detector together, is 0.7 to 1.2 px; a patient who breathes or a tube out of
    // focus shows as more than 2.
    double most_blur_px = 2;
};
Acceptance judge(const ImageQuality& quality, const ImageQualityLimits& limits = {});

}  // namespace fluorocut
