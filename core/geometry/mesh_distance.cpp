#include "core/geometry/mesh_distance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace fluorocut {
namespace {

constexpr std::int32_t kLeafSize = 3;  // triangles in a leaf, at most

// Bounds in single precision, rounded outward: half the memory, and no point of a triangle lies outside.
struct Box {
    std::array<float, 3> low, high;

    double distance2(const Vector3& p) const {
        double sum = 0;
        for (int axis = 0; axis < 3; ++axis) {
            const auto a = static_cast<std::size_t>(axis);
            const double outside = std::max({low[a] - p[axis], p[axis] - high[a], 0.0});
            sum += outside * outside;
        }
        return sum;
    }
};

struct Node {
    Box box;
    std::int32_t first;  // a leaf's first triangle; otherwise the right child (the left one follows the node)
    std::int32_t count;  // triangles of a leaf; 0: no leaf
};

// A triangle by one corner and two edges, in the tree's order.
struct Facet {
    Vector3 a, ab, ac;
    std::int32_t triangle;
};

Vector3 nearestOnLine(const Vector3& p, const Vector3& a, const Vector3& ab) {
    const double length2 = ab.squaredNorm();
    return length2 > 0 ? Vector3(a + std::clamp(ab.dot(p - a) / length2, 0.0, 1.0) * ab) : a;
}

// A triangle without area is its edges.
Vector3 nearestOnEdges(const Facet& facet, const Vector3& p) {
    const std::array<Vector3, 3> candidates{nearestOnLine(p, facet.a, facet.ab), nearestOnLine(p, facet.a, facet.ac),
                                            nearestOnLine(p, facet.a + facet.ab, facet.ac - facet.ab)};
    return *std::min_element(candidates.begin(), candidates.end(), [&](const Vector3& q, const Vector3& r) {
        return (q - p).squaredNorm() < (r - p).squaredNorm();
    });
}

// Ericson, Real-Time Collision Detection (2005), 5.1.5.
Vector3 nearestOnFacet(const Facet& facet, const Vector3& p) {
    const Vector3 &ab = facet.ab, &ac = facet.ac;
    const Vector3 ap = p - facet.a;
    const double d1 = ab.dot(ap), d2 = ac.dot(ap);
    if (d1 <= 0 && d2 <= 0) return facet.a;
    const Vector3 bp = ap - ab;
    const double d3 = ab.dot(bp), d4 = ac.dot(bp);
    if (d3 >= 0 && d4 <= d3) return facet.a + ab;
    const Vector3 cp = ap - ac;
    const double d5 = ab.dot(cp), d6 = ac.dot(cp);
    if (d6 >= 0 && d5 <= d6) return facet.a + ac;
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 > d3) return facet.a + d1 / (d1 - d3) * ab;
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0 && d2 > d6) return facet.a + d2 / (d2 - d6) * ac;
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0 && (d4 - d3) + (d5 - d6) > 0) {
        return facet.a + ab + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (ac - ab);
    }
    const double area2 = va + vb + vc;  // squared, times four; rounding leaves 1e-16 of the edges' product
    if (!(area2 > 1e-12 * ab.squaredNorm() * ac.squaredNorm())) return nearestOnEdges(facet, p);
    return facet.a + vb / area2 * ab + vc / area2 * ac;
}

// The angle that the triangle fills round its point q: all round inside it, half at an edge, the corner's at a corner.
// 0 when q does not lie on it or the triangle is thinner than `eps`.
double angleAround(const Facet& facet, const Vector3& q, double eps) {
    const double eps2 = eps * eps;
    const std::array<Vector3, 3> corner{facet.a, facet.a + facet.ab, facet.a + facet.ac};
    const std::array<Vector3, 3> edge{facet.ab, facet.ac - facet.ab, -facet.ac};
    const double twice = facet.ab.cross(facet.ac).norm();
    const double longest = std::sqrt(std::max({edge[0].squaredNorm(), edge[1].squaredNorm(), edge[2].squaredNorm()}));
    if (!(twice > eps * longest)) return 0;
    if (!((nearestOnFacet(facet, q) - q).squaredNorm() <= eps2)) return 0;
    for (std::size_t i = 0; i < 3; ++i) {
        if ((q - corner[i]).squaredNorm() > eps2) continue;
        const Vector3 &out = edge[i], in = -edge[(i + 2) % 3];
        return std::atan2(out.cross(in).norm(), out.dot(in));
    }
    for (std::size_t i = 0; i < 3; ++i) {
        if ((nearestOnLine(q, corner[i], edge[i]) - q).squaredNorm() <= eps2) return std::numbers::pi;
    }
    return 2 * std::numbers::pi;
}

}  // namespace

