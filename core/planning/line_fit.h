// A straight line through points that lie near it, all equally uncertain across it:
//     through their mean, along the largest axis of their scatter; with n points at places t along the line
//     sigma across at place t:  s sqrt(1 / n + (t - mean t)^2 / S),   S = sum (t - mean t)^2,   direction: s / sqrt(S)
// s is estimated from the distances themselves (2 n - 4 degrees of freedom). mm.
#pragma once

#include <limits>
#include <vector>

#include "core/geometry/rigid3.h"

namespace fluorocut {

struct LineFit {
    Vector3 point = Vector3::Constant(std::numeric_limits<double>::quiet_NaN());      // the mean
    Vector3 direction = Vector3::Constant(std::numeric_limits<double>::quiet_NaN());  // unit, sign without meaning
    double rms_mm = std::numeric_limits<double>::quiet_NaN();                         // distances from the line
    double sigma_mm = std::numeric_limits<double>::quiet_NaN();             // of one point, along one direction across
    double direction_sigma_rad = std::numeric_limits<double>::quiet_NaN();  // about any axis across
    double point_sigma_mm = std::numeric_limits<double>::quiet_NaN();       // across, at the mean

    double sigmaAt(const Vector3& place) const;  // across
};

// NaN for fewer than three points, or points in one place.
LineFit fitLine(const std::vector<Vector3>& points);

}  // namespace fluorocut
