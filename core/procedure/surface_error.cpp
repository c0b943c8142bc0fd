#include "core/procedure/surface_error.h"

#include <algorithm>
#include <stdexcept>

#include "core/geometry/point_error.h"

namespace fluorocut {

std::vector<SurfacePoint> wallPoints(const TriangleMesh& cavity, double top_mm) {
    std::vector<SurfacePoint> walls;
    for (const SurfacePoint& point : surfacePoints(cavity)) {
        if (point.position.z() < top_mm - 1e-6) walls.push_back(point);
    }
    return walls;
}

SurfaceError surfaceError(const std::vector<SurfacePoint>& walls, const Pose& place) {
    SurfaceError worst;
    // The radius grows with the covariance: only places whose covariance is nearly the largest can have the largest.
    std::vector<std::pair<double, const SurfacePoint*>> by_size;
    for (const SurfacePoint& point : walls)
        by_size.emplace_back(pointCovariance(place, point.position).trace(), &point);
    std::sort(by_size.begin(), by_size.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    for (const auto& [trace, point] : by_size) {
        // 95 % radius: 2.80 sigma for three equal axes, 1.96 for one, so 1.61 to 1.96 times the root of the trace.
        if (worst.bound_mm > 1.97 * std::sqrt(trace)) break;
        const double radius = errorRadius(pointCovariance(place, point->position));
        if (!(radius <= worst.bound_mm)) worst = {radius, point->position};
    }
    return worst;
}

double insetFor(const std::vector<SurfacePoint>& walls, const Pose& place, double probability) {
    if (!place.covariance) throw std::logic_error("insetFor: the pose has no covariance");
    std::vector<SurfacePoint> placed;
    for (const SurfacePoint& point : walls)
        placed.push_back({place.target_from_source * point.position, place.target_from_source.rotate(point.normal)});
    ContainmentOptions options;
    options.probability = probability;
    return containedInset(placed, place.target_from_source.translation(), *place.covariance, options);
}

CavityOffset offsetOf(const std::vector<SurfacePoint>& walls, const Rigid3& planned, const Rigid3& found) {
    CavityOffset offset;
    if (walls.empty()) return offset;
    Vector3 middle = Vector3::Zero();
    offset.most_mm = 0;
    for (const SurfacePoint& point : walls) {
        middle += point.position / static_cast<double>(walls.size());
        offset.most_mm = std::max(offset.most_mm, (found * point.position - planned * point.position).norm());
    }
    offset.middle_mm = (found * middle - planned * middle).norm();
    offset.turn_rad = (planned.inverse() * found).rotationAngle();
    return offset;
}

}  // namespace fluorocut
