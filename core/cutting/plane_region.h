// Areas in a plane, bounded by polygons: what a layer of a tool path is made of. mm.
//
// Outer borders run counter-clockwise, those of holes clockwise: the area lies to the left. Offsets and set operations
// are Clipper's (Vatti's algorithm on integers of 1e-5 mm: results are within 2e-5 mm and never tangled).
#pragma once

#include <vector>

#include "core/geometry/rigid3.h"

namespace fluorocut {

using Polygon = std::vector<Vector2>;  // closed; the first point is not repeated
using PlaneRegion = std::vector<Polygon>;

double area(const PlaneRegion& region);  // mm2; holes count against

// Grown by `distance_mm` (rounded corners, within `tolerance_mm`), or shrunk by its negative.
PlaneRegion offset(const PlaneRegion& region, double distance_mm, double tolerance_mm);
PlaneRegion intersection(const PlaneRegion& a, const PlaneRegion& b);
PlaneRegion difference(const PlaneRegion& a, const PlaneRegion& b);
PlaneRegion united(const PlaneRegion& a, const PlaneRegion& b);

// Connected parts, each its outer border first, then its holes.
std::vector<PlaneRegion> components(const PlaneRegion& region);

bool contains(const PlaneRegion& region, const Vector2& point);  // the border is arbitrary
bool containsSegment(const PlaneRegion& region, const Vector2& from, const Vector2& to);

// The same polygon with fewer points, nowhere farther than `tolerance_mm` from it (Douglas and Peucker 1973).
Polygon simplified(const Polygon& polygon, double tolerance_mm);

struct BorderPoint {
    std::size_t polygon = 0, edge = 0;  // from point `edge` to the next one
    Vector2 point = Vector2::Zero();
    double distance_mm = 0;
};
// The nearest place on the border of a region that is not empty.
BorderPoint nearestOnBorder(const PlaneRegion& region, const Vector2& point);

// The polygon's points, once round from a place on it and back there.
Polygon loopFrom(const Polygon& polygon, const BorderPoint& start);

// A way from one point to another inside the region: straight, or along the border where that would leave it. Empty
// when the points do not lie in one part of the region.
std::vector<Vector2> wayInside(const PlaneRegion& region, const Vector2& from, const Vector2& to);

}  // namespace fluorocut
