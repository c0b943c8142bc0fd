// The outer surface of a proximal femur and the thickness of its cortex, as functions of space.
//
// Frame `bone`, mm: x lateral, y posterior, z proximal along the shaft's axis at the lesser trochanter; origin on that
// axis at the level of the lesser trochanter's tip. For a left femur these are the directions of DICOM's LPS; a right
// femur is its mirror image in x.
//
// The surface is a smooth union (implicit.h) of the shaft (an ellipse of varying size swept along the bowed axis), the
// neck (an ellipse swept along the neck's axis, narrowest in the middle), the head (a sphere), the trochanters
// (ellipsoids), the intertrochanteric crest and line and the linea aspera; the fovea and the trochanteric fossa are
// taken away.
#pragma once

#include <array>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

struct FemurDimensions {
    double head_diameter_mm;
    double femoral_offset_mm;
    double neck_shaft_angle_rad;
    double anteversion_rad;
    double neck_base_mm;       // where the neck's axis meets the shaft's, above the lesser trochanter's tip
    double bow_radius_mm;      // of the shaft's axis, convex to the front
    double canal_flare_index;  // medio-lateral canal width 20 mm above the lesser trochanter over that at the isthmus
    double isthmus_canal_mm;   // medio-lateral canal width at the isthmus
};

// Sizes of everything that the dimensions leave open, for a head of 46 mm; they scale with the head.
struct FemurProportions {
    static constexpr int kShaftKnots = 8;
    struct Section {
        double z, x, y, half_x, half_y;
    };
    struct Blob {
        double x, y, z, half_x, half_y, half_z, yaw, tilt;  // yaw about z, then tilt about the new y; rad
    };
    struct Bar {
        double ax, ay, az, bx, by, bz, ra, rb;
    };
    std::array<Section, kShaftKnots> shaft;
    double shaft_top, shaft_top_blend;
    // Half axes of the neck (in the neck's plane and across it) at its base, its middle and the head's centre; sideways
    // shift of its base.
    std::array<double, 3> neck_in_plane, neck_across;
    double neck_base_shift;
    double neck_forward;  // the neck's axis passes in front of the shaft's
    Blob greater, horn, lesser, fossa;
    Bar crest, front_line;
    double neck_blend, head_blend, greater_blend, lesser_blend, bar_blend, fossa_blend;
};

extern const FemurProportions kTypicalFemur;

class FemurShape {
  public:
    explicit FemurShape(const FemurDimensions& dimensions, const FemurProportions& proportions = kTypicalFemur);

    // Sets the cortex so that the canal has the dimensions' widths at the isthmus and 20 mm above the lesser
    // trochanter. Where the bone is too narrow or too wide for one of them: the nearest possible, or, when `exact`,
    // invalidOption.
    struct Exact {
        bool isthmus, flare;
    };
    Result<void> fitCanal(Exact exact);

    // Signed distance to the outer surface, approximately; exact to first order at the surface.
    double outer(const Vector3& p) const { return walls(p).outer; }

    // Signed distances to the outer surface and to the surface of the spongy bone and marrow inside it. The cortex of
    // the shaft runs on below the lesser trochanter, which is a spongy knob with a thin shell of its own.
    struct Walls {
        double outer, inner;
    };
    Walls walls(const Vector3& p) const;

    // Medio-lateral extent of the bone and of the canal at a level, as an antero-posterior radiograph shows it.
    double outerWidth(double z) const { return width(z, false); }
    double canalWidth(double z) const { return width(z, true); }
    double isthmusLevel() const { return kIsthmusLevel * scale_; }
    double flareLevel() const { return 20; }

    // The point of the surface that lies farthest in a direction, by climbing from `start`.
    Vector3 extremePoint(const Vector3& direction, const Vector3& start) const;

    const Vector3& headCenter() const { return head_; }
    double headRadius() const { return radius_; }
    // Where the neck's axis passes the shaft's (a little in front of it), and its direction toward the head.
    const Vector3& neckBase() const { return neck_base_; }
    const Vector3& neckDirection() const { return neck_; }
    double neckLength() const { return neck_length_; }
    // Centre of the shaft's section at a level.
    Vector3 shaftAxis(double z) const;
    double scale() const { return scale_; }

  private:
    struct Section {
        double x, y, half_x, half_y;
    };
    Section section(double z) const;  // in proportions' units
    double shaft(const Vector3& q) const;
    double neck(const Vector3& q) const;
    double width(double z, bool canal) const;
    double body(const Vector3& q) const;    // all but the lesser trochanter
    double cortex(const Vector3& p) const;  // of the body, mm

    static constexpr double kIsthmusLevel = -105;

    FemurDimensions dimensions_;
    double cortex_isthmus_ = 7, cortex_flare_ = 2.5;  // mm
    FemurProportions parts_;
    double scale_, radius_, bow_;
    Vector3 head_, neck_base_, neck_, neck_side_, neck_across_;
    double neck_length_;
    std::vector<Section> table_;
    Matrix3 greater_axes_, horn_axes_, lesser_axes_, fossa_axes_;
};

}  // namespace fluorocut
