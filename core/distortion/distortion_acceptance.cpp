#include "core/distortion/distortion_acceptance.h"

#include <algorithm>
#include <cmath>

namespace fluorocut {
namespace {

constexpr int kGrid = 32;  // places along the longer side

double deviationAt(const DistortionMap& map, const Vector2& pixel) {
    return std::sqrt(0.5 * map.covariance(pixel).trace());
}

}  // namespace

MapUncertainty uncertaintyOf(const DistortionMap& map) {
    MapUncertainty result;
    result.middle_mm = deviationAt(map, map.parts().support.centre());
    const double step = static_cast<double>(std::max(map.columns(), map.rows())) / kGrid;
    double sum = 0, largest = 0;
    int count = 0;
    for (double v = 0.5 * step; v < map.rows(); v += step) {
        for (double u = 0.5 * step; u < map.columns(); u += step) {
            const Vector2 pixel(u, v);
            if (!map.covers(pixel)) continue;
            const double deviation = deviationAt(map, pixel);
            sum += deviation * deviation;
            largest = std::max(largest, deviation);
            ++count;
        }
    }
    if (count == 0) return result;
    result.rms_mm = std::sqrt(sum / count);
    result.largest_mm = largest;
    return result;
}

Acceptance judge(const DistortionMap& map, const DistortionLimits& limits) {
    return {atMost("residual", map.quality().rms_mm, limits.max_residual_mm, "mm"),
            atMost("uncertainty", uncertaintyOf(map).rms_mm, limits.max_uncertainty_mm, "mm"),
            atLeast("coverage", map.quality().coverage, limits.min_coverage, "")};
}

}  // namespace fluorocut
