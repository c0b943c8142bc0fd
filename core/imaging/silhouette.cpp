#include "core/imaging/silhouette.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/geometry/mesh_properties.h"

namespace fluorocut {
namespace {

constexpr double kGrazing = 1e-9;  // rad

std::size_t at(std::int32_t i) {
    return static_cast<std::size_t>(i);
}

double cross(const Vector2& a, const Vector2& b) {
    return a.x() * b.y() - a.y() * b.x();
}

// One edge of a contour in ideal pixels, and where others cross it.
struct Segment {
    Vector2 from, to;
    double z_from, z_to;
    std::int32_t half_edge;  // on the facing side
    std::int32_t next;       // the segment that goes on where this one ends
    struct Crossing {
        double t;
        Vector2 pixel;
    };
    std::vector<Crossing> crossings = {};
};

// The segments, sorted into strips across the axis along which the contours are longest.
class Strips {
  public:
    explicit Strips(const std::vector<Segment>& segments) : segments_(segments) {
        Vector2 low = Vector2::Constant(std::numeric_limits<double>::infinity()), high = -low;
        for (const Segment& s : segments) {
            low = low.cwiseMin(s.from);
            high = high.cwiseMax(s.from);
        }
        major_ = high.x() - low.x() > high.y() - low.y() ? 0 : 1;
        count_ = std::clamp<int>(static_cast<int>(segments.size()), 1, 4096);
        low_ = low[major_];
        per_strip_ = count_ / std::max(high[major_] - low_, 1e-9);
        first_.assign(static_cast<std::size_t>(count_) + 1, 0);
        const auto visit = [&](auto&& use) {
            for (std::size_t i = 0; i < segments.size(); ++i) {
                const auto [a, b] = std::minmax({strip(segments[i].from[major_]), strip(segments[i].to[major_])});
                for (int s = a; s <= b; ++s)
                    use(static_cast<std::size_t>(s), i);
            }
        };
        visit([&](std::size_t s, std::size_t) { ++first_[s + 1]; });
        for (std::size_t s = 1; s < first_.size(); ++s)
            first_[s] += first_[s - 1];
        members_.resize(first_.back());
        std::vector<std::size_t> fill(first_.begin(), first_.end() - 1);
        visit([&](std::size_t s, std::size_t i) { members_[fill[s]++] = static_cast<std::int32_t>(i); });
    }

    // Calls use(i, j, crossing pixel) once for every two segments that cross inside.
    template <class Use>
    void visitCrossings(Use&& use) const {
        for (int s = 0; s < count_; ++s) {
            const auto members = in(s);
            for (std::size_t m = 0; m < members.size(); ++m) {
                const Segment& a = segments_[at(members[m])];
                const Vector2 along = a.to - a.from;
                const Vector2 a_low = a.from.cwiseMin(a.to), a_high = a.from.cwiseMax(a.to);
                for (std::size_t n = m + 1; n < members.size(); ++n) {
                    const Segment& b = segments_[at(members[n])];
                    if (std::max(b.from.x(), b.to.x()) < a_low.x() || std::min(b.from.x(), b.to.x()) > a_high.x() ||
                        std::max(b.from.y(), b.to.y()) < a_low.y() || std::min(b.from.y(), b.to.y()) > a_high.y())
                        continue;
                    const double b_from = cross(along, b.from - a.from), b_to = cross(along, b.to - a.from);
                    if (!(b_from * b_to < 0)) continue;
                    const Vector2 other = b.to - b.from;
                    if (!(cross(other, a.from - b.from) * cross(other, a.to - b.from) < 0)) continue;
                    const Vector2 pixel = b.from + b_from / (b_from - b_to) * other;
                    if (strip(pixel[major_]) == s) use(members[m], members[n], pixel);
                }
            }
        }
    }

    // How many layers of the solid's front lie just outside segment `own`, at a place on it: the winding number there.
    int layersOutside(std::int32_t own, const Vector2& place) const {
        // The ray runs toward larger coordinates along the minor axis. It leaves a layer where it passes a segment
        // whose outer side, (-dv, du), looks along the ray.
        const int minor = 1 - major_;
        const double outward = major_ == 1 ? -1 : 1;
        int layers = 0;
        for (const std::int32_t i : in(strip(place[major_]))) {
            if (i == own) continue;
            const Segment& s = segments_[at(i)];
            const double from = s.from[major_], to = s.to[major_];
            if ((from <= place[major_]) == (to <= place[major_])) continue;
            const double meets = s.from[minor] + (place[major_] - from) / (to - from) * (s.to[minor] - s.from[minor]);
            if (meets > place[minor]) layers += outward * (to - from) > 0 ? 1 : -1;
        }
        // The segment itself: the ray starts on its outer side. If it runs along the ray, the count above is that of a
        // place a little up the major axis.
        const Segment& s = segments_[at(own)];
        const double rise = s.to[major_] - s.from[major_];
        const double outer_along_major = -outward * (s.to[minor] - s.from[minor]);
        const bool counted_from_inside = rise != 0 ? outward * rise < 0 : outer_along_major < 0;
        return layers - (counted_from_inside ? 1 : 0);
    }

