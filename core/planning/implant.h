// Implants: femoral stems of a built-in parametric library and of any manufacturer's mesh.
//
// Frame `cavity`: origin at the stem's reference point (the middle of the resection plane on the stem's axis), z along
// the stem's axis, proximal positive; x medial (toward the head), y anterior for a LEFT stem; a right one is its mirror
// image in y. mm.
//
// Files: fluorocut/implant/1, resources/implants: a family with its sizes, neck lengths and head offsets; or a mesh
// with its unit, axis and reference point.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"
#include "core/imaging/materials.h"

namespace fluorocut {

enum class Side { left, right };

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
    std::vector<ImplantPart> parts;         // the first is the stem that goes into bone, with its neck
    Vector3 head_center = Vector3::Zero();  // with the chosen head
    double head_radius_mm = 0;
    double resection_z_mm = 0;  // the stem below it lies in bone
    double stem_length_mm = 0;  // from there to the tip
};

}  // namespace fluorocut
