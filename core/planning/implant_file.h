// fluorocut/implant/1: a family of parametric stems, or one stem that a mesh gives.
//
//     {"schema": "fluorocut/implant/1", "name": "straight", "description": "...", "basis": "...",
//      "materials": {"stem": "titanium", "head": "cobalt-chrome"},
//      "stem": {"even_taper": 0.5, "flare_power": 4, "distal_exponent": 2.5, "proximal_exponent": 4,
//               "posterior_curve_mm": 4, "flutes": {"count": 8, "depth_mm": 0.8, "levels": [0.06, 0.6]}},
//      "neck_shaft_angle_deg": 132, "anteversion_deg": 0, "necks_mm": [-4, 0, 4, 8], "heads_mm": [28, 32, 36],
//      "sizes": [{"name": "8", "length_mm": 115, "distal_mm": [8, 7.5], "proximal_mm": [25, 12], "offset_mm": 38,
//                 "head_height_mm": 27.5}]}
//
//     {"schema": "fluorocut/implant/1", "name": "...", "mesh": "stem.stl", "mm_per_unit": 1000, "material": "titanium",
//      "side": "left", "cavity_from_mesh": [[...]], "resection_z_mm": 0,
//      "head": {"center_mm": [x, y, z], "radius_mm": 16}}
//
// `cavity_from_mesh` takes millimetres (mesh coordinates times mm_per_unit) to the frame `cavity`; `mesh` is a path
// relative to the file; the curve, the flutes and the head may be left out.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/planning/implant.h"
#include "core/planning/implant_family.h"

namespace fluorocut {

struct MeshImplant {
    std::string name;
    std::filesystem::path mesh;
    double mm_per_unit = 1;
    Material material = Material::titanium;
    Side side = Side::left;
    Rigid3 cavity_from_mesh;
    double resection_z_mm = 0;
    std::optional<Vector3> head_center_mm;
    double head_radius_mm = std::numeric_limits<double>::quiet_NaN();
};

Result<ImplantFamily> readImplantFamily(const std::filesystem::path& path);
Result<void> writeMeshImplant(const std::filesystem::path& path, const MeshImplant& implant);

// The implant that `name` means: a family of resources/implants or a file with one (`choice` picks from it), or a file
// with a mesh implant (whose size and neck cannot be chosen; its other side is its mirror image).
Result<Implant> loadImplant(const std::string& name, const ImplantChoice& choice = {});

// Every size of a family of resources/implants (or of a file), from small to large; `choice.size` does not count.
Result<std::vector<Implant>> loadSizes(const std::string& name, const ImplantChoice& choice = {});

// An implant from a mesh in millimetres, already in the frame `cavity`.
Result<Implant> implantOfMesh(TriangleMesh mesh_in_cavity, const MeshImplant& description);

}  // namespace fluorocut
