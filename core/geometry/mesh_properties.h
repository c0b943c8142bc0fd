// What a triangle mesh is: its size, its volume, and whether it bounds a solid. Any mesh may be asked about, a broken
// one too; the answer is a value, and `requireSolid` turns it into the one sentence a person needs.
//
// Volume and centroid come from the divergence theorem (sum of signed tetrahedra, taken about the middle of the bounds
// so that nothing is lost far from the origin); they mean something only when the mesh is watertight. Overlapping
// shells add. Units: mm, mm^2, mm^3, in the mesh's frame.
#pragma once

#include <cstddef>
#include <string>

#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

struct MeshProperties {
    std::size_t vertices = 0;
    std::size_t triangles = 0;
    std::size_t bad_vertices = 0;          // not finite
    std::size_t bad_triangles = 0;         // a corner that is not a vertex
    std::size_t degenerate_triangles = 0;  // without area (less than 1e-12 of their longest edge squared)
    std::size_t edges = 0;
    std::size_t boundary_edges = 0;      // one triangle only: the rim of a hole
    std::size_t flipped_edges = 0;       // two triangles that run along it the same way: one of them is inside out
    std::size_t non_manifold_edges = 0;  // three triangles or more
    std::size_t open_edges = 0;          // not run along equally often both ways; 0: the surface has no rim
    std::size_t components = 0;          // parts that share no vertex

    // NaN until known: a mesh with bad vertices or triangles has no measures.
    double area_mm2;
    double volume_mm3;  // positive when the triangles are counter-clockwise seen from outside
    Vector3 centroid;
    Vector3 min_corner, max_corner;  // bounds of the vertices that triangles use

    MeshProperties();

    bool valid() const { return triangles > 0 && bad_vertices == 0 && bad_triangles == 0; }
    // Encloses space without a gap, all triangles turned the same way. Parts may touch along an edge.
    bool watertight() const { return valid() && open_edges == 0; }
    // Watertight, and every edge has exactly two triangles.
    bool closedManifold() const { return watertight() && boundary_edges + flipped_edges + non_manifold_edges == 0; }
};

MeshProperties meshProperties(const TriangleMesh& mesh);

// Success when the mesh is watertight and turned outward; otherwise the reason, with `where` (a file's name, "mesh") as
// its subject.
Result<void> requireSolid(const MeshProperties& properties, const std::string& where);
inline Result<void> requireSolid(const TriangleMesh& mesh, const std::string& where) {
    return requireSolid(meshProperties(mesh), where);
}

}  // namespace fluorocut
