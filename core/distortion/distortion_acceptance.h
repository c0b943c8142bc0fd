// How certain a distortion map is, and whether that is enough to measure with. Every length is mm in the detector
// plane.
#pragma once

#include <limits>

#include "core/base/acceptance.h"
#include "core/distortion/distortion_map.h"

namespace fluorocut {

// Standard deviation per axis, sqrt(trace(covariance) / 2), over a grid of pixels inside the support.
struct MapUncertainty {
    double middle_mm = std::numeric_limits<double>::quiet_NaN();  // at the middle of the support
    double rms_mm = std::numeric_limits<double>::quiet_NaN();
    double largest_mm = std::numeric_limits<double>::quiet_NaN();
};
MapUncertainty uncertaintyOf(const DistortionMap& map);

// 0.05 mm of smooth residual distortion costs 0.4 mm of a fiducial's depth in a single view: a map has to be better.
struct DistortionLimits {
    double max_residual_mm = 0.25;     // rms of the points about the map: their noise, mostly
    double max_uncertainty_mm = 0.05;  // rms over the support
    double min_coverage = 0.3;         // of the image
};
Acceptance judge(const DistortionMap& map, const DistortionLimits& limits = {});

}  // namespace fluorocut
