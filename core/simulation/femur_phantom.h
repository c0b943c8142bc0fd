// A built-in patient: a proximal femur with soft tissue and the hip's socket, generated as a CT in Hounsfield units.
//
// Frame of the CT: femur (DICOM LPS, mm): x to the patient's left, y to the back, z up. The femur stands with the axis
// of its shaft, at the lesser trochanter, along z, and with the plane of its knee along x; the origin lies on the axis
// at the level of the lesser trochanter's tip. A right femur is the exact mirror image in x of the left one of the same
// options.
//
// How it is made: a signed distance (femur_shape.h) gives bone, cortex and marrow space with partial volumes over one
// voxel; femur_tissue.h fills the bone, soft_tissue.h and pelvis_shape.h surround it, removed_implant.h takes an old
// implant out. Everything is a function of the place and the seed, so the result does not depend on the number of
// threads.
//
// Defaults are means of adults: Noble et al., "The anatomic basis of femoral component design", Clin Orthop 235 (1988):
// head 46.1 +- 4.8 mm, offset 43.0 +- 6.8 mm, neck-shaft angle 124.7 +- 7.4 degrees, canal width at the isthmus 12.3 +-
// 2.3 mm, canal flare index 3.8 +- 0.7 (below 3 stovepipe, 3 to 4.7 normal, above 4.7 champagne flute), head's height
// above the lesser trochanter 51.6 +- 7.1 mm; anteversion 10 to 15 degrees; bow radius 1.2 +- 0.36 m (Egol 2004).
// Dorr et al., Bone 14 (1993), for the types A, B, C.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/base/units.h"
#include "core/image/volume.h"
#include "core/simulation/femur_tissue.h"
#include "core/simulation/removed_implant.h"

namespace fluorocut {

enum class BodySide { left, right };

// A: narrow canal, thick cortex, strong flare (champagne flute). B: usual. C: wide canal, thin cortex (stovepipe).
enum class DorrType { A, B, C };

struct CanalShape {
    double flare_index;  // medio-lateral width 20 mm above the lesser trochanter over that at the isthmus
    double isthmus_mm;   // medio-lateral width at the isthmus
};
CanalShape typicalCanal(DorrType type);

struct FemurOptions {
    BodySide side = BodySide::left;
    double head_diameter_mm = 46;   // what no option names scales with the head: trochanters, shaft, muscles, pelvis
    double femoral_offset_mm = 43;  // head's centre to the shaft's axis, in the neck's plane
    double neck_shaft_angle_rad = radiansFromDegrees(127);
    double anteversion_rad = radiansFromDegrees(12);
    double neck_base_mm = 16;      // where the neck's axis passes the shaft's, above the lesser trochanter
    double bow_radius_mm = 1200;   // of the shaft's axis, convex to the front
    double shaft_length_mm = 160;  // of shaft below the lesser trochanter; the volume ends there

    DorrType dorr = DorrType::B;
    // Unset: typicalCanal(dorr), its width scaled with the head and its flare as near as the bone allows.
    std::optional<double> canal_flare_index;
    std::optional<double> isthmus_canal_mm;
    BoneDensities densities;

    bool soft_tissue = true;  // false: dry bone in air
    double fat_mm = 14;       // under the skin
    bool pelvis = true;

    std::optional<ImplantRemoval> removed_implant;  // unset: a femur that was never operated on

    double voxel_mm = 0.8;
    std::uint64_t seed = 1;  // texture only: the bone's surface does not depend on it

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

// Facts about the generated femur, in the CT's frame, mm. For showing and for checking, never for an estimator.
struct FemurLandmarks {
    Vector3 head_center_mm = kNotSet;
    double head_radius_mm = NAN;
    Vector3 neck_base_mm = kNotSet;           // where the neck's axis passes the shaft's, a little in front of it
    Vector3 neck_direction = kNotSet;         // unit, toward the head
    std::vector<Vector3> shaft_axis_mm;       // centres of the shaft every 10 mm, from the lesser trochanter down
    Vector3 greater_trochanter_mm = kNotSet;  // highest point
    Vector3 lesser_trochanter_mm = kNotSet;   // tip
    Vector3 isthmus_mm = kNotSet;             // on the axis
    double isthmus_outer_mm = NAN, isthmus_canal_mm = NAN;  // medio-lateral widths
    double canal_flare_index = NAN;
};

struct FemurPhantom {
    Volume ct;
    FemurLandmarks landmarks;
    std::optional<RemovedImplantFacts> removed_implant;
    double elapsed_ms = NAN;
};

// Fails with invalidOption (also when options contradict each other, such as a canal wider than the bone), or
// cancelled.
Result<FemurPhantom> generateFemur(const FemurOptions& options = {}, Progress& progress = Progress::none());

// The shape behind the CT, in the frame `bone` of femur_shape.h: for tests.
Result<FemurShape> femurShape(const FemurOptions& options);

}  // namespace fluorocut
