// HalfEdgeMesh: a triangle mesh with its adjacency, built once and never changed.
//
// Half-edge h = 3 * face + corner runs from that corner to the next, counter-clockwise round its face; its twin runs
// the other way on the neighbouring face (-1 at the rim of a hole). Everything lies in flat arrays: `edges()` is made
// for one branch-free pass over all edges with both faces, as apparent contours need it. mm, in the mesh's frame.
//
// `build` refuses what half-edges cannot describe: corners that are no vertex, an edge with three faces or more,
// neighbours turned opposite ways; it names the first such edge. Holes are allowed (`closed()` tells). Parts may touch
// in a vertex.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/edge_groups.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

class HalfEdgeMesh {
  public:
    struct Edge {
        std::int32_t v0, v1;  // the ends
        std::int32_t f0, f1;  // f0 runs along it from v0 to v1, f1 from v1 to v0; f1 is -1 at a rim
    };

    // `where` is the subject of an error's sentence (a file's name).
    static Result<HalfEdgeMesh> build(TriangleMesh mesh, const std::string& where = "mesh");

    const TriangleMesh& mesh() const { return mesh_; }
    const std::vector<Edge>& edges() const { return edges_; }
    // Unit vectors out of the faces; zero for a face without area.
    const std::vector<Vector3>& faceNormals() const { return face_normals_; }
    std::size_t boundaryEdges() const { return boundary_edges_; }
    bool closed() const { return boundary_edges_ == 0; }

    static constexpr std::int32_t face(std::int32_t h) { return h / 3; }
    static constexpr std::int32_t next(std::int32_t h) { return nextHalfEdge(h); }
    static constexpr std::int32_t previous(std::int32_t h) { return h % 3 == 0 ? h + 2 : h - 1; }
    std::int32_t origin(std::int32_t h) const { return halfEdgeOrigin(mesh_, h); }
    std::int32_t tip(std::int32_t h) const { return origin(next(h)); }
    std::int32_t twin(std::int32_t h) const { return twin_[static_cast<std::size_t>(h)]; }
    std::int32_t edge(std::int32_t h) const { return edge_of_[static_cast<std::size_t>(h)]; }

    // The half-edges that leave a vertex, counter-clockwise seen from outside, fan after fan: round an inner vertex
    // once; at a rim from one side of the hole to the other. Their tips are the ring of neighbours (a rim's last
    // neighbour is the origin of previous() of the last one).
    std::span<const std::int32_t> outgoing(std::int32_t vertex) const;

  private:
    HalfEdgeMesh() = default;
    void orderFans();

    TriangleMesh mesh_;
    std::vector<Edge> edges_;
    std::vector<Vector3> face_normals_;
    std::vector<std::int32_t> twin_;
    std::vector<std::int32_t> edge_of_;
    std::vector<std::int32_t> outgoing_;  // of vertex v: outgoing_[first_outgoing_[v]] ...
    std::vector<std::int32_t> first_outgoing_;
    std::size_t boundary_edges_ = 0;
};

}  // namespace fluorocut
