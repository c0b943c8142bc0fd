// Support: the part of an image that groove points vouch for.
//
// A region around a centre, each of whose points sees the centre: its rim at equal angles from +u toward +v, with a
// cubic (Catmull-Rom) between them. Pixels.
#pragma once

#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

class Support {
  public:
    static constexpr int kDirections = 96;
    Support() = default;
    Support(const Vector2& centre_px, const std::vector<double>& radius_px);

    // What is inside the convex hulls of all the sets of points, with its rim smoothed and moved outward by margin_px.
    // noSolution when they have no region in common.
    static Result<Support> around(const std::vector<std::vector<Vector2>>& sets, double margin_px);

    const Vector2& centre() const { return centre_; }
    const std::vector<double>& radii() const { return radius_; }
    double radius(double angle_rad) const;
    bool contains(const Vector2& pixel, double margin_px = 0) const;
    // How far inside the rim along the line from the centre; negative outside.
    double depth(const Vector2& pixel) const;
    // The point of the rim toward `pixel`.
    Vector2 rimToward(const Vector2& pixel) const;
    std::vector<Vector2> polygon() const;

  private:
    Vector2 centre_ = Vector2::Zero();
    std::vector<double> radius_;
    double least_ = 0;  // below the rim everywhere
};

}  // namespace fluorocut
