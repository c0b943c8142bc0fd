#include "core/geometry/mesh_section.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "core/geometry/polygon.h"

namespace fluorocut {
namespace {

std::size_t at(std::int32_t i) {
    return static_cast<std::size_t>(i);
}

constexpr double kOnPlane = 1e-12;  // of the mesh's size: a vertex this near lies on the plane, or caps get slivers

std::vector<double> heights(const HalfEdgeMesh& mesh, const Plane& plane) {
    if (!mesh.closed()) throw std::logic_error("mesh_section: the mesh is not closed");
    if (!(plane.normal.norm() > 0)) throw std::logic_error("mesh_section: a plane without normal");
    std::vector<double> result;
    result.reserve(mesh.mesh().vertices.size());
    double size = 0;
    for (const Vector3& v : mesh.mesh().vertices) {
        result.push_back(plane.above(v));
        size = std::max(size, (v - plane.point).cwiseAbs().maxCoeff());
    }
    const double least = kOnPlane * size * plane.normal.norm();
    for (double& height : result)
        if (std::abs(height) <= least) height = 0;
    return result;
}

// Where the plane meets the edge between vertices a and b, the same from either side.
Vector3 meeting(const std::vector<Vector3>& vertices, const std::vector<double>& height, std::int32_t a,
                std::int32_t b) {
    if (a > b) std::swap(a, b);
    const double t = height[at(a)] / (height[at(a)] - height[at(b)]);
    return (1 - t) * vertices[at(a)] + t * vertices[at(b)];
}

double signedArea(const std::vector<Vector2>& points, const std::vector<std::int32_t>& ring) {
    double twice = 0;
    for (std::size_t i = 0; i < ring.size(); ++i) {
        const Vector2 &a = points[at(ring[i])], &b = points[at(ring[(i + 1) % ring.size()])];
        twice += a.x() * b.y() - a.y() * b.x();
    }
    return 0.5 * twice;
}

bool inside(const Vector2& p, const std::vector<Vector2>& points, const std::vector<std::int32_t>& ring) {
    bool odd = false;
    for (std::size_t i = 0; i < ring.size(); ++i) {
        const Vector2 &a = points[at(ring[i])], &b = points[at(ring[(i + 1) % ring.size()])];
        if ((a.y() <= p.y()) == (b.y() <= p.y())) continue;
        odd ^= a.x() + (p.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x()) > p.x();
    }
    return odd;
}

// The edges of a mesh that only one triangle has, joined to closed rings against their direction: as the triangles that
// will close the mesh run along them.
std::vector<std::vector<std::int32_t>> rims(const TriangleMesh& mesh) {
    const EdgeGroups groups = groupEdges(mesh);
    std::vector<std::pair<std::int32_t, std::int32_t>> next;  // from tip to origin, sorted by tip
    for (std::size_t e = 0; e < groups.count(); ++e) {
        if (groups.first[e + 1] - groups.first[e] != 1) continue;
        const std::int32_t h = groups.half_edges[at(groups.first[e])];
        next.emplace_back(halfEdgeOrigin(mesh, nextHalfEdge(h)), halfEdgeOrigin(mesh, h));
    }
    std::sort(next.begin(), next.end());
    std::vector<bool> used(next.size(), false);
    std::vector<std::vector<std::int32_t>> rings;
    for (std::size_t start = 0; start < next.size(); ++start) {
        if (used[start]) continue;
        rings.emplace_back();
        for (std::size_t i = start; !used[i];) {
            used[i] = true;
            rings.back().push_back(next[i].first);
            const auto from = std::lower_bound(next.begin(), next.end(), std::pair(next[i].second, std::int32_t{0}));
            i = static_cast<std::size_t>(from - next.begin());
            while (used[i] && i + 1 < next.size() && next[i + 1].first == next[i].first)
                ++i;  // rings that touch in a vertex
        }
    }
    return rings;
}

}  // namespace

// Across a triangle the polygon runs from the half-edge that goes down through the plane to the one that goes up.
std::vector<std::vector<Vector3>> sectionPolygons(const HalfEdgeMesh& mesh, const Plane& plane) {
    const std::vector<double> height = heights(mesh, plane);
    const auto above = [&](std::int32_t vertex) { return height[at(vertex)] > 0; };
    const auto goesDown = [&](std::int32_t h) { return above(mesh.origin(h)) && !above(mesh.tip(h)); };
    const auto half_edges = static_cast<std::int32_t>(3 * mesh.mesh().triangles.size());
    std::vector<bool> used(at(half_edges), false);
    std::vector<std::vector<Vector3>> polygons;
    for (std::int32_t start = 0; start < half_edges; ++start) {
        if (used[at(start)] || !goesDown(start)) continue;
        std::vector<Vector3> polygon;
        std::int32_t h = start;
        do {
            used[at(h)] = true;
            const Vector3 corner = meeting(mesh.mesh().vertices, height, mesh.origin(h), mesh.tip(h));
            if (polygon.empty() || polygon.back() != corner) polygon.push_back(corner);
            std::int32_t up = HalfEdgeMesh::next(h);
            if (above(mesh.origin(up)) || !above(mesh.tip(up))) up = HalfEdgeMesh::next(up);
            h = mesh.twin(up);
        } while (h != start);
        while (polygon.size() > 1 && polygon.back() == polygon.front())
            polygon.pop_back();
        if (polygon.size() > 2) polygons.push_back(std::move(polygon));
    }
    return polygons;
}

Result<TriangleMesh> partBelow(const HalfEdgeMesh& mesh, const Plane& plane) {
    const std::vector<double> height = heights(mesh, plane);
    const std::vector<Vector3>& vertices = mesh.mesh().vertices;
    TriangleMesh part;
    std::vector<std::int32_t> kept(vertices.size(), -1), met(mesh.edges().size(), -1);
    const auto add = [&](std::int32_t& index, const Vector3& v) {
        if (index < 0) {
            index = static_cast<std::int32_t>(part.vertices.size());
            part.vertices.push_back(v);
        }
        return index;
    };
    for (std::int32_t f = 0; f < static_cast<std::int32_t>(mesh.mesh().triangles.size()); ++f) {
        const Triangle& t = mesh.mesh().triangles[at(f)];
        if (height[at(t[0])] == 0 && height[at(t[1])] == 0 && height[at(t[2])] == 0) continue;  // the cap's business
        std::vector<std::int32_t> corners;
        const auto push = [&](std::int32_t index) {
            if (corners.empty() || (corners.back() != index && corners.front() != index)) corners.push_back(index);
        };
        for (std::int32_t c = 0; c < 3; ++c) {
            const std::int32_t h = 3 * f + c, from = mesh.origin(h), to = mesh.tip(h);
            const bool from_below = !(height[at(from)] > 0), to_below = !(height[at(to)] > 0);
            if (from_below) push(add(kept[at(from)], vertices[at(from)]));
            if (from_below == to_below) continue;
            const std::int32_t low = from_below ? from : to;
            if (height[at(low)] == 0) {
                push(add(kept[at(low)], vertices[at(low)]));
            } else {
                push(add(met[at(mesh.edge(h))], meeting(vertices, height, from, to)));
            }
        }
        for (std::size_t i = 2; i < corners.size(); ++i)
            part.triangles.push_back({corners[0], corners[i - 1], corners[i]});
    }
    if (part.triangles.empty())
        return invalidInput("part of a mesh below a plane", "nothing", "a plane that the mesh reaches below");

    const Vector3 normal = plane.normal.normalized(), u = normal.unitOrthogonal(), v = normal.cross(u);
    std::vector<Vector2> flat;
    flat.reserve(part.vertices.size());
    for (const Vector3& p : part.vertices)
        flat.emplace_back(u.dot(p - plane.point), v.dot(p - plane.point));
    std::vector<std::vector<std::int32_t>> outlines, holes;
    for (std::vector<std::int32_t>& ring : rims(part))
        (signedArea(flat, ring) > 0 ? outlines : holes).push_back(std::move(ring));
    std::vector<std::vector<std::vector<std::int32_t>>> holes_of(outlines.size());
    for (std::vector<std::int32_t>& hole : holes) {
        std::size_t owner = outlines.size();
        for (std::size_t o = 0; o < outlines.size(); ++o) {
            if (!inside(flat[at(hole[0])], flat, outlines[o])) continue;
            if (owner == outlines.size() || signedArea(flat, outlines[o]) < signedArea(flat, outlines[owner]))
                owner = o;
        }
        if (owner < outlines.size()) holes_of[owner].push_back(std::move(hole));
    }
    for (std::size_t o = 0; o < outlines.size(); ++o) {
        const auto cap = triangulate(flat, outlines[o], holes_of[o]);
        if (!cap) return cap.error();
        part.triangles.insert(part.triangles.end(), cap->begin(), cap->end());
    }
    return part;
}

}  // namespace fluorocut
