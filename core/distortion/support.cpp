#include "core/distortion/support.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace fluorocut {
namespace {

constexpr double kStep = 2 * std::numbers::pi / Support::kDirections;

double cross(const Vector2& a, const Vector2& b) {
    return a.x() * b.y() - a.y() * b.x();
}

// Andrew's monotone chain: corners in order of turning from +u toward +v.
std::vector<Vector2> convexHull(std::vector<Vector2> points) {
    std::sort(points.begin(), points.end(),
              [](const Vector2& a, const Vector2& b) { return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y(); });
    std::vector<Vector2> hull;
    for (int side = 0; side < 2; ++side) {
        const std::size_t start = hull.size();
        for (const Vector2& point : points) {
            while (hull.size() >= start + 2 && cross(hull.back() - hull[hull.size() - 2], point - hull.back()) <= 0) {
                hull.pop_back();
            }
            hull.push_back(point);
        }
        hull.pop_back();
        std::reverse(points.begin(), points.end());
    }
    return hull;
}

// The part of a convex polygon left of the line a -> b.
std::vector<Vector2> clipped(const std::vector<Vector2>& polygon, const Vector2& a, const Vector2& b) {
    std::vector<Vector2> result;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        const Vector2 &p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
        const double from = cross(b - a, p - a), to = cross(b - a, q - a);
        if (from >= 0) result.push_back(p);
        if ((from >= 0) != (to >= 0)) result.push_back(p + from / (from - to) * (q - p));
    }
    return result;
}

Vector2 centroid(const std::vector<Vector2>& polygon) {
    double area = 0;
    Vector2 sum = Vector2::Zero();
    for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
        const double part = cross(polygon[i] - polygon[0], polygon[i + 1] - polygon[0]);
        area += part;
        sum += part / 3 * (polygon[0] + polygon[i] + polygon[i + 1]);
    }
    return sum / area;
}

Vector2 direction(double angle_rad) {
    return {std::cos(angle_rad), std::sin(angle_rad)};
}

}  // namespace

Support::Support(const Vector2& centre_px, const std::vector<double>& radius_px)
    : centre_(centre_px), radius_(radius_px) {
    if (radius_.size() != kDirections || !centre_.allFinite()) throw std::logic_error("Support: bad rim");
    for (const double radius : radius_) {
        if (!(radius > 0 && std::isfinite(radius))) throw std::logic_error("Support: bad radius");
    }
    least_ = 0.8 * *std::min_element(radius_.begin(), radius_.end());  // a cubic undershoots by less
}

Result<Support> Support::around(const std::vector<std::vector<Vector2>>& sets, double margin_px) {
    std::vector<Vector2> common;
    for (const std::vector<Vector2>& points : sets) {
        const std::vector<Vector2> hull = convexHull(points);
        if (common.empty()) {
            common = hull;
        } else {
            for (std::size_t i = 0; i < hull.size() && !common.empty(); ++i)
                common = clipped(common, hull[i], hull[(i + 1) % hull.size()]);
        }
        if (common.size() < 3) break;
    }
    const Vector2 centre = common.size() < 3 ? Vector2::Zero().eval() : centroid(common);
    std::vector<double> rim(kDirections, std::numeric_limits<double>::infinity());
    for (std::size_t k = 0; k < rim.size(); ++k) {
        const Vector2 ray = direction(kStep * static_cast<double>(k));
        for (std::size_t i = 0; i < common.size(); ++i) {
            const Vector2 &a = common[i], edge = common[(i + 1) % common.size()] - a;
            const double outward = cross(ray, edge);
            if (outward > 0) rim[k] = std::min(rim[k], cross(a - centre, edge) / outward);
        }
    }
    const auto [least, most] = std::minmax_element(rim.begin(), rim.end());
    if (!(*least > 0 && *most < std::numeric_limits<double>::infinity())) {
        return noSolution("groove points", "no region where grooves of both directions were found",
                          "points of both around a common middle");
    }
    std::vector<double> smooth(kDirections);
    for (int k = 0; k < kDirections; ++k) {
        const auto at = [&](int offset) {
            return rim[static_cast<std::size_t>((k + offset + kDirections) % kDirections)];
        };
        const double mean = (at(-2) + 4 * at(-1) + 6 * at(0) + 4 * at(1) + at(2)) / 16;
        smooth[static_cast<std::size_t>(k)] = mean + margin_px;
    }
    return Support(centre, smooth);
}

double Support::radius(double angle_rad) const {
    double turns = angle_rad / kStep;
    turns -= std::floor(turns / kDirections) * kDirections;
    const int k = std::min(static_cast<int>(turns), kDirections - 1);
    const double t = turns - k;
    const auto at = [&](int offset) {
        return radius_[static_cast<std::size_t>((k + offset + kDirections) % kDirections)];
    };
    const double slope0 = 0.5 * (at(1) - at(-1)), slope1 = 0.5 * (at(2) - at(0)), rise = at(1) - at(0);
    return at(0) + t * (slope0 + t * (3 * rise - 2 * slope0 - slope1 + t * (slope0 + slope1 - 2 * rise)));
}

bool Support::contains(const Vector2& pixel, double margin_px) const {
    const Vector2 from_centre = pixel - centre_;
    const double distance = from_centre.norm() - margin_px;
    if (distance <= least_) return true;
    return distance <= radius(std::atan2(from_centre.y(), from_centre.x()));  // not for NaN
}

double Support::depth(const Vector2& pixel) const {
    const Vector2 from_centre = pixel - centre_;
    return radius(std::atan2(from_centre.y(), from_centre.x())) - from_centre.norm();
}

Vector2 Support::rimToward(const Vector2& pixel) const {
    const Vector2 from_centre = pixel - centre_;
    return centre_ + radius(std::atan2(from_centre.y(), from_centre.x())) * from_centre.normalized();
}

std::vector<Vector2> Support::polygon() const {
    std::vector<Vector2> result;
    for (std::size_t k = 0; k < radius_.size(); ++k)
        result.push_back(centre_ + radius_[k] * direction(kStep * static_cast<double>(k)));
    return result;
}

}  // namespace fluorocut
