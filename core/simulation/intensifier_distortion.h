// How an X-ray image intensifier bends its picture (Boone et al. 1991; Fahrig et al. 1997):
//
//     d = t + Rot(w + a (|u| / R)^2) u (1 + k / R (|u| / R)^2)
//
//   u, d  ideal and distorted place, mm in the detector plane about the principal point (core/imaging/distortion.h)
//   k     pincushion: the flat picture of a curved input screen; outward shift (mm) at the rim, |u| = R
//   a     S-shape: electrons turn about the axial part of the Earth's magnetic field, the more the farther out (rad at
//         the rim); a straight line becomes an S
//   t, w  shift by the transverse part of the field and by the tube's sag; turn by the sag
//
// From 2 R on the radial term continues as a straight line, so that the map is one-to-one on the whole plane and its
// inverse exists everywhere: radius by Newton's method (monotone and convex or concave: it cannot fail), then angle.
// The twist preserves area, so only the radial term can fold the picture over; parameters that do so are refused.
//
// IntensifierOptions describe one tube at every pose: field and gravity are fixed in the room, the tube turns. The
// distortion is a smooth function of the imager's orientation, and the same each time it comes back.
#pragma once

#include <memory>

#include "core/base/random.h"
#include "core/base/result.h"
#include "core/base/units.h"
#include "core/geometry/rigid3.h"
#include "core/imaging/distortion.h"

namespace fluorocut {

struct IntensifierDistortionParameters {
    double field_radius_mm = 82;         // R
    double pincushion_mm = 0;            // k
    double s_shape_rad = 0;              // a
    Vector2 shift_mm = Vector2::Zero();  // t
    double rotation_rad = 0;             // w

    bool isIdentity() const {
        return pincushion_mm == 0 && s_shape_rad == 0 && shift_mm.isZero(0) && rotation_rad == 0;
    }

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

class IntensifierDistortion final : public Distortion {
  public:
    static Result<std::shared_ptr<const IntensifierDistortion>> create(
        const IntensifierDistortionParameters& parameters);

    Vector2 distorted(const Vector2& undistorted_mm) const override;
    Vector2 undistorted(const Vector2& distorted_mm) const override;  // to 1e-9 mm

    const IntensifierDistortionParameters& parameters() const { return parameters_; }

  private:
    explicit IntensifierDistortion(const IntensifierDistortionParameters& parameters) : parameters_(parameters) {}

    IntensifierDistortionParameters parameters_;
};

// The defaults are those of a 9-inch tube of the 1980s: 5 to 8 pixels of 0.32 mm at the rim.
struct IntensifierOptions {
    double field_radius_mm = 82;
    double pincushion_mm = 2.1;   // at the rim, at every pose
    double s_shape_rad = 0.02;    // at the rim, with the whole field along the tube
    double field_shift_mm = 0.8;  // with the whole field across the tube
    // Direction of the field in the room (core/imaging/carm_position.h): below the horizontal, and in the horizontal
    // plane from the patient's head (z) toward the left (x).
    double field_dip_rad = radiansFromDegrees(62);
    double field_heading_rad = radiansFromDegrees(35);
    double sag_shift_mm = 0.3;  // with gravity across the tube
    double sag_rotation_rad = 0.004;
    // What does not repeat when the same pose comes again: standard deviation (mm, at the rim) of every term.
    double repeatability_mm = 0;

    Result<void> validate() const;

    // Without any bending.
    static IntensifierOptions none();
};

// The terms for an imager that stands so in the room; only its rotation matters.
IntensifierDistortionParameters intensifierAt(const IntensifierOptions& options, const Rigid3& imager_from_room);

// The same with what does not repeat added.
IntensifierDistortionParameters disturbed(IntensifierDistortionParameters parameters, double repeatability_mm,
                                          Random& random);

}  // namespace fluorocut
