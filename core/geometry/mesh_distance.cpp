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

constexpr std::int32_t kLeafSize = 3;      // triangles in a leaf, at most
constexpr std::int32_t kMostInDisc = 512;  // of more, no disc is made: it would not be flat

// Four subtrees and what bounds each, side by side so that one instruction serves all four; in single precision and
// rounded so that distances come out too small rather than too large, from the tree's own origin.
//
// The disc, a flat cylinder round the triangles, says far more than the box where the surface slants: a box stands out
// of it by as much as it is wide. Its normal is a little shorter than 1, its sizes are a little too large.
struct Node {
    using Four = Eigen::Array4f;
    std::array<Four, 3> low, high, center, normal;
    Four radius, half_height;
    std::array<std::int32_t, 4> first;  // a leaf's first facet, or a node
    std::array<std::int32_t, 4> count;  // facets of a leaf; 0: a node; -1: nothing

    Node() {
        const float infinity = std::numeric_limits<float>::infinity();
        for (std::size_t axis = 0; axis < 3; ++axis) {
            low[axis].setConstant(infinity);
            high[axis].setConstant(-infinity);
            center[axis].setZero();
            normal[axis].setZero();
        }
        radius.setConstant(infinity);
        half_height.setConstant(infinity);
        first.fill(0);
        count.fill(-1);
    }

    Four distance2(const std::array<float, 3>& p) const {
        std::array<Four, 3> off;
        Four box = Four::Zero();
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const Four outside = (low[axis] - p[axis]).max(p[axis] - high[axis]).max(0.0F);
            box += outside * outside;
            off[axis] = p[axis] - center[axis];
        }
        const Four height = normal[0] * off[0] + normal[1] * off[1] + normal[2] * off[2];
        const Four above = (height.abs() - half_height).max(0.0F);
        Four beside = Four::Zero();
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
            const Four across = normal[u] * off[v] - normal[v] * off[u];
            beside += across * across;
        }
        beside = (beside.sqrt() - radius).max(0.0F);
        return box.max(above * above + beside * beside);
    }
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
    Vector3 origin = Vector3::Zero();
    double extent = 0;
    double touch_mm = 0;  // nearer than this is the same point
    std::vector<Node> nodes;
    std::vector<Facet> facets;
    std::vector<std::int32_t> place;  // of every triangle among the facets
    std::vector<std::int32_t> order;  // of the triangles, while the tree is built
    std::vector<Vector3> middles;

    const Vector3& corner(std::int32_t triangle, std::size_t c) const {
        return mesh.vertices[static_cast<std::size_t>(mesh.triangles[static_cast<std::size_t>(triangle)][c])];
    }

    void build();
    std::int32_t halve(std::int32_t begin, std::int32_t end);
    std::int32_t makeNode(std::int32_t begin, std::int32_t end);
    void bound(Node& node, Eigen::Index child, std::int32_t begin, std::int32_t end) const;

    // Calls visit(facet) for the facets of every leaf that may lie within `limit()`, near ones first.
    template <class Limit, class Visit>
    void search(const Vector3& p, Limit&& limit, Visit&& visit) const;
};

void MeshDistance::Tree::bound(Node& node, Eigen::Index child, std::int32_t begin, std::int32_t end) const {
    const float infinity = std::numeric_limits<float>::infinity();
    Vector3 low = Vector3::Constant(std::numeric_limits<double>::infinity()), high = -low, sum = Vector3::Zero();
    for (std::int32_t i = begin; i < end; ++i) {
        const std::int32_t t = order[static_cast<std::size_t>(i)];
        for (std::size_t c = 0; c < 3; ++c) {
            low = low.cwiseMin(corner(t, c) - origin);
            high = high.cwiseMax(corner(t, c) - origin);
        }
        sum += (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0));
    }
    const Eigen::Vector3f center = (0.5 * (low + high)).cast<float>();
    const Eigen::Vector3f normal = sum.norm() > 0 ? Eigen::Vector3f(((1 - 1e-6) * sum.normalized()).cast<float>())
                                                  : Eigen::Vector3f(0, 0, 1 - 1e-6F);
    for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        node.low[a][child] = std::nextafter(static_cast<float>(low[axis]), -infinity);
        node.high[a][child] = std::nextafter(static_cast<float>(high[axis]), infinity);
        node.center[a][child] = center[axis];
        node.normal[a][child] = normal[axis];
    }
    if (end - begin > kMostInDisc) return;
    const Vector3 c = center.cast<double>() + origin, n = normal.cast<double>();
    double height = 0, radius = 0;
    for (std::int32_t i = begin; i < end; ++i) {
        for (std::size_t v = 0; v < 3; ++v) {
            const Vector3 off = corner(order[static_cast<std::size_t>(i)], v) - c;
            height = std::max(height, std::abs(n.dot(off)));
            radius = std::max(radius, n.cross(off).norm());
        }
    }
    node.half_height[child] = static_cast<float>(1.00001 * height);
    node.radius[child] = static_cast<float>(1.00001 * radius);
}

