// A place that the hand points at in one view, as all other views see it: the ray through it as a curve (its epipolar
// line, bent where the imager bends pictures), and, once it is pointed at in two views, the point in space.
#pragma once

#include <optional>

#include "core/base/result.h"
#include "core/imaging/rays.h"
#include "ui/spreadsheet/overlays.h"

namespace fluorocut::ui {

struct PointedPlace {
    std::size_t view = 0;
    Picture picture;
    Vector2 pixel = Vector2::Zero();
};

// How well two rays must meet to be taken for one point: what a hand can do.
inline constexpr double kMeetPx = 4;

class Pointing {
  public:
    // The hand is at this place. What it last pointed at in another view stays.
    void pointAt(PointedPlace place);
    void clear();

    bool empty() const { return !now_; }
    // The point that both places fix, in femur; nothing unless the rays meet within kMeetPx.
    const std::optional<TriangulatedPoint>& point() const { return point_; }

    // What a picture of `view` shows of it.
    Overlay overlayFor(std::size_t view, const Picture& picture) const;

  private:
    std::optional<PointedPlace> now_, before_;  // in different views
    std::optional<TriangulatedPoint> point_;
};

}  // namespace fluorocut::ui
