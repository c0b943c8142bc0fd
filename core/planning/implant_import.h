// Any manufacturer's mesh as an implant: unit, axis, reference point and the medial direction are given, or guessed
// from the shape, and what was guessed is said in words with how sure it is.
//
//   unit        by size: a stem is 60 to 450 mm long
//   axis        the principal axis of the volume (the longest), then the line through the middles of the sections in
//               the distal two fifths: neck and flare pull the principal axis over
//   distal end  the second quarter from it is thinner than the third
//   reference   where the medial border turns out to the neck (steeper than 1 in 1.5): the resection's level, on the
//               axis; a stem without neck: its top
//   medial      from the axis to the middle of the highest quarter's sections, where the neck or the flare leans
//
// The side cannot be seen from a stem that is its own mirror image: it is given.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/planning/implant_file.h"

namespace fluorocut {

struct ImportOptions {
    std::string name = "imported stem";
    std::optional<double> mm_per_unit = {};
    // In the mesh's own frame and unit.
    std::optional<Vector3> proximal = {};   // along the stem's axis
    std::optional<Vector3> medial = {};     // need not be across the axis
    std::optional<Vector3> reference = {};  // on the axis, at the resection
    std::optional<Side> side = {};
    Material material = Material::titanium;
};

struct ImplantImport {
    MeshImplant description;  // with a path of its own once the mesh has one
    Implant implant;
    std::vector<std::string> guessed;    // sentences; empty when all was given
    std::vector<std::string> uncertain;  // those of them that need a look
};

// `mesh` as the file has it; `where` is the subject of errors. invalidInput for a mesh that is no solid, or too small,
// too large or too round for a stem.
Result<ImplantImport> importImplant(TriangleMesh mesh, const ImportOptions& options = {},
                                    const std::string& where = "mesh");

}  // namespace fluorocut
