// What a moving cutter takes away. The cutter is a ball on a shank of the ball's own radius; frame `cutter`: origin at
// the ball's centre, z along the spindle, out of the bone.
//
// While its centre goes from a to b with the spindle along the unit vector d, the cutter sweeps all points within its
// radius R of the parallelogram
//
//     { a + s (b - a) + t d :  0 <= s <= 1,  0 <= t <= L }
//
// (the Minkowski sum of the ball with the parallelogram; the shank is L long and its upper end is round here, far
// outside the bone). So everything that is asked of a cut is a distance to parallelograms: exact, without sampling. mm;
// the frame is the caller's, the same for all.
#pragma once

#include "core/base/result.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

struct Cutter {
    double radius_mm = 3;
    double length_mm = 150;  // of the part that may touch bone, from the ball's centre along the spindle

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

// One straight piece of a path: the cutter keeps its direction.
struct ToolSegment {
    Vector3 from_mm = Vector3::Zero();  // of the ball's centre
    Vector3 to_mm = Vector3::Zero();
    Vector3 spindle = Vector3::UnitZ();  // unit, out of the bone
};

// The nearest point of a segment's parallelogram. Segments without length and segments along the spindle are lines.
Vector3 nearestOnSweep(const ToolSegment& segment, double length_mm, const Vector3& point);

// To it: sqrt of the squared distance, 1e-12 relative.
inline double distanceToSweep(const ToolSegment& segment, double length_mm, const Vector3& point) {
    return (point - nearestOnSweep(segment, length_mm, point)).norm();
}

// Signed distance (exact outside; inside at least its negative is that of the nearest single position) from what the
// cutter takes away on its way: negative where bone is removed.
inline double distanceToRemoved(const Cutter& cutter, const ToolSegment& segment, const Vector3& point) {
    return distanceToSweep(segment, cutter.length_mm, point) - cutter.radius_mm;
}

}  // namespace fluorocut
