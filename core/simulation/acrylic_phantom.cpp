#include "core/simulation/acrylic_phantom.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/simulation/voxel_count.h"

namespace fluorocut {
namespace {

constexpr int kSubsamples = 8;
constexpr std::size_t kSlicesPerReport = 16;

// One axis of the grid: of each voxel's extent [low, high], the part that the block's faces leave.
struct Axis {
    int count;
    double first_mm;  // centre of the first voxel
    std::vector<double> low_mm, high_mm;
};

Axis makeAxis(double size_mm, double voxel_mm, double margin_mm) {
    Axis axis;
    axis.count = static_cast<int>(std::ceil((size_mm + 2 * margin_mm) / voxel_mm));
    axis.first_mm = -0.5 * (axis.count - 1) * voxel_mm;
    for (int i = 0; i < axis.count; ++i) {
        const double center = axis.first_mm + i * voxel_mm;
        axis.low_mm.push_back(std::max(center - 0.5 * voxel_mm, -0.5 * size_mm));
        axis.high_mm.push_back(std::min(center + 0.5 * voxel_mm, 0.5 * size_mm));
    }
    return axis;
}

// How far a point lies outside the box that is left when the block shrinks by the edge radius.
Vector3 beyondCore(const Vector3& point, const AcrylicOptions& options) {
    return (point.cwiseAbs() - 0.5 * options.size_mm + Vector3::Constant(options.edge_radius_mm)).cwiseMax(0.0);
}

// The fraction of the box between `low` and `high` for which `inside(point)` holds.
template <class Inside>
double subsampled(const Vector3& low, const Vector3& high, const Inside& inside) {
    int hits = 0;
    const Vector3 step = (high - low) / kSubsamples;
    const Vector3 first = low + 0.5 * step;
    for (int k = 0; k < kSubsamples; ++k)
        for (int j = 0; j < kSubsamples; ++j)
            for (int i = 0; i < kSubsamples; ++i)
                hits += inside(Vector3(first + step.cwiseProduct(Vector3(i, j, k))));
    return hits / double(kSubsamples * kSubsamples * kSubsamples);
}

// Beads stand in the middle of the walls. They go around the block by the golden section and rise by equal steps, so
// that no rotation or reflection takes the pattern into itself.
std::vector<Vector3> placeBeads(const AcrylicOptions& options) {
    std::vector<Vector3> centers;
    const Vector3 half = 0.5 * options.size_mm;
    for (int n = 0; n < options.beads; ++n) {
        const double turn = 4 * std::fmod(n * (std::numbers::phi - 1), 1.0);  // 0 to 4: along the four sides
        const double along = 0.6 * (2 * (turn - std::floor(turn)) - 1);       // clear of the long edges
        const std::array<Vector2, 4> sides{Vector2(1, along), Vector2(-along, 1), Vector2(-1, -along),
                                           Vector2(along, -1)};
        const Vector2 side = 0.76 * sides[static_cast<std::size_t>(turn) % 4];
        const double level = options.beads == 1 ? 0.0 : 2.0 * n / (options.beads - 1) - 1;
        centers.emplace_back(side.x() * half.x(), side.y() * half.y(), 0.85 * level * half.z());
    }
    return centers;
}

}  // namespace

Result<void> AcrylicOptions::validate() const {
    for (int axis = 0; axis < 3; ++axis) {
        const std::string field = fmt::format("size_mm[{}]", axis);
        if (auto ok = requireRange(field.c_str(), size_mm[axis], 5, 500, "mm"); !ok) return ok;
    }
    // Beads' centres are 0.12 of a side from the long faces and 0.075 from the ends; they must stay inside the block.
    const double shortest = size_mm.minCoeff();
    if (auto ok = requireRange("edge_radius_mm", edge_radius_mm, 0, (beads > 0 ? 0.2 : 0.5) * shortest, "mm"); !ok) {
        return ok;
    }
    if (auto ok = requireRange("voxel_mm", voxel_mm, 0.1, 5, "mm"); !ok) return ok;
    if (auto ok = requireRange("air_margin_mm", air_margin_mm, 0, 200, "mm"); !ok) return ok;
    if (auto ok = requireRange("acrylic_hu", acrylic_hu, -1000, 30000, "HU"); !ok) return ok;
    if (auto ok = requireRange("air_hu", air_hu, -1024, 0, "HU"); !ok) return ok;
    if (auto ok = requireRange("beads", beads, 0, 24, "beads"); !ok) return ok;
    if (beads > 0) {
        if (auto ok = requireRange("bead_diameter_mm", bead_diameter_mm, 0.5, 0.14 * shortest, "mm"); !ok) return ok;
    }
    if (auto ok = requireRange("bead_hu", bead_hu, -1000, 32767, "HU"); !ok) return ok;
    const Vector3 counts = (size_mm.array() + 2 * air_margin_mm) / voxel_mm + 1;
    return requireVoxelCount(counts.prod());
}

Result<AcrylicPhantom> generateAcrylicBlock(const AcrylicOptions& options, Progress& progress) {
    if (auto ok = options.validate(); !ok) return ok.error();
    const double voxel = options.voxel_mm;
    const std::array<Axis, 3> axes{makeAxis(options.size_mm.x(), voxel, options.air_margin_mm),
                                   makeAxis(options.size_mm.y(), voxel, options.air_margin_mm),
                                   makeAxis(options.size_mm.z(), voxel, options.air_margin_mm)};
    VolumeGrid grid;
    grid.size = {axes[0].count, axes[1].count, axes[2].count};
    grid.spacing_mm = Vector3::Constant(voxel);
    grid.origin_mm = {axes[0].first_mm, axes[1].first_mm, axes[2].first_mm};

    AcrylicPhantom result{Volume(grid, static_cast<float>(options.air_hu)), placeBeads(options)};
    const double radius = options.edge_radius_mm;
    const double bead_radius = 0.5 * options.bead_diameter_mm;
    const double voxel_mm3 = voxel * voxel * voxel;
    const Vector3 half_voxel = Vector3::Constant(0.5 * voxel);

    const auto fillSlices = [&](std::size_t begin, std::size_t end) {
        for (std::size_t slice = begin; slice < end; ++slice) {
            const int k = static_cast<int>(slice);
            const auto& [x_axis, y_axis, z_axis] = axes;
            for (int j = 0; j < grid.size[1]; ++j) {
                float* row = result.ct.row(j, k);
                const auto y = static_cast<std::size_t>(j);
                for (int i = 0; i < grid.size[0]; ++i) {
                    const auto x = static_cast<std::size_t>(i);
                    const Vector3 low(x_axis.low_mm[x], y_axis.low_mm[y], z_axis.low_mm[slice]);
                    const Vector3 high(x_axis.high_mm[x], y_axis.high_mm[y], z_axis.high_mm[slice]);
                    if (!(low.array() < high.array()).all()) continue;
                    double fraction = (high - low).prod() / voxel_mm3;
                    // Where no edge or corner is near, that is exact.
                    const Vector3 reach = beyondCore(low.cwiseAbs().cwiseMax(high.cwiseAbs()), options);
                    if (radius > 0 && reach.norm() > radius && (reach.array() > 0).count() >= 2) {
                        fraction *= subsampled(low, high, [&](const Vector3& point) {
                            return beyondCore(point, options).squaredNorm() <= radius * radius;
                        });
                    }
                    const Vector3 center = grid.pointFromIndex(Vector3(i, j, k));
                    double value = options.air_hu + fraction * (options.acrylic_hu - options.air_hu);
                    for (const Vector3& bead : result.bead_centers_mm) {
                        if ((center - bead).norm() > bead_radius + half_voxel.norm()) continue;
                        const double part =
                            subsampled(center - half_voxel, center + half_voxel, [&](const Vector3& point) {
                                return (point - bead).squaredNorm() <= bead_radius * bead_radius;
                            });
                        value += part * (options.bead_hu - value);
                    }
                    row[i] = static_cast<float>(value);
                }
            }
        }
    };
    // Some slices at a time, so that progress and cancellation stay on this thread.
    const auto slices = static_cast<std::size_t>(grid.size[2]);
    for (std::size_t first = 0; first < slices; first += kSlicesPerReport) {
        if (progress.isCancelled()) return cancelled("acrylic block");
        progress.report(double(first) / double(slices), "acrylic block");
        parallelFor(std::min(kSlicesPerReport, slices - first), 2,
                    [&](std::size_t begin, std::size_t end) { fillSlices(first + begin, first + end); });
    }
    progress.report(1, "acrylic block");
    return result;
}

}  // namespace fluorocut
