// A CT's section across a shaft, and what in it is the bone asked for: everything that its cortex encloses, so that
// marrow and cancellous bone belong to it, whatever their density.
//
// Pixels above `shell_hu` are a shell; what the section's border can reach without crossing it is outside; of the rest
// the part nearest to a place asked for is the bone. A plane given by its origin and unit vectors u, v; mm, HU.
#pragma once

#include <optional>

#include "core/geometry/rigid3.h"
#include "core/image/image.h"
#include "core/image/volume.h"

namespace fluorocut {

inline constexpr double kAirHounsfield = -1000;  // beyond the CT

struct SectionPlane {
    Vector3 origin, u, v;

    Vector3 at(const Vector2& p) const { return origin + p.x() * u + p.y() * v; }
};

struct BoneSection {
    double pixel_mm = 0;
    double reach_mm = 0;  // the section is the square |x|, |y| <= reach about the plane's origin
    Image hounsfield;
    Mask solid;              // 1 where the bone is
    Vector2 marrow_mm;       // middle of its part that is less dense than `marrow_hu`, about the place asked for
    double area_mm2 = 0;     // of the solid
    double width_mm = 0;     // the larger side of the upright box around it
    bool at_border = false;  // it reaches the section's border

    bool covers(const Vector2& p) const;
    Vector2 place(int x, int y) const { return {x * pixel_mm - reach_mm, y * pixel_mm - reach_mm}; }
};

struct SectionThresholds {
    double shell_hu = 300;   // muscle, and contrast medium in vessels, stay below; a 1 mm shell in 0.8 mm voxels above
    double marrow_hu = 700;  // half of cortical bone
};

// Nothing when no bone that encloses marrow lies within `near_mm` of the place.
std::optional<BoneSection> boneSection(const Volume& ct, const SectionPlane& plane, double reach_mm, double pixel_mm,
                                       const Vector2& place, double near_mm, const SectionThresholds& thresholds = {});

}  // namespace fluorocut
