#include "core/simulation/cutting.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/geometry/mesh_properties.h"
#include "core/image/voxelize.h"

namespace fluorocut {
namespace {

// Raises `fraction` to the coverage of the block.
void unite(Volume& fraction, const VoxelCoverage& coverage) {
    const Volume& block = coverage.fraction;
    const auto& [di, dj, dk] = coverage.offset;
    for (int k = 0; k < block.size(2); ++k) {
        for (int j = 0; j < block.size(1); ++j) {
            const float* in = block.row(j, k);
            float* out = fraction.row(j + dj, k + dk) + di;
            for (int i = 0; i < block.size(0); ++i)
                out[i] = std::max(out[i], in[i]);
        }
    }
}

}  // namespace

Result<void> CutOptions::validate() const {
    if (auto ok = requireRange("fill_hu", fill_hu, -1024, 3071, "HU"); !ok) return ok;
    if (auto ok = requireRange("sweep_mm", sweep_mm, 0, 1000, "mm"); !ok) return ok;
    if (!(std::abs(sweep_direction_in_cavity.norm() - 1) < 1e-6)) {
        return invalidOption("sweep_direction_in_cavity",
                             fmt::format("a length of {}", sweep_direction_in_cavity.norm()), "a unit vector");
    }
    return {};
}

Result<CutResult> cutMesh(const Volume& hounsfield, const TriangleMesh& mesh, const Rigid3& femur_from_cavity,
                          const CutOptions& options, const Volume* already_removed, Progress& progress) {
    if (auto ok = options.validate(); !ok) return ok.error();
    const VolumeGrid& grid = hounsfield.grid();
    if (already_removed && !(already_removed->grid() == grid)) {
        throw std::logic_error("cutMesh: already_removed lies on another grid than the CT");
    }

    const double step_mm = 0.5 * grid.spacing_mm.minCoeff();
    const int steps = static_cast<int>(std::ceil(options.sweep_mm / step_mm));
    Volume fraction(grid);
    for (int step = 0; step <= steps; ++step) {
        if (progress.isCancelled()) return cancelled("cutting");
        progress.report(0.9 * step / (steps + 1), "cutting the cavity");
        const double back_mm = steps == 0 ? 0 : options.sweep_mm * step / steps;
        const Rigid3 moved = femur_from_cavity * Rigid3::fromTranslation(back_mm * options.sweep_direction_in_cavity);
        const auto coverage = voxelize(mesh, moved, grid, "cavity mesh");
        if (!coverage) return coverage.error();
        unite(fraction, *coverage);
    }

    CutResult result;
    result.mesh_mm3 = meshProperties(mesh).volume_mm3;
    result.volume = hounsfield;
    const auto fill = static_cast<float>(options.fill_hu);
    double removed_voxels = 0, new_voxels = 0;
    for (std::size_t n = 0; n < grid.voxelCount(); ++n) {
        float& now = fraction.voxels()[n];
        const float before = already_removed ? already_removed->voxels()[n] : 0.0f;
        removed_voxels += now;
        result.voxels_touched += now > 0;
        if (now <= before) {
            now = before;
            continue;
        }
        new_voxels += now - before;
        float& value = result.volume.voxels()[n];
        value = fill + (value - fill) * (1 - now) / (1 - before);
    }
    if (result.voxels_touched == 0) {
        return invalidInput("cavity mesh", "no part of it inside the CT", "a cavity that meets the CT",
                            "check femur_from_cavity and the mesh's unit");
    }
    const double voxel_mm3 = grid.spacing_mm.prod();
    result.removed_mm3 = removed_voxels * voxel_mm3;
    result.newly_removed_mm3 = new_voxels * voxel_mm3;
    if (options.sweep_mm == 0 && result.removed_mm3 < 0.999 * result.mesh_mm3) {
        result.warnings.push_back(fmt::format("{:.1f} % of the cavity lies outside the CT and removes nothing",
                                              100 * (1 - result.removed_mm3 / result.mesh_mm3)));
    }
    result.removed_fraction = std::move(fraction);
    progress.report(1, "cavity cut");
    return result;
}

}  // namespace fluorocut
