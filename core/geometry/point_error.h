// How large the error of a point is, given its covariance (3x3, mm^2, normal errors): what a surgeon is told.
#pragma once

#include "core/geometry/rigid3.h"

namespace fluorocut {

// The sphere about the point that holds the truth with this probability: P(|e| < r) for e ~ N(0, covariance), by
// quadrature over the principal axes. 1e-4 relative. NaN for a covariance that is not finite.
double errorRadius(const Matrix3& covariance_mm2, double probability = 0.95);

struct WorstDirection {
    double sigma_mm = 0;
    Vector3 direction = Vector3::UnitX();  // unit, sign without meaning
};
WorstDirection worstDirection(const Matrix3& covariance_mm2);

}  // namespace fluorocut
