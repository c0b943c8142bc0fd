#include "core/simulation/corkscrew_objects.h"

#include <optional>
#include <utility>

#include "core/geometry/mesh_tools.h"
#include "core/simulation/closed_form_projection.h"

namespace fluorocut {

Result<std::vector<HeldObject>> heldCorkscrew(const std::string& name, const CorkscrewLayout& layout, HeldBy holder,
                                              const Rigid3& holder_from_corkscrew, const CorkscrewFineness& fineness) {
    Result<CorkscrewSolid> solid = corkscrewSolid(layout, fineness);
    if (!solid) return solid.error();
    std::vector<HeldObject> parts;
    const auto add = [&](const char* part, TriangleMesh mesh, Material material, std::optional<Material> displaces) {
        HeldObject object;
        object.name = name + " " + part;
        object.mesh = std::move(mesh);
        object.material = material;
        object.displaces = displaces;
        object.holder = holder;
        object.holder_from_object = holder_from_corkscrew;
        parts.push_back(std::move(object));
    };
    add("rod", std::move(solid->rod), layout.rod, std::nullopt);
    if (!solid->shaft_inside.triangles.empty()) add("shaft", std::move(solid->shaft_inside), layout.shaft, layout.rod);
    if (!solid->shaft_outside.triangles.empty())
        add("shaft outside", std::move(solid->shaft_outside), layout.shaft, std::nullopt);
    TriangleMesh wire = std::move(solid->helix);
    for (TriangleMesh& ring : solid->rings)
        wire = merged(std::move(wire), std::move(ring));
    add("wire", std::move(wire), layout.wire, layout.rod);
    if (layout.beads.empty()) return parts;
    add("beads", {}, layout.shaft, layout.rod);
    BeadLayout beads;
    for (const CorkscrewBead& bead : layout.beads)
        beads.beads.push_back({std::to_string(beads.beads.size() + 1), bead.center_mm, 2 * bead.radius_mm});
    // In closed form: finer than any mesh of them.
    parts.back().path_lengths = [beads](const CArm& carm, const Rigid3& imager_from_corkscrew,
                                        const MeshProjectionOptions& how) {
        return spherePathLengths(beads, carm, imager_from_corkscrew, how);
    };
    return parts;
}

}  // namespace fluorocut
