// What lies in the beam when a C-arm is calibrated, as objects for the virtual operating room: the grooved plate on the
// detector, beads, and what overlays the plate: a limb, clamps, screws.
//
// Frames: objects held by the imager are placed in its detector's frame (HeldBy::imager: origin where the principal
// axis meets the detector plane, x along columns, y down the rows, z away from the source, mm). Limb and screws are
// held by the room: their place is given in `room`, whose origin is the isocentre.
#pragma once

#include <string>
#include <vector>

#include "core/distortion/plate_solid.h"
#include "core/fiducial/bead_layout.h"
#include "core/geometry/rigid3.h"
#include "core/simulation/virtual_operating_room.h"

namespace fluorocut {

// How the plate lies on the detector: its plane z = 0 is the detector plane.
struct PlatePlacement {
    Vector2 shift_mm = Vector2::Zero();
    double rotation_rad = 0;  // about the beam, from columns toward rows
    bool mirrored = false;    // turned over about its y axis before: seen mirrored, grooves toward the detector
};

// detector_from_plate, the plate's frame being that of its solid.
Rigid3 placedPlate(const PlatePlacement& placement);

// Path lengths in closed form. invalidOption: a plate that does not validate.
Result<HeldObject> heldPlate(const GroovedPlate& plate, const PlatePlacement& placement = {});

// Balls of steel, path lengths in closed form, whoever holds them. invalidOption: a layout that does not validate.
Result<HeldObject> heldBeads(const std::string& name, const BeadLayout& layout, HeldBy holder,
                             const Rigid3& holder_from_layout, Material material = Material::steel);

// The paper's bead test: a square lattice of beads over the plate's land side, those whose centres lie within `half_mm`
// of the middle. Frame plate (that of an unmirrored plate); their height is beadHeight's.
Result<BeadLayout> beadsOnPlate(double spacing_mm, double diameter_mm, double half_mm, const GroovedPlate& plate);
// Of a bead's centre above the plate plane, toward the source: half the grooves' depth and its radius. (The beads sit
// on a thin sheet: one over a groove does not sink in.)
double beadHeight(const GroovedPlate& plate, double diameter_mm);

// A limb like the paper's ham, of elliptic section, along `axis_in_room` through `middle_in_room`.
struct LimbOptions {
    Vector3 middle_in_room = Vector3::Zero();
    Vector3 axis_in_room = Vector3::UnitZ();
    Vector2 half_width_mm{75, 60};  // at its middle, across the axis
    double length_mm = 500;         // longer than any field: its ends are not seen
    double taper = 0.15;            // half widths fall by this part toward +axis, and grow toward -axis
    double bone_radius_mm = 14;     // of a tube of cortical bone along it; 0: none
    double marrow_radius_mm = 8;
    double bone_offset_mm = 12;  // of the bone's axis from the limb's

    Result<void> validate() const;
};
// The limb, and the bone and marrow in it (which displace what they lie in).
Result<std::vector<HeldObject>> heldLimb(const LimbOptions& options = {});

// A surgical clamp: two steel blades crossing at a pin, each with a ring; about 150 mm long. In its frame the pin is at
// the origin, the blades' tips at +x, the rings at -x, all of it within |z| < 4 mm.
std::vector<HeldObject> clamp(const std::string& name, HeldBy holder, const Rigid3& holder_from_clamp);

// A bone screw: shaft of 4.5 mm, head of 8 mm, along z, the tip at the origin and the head at -length.
HeldObject screw(const std::string& name, double length_mm, HeldBy holder, const Rigid3& holder_from_screw);

}  // namespace fluorocut