  private:
    int strip(double major) const {
        return static_cast<int>(std::clamp<double>((major - low_) * per_strip_, 0, count_ - 1));
    }
    std::span<const std::int32_t> in(int s) const {
        const auto begin = first_[static_cast<std::size_t>(s)], end = first_[static_cast<std::size_t>(s) + 1];
        return std::span(members_).subspan(begin, end - begin);
    }

    const std::vector<Segment>& segments_;
    int major_ = 0, count_ = 1;
    double low_ = 0, per_strip_ = 0;
    std::vector<std::size_t> first_;
    std::vector<std::int32_t> members_;
};

}  // namespace

Result<void> SilhouetteOptions::validate() const {
    return requireRange("fold_mm", fold_mm, 0, 100, "mm");
}

struct Silhouette::Prepared {
    HalfEdgeMesh mesh;
    Vector3 low, high;
    // Planes of the facets: n . x = offset, x from the middle of the mesh.
    Vector3 middle;
    std::vector<double> nx, ny, nz, offset;
    std::vector<std::array<std::int32_t, 2>> edge_faces;
    std::vector<std::int32_t> edge_half_edge;  // of its first face
    double radius = 0;

    explicit Prepared(HalfEdgeMesh half_edges, const MeshProperties& properties)
        : mesh(std::move(half_edges)),
          low(properties.min_corner),
          high(properties.max_corner),
          middle(0.5 * (low + high)),
          radius(0.5 * (high - low).norm()) {
        const std::vector<Vector3>& vertices = mesh.mesh().vertices;
        const std::vector<Triangle>& triangles = mesh.mesh().triangles;
        for (std::size_t f = 0; f < triangles.size(); ++f) {
            const Vector3& n = mesh.faceNormals()[f];
            nx.push_back(n.x());
            ny.push_back(n.y());
            nz.push_back(n.z());
            offset.push_back(n.dot(vertices[at(triangles[f][0])] - middle));
        }
        edge_faces.reserve(mesh.edges().size());
        for (const HalfEdgeMesh::Edge& edge : mesh.edges())
            edge_faces.push_back({edge.f0, edge.f1});
        edge_half_edge.resize(mesh.edges().size());
        for (std::int32_t h = 0; h < static_cast<std::int32_t>(3 * triangles.size()); ++h) {
            if (edge_faces[at(mesh.edge(h))][0] == HalfEdgeMesh::face(h)) edge_half_edge[at(mesh.edge(h))] = h;
        }
    }

    std::vector<std::uint8_t> facing(const Vector3& source) const {
        const Vector3 s = source - middle;
        const double least = kGrazing * (s.norm() + radius);
        std::vector<std::uint8_t> result(offset.size());
        for (std::size_t f = 0; f < result.size(); ++f)
            result[f] = nx[f] * s.x() + ny[f] * s.y() + nz[f] * s.z() - offset[f] > least;
        return result;
    }

    bool inFrontOfSource(const Rigid3& imager_from_mesh) const {
        const Vector3 axis = imager_from_mesh.rotation().conjugate() * Vector3::UnitZ();
        const double depth = imager_from_mesh.translation().z();
        if (depth + axis.dot(middle) - axis.cwiseAbs().dot(0.5 * (high - low)) > 0) return true;
        return std::all_of(mesh.mesh().vertices.begin(), mesh.mesh().vertices.end(),
                           [&](const Vector3& v) { return depth + axis.dot(v) > 0; });
    }

