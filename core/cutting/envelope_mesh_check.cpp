// The envelope check on triangles: see envelope_check.h.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <fmt/format.h>

#include "core/base/parallel.h"
#include "core/cutting/envelope_check.h"
#include "core/cutting/move_flaw.h"
#include "core/geometry/mesh_properties.h"

namespace fluorocut {
namespace {

constexpr double kLooked = 0.5;  // mm beyond the cutter in which room is measured
constexpr std::uint32_t kLeaf = 4;

struct Corners {
    Vector3 a, b, c;
};

double squaredDistanceInRegions(const Vector3& p, const Corners& t) {
    // Regions of the plane round a triangle (Ericson, Real-Time Collision Detection, 5.1.5).
    const Vector3 ab = t.b - t.a, ac = t.c - t.a, ap = p - t.a;
    const double d1 = ab.dot(ap), d2 = ac.dot(ap);
    if (d1 <= 0 && d2 <= 0) return ap.squaredNorm();
    const Vector3 bp = p - t.b;
    const double d3 = ab.dot(bp), d4 = ac.dot(bp);
    if (d3 >= 0 && d4 <= d3) return bp.squaredNorm();
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return (ap - d1 / (d1 - d3) * ab).squaredNorm();
    const Vector3 cp = p - t.c;
    const double d5 = ab.dot(cp), d6 = ac.dot(cp);
    if (d6 >= 0 && d5 <= d6) return cp.squaredNorm();
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return (ap - d2 / (d2 - d6) * ac).squaredNorm();
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (bp - w * (t.c - t.b)).squaredNorm();
    }
    const double sum = va + vb + vc;
    return (ap - vb / sum * ab - vc / sum * ac).squaredNorm();
}

// Between two segments, either of which may be a point.
double squaredDistance(const Vector3& p1, const Vector3& q1, const Vector3& p2, const Vector3& q2) {
    const Vector3 u = q1 - p1, v = q2 - p2, r = p1 - p2;
    const double a = u.squaredNorm(), e = v.squaredNorm(), f = v.dot(r), c = u.dot(r), b = u.dot(v);
    double s = 0, t = 0;
    if (a > 0 && e > 0) {
        const double denominator = a * e - b * b;
        s = denominator > 1e-14 * a * e ? std::clamp((b * f - c * e) / denominator, 0.0, 1.0) : 0;
        t = (b * s + f) / e;
        if (t < 0) {
            t = 0;
            s = std::clamp(-c / a, 0.0, 1.0);
        } else if (t > 1) {
            t = 1;
            s = std::clamp((b - c) / a, 0.0, 1.0);
        }
    } else if (a > 0) {
        s = std::clamp(-c / a, 0.0, 1.0);
    } else if (e > 0) {
        t = std::clamp(f / e, 0.0, 1.0);
    }
    return (r + s * u - t * v).squaredNorm();
}

double squaredDistance(const Vector3& p, const Corners& t) {
    const double regular = squaredDistanceInRegions(p, t);
    if (regular >= 0) return regular;
    // A triangle without area divided by it: NaN. Its sides are all of it.
    return std::min(
        {squaredDistance(p, p, t.a, t.b), squaredDistance(p, p, t.b, t.c), squaredDistance(p, p, t.c, t.a)});
}

// Whether a segment goes through a triangle.
bool pierces(const Vector3& p, const Vector3& q, const Corners& t) {
    const Vector3 n = (t.b - t.a).cross(t.c - t.a);
    const double above_p = n.dot(p - t.a), above_q = n.dot(q - t.a);
    if ((above_p > 0) == (above_q > 0)) return false;
    const Vector3 x = p + above_p / (above_p - above_q) * (q - p);
    return n.dot((t.b - t.a).cross(x - t.a)) >= 0 && n.dot((t.c - t.b).cross(x - t.b)) >= 0 &&
           n.dot((t.a - t.c).cross(x - t.c)) >= 0;
}

// What the cutter's axis passes over in one move, up to the open end: a parallelogram as two triangles.
struct Sheet {
    Vector3 corner[4];
    Corners half[2];
    Vector3 low, high;
    Matrix3 frame;              // rows: across the spindle in the sheet, off the sheet, along the spindle
    Vector3 own_low, own_high;  // the sheet's extent along them

