#include "core/cutting/removal.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/cutting/sweep_tree.h"
#include "core/image/isosurface.h"

namespace fluorocut {
namespace {

struct SurfacePlace {
    Vector3 point;
    Vector3 normal;
};

// Places spread evenly over the part of a mesh below the top: every `area / count` mm2 one, somewhere in its triangle
// (a sequence that fills the unit square evenly, Roberts 2018).
std::vector<SurfacePlace> spread(const TriangleMesh& mesh, double top_mm, int count) {
    const auto corner = [&](const Triangle& t, std::size_t k) { return mesh.vertices[static_cast<std::size_t>(t[k])]; };
    const auto doubleArea = [&](const Triangle& t) {
        return Vector3((corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)));
    };
    const double ceiling = top_mm - 1e-6;
    const auto isLid = [&](const Triangle& t) {
        return std::min({corner(t, 0).z(), corner(t, 1).z(), corner(t, 2).z()}) >= ceiling;
    };
    double total = 0;
    for (const Triangle& t : mesh.triangles)
        if (!isLid(t)) total += doubleArea(t).norm();
    std::vector<SurfacePlace> places;
    if (!(total > 0)) return places;
    const double each = total / count;
    double due = 0.5 * each, u = 0.5, v = 0.5;
    for (const Triangle& t : mesh.triangles) {
        if (isLid(t)) continue;
        const Vector3 n = doubleArea(t);
        for (due -= n.norm(); due < 0; due += each) {
            u = std::fmod(u + 0.7548776662466927, 1.0);
            v = std::fmod(v + 0.5698402909980532, 1.0);
            const double a = u + v > 1 ? 1 - u : u, b = u + v > 1 ? 1 - v : v;
            const Vector3 p = corner(t, 0) + a * (corner(t, 1) - corner(t, 0)) + b * (corner(t, 2) - corner(t, 0));
            if (p.z() < ceiling) places.push_back({p, n.normalized()});
        }
    }
    return places;
}

double quantile95(std::vector<double> values) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

}  // namespace

Result<void> RemovalOptions::validate() const {
    return requireRange("points", points, 100, 1e7, "");
}

Result<RemovalReport> simulateRemoval(const ToolPath& path, const TriangleMesh& planned, double top_mm,
                                      const RemovalOptions& options, Progress& progress) {
    if (Result<void> ok = options.validate(); !ok) return ok.error();
    const SweepTree tree(path);
    if (tree.empty()) return invalidInput("tool path", "no moves that cut", "at least one");
    const std::vector<SurfacePlace> places = spread(planned, top_mm, options.points);
    if (places.empty()) {
        return invalidInput("planned cavity", "no surface below its top", "a closed mesh below z = top",
                            "Give the mesh that the path was planned for.");
    }
    RemovalReport report;
    report.left_mm.resize(places.size());
    std::vector<double> cusp(places.size());
    const double radius = path.cutter.radius_mm;
    constexpr std::size_t kChunk = 4096;
    for (std::size_t done = 0; done < places.size(); done += kChunk) {
        if (progress.isCancelled()) return cancelled("simulated removal");
        progress.report(static_cast<double>(done) / static_cast<double>(places.size()), "simulated removal");
        parallelFor(std::min(kChunk, places.size() - done), 64, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = done + begin; i < done + end; ++i) {
                const SweepTree::Nearest near = tree.nearest(places[i].point);
                const Vector3 off = places[i].point - near.foot;
                const double across2 = off.squaredNorm() - std::pow(off.dot(places[i].normal), 2);
                report.left_mm[i] = near.distance_mm - radius;
                cusp[i] = radius - std::sqrt(std::max(radius * radius - across2, 0.0));
            }
        });
    }
    std::vector<double> size(places.size()), rest(places.size());
    for (std::size_t i = 0; i < places.size(); ++i) {
        size[i] = std::abs(report.left_mm[i]);
        // Written so that a path without the figure has no cusps.
        cusp[i] = path.most_cusp_mm > 0 ? std::min(cusp[i], path.most_cusp_mm) : 0;
        rest[i] = std::abs(report.left_mm[i] - cusp[i]);
    }
    report.left_95_mm = quantile95(size);
    report.outside_cusps_95_mm = quantile95(rest);
    report.cusp_95_mm = quantile95(cusp);
    report.most_left_mm = *std::max_element(report.left_mm.begin(), report.left_mm.end());
    report.most_beyond_mm = -*std::min_element(report.left_mm.begin(), report.left_mm.end());
    return report;
}

