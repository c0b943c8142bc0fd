// What a plane makes of a closed mesh: the polygons in which it cuts the surface, and the part of the solid below it.
// Exact: every corner lies where an edge meets the plane. A vertex on the plane (within 1e-12 of the mesh's size)
// counts as below it, so that all facets agree and the polygons are closed. mm, in the mesh's frame.
#pragma once

#include <vector>

#include "core/base/result.h"
#include "core/geometry/half_edge_mesh.h"

namespace fluorocut {

struct Plane {
    Vector3 point = Vector3::Zero();
    Vector3 normal = Vector3::UnitZ();  // of any length but zero; "above" is where it points

    double above(const Vector3& p) const { return normal.dot(p - point); }
};

// Closed polygons (the last corner joins the first): seen from above the inside of the solid lies on the left, so that
// outlines run counter-clockwise and holes clockwise. Throws std::logic_error for a mesh that is not closed.
std::vector<std::vector<Vector3>> sectionPolygons(const HalfEdgeMesh& mesh, const Plane& plane);

// The part of the solid below the plane, closed by a flat cap. invalidInput when nothing lies below it; noSolution when
// outlines touch in the plane.
Result<TriangleMesh> partBelow(const HalfEdgeMesh& mesh, const Plane& plane);

}  // namespace fluorocut
