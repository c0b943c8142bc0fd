#include "core/planning/implant.h"

#include "core/geometry/mesh_tools.h"

namespace fluorocut {
namespace {

TriangleMesh mirroredMesh(TriangleMesh mesh) {
    for (Vector3& v : mesh.vertices)
        v.y() = -v.y();
    return flipped(std::move(mesh));
}

}  // namespace

std::string_view name(Side side) {
    return side == Side::left ? "left" : "right";
}

Implant mirrored(Implant implant) {
    for (ImplantPart& part : implant.parts)
        part.mesh = mirroredMesh(std::move(part.mesh));
    implant.in_bone = mirroredMesh(std::move(implant.in_bone));
    implant.head_center.y() = -implant.head_center.y();
    implant.side = implant.side == Side::left ? Side::right : Side::left;
    return implant;
}

}  // namespace fluorocut
