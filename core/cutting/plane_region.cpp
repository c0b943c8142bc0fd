#include "core/cutting/plane_region.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <polyclipping/clipper.hpp>

namespace fluorocut {
namespace {

constexpr double kUnitsPerMm = 1e5;

ClipperLib::Paths toClipper(const PlaneRegion& region) {
    ClipperLib::Paths paths;
    paths.reserve(region.size());
    for (const Polygon& polygon : region) {
        ClipperLib::Path& path = paths.emplace_back();
        path.reserve(polygon.size());
        for (const Vector2& p : polygon)
            path.emplace_back(std::llround(p.x() * kUnitsPerMm), std::llround(p.y() * kUnitsPerMm));
    }
    return paths;
}

Polygon fromClipper(const ClipperLib::Path& path) {
    Polygon polygon;
    polygon.reserve(path.size());
    for (const ClipperLib::IntPoint& p : path)
        polygon.push_back(Vector2(static_cast<double>(p.X), static_cast<double>(p.Y)) / kUnitsPerMm);
    return polygon;
}

PlaneRegion fromClipper(const ClipperLib::Paths& paths) {
    PlaneRegion region;
    for (const ClipperLib::Path& path : paths) {
        if (path.size() >= 3) region.push_back(fromClipper(path));
    }
    return region;
}

PlaneRegion combined(ClipperLib::ClipType type, const PlaneRegion& a, const PlaneRegion& b) {
    ClipperLib::Clipper clipper;
    clipper.AddPaths(toClipper(a), ClipperLib::ptSubject, true);
    clipper.AddPaths(toClipper(b), ClipperLib::ptClip, true);
    ClipperLib::Paths result;
    clipper.Execute(type, result, ClipperLib::pftNonZero, ClipperLib::pftNonZero);
    return fromClipper(result);
}

double cross(const Vector2& a, const Vector2& b) {
    return a.x() * b.y() - a.y() * b.x();
}

bool segmentsCross(const Vector2& a, const Vector2& b, const Vector2& c, const Vector2& d) {
    const Vector2 ab = b - a, cd = d - c;
    return (cross(ab, c - a) > 0) != (cross(ab, d - a) > 0) && (cross(cd, a - c) > 0) != (cross(cd, b - c) > 0);
}

Vector2 nearestOnSegment(const Vector2& a, const Vector2& b, const Vector2& point) {
    const Vector2 way = b - a;
    const double length2 = way.squaredNorm();
    return length2 > 0 ? Vector2(a + std::clamp((point - a).dot(way) / length2, 0.0, 1.0) * way) : a;
}

}  // namespace

double area(const PlaneRegion& region) {
    double twice = 0;
    for (const Polygon& polygon : region) {
        for (std::size_t i = 0; i < polygon.size(); ++i)
            twice += cross(polygon[i], polygon[(i + 1) % polygon.size()]);
    }
    return 0.5 * twice;
}

PlaneRegion offset(const PlaneRegion& region, double distance_mm, double tolerance_mm) {
    ClipperLib::ClipperOffset clipper(2.0, std::max(tolerance_mm * kUnitsPerMm, 1.0));
    clipper.AddPaths(toClipper(region), ClipperLib::jtRound, ClipperLib::etClosedPolygon);
    ClipperLib::Paths result;
    clipper.Execute(result, distance_mm * kUnitsPerMm);
    return fromClipper(result);
}

PlaneRegion intersection(const PlaneRegion& a, const PlaneRegion& b) {
    return combined(ClipperLib::ctIntersection, a, b);
}

PlaneRegion difference(const PlaneRegion& a, const PlaneRegion& b) {
    return combined(ClipperLib::ctDifference, a, b);
}

PlaneRegion united(const PlaneRegion& a, const PlaneRegion& b) {
    return combined(ClipperLib::ctUnion, a, b);
}

std::vector<PlaneRegion> components(const PlaneRegion& region) {
    ClipperLib::Clipper clipper;
    clipper.AddPaths(toClipper(region), ClipperLib::ptSubject, true);
    ClipperLib::PolyTree tree;
    clipper.Execute(ClipperLib::ctUnion, tree, ClipperLib::pftNonZero);
    std::vector<PlaneRegion> parts;
    for (const ClipperLib::PolyNode* node = tree.GetFirst(); node; node = node->GetNext()) {
        if (node->IsHole()) continue;
        PlaneRegion& part = parts.emplace_back();
        part.push_back(fromClipper(node->Contour));
        for (const ClipperLib::PolyNode* hole : node->Childs)
            part.push_back(fromClipper(hole->Contour));
    }
    return parts;
}

bool contains(const PlaneRegion& region, const Vector2& point) {
    bool inside = false;
    for (const Polygon& polygon : region) {
        for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
            const Vector2 &a = polygon[i], &b = polygon[j];
            if ((a.y() > point.y()) != (b.y() > point.y()) &&
                point.x() < a.x() + (point.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x())) {
                inside = !inside;
            }
        }
    }
    return inside;
}

