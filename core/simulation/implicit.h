// Building blocks of implicit shapes: functions that are negative inside, positive outside and close to the distance in
// mm near the surface. Ellipses and ellipsoids use f = k0 (k0 - 1) / k1 with k0 = |p / r|, k1 = |p / r^2|: exact on
// the surface to first order, which is what partial volumes need. Smooth unions are the polynomial ones of Quilez
// ("smooth minimum", 2013): the sum differs from the plain union only where the two distances differ by less than
// `blend_mm`.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/geometry/rigid3.h"

namespace fluorocut::implicit {

inline double smoothUnion(double a, double b, double blend_mm) {
    const double h = std::max(blend_mm - std::abs(a - b), 0.0);
    return std::min(a, b) - h * h / (4 * blend_mm);
}

inline double smoothIntersection(double a, double b, double blend_mm) {
    return -smoothUnion(-a, -b, blend_mm);
}

inline double smoothSubtraction(double a, double removed, double blend_mm) {
    return -smoothUnion(-a, removed, blend_mm);
}

inline double sphere(const Vector3& p, const Vector3& center, double radius) {
    return (p - center).norm() - radius;
}

inline double ellipse(double x, double y, double half_x, double half_y) {
    const double u = x / half_x, v = y / half_y;
    const double k0 = std::sqrt(u * u + v * v);
    const double k1 = std::sqrt(u * u / (half_x * half_x) + v * v / (half_y * half_y));
    return k1 > 1e-9 ? k0 * (k0 - 1) / k1 : -std::min(half_x, half_y);
}

// Axes of the ellipsoid are the rows of `local_from_world`.
inline double ellipsoid(const Vector3& p, const Vector3& center, const Vector3& half, const Matrix3& local_from_world) {
    const Vector3 q = (local_from_world * (p - center)).cwiseQuotient(half);
    const double k0 = q.norm();
    const double k1 = q.cwiseQuotient(half).norm();
    return k1 > 1e-9 ? k0 * (k0 - 1) / k1 : -half.minCoeff();
}

// A ball that moves from a to b while its radius changes from ra to rb linearly.
inline double roundCone(const Vector3& p, const Vector3& a, const Vector3& b, double ra, double rb) {
    const Vector3 ab = b - a;
    const double t = std::clamp((p - a).dot(ab) / ab.squaredNorm(), 0.0, 1.0);
    return (p - a - t * ab).norm() - (ra + t * (rb - ra));
}

// 0 below low, 1 above high, smooth between.
inline double smoothStep(double low, double high, double x) {
    const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
    return t * t * (3 - 2 * t);
}

}  // namespace fluorocut::implicit
