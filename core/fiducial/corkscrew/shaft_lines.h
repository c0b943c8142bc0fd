// The straight lines of an image that might be the shaft: a Hough transform (Duda and Hart 1972) of the middles of dark
// lines, each voting only for lines that run its way. Many lines, not the longest: a clamp or a cortex may be longer.
#pragma once

#include <vector>

#include "core/fiducial/corkscrew/ridge_map.h"

namespace fluorocut::corkscrew {

// x cos(normal) + y sin(normal) = offset, pixels about the principal point. It runs along (-sin, cos).
struct ImageLine {
    double normal_rad = 0;
    double offset_px = 0;
    double votes = 0;

    Vector2 normal() const { return {std::cos(normal_rad), std::sin(normal_rad)}; }
    Vector2 along() const { return {-std::sin(normal_rad), std::cos(normal_rad)}; }
};

// Best first, no two nearly the same.
std::vector<ImageLine> shaftLines(const std::vector<RidgePoint>& points, const CArm& ideal, int most);

}  // namespace fluorocut::corkscrew
