#include "core/cutting/envelope_check.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/cutting/move_flaw.h"
#include "core/geometry/mesh_properties.h"

namespace fluorocut {
namespace {

constexpr double kLevel = 1e-6;        // mm: vertices of a flat face
constexpr double kTurnRoom = 2;        // mm below the open end in which the spindle may turn
constexpr double kJoint = 1e-6;        // mm between one move's end and the next one's beginning
constexpr double kLeastUpright = 0.5;  // of the spindle's z

std::string describe(const ToolPath& path, std::size_t move) {
    static const char* const kNames[] = {"rapid", "entry", "cut", "retract"};
    const ToolMove& m = path.moves[move];
    const Vector3 &a = m.segment.from_mm, &b = m.segment.to_mm;
    return fmt::format("tool path, move {} of {} ({}, ({:.2f}, {:.2f}, {:.2f}) to ({:.2f}, {:.2f}, {:.2f}) mm)",
                       move + 1, path.moves.size(), kNames[static_cast<int>(m.motion)], a.x(), a.y(), a.z(), b.x(),
                       b.y(), b.z());
}

}  // namespace

std::string moveFlaw(const ToolPath& path, std::size_t move, double open_mm) {
    const ToolMove& m = path.moves[move];
    const ToolSegment& s = m.segment;
    if (!s.from_mm.allFinite() || !s.to_mm.allFinite() || !s.spindle.allFinite()) return "a place that is no number";
    if (!(std::abs(s.spindle.norm() - 1) <= 1e-6)) return fmt::format("a spindle of length {:g}", s.spindle.norm());
    if (!(s.spindle.z() >= kLeastUpright)) return "a spindle that leans by more than 60 degrees";
    if (!(m.feed_mm_s > 0) || !std::isfinite(m.feed_mm_s)) return fmt::format("a feed of {:g} mm/s", m.feed_mm_s);
    const double highest = std::max(s.from_mm.z(), s.to_mm.z()), lowest = std::min(s.from_mm.z(), s.to_mm.z());
    if (!(highest <= open_mm)) return fmt::format("the ball's centre {:.2f} mm above the open end", highest - open_mm);
    const double way = (open_mm - lowest) / s.spindle.z();
    if (!(way <= path.cutter.length_mm)) {
        return fmt::format("a shank of {:g} mm where the open end is {:.2f} mm away", path.cutter.length_mm, way);
    }
    if (move > 0) {
        const ToolSegment& last = path.moves[move - 1].segment;
        const double gap = (s.from_mm - last.to_mm).norm();
        if (!(gap <= kJoint)) return fmt::format("a jump of {:.3g} mm from where the last move ended", gap);
        if (!((s.spindle - last.spindle).norm() <= 1e-9) && !(s.from_mm.z() >= open_mm - kTurnRoom)) {
            return "a turn of the spindle inside the cavity";
        }
    }
    return "";
}

Result<void> EnvelopeOptions::validate() const {
    return requireRanges({{"tolerance_mm", tolerance_mm, 0, 5, "mm"}, {"voxel_mm", voxel_mm, 0.02, 2, "mm"}});
}

bool EnvelopeVerdict::passed() const {
    // Written so that NaN fails.
    return !inside.empty() && std::all_of(inside.begin(), inside.end(), [](bool in) { return in; }) &&
           worst_mm < std::numeric_limits<double>::infinity();
}

Result<TriangleMesh> openedUpward(const TriangleMesh& cavity, double open_mm) {
    if (Result<void> solid = requireSolid(cavity, "cavity"); !solid) return solid.error();
    double top = -std::numeric_limits<double>::infinity();
    for (const Vector3& v : cavity.vertices)
        top = std::max(top, v.z());
    if (!(open_mm > top)) {
        return invalidInput("cavity", fmt::format("a top at {:.2f} mm", top),
                            fmt::format("one below the open end, {:.2f} mm", open_mm));
    }
    const auto isTop = [&](std::int32_t v) { return cavity.vertices[static_cast<std::size_t>(v)].z() >= top - kLevel; };

    TriangleMesh result = cavity;
    std::map<std::int32_t, std::int32_t> raised;  // the copies of the top's vertices
    std::set<std::pair<std::int32_t, std::int32_t>> edges;
    const auto raise = [&](std::int32_t v) {
        const auto [at, is_new] = raised.try_emplace(v, static_cast<std::int32_t>(result.vertices.size()));
        if (is_new) {
            result.vertices.push_back(cavity.vertices[static_cast<std::size_t>(v)]);
            result.vertices.back().z() = open_mm;
        }
        return at->second;
    };
    for (Triangle& t : result.triangles) {
        if (!isTop(t[0]) || !isTop(t[1]) || !isTop(t[2])) continue;
        for (std::size_t k = 0; k < 3; ++k)
            edges.emplace(t[k], t[(k + 1) % 3]);
        for (std::int32_t& v : t)
            v = raise(v);
    }
    if (edges.empty()) {
        return invalidInput("cavity", "no flat face at its top", "a mesh that is closed by a plane at its top",
                            "Cut it off level where the cutter comes in.");
    }
    for (const auto& [a, b] : edges) {
        if (edges.count({b, a})) continue;
        result.triangles.push_back({a, b, raised[b]});
        result.triangles.push_back({a, raised[b], raised[a]});
    }
    // Inner vertices of the old top face are used no longer.
    std::vector<std::int32_t> place(result.vertices.size(), -1);
    std::vector<Vector3> vertices;
    for (Triangle& t : result.triangles) {
        for (std::int32_t& v : t) {
            std::int32_t& to = place[static_cast<std::size_t>(v)];
            if (to < 0) {
                to = static_cast<std::int32_t>(vertices.size());
                vertices.push_back(result.vertices[static_cast<std::size_t>(v)]);
            }
            v = to;
        }
    }
    result.vertices = std::move(vertices);
    return result;
}

Result<CheckedToolPath> checkToolPath(ToolPath path, const Cutter& mounted, const TriangleMesh& envelope,
                                      const EnvelopeOptions& options, Progress& progress) {
    if (!(std::abs(path.cutter.radius_mm - mounted.radius_mm) <= 1e-6) ||
        !(std::abs(path.cutter.length_mm - mounted.length_mm) <= 1e-6)) {
        return invalidInput(
            "tool path, cutter",
            fmt::format("radius {:g}, length {:g} mm", path.cutter.radius_mm, path.cutter.length_mm),
            fmt::format("the mounted one, radius {:g}, length {:g} mm", mounted.radius_mm, mounted.length_mm),
            "Plan the path for the cutter that is mounted.");
    }
    SubProgress first(progress, 0, 0.5), second(progress, 0.5, 1);
    const Result<EnvelopeVerdict> mesh = checkByMesh(path, envelope, options, first);
    if (!mesh) return mesh.error();
    const Result<EnvelopeVerdict> voxels = checkByVoxels(path, envelope, options, second);
    if (!voxels) return voxels.error();
    if (mesh->inside.size() != path.moves.size() || voxels->inside.size() != path.moves.size()) {
        throw std::logic_error("checkToolPath: a verdict that is not of every move");
    }
    double open = -std::numeric_limits<double>::infinity();
    for (const Vector3& v : envelope.vertices)
        open = std::max(open, v.z());
    for (std::size_t i = 0; i < path.moves.size(); ++i) {
        if (mesh->inside[i] && voxels->inside[i]) continue;
        std::string found = moveFlaw(path, i, open);
        if (found.empty()) {
            found = !mesh->inside[i] && !voxels->inside[i] ? "a cutter that reaches beyond the envelope, by both checks"
                    : mesh->inside[i] ? "a cutter that reaches beyond the envelope by the voxel check alone"
                                      : "a cutter that reaches beyond the envelope by the mesh check alone";
            found += fmt::format(" (at worst {:.3f} mm by mesh, {:.3f} mm by voxels, of the whole path)",
                                 mesh->worst_mm, voxels->worst_mm);
        }
        return noSolution(describe(path, i), found, "a move inside the envelope", "Plan the path anew.");
    }
    if (!mesh->passed() || !voxels->passed())
        return noSolution("tool path", "a check that did not pass", "two that do");
    return CheckedToolPath(std::move(path), mesh->worst_mm, voxels->worst_mm);
}

}  // namespace fluorocut