struct MeshDistance::Tree {
    TriangleMesh mesh;
    std::vector<Node> nodes;
    std::vector<Facet> facets;
    std::vector<std::int32_t> place;  // of every triangle among the facets
    double touch_mm = 0;              // nearer than this is the same point

    void build();
    std::int32_t split(std::vector<std::int32_t>& order, const std::vector<Vector3>& middles, std::int32_t begin,
                       std::int32_t end);

    // Calls visit(facet) for the facets of every leaf whose box lies within `limit2()`, near ones first.
    template <class Limit, class Visit>
    void search(const Vector3& p, Limit&& limit2, Visit&& visit) const;
};

std::int32_t MeshDistance::Tree::split(std::vector<std::int32_t>& order, const std::vector<Vector3>& middles,
                                       std::int32_t begin, std::int32_t end) {
    Vector3 low = Vector3::Constant(std::numeric_limits<double>::infinity()), high = -low;
    Vector3 middle_low = low, middle_high = high;
    for (std::int32_t i = begin; i < end; ++i) {
        const auto t = static_cast<std::size_t>(order[static_cast<std::size_t>(i)]);
        for (const std::int32_t v : mesh.triangles[t]) {
            low = low.cwiseMin(mesh.vertices[static_cast<std::size_t>(v)]);
            high = high.cwiseMax(mesh.vertices[static_cast<std::size_t>(v)]);
        }
        middle_low = middle_low.cwiseMin(middles[t]);
        middle_high = middle_high.cwiseMax(middles[t]);
    }
    Node node{};
    for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        const float infinity = std::numeric_limits<float>::infinity();
        node.box.low[a] = std::nextafter(static_cast<float>(low[axis]), -infinity);
        node.box.high[a] = std::nextafter(static_cast<float>(high[axis]), infinity);
    }
    const auto self = nodes.size();
    nodes.push_back(node);
    if (end - begin <= kLeafSize) {
        nodes[self].first = begin;
        nodes[self].count = end - begin;
    } else {
        int axis = 0;
        (middle_high - middle_low).maxCoeff(&axis);
        const std::int32_t half = begin + (end - begin) / 2;
        std::nth_element(
            order.begin() + begin, order.begin() + half, order.begin() + end, [&](std::int32_t a, std::int32_t b) {
                return middles[static_cast<std::size_t>(a)][axis] < middles[static_cast<std::size_t>(b)][axis];
            });
        split(order, middles, begin, half);
        nodes[self].first = split(order, middles, half, end);
    }
    return static_cast<std::int32_t>(self);
}

void MeshDistance::Tree::build() {
    const auto vertex = [&](std::int32_t v) -> const Vector3& { return mesh.vertices[static_cast<std::size_t>(v)]; };
    std::vector<Vector3> middles;
    middles.reserve(mesh.triangles.size());
    for (const auto& [a, b, c] : mesh.triangles)
        middles.push_back((vertex(a) + vertex(b) + vertex(c)) / 3);
    std::vector<std::int32_t> order(mesh.triangles.size());
    std::iota(order.begin(), order.end(), 0);
    nodes.reserve(order.size());
    split(order, middles, 0, static_cast<std::int32_t>(order.size()));
    facets.reserve(order.size());
    place.resize(order.size());
    for (const std::int32_t t : order) {
        const auto& [a, b, c] = mesh.triangles[static_cast<std::size_t>(t)];
        place[static_cast<std::size_t>(t)] = static_cast<std::int32_t>(facets.size());
        facets.push_back({vertex(a), vertex(b) - vertex(a), vertex(c) - vertex(a), t});
    }
    double extent = 0;
    for (std::size_t a = 0; a < 3; ++a)
        extent = std::max<double>(extent, nodes[0].box.high[a] - nodes[0].box.low[a]);
    touch_mm = 1e-9 * extent;
}