    Sheet(const ToolSegment& s, double length) {
        const Vector3 up = length * s.spindle;
        corner[0] = s.from_mm;
        corner[1] = s.to_mm;
        corner[2] = s.to_mm + up;
        corner[3] = s.from_mm + up;
        half[0] = {corner[0], corner[1], corner[2]};
        half[1] = {corner[0], corner[2], corner[3]};
        low = corner[0].cwiseMin(corner[1]).cwiseMin(corner[2]).cwiseMin(corner[3]);
        high = corner[0].cwiseMax(corner[1]).cwiseMax(corner[2]).cwiseMax(corner[3]);
        const Vector3 way = s.to_mm - s.from_mm, across = way - way.dot(s.spindle) * s.spindle;
        frame.row(0) = across.norm() > 1e-9 ? across.normalized() : s.spindle.unitOrthogonal();
        frame.row(1) = s.spindle.cross(frame.row(0).transpose());
        frame.row(2) = s.spindle;
        own_low.setConstant(std::numeric_limits<double>::infinity());
        own_high = -own_low;
        for (const Vector3& p : corner) {
            own_low = own_low.cwiseMin(frame * p);
            own_high = own_high.cwiseMax(frame * p);
        }
    }

    // At least this far from a box: told along the box's axes and along the sheet's.
    double squaredGap(const Vector3& box_low, const Vector3& box_high) const {
        const double along_box = (box_low - high).cwiseMax(low - box_high).cwiseMax(0).squaredNorm();
        const Vector3 middle = frame * (0.5 * (box_low + box_high));
        const Vector3 reach = frame.cwiseAbs() * (0.5 * (box_high - box_low));
        const double along_own =
            (middle - reach - own_high).cwiseMax(own_low - middle - reach).cwiseMax(0).squaredNorm();
        return std::max(along_box, along_own);
    }

    double squaredGap(const Corners& t) const {
        const Vector3 a = frame * t.a, b = frame * t.b, c = frame * t.c;
        const Vector3 t_low = a.cwiseMin(b).cwiseMin(c), t_high = a.cwiseMax(b).cwiseMax(c);
        return (t_low - own_high).cwiseMax(own_low - t_high).cwiseMax(0).squaredNorm();
    }

    double squaredDistanceTo(const Vector3& p) const {
        return std::min(squaredDistance(p, half[0]), squaredDistance(p, half[1]));
    }

    double squaredDistanceTo(const Corners& t) const {
        double best = std::numeric_limits<double>::infinity();
        const Vector3* points[3] = {&t.a, &t.b, &t.c};
        for (int k = 0; k < 3; ++k) {
            const Vector3 &p = *points[k], &q = *points[(k + 1) % 3];
            if (pierces(p, q, half[0]) || pierces(p, q, half[1])) return 0;
            best = std::min(best, squaredDistanceTo(p));
            for (int side = 0; side < 4; ++side)
                best = std::min(best, squaredDistance(p, q, corner[side], corner[(side + 1) % 4]));
        }
        for (int side = 0; side < 4; ++side) {
            if (pierces(corner[side], corner[(side + 1) % 4], t)) return 0;
            best = std::min(best, squaredDistance(corner[side], t));
        }
        return best;
    }
};

class Walls {
  public:
    explicit Walls(const TriangleMesh& mesh) {
        for (const Vector3& v : mesh.vertices)
            open_ = std::max(open_, v.z());
        for (const Triangle& t : mesh.triangles) {
            const auto at = [&](std::size_t k) { return mesh.vertices[static_cast<std::size_t>(t[k])]; };
            const Corners corners{at(0), at(1), at(2)};
            const bool end = std::min({corners.a.z(), corners.b.z(), corners.c.z()}) >= open_ - 1e-6;
            (end ? end_ : walls_).push_back(corners);
        }
        if (!walls_.empty()) build(0, static_cast<std::uint32_t>(walls_.size()));
    }

    double open() const { return open_; }
    bool hasEnd() const { return !end_.empty(); }

    bool leavesThroughEnd(const Vector3& p, const Vector3& spindle) const {
        const Vector3 x = p + (open_ - p.z()) / spindle.z() * spindle;
        return std::any_of(end_.begin(), end_.end(), [&](const Corners& t) {
            const auto side = [&](const Vector3& a, const Vector3& b) {
                return (b.x() - a.x()) * (x.y() - a.y()) - (b.y() - a.y()) * (x.x() - a.x());
            };
            const double ab = side(t.a, t.b), bc = side(t.b, t.c), ca = side(t.c, t.a);
            return (ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0);
        });
    }