    // Half-edges of the facing side, loop after loop: `next` of the last one is the first.
    std::vector<Segment> segments(const CArm& ideal, const Rigid3& imager_from_mesh,
                                  const std::vector<std::uint8_t>& facing) const {
        std::vector<Segment> result;
        std::vector<std::uint8_t> taken(edge_faces.size(), 0);
        for (std::size_t e = 0; e < edge_faces.size(); ++e) {
            const auto [f0, f1] = edge_faces[e];
            if (facing[at(f0)] == facing[at(f1)] || taken[e]) continue;
            const std::int32_t start = facing[at(f0)] ? edge_half_edge[e] : mesh.twin(edge_half_edge[e]);
            const auto first = static_cast<std::int32_t>(result.size());
            std::int32_t h = start;
            do {
                const Vector3 p = imager_from_mesh * mesh.mesh().vertices[at(mesh.origin(h))];
                const auto index = static_cast<std::int32_t>(result.size());
                result.push_back({ideal.projectIdeal(p), {}, p.z(), 0, h, index + 1});
                taken[at(mesh.edge(h))] = 1;
                h = HalfEdgeMesh::next(h);
                while (facing[at(HalfEdgeMesh::face(mesh.twin(h)))])
                    h = HalfEdgeMesh::next(mesh.twin(h));
            } while (h != start);
            result.back().next = first;
        }
        for (Segment& s : result) {
            s.to = result[at(s.next)].from;
            s.z_to = result[at(s.next)].z_from;
        }
        return result;
    }
};

namespace {

// Places at which the image is asked what lies in front of them.
struct Query {
    Vector2 place;  // ideal pixels
    double z;
    std::int32_t half_edge;
    ContourPoint* point;
};

// Marks the queries that a facing facet hides: the facets near a query are found through a grid of cells that holds
// only cells with queries.
void markHidden(const HalfEdgeMesh& mesh, const std::vector<std::uint8_t>& facing, const CArm& carm,
                const Rigid3& imager_from_mesh, double fold_mm, std::vector<Query>& queries) {
    if (queries.empty()) return;
    Vector2 low = queries[0].place, high = low;
    for (const Query& q : queries) {
        low = low.cwiseMin(q.place);
        high = high.cwiseMax(q.place);
    }
    constexpr int kCells = 128;  // along each axis
    const Vector2 per_cell = (high - low).cwiseMax(1e-6).cwiseInverse() * kCells;
    const auto cell = [&](const Vector2& p, int axis) {
        return static_cast<int>(std::clamp<double>((p[axis] - low[axis]) * per_cell[axis], 0, kCells - 1));
    };
    std::vector<std::vector<Query*>> cells(kCells * kCells);
    for (Query& q : queries)
        cells[static_cast<std::size_t>(cell(q.place, 1) * kCells + cell(q.place, 0))].push_back(&q);

    const std::vector<Vector3>& vertices = mesh.mesh().vertices;
    std::vector<Vector3> seen(vertices.size());  // ideal pixel and depth
    const Matrix3 rotation = imager_from_mesh.rotationMatrix();
    const Vector2 scale = carm.focal_length_mm * carm.pixel_mm.cwiseInverse();
    for (std::size_t v = 0; v < vertices.size(); ++v) {
        const Vector3 p = rotation * vertices[v] + imager_from_mesh.translation();
        seen[v] << (scale.cwiseProduct(p.head<2>()) / p.z() + carm.principal_point_px), p.z();
    }
    for (std::size_t f = 0; f < facing.size(); ++f) {
        if (!facing[f]) continue;
        const Triangle& t = mesh.mesh().triangles[f];
        const Vector3 &a = seen[at(t[0])], &b = seen[at(t[1])], &c = seen[at(t[2])];
        const Vector2 box_low = a.cwiseMin(b).cwiseMin(c).head<2>(), box_high = a.cwiseMax(b).cwiseMax(c).head<2>();
        if ((box_high.array() < low.array()).any() || (box_low.array() > high.array()).any()) continue;
        const double z_low = std::min({a.z(), b.z(), c.z()});
        for (int y = cell(box_low, 1), y_end = cell(box_high, 1); y <= y_end; ++y) {
            for (int x = cell(box_low, 0), x_end = cell(box_high, 0); x <= x_end; ++x) {
                for (Query* q : cells[static_cast<std::size_t>(y * kCells + x)]) {
                    const double front_of = q->z * (1 - 1e-9) - fold_mm;
                    if (q->point->hidden || z_low > front_of || at(HalfEdgeMesh::face(q->half_edge)) == f) continue;
                    // Facing facets run clockwise in pixels (rows run down): all three areas are negative inside.
                    const Vector2 pa = a.head<2>() - q->place, pb = b.head<2>() - q->place, pc = c.head<2>() - q->place;
                    const double wa = cross(pb, pc), wb = cross(pc, pa), wc = cross(pa, pb), sum = wa + wb + wc;
                    if (wa > 0 || wb > 0 || wc > 0 || !(sum < 0)) continue;
                    // 1 / z is linear in the image.
                    const double z = sum / (wa / a.z() + wb / b.z() + wc / c.z());
                    if (z < front_of) q->point->hidden = true;
                }
            }
        }
    }
}

}  // namespace

Result<Silhouette> Silhouette::prepare(TriangleMesh mesh, const std::string& where) {
    const MeshProperties properties = meshProperties(mesh);
    if (Result<void> solid = requireSolid(properties, where); !solid) return solid.error();
    Result<HalfEdgeMesh> half_edges = HalfEdgeMesh::build(std::move(mesh), where);
    if (!half_edges) return half_edges.error();
    return Silhouette(std::make_shared<const Prepared>(std::move(*half_edges), properties));
}

const TriangleMesh& Silhouette::mesh() const {
    return prepared_->mesh.mesh();
}

Result<std::vector<ContourLoop>> Silhouette::project(const CArm& carm, const Rigid3& imager_from_mesh,
                                                     const SilhouetteOptions& options) const {
    if (Result<void> valid = carm.validate(); !valid)
        throw std::logic_error("Silhouette::project: " + valid.error().message());
    if (Result<void> valid = options.validate(); !valid) return valid.error();
    if (!prepared_->inFrontOfSource(imager_from_mesh))
        return invalidInput("pose of the mesh", "parts of it beside or behind the X-ray source",
                            "all of it between source and detector", "check the pose imager_from_mesh");

    const HalfEdgeMesh& mesh = prepared_->mesh;
    const std::vector<std::uint8_t> facing = prepared_->facing(imager_from_mesh.inverse().translation());
    std::vector<Segment> segments = prepared_->segments(carm, imager_from_mesh, facing);

    const bool classify = options.find_outline || options.find_hidden;
    std::optional<Strips> strips;
    if (classify && !segments.empty()) {
        strips.emplace(segments);
        strips->visitCrossings([&](std::int32_t i, std::int32_t j, const Vector2& pixel) {
            for (Segment* s : {&segments[at(i)], &segments[at(j)]}) {
                const Vector2 along = s->to - s->from;
                s->crossings.push_back({along.dot(pixel - s->from) / along.squaredNorm(), pixel});
            }
        });
    }

    std::vector<ContourLoop> loops;
    struct Piece {
        std::int32_t segment;
        Vector2 middle;
        double z;
    };
    std::vector<std::vector<Piece>> pieces;  // of loops[i]
    for (std::size_t i = 0; i < segments.size(); ++i) {
        Segment& s = segments[i];
        if (i == 0 || segments[i - 1].next != static_cast<std::int32_t>(i)) {
            loops.emplace_back();
            pieces.emplace_back();
        }
        const Vector3& from = mesh.mesh().vertices[at(mesh.origin(s.half_edge))];
        const Vector3& to = mesh.mesh().vertices[at(mesh.tip(s.half_edge))];
        std::sort(s.crossings.begin(), s.crossings.end(), [](const auto& a, const auto& b) { return a.t < b.t; });
        double t = 0;
        Vector2 ideal = s.from;
        for (std::size_t c = 0; c <= s.crossings.size(); ++c) {
            const bool last = c == s.crossings.size();
            const double t_end = last ? 1 : s.crossings[c].t;
            // Along the edge in space, where it is halfway in the image: 1 / z is linear there.
            const double along = t * s.z_from / ((1 - t) * s.z_to + t * s.z_from);
            loops.back().push_back({carm.distortedPixel(ideal), from + along * (to - from)});
            const double half = 0.5 * (t + t_end);
            pieces.back().push_back({static_cast<std::int32_t>(i), s.from + half * (s.to - s.from),
                                     1 / ((1 - half) / s.z_from + half / s.z_to)});
            if (!last) ideal = s.crossings[c].pixel;
            t = t_end;
        }
    }
    if (!strips) return loops;

    std::vector<Query> queries;
    for (std::size_t l = 0; l < loops.size(); ++l) {
        for (std::size_t i = 0; i < loops[l].size(); ++i) {
            const Piece& piece = pieces[l][i];
            loops[l][i].outline = strips->layersOutside(piece.segment, piece.middle) <= 0;
            if (options.find_hidden && !loops[l][i].outline)
                queries.push_back({piece.middle, piece.z, segments[at(piece.segment)].half_edge, &loops[l][i]});
        }
    }
    markHidden(mesh, facing, carm, imager_from_mesh, options.fold_mm, queries);
    return loops;
}

}  // namespace fluorocut