bool containsSegment(const PlaneRegion& region, const Vector2& from, const Vector2& to) {
    if (!contains(region, from) || !contains(region, to)) return false;
    for (const Polygon& polygon : region) {
        for (std::size_t i = 0; i < polygon.size(); ++i)
            if (segmentsCross(from, to, polygon[i], polygon[(i + 1) % polygon.size()])) return false;
    }
    return true;
}

Polygon simplified(const Polygon& polygon, double tolerance_mm) {
    const std::size_t count = polygon.size();
    if (count < 5) return polygon;
    // Opened at two points far from each other, which stay.
    std::size_t far = 0;
    for (std::size_t i = 1; i < count; ++i)
        if ((polygon[i] - polygon[0]).squaredNorm() > (polygon[far] - polygon[0]).squaredNorm()) far = i;
    std::vector<char> kept(count, 0);
    kept[0] = kept[far] = 1;
    std::vector<std::pair<std::size_t, std::size_t>> open{{0, far}, {far, count}};
    while (!open.empty()) {
        const auto [begin, end] = open.back();
        open.pop_back();
        double worst = tolerance_mm;
        std::size_t at = end;
        for (std::size_t i = begin + 1; i < end; ++i) {
            const double off = (nearestOnSegment(polygon[begin], polygon[end % count], polygon[i]) - polygon[i]).norm();
            if (off > worst) worst = off, at = i;
        }
        if (at == end) continue;
        kept[at] = 1;
        open.emplace_back(begin, at);
        open.emplace_back(at, end);
    }
    Polygon result;
    for (std::size_t i = 0; i < count; ++i)
        if (kept[i]) result.push_back(polygon[i]);
    return result.size() < 3 ? polygon : result;
}

BorderPoint nearestOnBorder(const PlaneRegion& region, const Vector2& point) {
    BorderPoint best;
    best.distance_mm = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < region.size(); ++k) {
        for (std::size_t i = 0; i < region[k].size(); ++i) {
            const Vector2 near = nearestOnSegment(region[k][i], region[k][(i + 1) % region[k].size()], point);
            const double distance = (near - point).norm();
            if (distance < best.distance_mm) best = {k, i, near, distance};
        }
    }
    return best;
}

Polygon loopFrom(const Polygon& polygon, const BorderPoint& start) {
    Polygon loop{start.point};
    for (std::size_t i = 1; i <= polygon.size(); ++i)
        loop.push_back(polygon[(start.edge + i) % polygon.size()]);
    loop.push_back(start.point);
    // Where the place is a corner, it would come twice.
    loop.erase(
        std::unique(loop.begin(), loop.end(), [](const Vector2& a, const Vector2& b) { return (a - b).norm() < 1e-6; }),
        loop.end());
    return loop;
}

std::vector<Vector2> wayInside(const PlaneRegion& region, const Vector2& from, const Vector2& to) {
    if (containsSegment(region, from, to)) return {to};
    for (const PlaneRegion& part : components(region)) {
        if (!contains(part, from) || !contains(part, to)) continue;
        // A little inside, so that no step runs along the very border.
        const double inset = 1e-4;
        const PlaneRegion inner = offset(part, -inset, inset);
        if (inner.empty()) return {};
        const BorderPoint a = nearestOnBorder(inner, from);
        const BorderPoint b = nearestOnBorder({inner[a.polygon]}, to);
        // Both ways round; the shorter one that stays inside.
        std::vector<Vector2> forward{a.point}, backward{a.point};
        const std::size_t count = inner[a.polygon].size();
        const auto at = [&](std::size_t i) { return inner[a.polygon][i % count]; };
        for (std::size_t i = a.edge; i % count != b.edge; ++i)
            forward.push_back(at(i + 1));
        for (std::size_t i = a.edge + count; i % count != b.edge; --i)
            backward.push_back(at(i));
        const auto length = [&](const std::vector<Vector2>& way) {
            double sum = 0;
            for (std::size_t i = 1; i < way.size(); ++i)
                sum += (way[i] - way[i - 1]).norm();
            return sum + (b.point - way.back()).norm();
        };
        std::vector<Vector2> way = length(forward) <= length(backward) ? forward : backward;
        way.push_back(b.point);
        way.push_back(to);
        // Corners that can be left out are.
        std::vector<Vector2> result;
        Vector2 here = from;
        for (std::size_t i = 0; i < way.size();) {
            std::size_t next = i;
            for (std::size_t k = way.size(); k-- > i + 1;) {
                if (containsSegment(part, here, way[k])) {
                    next = k;
                    break;
                }
            }
            if (!containsSegment(part, here, way[next])) return {};
            result.push_back(here = way[next]);
            i = next + 1;
        }
        return result;
    }
    return {};
}

}  // namespace fluorocut
