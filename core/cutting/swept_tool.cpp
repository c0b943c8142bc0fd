#include "core/cutting/swept_tool.h"

#include <algorithm>
#include <cmath>

#include "core/base/option_checks.h"

namespace fluorocut {

Result<void> Cutter::validate() const {
    return requireRanges(
        {{"cutter.radius_mm", radius_mm, 0.1, 50, "mm"}, {"cutter.length_mm", length_mm, radius_mm, 1000, "mm"}});
}

Vector3 nearestOnSweep(const ToolSegment& segment, double length_mm, const Vector3& point) {
    const Vector3& d = segment.spindle;
    const Vector3 way = segment.to_mm - segment.from_mm;
    const Vector3 off = point - segment.from_mm;
    // The part of the way across the spindle: s is free of t only if there is some.
    const double along = way.dot(d), way2 = way.squaredNorm(), across2 = way2 - along * along;
    const auto place = [&](double s, double t) { return Vector3(segment.from_mm + s * way + t * d); };
    if (across2 > 1e-18 * way2) {
        // The foot of the perpendicular on the plane; inside the parallelogram it is the nearest point.
        const double s = off.dot(way - along * d) / across2;
        const double t = (off - s * way).dot(d);
        if (s >= 0 && s <= 1 && t >= 0 && t <= length_mm) return place(s, t);
    }
    // Otherwise the nearest point lies on one of the four sides.
    const auto bestT = [&](double s) { return std::clamp((off - s * way).dot(d), 0.0, length_mm); };
    const auto bestS = [&](double t) { return way2 > 0 ? std::clamp((off - t * d).dot(way) / way2, 0.0, 1.0) : 0.0; };
    Vector3 best = place(0, bestT(0));
    for (const Vector3& other : {place(1, bestT(1)), place(bestS(0), 0), place(bestS(length_mm), length_mm)})
        if ((point - other).squaredNorm() < (point - best).squaredNorm()) best = other;
    return best;
}

}  // namespace fluorocut
