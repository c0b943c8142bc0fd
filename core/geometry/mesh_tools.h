// Small operations that make a new mesh from an old one. mm, in the mesh's frame.
#pragma once

#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

// The mesh in another frame: every vertex p becomes target_from_source * p.
TriangleMesh transformed(TriangleMesh mesh, const Rigid3& target_from_source);

// Turned inside out.
TriangleMesh flipped(TriangleMesh mesh);

// Both meshes as parts of one.
TriangleMesh merged(TriangleMesh a, const TriangleMesh& b);

// One vertex for all that lie within `tolerance_mm` of it (0: that are equal), as a triangle soup (STL) needs. The
// first of them stays where it was; triangles that lose a corner and vertices that no triangle used go. Order is kept.
// Vertices must be finite (throws std::logic_error) and corners valid (throws std::out_of_range, a logic_error too).
TriangleMesh weldVertices(const TriangleMesh& mesh, double tolerance_mm = 0);

}  // namespace fluorocut
