#include "core/geometry/mesh_tools.h"

#include <bit>
#include <cmath>
#include <stdexcept>
#include <unordered_map>
#include <utility>

namespace fluorocut {
namespace {

// Cells of the welding grid: equal coordinates share a cell, and with a tolerance anything nearer than it lies in the
// same cell or a neighbour. Doubles hold the cell numbers, so that far-away vertices overflow nothing.
using Cell = std::array<double, 3>;

struct CellHash {
    std::size_t operator()(const Cell& cell) const {
        std::uint64_t hash = 0;
        for (const double c : cell)  // + 0.0 makes one zero of both
            hash = (hash ^ std::bit_cast<std::uint64_t>(c + 0.0)) * 0x9e3779b97f4a7c15u, hash ^= hash >> 29;
        return static_cast<std::size_t>(hash);
    }
};

}  // namespace

TriangleMesh transformed(TriangleMesh mesh, const Rigid3& target_from_source) {
    for (Vector3& v : mesh.vertices)
        v = target_from_source * v;
    return mesh;
}

TriangleMesh flipped(TriangleMesh mesh) {
    for (Triangle& t : mesh.triangles)
        std::swap(t[1], t[2]);
    return mesh;
}

TriangleMesh merged(TriangleMesh a, const TriangleMesh& b) {
    const auto shift = static_cast<std::int32_t>(a.vertices.size());
    a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
    for (const Triangle& t : b.triangles)
        a.triangles.push_back({t[0] + shift, t[1] + shift, t[2] + shift});
    return a;
}

TriangleMesh weldVertices(const TriangleMesh& mesh, double tolerance_mm) {
    if (!(tolerance_mm >= 0)) throw std::logic_error("weldVertices: the tolerance is negative");
    const int reach = tolerance_mm > 0 ? 1 : 0;  // neighbouring cells to look into
    const auto cellOf = [&](const Vector3& v) -> Cell {
        if (reach == 0) return {v.x(), v.y(), v.z()};
        return {std::floor(v.x() / tolerance_mm), std::floor(v.y() / tolerance_mm), std::floor(v.z() / tolerance_mm)};
    };
    TriangleMesh welded;
    std::unordered_multimap<Cell, std::int32_t, CellHash> kept;
    kept.reserve(mesh.vertices.size());
    const auto find = [&](const Vector3& v) -> std::int32_t {
        const Cell cell = cellOf(v);
        std::int32_t best = -1;
        for (int n = 0; n < (reach ? 27 : 1); ++n) {
            const Cell near{cell[0] + reach * (n % 3 - 1), cell[1] + reach * (n / 3 % 3 - 1),
                            cell[2] + reach * (n / 9 - 1)};
            const auto [begin, end] = kept.equal_range(near);
            for (auto it = begin; it != end; ++it) {
                const bool same = (welded.vertices[static_cast<std::size_t>(it->second)] - v).norm() <= tolerance_mm;
                if (same && (best < 0 || it->second < best)) best = it->second;
            }
        }
        return best;
    };
    std::vector<std::int32_t> number(mesh.vertices.size(), -1);
    for (const Triangle& t : mesh.triangles) {
        Triangle corners{};
        for (std::size_t i = 0; i < 3; ++i) {
            auto& known = number.at(static_cast<std::size_t>(t[i]));
            if (known < 0) {
                const Vector3& v = mesh.vertices[static_cast<std::size_t>(t[i])];
                if (!v.allFinite()) throw std::logic_error("weldVertices: a vertex is not finite");
                known = find(v);
                if (known < 0) {
                    known = static_cast<std::int32_t>(welded.vertices.size());
                    welded.vertices.push_back(v);
                    kept.emplace(cellOf(v), known);
                }
            }
            corners[i] = known;
        }
        if (corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0]) {
            welded.triangles.push_back(corners);
        }
    }
    return welded;
}

}  // namespace fluorocut
