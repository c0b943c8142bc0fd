// The half-edges of a mesh, grouped by the edge they lie on: what mesh_properties counts and HalfEdgeMesh pairs up.
// Half-edge h = 3 * triangle + corner runs from that corner to the next one.
//
// Linear in the mesh's size (a counting sort by the smaller vertex, then small sorts), deterministic. Corners must be
// valid indices. Half-edges from a vertex to itself (a degenerate triangle's) belong to no edge.
#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

constexpr std::int32_t nextHalfEdge(std::int32_t h) {
    return h % 3 == 2 ? h - 2 : h + 1;
}

inline std::int32_t halfEdgeOrigin(const TriangleMesh& mesh, std::int32_t h) {
    return mesh.triangles[static_cast<std::size_t>(h / 3)][static_cast<std::size_t>(h % 3)];
}

struct EdgeGroups {
    std::vector<std::int32_t> half_edges;  // edge e owns half_edges[first[e]] ... half_edges[first[e + 1] - 1]
    std::vector<std::int32_t> first;

    std::size_t count() const { return first.size() - 1; }
};

EdgeGroups groupEdges(const TriangleMesh& mesh);

}  // namespace fluorocut
