// Where the ball's centre may be in one layer: the set of (x, y) at a height z for which the ball, and the shank above
// it, lie in the cavity:
//
//     reach(p) = max { field(p + t d) : t >= 0, below the way's open end } + radius <= 0          d: spindle
//
// The field counts as running straight up from the cavity's top: that is the way through which the cutter comes (what
// `openedUpward`, envelope_check.h, makes of the cavity's mesh). Where the cavity widens toward the top and the spindle
// is +z, the greatest value is the first, and nothing is sampled along the shank; that is found out, not assumed.
//
// The border is followed on the trilinear field, or, near it, on the distance to the cavity's mesh where that is at
// hand: the field cuts off edges and corners of the ball's places by up to a third of a voxel, and a cavity whose
// edges are as round as the cutter loses as much along all of them. Marching squares find the border, every point is
// moved onto the level, and chords are halved until they keep to it, so that the whole polygon lies between 0 and
// `tolerance_mm` inside the border. Of a layer that lies between the field's voxels altogether the one deepest place is
// found. Frame `cavity`, mm.
#pragma once

#include "core/base/result.h"
#include "core/cutting/plane_region.h"
#include "core/geometry/mesh_distance.h"
#include "core/image/volume.h"

namespace fluorocut {

class BallReach {
  public:
    // `open_mm`: z at which the way ends. `field` stays the caller's. invalidInput when it is not along the frame's
    // axes, holds NaN, or does not hold the top.
    static Result<BallReach> of(const Volume& field, const MeshDistance* wall, double radius_mm, double top_mm,
                                double open_mm, double tolerance_mm);

    double value(const Vector3& center, const Vector3& spindle) const;  // reach(p); <= 0: may be there
    double ballValue(const Vector3& center) const;                      // of the ball alone

    PlaneRegion region(double z_mm, const Vector3& spindle) const;
    PlaneRegion ballRegion(double z_mm) const;  // of the ball alone

    // Places of the field's grid (every `stride`-th) where the ball may be.
    std::vector<Vector3> places(double z_mm, int stride) const;
    bool shankClear(const Vector3& center, const Vector3& spindle) const;

    // The lowest height at which the ball may be somewhere, with all of the tolerance to spare; NaN: nowhere.
    double lowest() const;

  private:
    BallReach(const Volume& field, const MeshDistance* wall, double radius_mm, double top_mm, double open_mm,
              double tolerance_mm)
        : field_(&field),
          wall_(wall),
          radius_mm_(radius_mm),
          top_mm_(top_mm),
          open_mm_(open_mm),
          tolerance_mm_(tolerance_mm) {}

    template <class Value>
    PlaneRegion contour(double z_mm, const Value& value) const;
    bool anywhere(double z_mm) const;
    bool widensUpward() const;

    const Volume* field_;
    const MeshDistance* wall_;  // of the cavity's mesh; may be null
    double radius_mm_, top_mm_, open_mm_, tolerance_mm_;
    bool straight_ = false;  // the shank along +z is in whenever the ball is
};

}  // namespace fluorocut
