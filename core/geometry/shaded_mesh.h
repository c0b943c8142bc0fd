// A triangle mesh as it is drawn: with a normal at every vertex, so that curved surfaces look round and edges sharp.
//
// The normal is the mean of the normals of the triangles that meet there, each weighted with its area (Gouraud 1971).
// Where triangles meet at more than the crease angle the vertex is doubled: each side of an edge has its own normal.
// mm, in the mesh's frame.
#pragma once

#include <optional>

#include "core/base/units.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

struct ShadedMesh {
    std::vector<Vector3> vertices;
    std::vector<Vector3> normals;  // unit, one for every vertex; zero where all triangles are without area
    std::vector<Triangle> triangles;
};

// As many triangles, in the same order. Corners must be valid (throws std::out_of_range).
ShadedMesh shadedMesh(const TriangleMesh& mesh, double crease_rad = radiansFromDegrees(40));

// Where a ray first meets the mesh, from either side: multiples of `direction` from `origin`, positive; nothing when it
// does not (Moeller, Trumbore 1997).
std::optional<double> firstHit(const ShadedMesh& mesh, const Vector3& origin, const Vector3& direction);

}  // namespace fluorocut
