// The shadow of a sphere on the detector. Frame `imager` (source at the origin, detector at z = f), mm.
//
// The rays that touch a sphere of radius r about C = (X, Y, Z) form the cone (d . C)^2 = |d|^2 (|C|^2 - r^2); with d =
// (x, y, f) that is an ellipse. With c = (X, Y):
//     centre           f c Z / (Z^2 - r^2)                    not the projection f c / Z of the sphere's centre,
//                                                             but farther out by the factor 1 / (1 - r^2 / Z^2)
//     along c          f r sqrt(|C|^2 - r^2) / (Z^2 - r^2)    semi-axis
//     across           f r / sqrt(Z^2 - r^2)                  semi-axis
// (3 mm of steel at 700 mm, 100 mm off the axis: the centre moves by 0.5 um. What a large sphere near the source does
// is another matter.) A distortion bends the outline; the centre of what is seen is taken as the mean of the outline.
#pragma once

#include <vector>

#include "core/geometry/rigid3.h"
#include "core/imaging/carm.h"

namespace fluorocut {

struct SphereShadow {
    Vector2 center_mm;         // in the detector plane, about the principal point, without distortion
    Vector2 radial_direction;  // unit, away from the principal point
    double radial_mm;          // semi-axes
    double tangential_mm;

    // The outline, angle counted from radial_direction.
    Vector2 at(double angle_rad) const;
};

// All NaN when the sphere does not lie wholly in front of the source.
SphereShadow sphereShadow(const Vector3& center_in_imager, double radius_mm, double focal_length_mm);

// Where the picture shows the shadow's centre: pixels, distorted if the C-arm is.
Vector2 shadowCenter(const CArm& carm, const Vector3& center_in_imager, double radius_mm);
std::vector<Vector2> shadowOutline(const CArm& carm, const Vector3& center_in_imager, double radius_mm, int points);

// The way back: the centre, in ideal pixels, of a shadow that was seen as a circle in the (distorted) image.
Vector2 idealShadowCenter(const CArm& carm, const Vector2& center_px, double radius_px);

}  // namespace fluorocut
