// Signs that rounding cannot get wrong, for decisions that must agree with each other: on which side of an edge a ray
// passes.
//
// Evaluated with floating-point expansions (Shewchuk 1997): exact for all finite arguments whose products neither
// overflow nor underflow (sizes between 1e-90 and 1e90 are far inside). Slow (about 2 us): ask only when a rounded
// value is within its error bound of zero.
#pragma once

#include "core/geometry/rigid3.h"

namespace fluorocut {

// -1, 0 or 1: the sign of a . (b x c).
int exactTripleProductSign(const Vector3& a, const Vector3& b, const Vector3& c);

// -1, 0 or 1: the sign of p * q - r * s.
int exactProductDifferenceSign(double p, double q, double r, double s);

// |rounded a . (b x c) - true one| is below this times the largest |a_x| |b_y| |c_z| over all orders of the axes: six
// products, each with fewer than eight roundings of 2^-53.
constexpr double kTripleProductError = 6 * 8 * 1.2e-16;

}  // namespace fluorocut
