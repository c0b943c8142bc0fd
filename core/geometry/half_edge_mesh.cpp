#include "core/geometry/half_edge_mesh.h"

#include <utility>

#include <fmt/format.h>

namespace fluorocut {
namespace {

std::size_t at(std::int32_t i) {
    return static_cast<std::size_t>(i);
}

}  // namespace

Result<HalfEdgeMesh> HalfEdgeMesh::build(TriangleMesh mesh, const std::string& where) {
    const auto vertices = static_cast<std::int64_t>(mesh.vertices.size());
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        const Triangle& t = mesh.triangles[f];
        for (const std::int32_t v : t) {
            if (v < 0 || v >= vertices) {
                return invalidInput(where, fmt::format("triangle {} with the corner {}", f, v),
                                    fmt::format("corners from 0 to {}", vertices - 1), "export the mesh again");
            }
        }
        if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) {
            return invalidInput(where,
                                fmt::format("triangle {} that uses the vertex {} twice", f, t[0] == t[1] ? t[0] : t[2]),
                                "three different corners", "remove degenerate triangles (weldVertices does)");
        }
    }

    HalfEdgeMesh result;
    result.mesh_ = std::move(mesh);
    const EdgeGroups groups = groupEdges(result.mesh_);
    result.twin_.assign(3 * result.mesh_.triangles.size(), -1);
    result.edge_of_.assign(result.twin_.size(), -1);
    result.edges_.reserve(groups.count());
    for (std::size_t e = 0; e < groups.count(); ++e) {
        const std::int32_t faces = groups.first[e + 1] - groups.first[e];
        const std::int32_t h = groups.half_edges[at(groups.first[e])];
        const std::int32_t from = result.origin(h), to = result.tip(h);
        if (faces > 2) {
            return invalidInput(where,
                                fmt::format("{} triangles at the edge between vertices {} and {}", faces, from, to),
                                "one or two triangles at every edge", "separate parts that touch along an edge");
        }
        result.edges_.push_back({from, to, face(h), -1});
        result.edge_of_[at(h)] = static_cast<std::int32_t>(e);
        if (faces == 1) {
            ++result.boundary_edges_;
            continue;
        }
        const std::int32_t twin = groups.half_edges[at(groups.first[e] + 1)];
        if (result.origin(twin) == from) {
            return invalidInput(
                where, fmt::format("neighbours turned opposite ways at the edge between vertices {} and {}", from, to),
                "all triangles counter-clockwise seen from outside", "orient the faces in a mesh editor");
        }
        result.edges_.back().f1 = face(twin);
        result.edge_of_[at(twin)] = static_cast<std::int32_t>(e);
        result.twin_[at(h)] = twin;
        result.twin_[at(twin)] = h;
    }

    result.face_normals_.reserve(result.mesh_.triangles.size());
    for (const Triangle& t : result.mesh_.triangles) {
        const Vector3& a = result.mesh_.vertices[at(t[0])];
        const Vector3 normal = (result.mesh_.vertices[at(t[1])] - a).cross(result.mesh_.vertices[at(t[2])] - a);
        const double length = normal.norm();
        result.face_normals_.push_back(length > 0 ? Vector3(normal / length) : Vector3(Vector3::Zero()));
    }
    result.orderFans();
    return result;
}

// Counter-clockwise round a vertex, the half-edge after h is twin(previous(h)); the one before it is next(twin(h)).
// A fan at a rim starts at the half-edge without a twin.
void HalfEdgeMesh::orderFans() {
    const auto half_edges = static_cast<std::int32_t>(twin_.size());
    first_outgoing_.assign(mesh_.vertices.size() + 1, 0);
    for (std::int32_t h = 0; h < half_edges; ++h)
        ++first_outgoing_[at(origin(h)) + 1];
    for (std::size_t v = 1; v < first_outgoing_.size(); ++v)
        first_outgoing_[v] += first_outgoing_[v - 1];
    outgoing_.resize(twin_.size());
    std::vector<std::int32_t> fill(first_outgoing_.begin(), first_outgoing_.end() - 1);
    std::vector<bool> placed(twin_.size(), false);
    const auto placeFan = [&](std::int32_t start) {
        for (std::int32_t h = start; h >= 0 && !placed[at(h)]; h = twin(previous(h))) {
            outgoing_[at(fill[at(origin(h))]++)] = h;
            placed[at(h)] = true;
        }
    };
    for (std::int32_t h = 0; h < half_edges; ++h) {
        if (twin(h) < 0) placeFan(h);
    }
    for (std::int32_t h = 0; h < half_edges; ++h)
        placeFan(h);
}

std::span<const std::int32_t> HalfEdgeMesh::outgoing(std::int32_t vertex) const {
    const auto begin = at(first_outgoing_[at(vertex)]), end = at(first_outgoing_[at(vertex) + 1]);
    return std::span(outgoing_).subspan(begin, end - begin);
}

}  // namespace fluorocut