template <class Limit, class Visit>
void MeshDistance::Tree::search(const Vector3& p, Limit&& limit2, Visit&& visit) const {
    struct Waiting {
        std::int32_t node;
        double distance2;
    };
    std::array<Waiting, 64> stack;  // halving: never deeper than 32
    std::size_t waiting = 0;
    stack[waiting++] = {0, nodes[0].box.distance2(p)};
    while (waiting > 0) {
        const auto [index, distance2] = stack[--waiting];
        if (!(distance2 <= limit2())) continue;
        const Node& node = nodes[static_cast<std::size_t>(index)];
        if (node.count > 0) {
            for (std::int32_t i = 0; i < node.count; ++i)
                visit(facets[static_cast<std::size_t>(node.first + i)]);
            continue;
        }
        Waiting near{index + 1, nodes[static_cast<std::size_t>(index) + 1].box.distance2(p)};
        Waiting far{node.first, nodes[static_cast<std::size_t>(node.first)].box.distance2(p)};
        if (far.distance2 < near.distance2) std::swap(near, far);
        if (far.distance2 <= limit2()) stack[waiting++] = far;
        if (near.distance2 <= limit2()) stack[waiting++] = near;
    }
}

Result<MeshDistance> MeshDistance::build(TriangleMesh mesh, const std::string& where) {
    if (mesh.triangles.empty()) {
        return invalidInput(where, "no triangles", "a surface to measure distances to", "check the export");
    }
    for (const Triangle& t : mesh.triangles) {
        for (const std::int32_t v : t) {
            if (v < 0 || static_cast<std::size_t>(v) >= mesh.vertices.size()) {
                return invalidInput(where, fmt::format("a triangle with the corner {}", v),
                                    fmt::format("corners from 0 to {}", mesh.vertices.size() - 1),
                                    "export the mesh again");
            }
            if (!mesh.vertices[static_cast<std::size_t>(v)].allFinite()) {
                return invalidInput(where, fmt::format("vertex {} that is not finite", v), "finite coordinates in mm",
                                    "export the mesh again");
            }
        }
    }
    auto tree = std::make_shared<Tree>();
    tree->mesh = std::move(mesh);
    tree->build();
    return MeshDistance(std::move(tree));
}

NearestPoint MeshDistance::nearest(const Vector3& point, double most_mm, std::int32_t guess) const {
    NearestPoint result;
    double best2 = most_mm * most_mm;
    const auto visit = [&](const Facet& facet) {
        const Vector3 q = nearestOnFacet(facet, point);
        const double distance2 = (q - point).squaredNorm();
        if (!(distance2 <= best2)) return;
        if (distance2 == best2 && result.triangle >= 0) return;
        best2 = distance2;
        result.point = q;
        result.triangle = facet.triangle;
    };
    if (guess >= 0) visit(tree_->facets[static_cast<std::size_t>(tree_->place[static_cast<std::size_t>(guess)])]);
    tree_->search(
        point, [&] { return best2; }, visit);
    if (result.triangle >= 0) result.distance_mm = std::sqrt(best2);
    return result;
}

double MeshDistance::signedDistance(const Vector3& point) const {
    const NearestPoint nearest = this->nearest(point);
    const auto& facets = tree_->facets;
    const auto normal = [](const Facet& facet) -> Vector3 { return facet.ab.cross(facet.ac).normalized(); };
    const Facet& hit = facets[static_cast<std::size_t>(
        tree_->place[static_cast<std::size_t>(std::max(nearest.triangle, std::int32_t{0}))])];
    Vector3 outward = normal(hit);
    const double eps = tree_->touch_mm;
    if (angleAround(hit, nearest.point, eps) < 2 * std::numbers::pi) {  // not in the middle of its triangle
        Vector3 sum = Vector3::Zero();
        tree_->search(
            nearest.point, [&] { return eps * eps; },
            [&](const Facet& facet) {
                const double angle = angleAround(facet, nearest.point, eps);
                if (angle > 0) sum += angle * normal(facet);
            });
        outward = sum;
    }
    return outward.dot(point - nearest.point) < 0 ? -nearest.distance_mm : nearest.distance_mm;
}

const TriangleMesh& MeshDistance::mesh() const {
    return tree_->mesh;
}

}  // namespace fluorocut
