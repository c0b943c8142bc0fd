#include "core/geometry/polygon.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

namespace fluorocut {
namespace {

using Ring = std::vector<std::int32_t>;

double cross(const Vector2& a, const Vector2& b, const Vector2& c) {
    return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

class Clipper {
  public:
    explicit Clipper(const std::vector<Vector2>& points) : points_(points) {}

    // Cuts the ring open where it sees the hole's rightmost point and runs around the hole.
    bool bridge(Ring& ring, const Ring& hole) const {
        const auto rightmost = std::max_element(hole.begin(), hole.end(),
                                                [&](std::int32_t a, std::int32_t b) { return at(a).x() < at(b).x(); });
        const std::optional<std::size_t> seen = visibleFrom(ring, at(*rightmost));
        if (!seen) return false;
        Ring around(rightmost, hole.end());
        around.insert(around.end(), hole.begin(), rightmost + 1);
        around.push_back(ring[*seen]);
        ring.insert(ring.begin() + static_cast<std::ptrdiff_t>(*seen) + 1, around.begin(), around.end());
        return true;
    }

    bool clip(Ring ring, std::vector<Triangle>& triangles) const {
        std::size_t i = 0, failures = 0;
        while (ring.size() > 3) {
            const std::size_t n = ring.size();
            i %= n;
            const std::size_t before = (i + n - 1) % n, after = (i + 1) % n;
            if (isEar(ring, ring[before], ring[i], ring[after])) {
                triangles.push_back({ring[before], ring[i], ring[after]});
                ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(i));
                failures = 0;
                ++i;  // leave the next corner for later: fewer slivers
            } else {
                if (++failures > n) return false;
                ++i;
            }
        }
        triangles.push_back({ring[0], ring[1], ring[2]});
        return cross(at(ring[0]), at(ring[1]), at(ring[2])) > 0;
    }

  private:
    const Vector2& at(std::int32_t i) const { return points_[static_cast<std::size_t>(i)]; }

    bool isEar(const Ring& ring, std::int32_t a, std::int32_t b, std::int32_t c) const {
        const Vector2 &pa = at(a), &pb = at(b), &pc = at(c);
        if (!(cross(pa, pb, pc) > 0)) return false;
        const Vector2 low = pa.cwiseMin(pb).cwiseMin(pc), high = pa.cwiseMax(pb).cwiseMax(pc);
        return std::none_of(ring.begin(), ring.end(), [&](std::int32_t other) {
            if (other == a || other == b || other == c) return false;
            const Vector2& p = at(other);
            if ((p.array() < low.array()).any() || (p.array() > high.array()).any()) return false;
            return cross(pa, pb, p) >= 0 && cross(pb, pc, p) >= 0 && cross(pc, pa, p) >= 0;
        });
    }

    // Whether the ring's inside lies toward `p` at its corner n. A point that a bridge has doubled has two corners; one
    // of them faces p.
    bool faces(const Ring& ring, std::size_t n, const Vector2& p) const {
        const Vector2& before = at(ring[(n + ring.size() - 1) % ring.size()]);
        const Vector2& here = at(ring[n]);
        const Vector2& after = at(ring[(n + 1) % ring.size()]);
        if (cross(before, here, after) > 0) return cross(before, here, p) > 0 && cross(here, after, p) > 0;
        return cross(before, here, p) > 0 || cross(here, after, p) > 0;
    }

    std::optional<std::size_t> visibleFrom(const Ring& ring, const Vector2& from) const {
        // The edge that a ray to the right meets first, then its right end, unless other corners stand in between: of
        // those the one nearest to the ray.
        double nearest = std::numeric_limits<double>::infinity();
        std::optional<std::size_t> candidate;
        for (std::size_t n = 0; n < ring.size(); ++n) {
            const std::size_t next = (n + 1) % ring.size();
            const Vector2 &a = at(ring[n]), &b = at(ring[next]);
            // The inside is left of an edge: those on the right of a point inside run upward.
            if (!(a.y() <= from.y() && from.y() < b.y())) continue;
            const double x = a.x() + (from.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
            if (x < from.x() || x >= nearest) continue;
            nearest = x;
            candidate = a.x() > b.x() ? n : next;
        }
        if (!candidate) return std::nullopt;
        const Vector2 hit(nearest, from.y()), end = at(ring[*candidate]);
        const Vector2 &low = end.y() < from.y() ? end : hit, &high = end.y() < from.y() ? hit : end;
        double steepest = std::numeric_limits<double>::infinity(), closest = steepest;
        std::optional<std::size_t> best;
        for (std::size_t n = 0; n < ring.size(); ++n) {
            const Vector2& p = at(ring[n]);
            if (p.x() < from.x() || !faces(ring, n, from)) continue;
            const bool inside = n == *candidate || p == end ||
                                (cross(from, low, p) >= 0 && cross(low, high, p) >= 0 && cross(high, from, p) >= 0);
            if (!inside) continue;
            const double slope = std::abs(p.y() - from.y()) / std::max(p.x() - from.x(), 1e-300);
            const double distance = (p - from).squaredNorm();
            if (slope < steepest || (slope == steepest && distance < closest)) {
                steepest = slope;
                closest = distance;
                best = n;
            }
        }
        return best;
    }

    const std::vector<Vector2>& points_;
};

}  // namespace

Result<std::vector<Triangle>> triangulate(const std::vector<Vector2>& points, const std::vector<std::int32_t>& outline,
                                          const std::vector<std::vector<std::int32_t>>& holes) {
    const Clipper clipper(points);
    const auto rightOf = [&](const Ring& hole) {
        double x = -std::numeric_limits<double>::infinity();
        for (const std::int32_t i : hole)
            x = std::max(x, points[static_cast<std::size_t>(i)].x());
        return x;
    };
    std::vector<Ring> sorted = holes;
    std::stable_sort(sorted.begin(), sorted.end(),
                     [&](const Ring& a, const Ring& b) { return rightOf(a) > rightOf(b); });
    Ring ring = outline;
    std::vector<Triangle> triangles;
    bool good = ring.size() >= 3;
    for (const Ring& hole : sorted)
        good = good && hole.size() >= 3 && clipper.bridge(ring, hole);
    if (!good || !clipper.clip(std::move(ring), triangles)) {
        return noSolution("triangles of a polygon", "an outline or holes that cross or touch",
                          "a simple polygon with holes apart from each other");
    }
    return triangles;
}

}  // namespace fluorocut
