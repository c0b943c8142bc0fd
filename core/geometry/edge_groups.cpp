#include "core/geometry/edge_groups.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

namespace fluorocut {

EdgeGroups groupEdges(const TriangleMesh& mesh) {
    if (mesh.triangles.size() > std::numeric_limits<std::int32_t>::max() / 3) {
        throw std::logic_error("groupEdges: more half-edges than 32 bits can number");
    }
    const auto half_edges = static_cast<std::int32_t>(3 * mesh.triangles.size());
    const auto low = [&](std::int32_t h) {
        return std::min(halfEdgeOrigin(mesh, h), halfEdgeOrigin(mesh, nextHalfEdge(h)));
    };
    const auto high = [&](std::int32_t h) {
        return std::max(halfEdgeOrigin(mesh, h), halfEdgeOrigin(mesh, nextHalfEdge(h)));
    };

    std::vector<std::int32_t> bucket(mesh.vertices.size() + 1, 0);
    for (std::int32_t h = 0; h < half_edges; ++h) {
        if (low(h) != high(h)) ++bucket[static_cast<std::size_t>(low(h)) + 1];
    }
    for (std::size_t v = 1; v < bucket.size(); ++v)
        bucket[v] += bucket[v - 1];
    struct Entry {
        std::int32_t high, half_edge;
        bool operator<(const Entry& other) const {
            return high != other.high ? high < other.high : half_edge < other.half_edge;
        }
    };
    std::vector<Entry> entries(static_cast<std::size_t>(bucket.back()));
    std::vector<std::int32_t> fill(bucket.begin(), bucket.end() - 1);
    for (std::int32_t h = 0; h < half_edges; ++h) {
        const std::int32_t v = low(h), w = high(h);
        if (v != w) entries[static_cast<std::size_t>(fill[static_cast<std::size_t>(v)]++)] = {w, h};
    }

    EdgeGroups groups;
    groups.half_edges.reserve(entries.size());
    groups.first.reserve(entries.size() / 2 + 1);
    for (std::size_t v = 0; v + 1 < bucket.size(); ++v) {
        const auto begin = entries.begin() + bucket[v], end = entries.begin() + bucket[v + 1];
        std::sort(begin, end);
        for (auto it = begin; it != end; ++it) {
            if (it == begin || it->high != (it - 1)->high) {
                groups.first.push_back(static_cast<std::int32_t>(groups.half_edges.size()));
            }
            groups.half_edges.push_back(it->half_edge);
        }
    }
    groups.first.push_back(static_cast<std::int32_t>(groups.half_edges.size()));
    return groups;
}

}  // namespace fluorocut
