#include "core/geometry/mesh_properties.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include <fmt/format.h>

#include "core/geometry/edge_groups.h"

namespace fluorocut {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kNoArea = 1e-12;  // of the longest edge squared: thinner than rounding lets one tell

std::size_t countComponents(const TriangleMesh& mesh) {
    std::vector<std::int32_t> parent(mesh.vertices.size());
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](std::int32_t v) {
        while (parent[static_cast<std::size_t>(v)] != v) {
            auto& up = parent[static_cast<std::size_t>(v)];
            up = parent[static_cast<std::size_t>(up)];
            v = up;
        }
        return v;
    };
    std::vector<bool> used(mesh.vertices.size(), false);
    for (const Triangle& t : mesh.triangles) {
        for (const std::int32_t v : t) {
            used[static_cast<std::size_t>(v)] = true;
            parent[static_cast<std::size_t>(root(v))] = root(t[0]);
        }
    }
    std::size_t components = 0;
    for (std::size_t v = 0; v < parent.size(); ++v)
        components += used[v] && parent[v] == static_cast<std::int32_t>(v);
    return components;
}

void countEdges(const TriangleMesh& mesh, MeshProperties& properties) {
    const EdgeGroups groups = groupEdges(mesh);
    properties.edges = groups.count();
    for (std::size_t e = 0; e < groups.count(); ++e) {
        int balance = 0;
        for (std::int32_t i = groups.first[e]; i < groups.first[e + 1]; ++i) {
            const std::int32_t h = groups.half_edges[static_cast<std::size_t>(i)];
            balance += halfEdgeOrigin(mesh, h) < halfEdgeOrigin(mesh, nextHalfEdge(h)) ? 1 : -1;
        }
        const std::int32_t faces = groups.first[e + 1] - groups.first[e];
        properties.open_edges += balance != 0;
        properties.boundary_edges += faces == 1;
        properties.flipped_edges += faces == 2 && balance != 0;
        properties.non_manifold_edges += faces > 2;
    }
}

void measure(const TriangleMesh& mesh, MeshProperties& properties) {
    const auto vertex = [&](std::int32_t v) -> const Vector3& { return mesh.vertices[static_cast<std::size_t>(v)]; };
    Vector3 low = Vector3::Constant(std::numeric_limits<double>::infinity()), high = -low;
    for (const Triangle& t : mesh.triangles) {
        for (const std::int32_t v : t) {
            low = low.cwiseMin(vertex(v));
            high = high.cwiseMax(vertex(v));
        }
    }
    const Vector3 middle = 0.5 * low + 0.5 * high;
    double area2 = 0, volume6 = 0;
    Vector3 moment24 = Vector3::Zero();
    for (const Triangle& t : mesh.triangles) {
        const Vector3 a = vertex(t[0]) - middle, b = vertex(t[1]) - middle, c = vertex(t[2]) - middle;
        const Vector3 normal = (b - a).cross(c - a);
        const double twice = normal.norm();
        const double longest2 = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
        properties.degenerate_triangles += !(twice > kNoArea * longest2);
        area2 += twice;
        const double tetrahedron6 = normal.dot(a);
        volume6 += tetrahedron6;
        moment24 += tetrahedron6 * (a + b + c);
    }
    properties.area_mm2 = area2 / 2;
    properties.volume_mm3 = volume6 / 6;
    properties.centroid = middle + moment24 / (4 * volume6);
    properties.min_corner = low;
    properties.max_corner = high;
}

}  // namespace

MeshProperties::MeshProperties()
    : area_mm2(kNaN),
      volume_mm3(kNaN),
      centroid(Vector3::Constant(kNaN)),
      min_corner(Vector3::Constant(kNaN)),
      max_corner(Vector3::Constant(kNaN)) {}

MeshProperties meshProperties(const TriangleMesh& mesh) {
    MeshProperties properties;
    properties.vertices = mesh.vertices.size();
    properties.triangles = mesh.triangles.size();
    const auto finite = [](const Vector3& v) { return v.allFinite(); };
    properties.bad_vertices = properties.vertices - static_cast<std::size_t>(std::count_if(
                                                        mesh.vertices.begin(), mesh.vertices.end(), finite));
    for (const Triangle& t : mesh.triangles) {
        properties.bad_triangles += !std::all_of(t.begin(), t.end(), [&](std::int32_t v) {
            return v >= 0 && static_cast<std::size_t>(v) < mesh.vertices.size();
        });
    }
    if (!properties.valid()) return properties;
    countEdges(mesh, properties);
    properties.components = countComponents(mesh);
    measure(mesh, properties);
    return properties;
}

Result<void> requireSolid(const MeshProperties& p, const std::string& where) {
    const std::string expected = "a closed surface whose triangles are counter-clockwise seen from outside";
    const std::string repair = "close and orient it in a mesh editor and export it again";
    if (p.triangles == 0) return invalidInput(where, "no triangles", expected, "check the export");
    if (p.bad_vertices > 0) {
        return invalidInput(where, fmt::format("{} of {} vertices that are not finite", p.bad_vertices, p.vertices),
                            "finite coordinates in mm", "export the mesh again");
    }
    if (p.bad_triangles > 0) {
        return invalidInput(where, fmt::format("{} triangles with a corner that is no vertex", p.bad_triangles),
                            fmt::format("corners from 0 to {}", p.vertices - 1), "export the mesh again");
    }
    if (p.open_edges > 0) {
        const std::size_t rims = p.boundary_edges, flips = p.flipped_edges;
        const std::string found = rims > 0    ? fmt::format("a hole: {} edges have one triangle only", rims)
                                  : flips > 0 ? fmt::format("neighbours turned opposite ways at {} edges", flips)
                                              : fmt::format("{} edges with an unpaired triangle", p.open_edges);
        return invalidInput(where, found, expected, repair);
    }
    if (!(p.volume_mm3 > 0)) {
        const bool flat = !(p.volume_mm3 < 0);
        return invalidInput(where,
                            flat ? "a surface that encloses no volume"
                                 : fmt::format("a surface turned inside out (volume {:.6g} mm^3)", p.volume_mm3),
                            expected, flat ? "check the export" : "flip its triangles");
    }
    return {};
}

}  // namespace fluorocut
