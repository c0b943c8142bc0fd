// Implants: femoral stems of a built-in parametric library (core/planning/implant_family.h) and of any manufacturer's
// mesh (core/planning/implant_import.h).
//
// Frame `cavity`: origin at the stem's reference point (the middle of the resection plane on the stem's axis), z along
// the stem's axis, proximal positive; x medial (toward the head), y anterior for a LEFT stem; a right one is its mirror
// image in y. mm.
//
// Files: fluorocut/implant/1, resources/implants: a family with its sizes, neck lengths and head offsets; or a mesh
// with its unit, axis and reference point (core/planning/implant_file.h).
#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"
#include "core/imaging/materials.h"

namespace fluorocut {

enum class Side { left, right };
std::string_view name(Side side);

struct ImplantPart {
    std::string name;  // "stem", "head"
    Material material = Material::titanium;
    TriangleMesh mesh;  // a solid
};

// One implant, ready to be planned with.
struct Implant {
    std::string family;
    std::string size;
    Side side = Side::left;
    std::vector<ImplantPart> parts;  // the first is the stem that goes into bone, with its neck
    TriangleMesh in_bone;            // what of the stem lies below the resection: cavities are planned from it
    // NaN where an imported mesh does not say.
    Vector3 head_center = Vector3::Constant(std::numeric_limits<double>::quiet_NaN());  // with the chosen head
    double head_radius_mm = std::numeric_limits<double>::quiet_NaN();
    double resection_z_mm = 0;  // the stem below it lies in bone
    double stem_length_mm = 0;  // from there to the tip
};

// The mirror image in y: a left implant as a right one and the other way round.
Implant mirrored(Implant implant);

}  // namespace fluorocut