Volume removedFraction(const ToolPath& path, const Rigid3& volume_from_cavity, const VolumeGrid& grid) {
    Volume fraction(grid);
    const SweepTree tree(path);
    if (tree.empty()) return fraction;
    const Rigid3 cavity_from_volume = volume_from_cavity.inverse();
    const double radius = path.cutter.radius_mm;
    // Beyond half a voxel's diagonal from the surface nothing or all of it is gone.
    const double reach = 0.5 * grid.spacing_mm.norm();
    const double enough = std::max(radius - reach, 0.0);
    const Matrix3 axes = cavity_from_volume.rotationMatrix() * grid.direction;
    parallelFor(static_cast<std::size_t>(grid.size[2]) * static_cast<std::size_t>(grid.size[1]), 1,
                [&](std::size_t begin, std::size_t end) {
                    for (std::size_t row = begin; row < end; ++row) {
                        const int j = static_cast<int>(row % static_cast<std::size_t>(grid.size[1]));
                        const int k = static_cast<int>(row / static_cast<std::size_t>(grid.size[1]));
                        for (int i = 0; i < grid.size[0]; ++i) {
                            const Vector3 center = cavity_from_volume * grid.pointFromIndex(Vector3(i, j, k));
                            const double d = tree.nearest(center, radius + reach, enough).distance_mm - radius;
                            if (!(d < reach)) continue;
                            if (d <= -reach) {
                                fraction(i, j, k) = 1;
                                continue;
                            }
                            double sum = 0;
                            for (int part = 0; part < 27; ++part) {
                                const Vector3 offset = Vector3(part % 3 - 1, part / 3 % 3 - 1, part / 9 - 1) / 3;
                                const Vector3 p = center + axes * offset.cwiseProduct(grid.spacing_mm);
                                const SweepTree::Nearest near = tree.nearest(p, radius + reach, enough);
                                if (!(near.distance_mm < radius + reach)) continue;
                                const Vector3 n = axes.transpose() * (p - near.foot).normalized();
                                // Thickness of the part along the normal.
                                const double thick = std::max(n.cwiseAbs().dot(grid.spacing_mm) / 3, 1e-9);
                                sum += std::clamp(0.5 - (near.distance_mm - radius) / thick, 0.0, 1.0);
                            }
                            fraction(i, j, k) = static_cast<float>(sum / 27);
                        }
                    }
                });
    return fraction;
}

TriangleMesh milledShape(const ToolPath& path, double top_mm, double spacing_mm) {
    Vector3 low = Vector3::Constant(std::numeric_limits<double>::infinity()), high = -low;
    for (const ToolMove& move : path.moves) {
        for (const Vector3& center : {move.segment.from_mm, move.segment.to_mm}) {
            low = low.cwiseMin(center);
            high = high.cwiseMax(center);
        }
    }
    const double radius = path.cutter.radius_mm;
    if (path.moves.empty() || !(low.z() - radius < top_mm)) return {};
    // Voxels' centres outside all around, and the last layer of them in the top.
    VolumeGrid grid;
    grid.spacing_mm.setConstant(spacing_mm);
    low -= Vector3::Constant(radius + spacing_mm);
    high += Vector3::Constant(radius + spacing_mm);
    low.z() = top_mm - spacing_mm * std::ceil((top_mm - low.z()) / spacing_mm);
    high.z() = top_mm;
    grid.origin_mm = low;
    for (int axis = 0; axis < 3; ++axis) {
        grid.size[static_cast<std::size_t>(axis)] =
            static_cast<int>(std::lround(std::ceil((high - low)[axis] / spacing_mm - 1e-6))) + 1;
    }
    Volume kept = removedFraction(path, Rigid3::identity(), grid);
    for (float& voxel : kept.voxels())
        voxel = 1 - voxel;
    return isosurface(kept, 0.5);
}

}  // namespace fluorocut