    // From the walls to a sheet; `most` when none is nearer.
    double distance(const Sheet& sheet, double most) const {
        double best2 = most * most;
        struct Open {
            std::uint32_t node;
            double gap2;
        };
        std::vector<Open> todo{{0, 0}};
        while (!todo.empty()) {
            const Open here = todo.back();
            todo.pop_back();
            if (here.gap2 >= best2) continue;
            const Node& node = nodes_[here.node];
            if (node.right == 0) {
                for (std::uint32_t i = node.begin; i < node.end; ++i)
                    if (sheet.squaredGap(walls_[i]) < best2)
                        best2 = std::min(best2, sheet.squaredDistanceTo(walls_[i]));
                continue;
            }
            const auto opened = [&](std::uint32_t id) {
                return Open{id, sheet.squaredGap(nodes_[id].low, nodes_[id].high)};
            };
            const Open left = opened(here.node + 1), right = opened(node.right);
            // The nearer one is looked at first.
            todo.push_back(left.gap2 < right.gap2 ? right : left);
            todo.push_back(left.gap2 < right.gap2 ? left : right);
        }
        return std::sqrt(best2);
    }

  private:
    struct Node {
        Vector3 low, high;
        std::uint32_t begin = 0, end = 0, right = 0;  // the left child follows its parent; right 0: a leaf
    };

    std::uint32_t build(std::uint32_t begin, std::uint32_t end) {
        const std::uint32_t id = static_cast<std::uint32_t>(nodes_.size());
        Node node;
        node.begin = begin;
        node.end = end;
        node.low.setConstant(std::numeric_limits<double>::infinity());
        node.high = -node.low;
        for (std::uint32_t i = begin; i < end; ++i) {
            for (const Vector3* p : {&walls_[i].a, &walls_[i].b, &walls_[i].c}) {
                node.low = node.low.cwiseMin(*p);
                node.high = node.high.cwiseMax(*p);
            }
        }
        nodes_.push_back(node);
        if (end - begin <= kLeaf) return id;
        Eigen::Index axis = 0;
        (node.high - node.low).maxCoeff(&axis);
        const std::uint32_t middle = begin + (end - begin) / 2;
        const auto key = [axis](const Corners& t) { return t.a[axis] + t.b[axis] + t.c[axis]; };
        std::nth_element(walls_.begin() + begin, walls_.begin() + middle, walls_.begin() + end,
                         [&](const Corners& s, const Corners& t) { return key(s) < key(t); });
        build(begin, middle);
        const std::uint32_t right = build(middle, end);
        nodes_[id].right = right;
        return id;
    }

    std::vector<Corners> walls_, end_;
    std::vector<Node> nodes_;
    double open_ = -std::numeric_limits<double>::infinity();
};

}  // namespace

Result<EnvelopeVerdict> checkByMesh(const ToolPath& path, const TriangleMesh& envelope, const EnvelopeOptions& options,
                                    Progress& progress) {
    if (Result<void> ok = options.validate(); !ok) return ok.error();
    if (Result<void> ok = path.cutter.validate(); !ok) return ok.error();
    if (path.moves.empty()) return invalidInput("tool path", "no moves", "at least one");
    if (Result<void> solid = requireSolid(envelope, "envelope"); !solid) return solid.error();
    const Walls walls(envelope);
    if (!walls.hasEnd()) {
        return invalidInput("envelope", "no flat face at its top", "an open end through which the cutter comes");
    }

    const double radius = path.cutter.radius_mm;
    std::vector<double> beyond(path.moves.size(), std::numeric_limits<double>::infinity());
    constexpr std::size_t kChunk = 1024;
    for (std::size_t done = 0; done < path.moves.size(); done += kChunk) {
        if (progress.isCancelled()) return cancelled("envelope check by mesh");
        progress.report(static_cast<double>(done) / static_cast<double>(path.moves.size()), "envelope check by mesh");
        parallelFor(std::min(kChunk, path.moves.size() - done), 16, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = done + begin; i < done + end; ++i) {
                const ToolSegment& s = path.moves[i].segment;
                if (!moveFlaw(path, i, walls.open()).empty()) continue;
                // The shank counts as far as the open end; from there it is nobody's.
                const double up = (walls.open() - std::min(s.from_mm.z(), s.to_mm.z())) / s.spindle.z();
                const double room = walls.distance(Sheet(s, up), radius + kLooked);
                beyond[i] = walls.leavesThroughEnd(s.from_mm, s.spindle) ? radius - room : radius + room;
            }
        });
    }
    EnvelopeVerdict verdict;
    for (const double b : beyond)
        verdict.inside.push_back(b <= options.tolerance_mm);
    const auto worst = std::max_element(beyond.begin(), beyond.end());
    verdict.worst_mm = *worst;
    verdict.worst_move = static_cast<std::size_t>(worst - beyond.begin());
    return verdict;
}

}  // namespace fluorocut