// Sorts the range into a lower and an upper half along its longest axis; where the upper one begins.
std::int32_t MeshDistance::Tree::halve(std::int32_t begin, std::int32_t end) {
    Vector3 low = Vector3::Constant(std::numeric_limits<double>::infinity()), high = -low;
    for (std::int32_t i = begin; i < end; ++i) {
        const Vector3& middle = middles[static_cast<std::size_t>(order[static_cast<std::size_t>(i)])];
        low = low.cwiseMin(middle);
        high = high.cwiseMax(middle);
    }
    int axis = 0;
    (high - low).maxCoeff(&axis);
    const std::int32_t half = begin + (end - begin) / 2;
    std::nth_element(order.begin() + begin, order.begin() + half, order.begin() + end,
                     [&](std::int32_t a, std::int32_t b) {
                         return middles[static_cast<std::size_t>(a)][axis] < middles[static_cast<std::size_t>(b)][axis];
                     });
    return half;
}

std::int32_t MeshDistance::Tree::makeNode(std::int32_t begin, std::int32_t end) {
    const auto self = nodes.size();
    nodes.emplace_back();
    std::array<std::int32_t, 5> border{begin, begin, begin, begin, end};
    if (end - begin > kLeafSize) {
        border[2] = halve(begin, end);
        border[1] = border[2] - begin > kLeafSize ? halve(begin, border[2]) : begin;
        border[3] = end - border[2] > kLeafSize ? halve(border[2], end) : border[2];
    }
    for (std::size_t child = 0; child < 4; ++child) {
        const std::int32_t from = border[child], to = border[child + 1];
        if (from == to) continue;
        bound(nodes[self], static_cast<Eigen::Index>(child), from, to);
        const bool leaf = to - from <= kLeafSize;
        const std::int32_t first = leaf ? from : makeNode(from, to);  // may move the nodes
        nodes[self].first[child] = first;
        nodes[self].count[child] = leaf ? to - from : 0;
    }
    return static_cast<std::int32_t>(self);
}

void MeshDistance::Tree::build() {
    Vector3 low = Vector3::Constant(std::numeric_limits<double>::infinity()), high = -low;
    const auto count = static_cast<std::int32_t>(mesh.triangles.size());
    for (std::int32_t t = 0; t < count; ++t) {
        middles.push_back((corner(t, 0) + corner(t, 1) + corner(t, 2)) / 3);
        for (std::size_t c = 0; c < 3; ++c) {
            low = low.cwiseMin(corner(t, c));
            high = high.cwiseMax(corner(t, c));
        }
    }
    origin = 0.5 * (low + high);
    extent = (high - low).norm();
    touch_mm = 1e-9 * extent;
    order.resize(mesh.triangles.size());
    std::iota(order.begin(), order.end(), 0);
    makeNode(0, count);
    facets.reserve(order.size());
    place.resize(order.size());
    for (const std::int32_t t : order) {
        place[static_cast<std::size_t>(t)] = static_cast<std::int32_t>(facets.size());
        facets.push_back({corner(t, 0), corner(t, 1) - corner(t, 0), corner(t, 2) - corner(t, 0), t});
    }
    order = {};
    middles = {};
}

template <class Limit, class Visit>
void MeshDistance::Tree::search(const Vector3& p, Limit&& limit, Visit&& visit) const {
    struct Waiting {
        std::int32_t first, count;
        float distance2;
    };
    const Vector3 off = p - origin;
    const std::array<float, 3> at{static_cast<float>(off.x()), static_cast<float>(off.y()),
                                  static_cast<float>(off.z())};
    const double rounding = 2e-6 * (extent + off.norm());  // of distances in single precision, with room
    const auto farthest = [&] {
        const double within = limit() + rounding;
        return static_cast<float>(1.00001 * within * within);
    };
    float most2 = farthest();
    std::array<Waiting, 96> stack;  // quartering 2^31 triangles: 16 levels, three waiting at each
    std::size_t waiting = 0;
    stack[waiting++] = {0, 0, 0};
    while (waiting > 0) {
        const auto [first, count, distance2] = stack[--waiting];
        if (!(distance2 <= most2)) continue;
        if (count > 0) {
            for (std::int32_t i = 0; i < count; ++i)
                visit(facets[static_cast<std::size_t>(first + i)]);
            most2 = farthest();
            continue;
        }
        const Node& node = nodes[static_cast<std::size_t>(first)];
        const Node::Four distances2 = node.distance2(at);
        const std::size_t bottom = waiting;
        for (std::size_t child = 0; child < 4; ++child) {
            const float child2 = distances2[static_cast<Eigen::Index>(child)];
            if (node.count[child] < 0 || !(child2 <= most2)) continue;
            std::size_t slot = waiting++;  // the nearest on top
            for (; slot > bottom && stack[slot - 1].distance2 < child2; --slot)
                stack[slot] = stack[slot - 1];
            stack[slot] = {node.first[child], node.count[child], child2};
        }
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
    double best2 = most_mm * most_mm, best = most_mm;
    const auto visit = [&](const Facet& facet) {
        const Vector3 q = nearestOnFacet(facet, point);
        const double distance2 = (q - point).squaredNorm();
        if (!(distance2 <= best2)) return;
        if (distance2 == best2 && result.triangle >= 0) return;
        best2 = distance2;
        best = std::sqrt(distance2);
        result.point = q;
        result.triangle = facet.triangle;
    };
    if (guess >= 0) visit(tree_->facets[static_cast<std::size_t>(tree_->place[static_cast<std::size_t>(guess)])]);
    tree_->search(
        point, [&] { return best; }, visit);
    if (result.triangle >= 0) result.distance_mm = best;
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
            nearest.point, [&] { return eps; },
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
