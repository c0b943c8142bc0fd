// A stem's pose in a bone, by the place that fits worst: the pose for which the stem's surface reaches least far beyond
// what it may fill. Inside, that is the pose with the most even room around it.
//
//     minimise  max_i e(T p_i)      e: excess, mm, how far a point lies beyond what may be filled (negative: room left)
//
// The maximum is approached from above by (1/b) log sum exp(b e_i) with b rising from 2 to 60 per mm, each time by
// Newton's method with the Hessian b (mean of J J^T - mean J mean J^T) under the softmax weights, damped as Levenberg
// and Marquardt do. The reference point stays on the seat (the resection's plane): five degrees of freedom. Turning
// about the axis costs `version_weight` (angle)^2 / 2 (mm), so that a round stem keeps the version it starts with.
// Frame `femur` (of the poses' target), mm.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "core/geometry/rigid3.h"

namespace fluorocut {

class Filling {
  public:
    virtual ~Filling() = default;
    // And its gradient there (zero where it is constant).
    virtual double excess(const Vector3& point, Vector3& gradient) const = 0;
};

struct StemFit {
    Rigid3 femur_from_cavity;
    double excess_mm = std::numeric_limits<double>::infinity();
    std::size_t worst = 0;  // which of the points
};

struct StemFitOptions {
    double version_weight = 0.5;  // mm per rad^2: 15 degrees cost 0.02 mm
    double most_turn_rad = 0.6;   // of version from the start
};

// Throws std::logic_error for no points.
StemFit fitStem(const std::vector<Vector3>& points_in_cavity, const Filling& filling, const Rigid3& start,
                const Vector3& seat_normal, const StemFitOptions& options = {});

// The worst place at a given pose.
StemFit evaluateStem(const std::vector<Vector3>& points_in_cavity, const Filling& filling, const Rigid3& pose);

}  // namespace fluorocut
