#include "core/planning/predicted_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/base/stopwatch.h"
#include "core/geometry/mesh_section.h"
#include "core/image/blur.h"
#include "core/image/voxelize.h"
#include "core/imaging/carm_image.h"

namespace fluorocut {
namespace {

using Role = PlannedSolids::Solid::Role;

constexpr double kMostSmooth = 0.9;  // of a level: the rest came straight through

// Coverage of several solids that do not overlap, cut at 1, on the block of the CT that holds them.
struct Coverage {
    std::array<int, 3> offset{0, 0, 0};
    Volume fraction;
};

Coverage joined(const std::vector<VoxelCoverage>& all, const VolumeGrid& grid) {
    std::array<int, 3> low{grid.size}, high{0, 0, 0};
    for (const VoxelCoverage& one : all) {
        for (std::size_t a = 0; a < 3 && !one.fraction.empty(); ++a) {
            low[a] = std::min(low[a], one.offset[a]);
            high[a] = std::max(high[a], one.offset[a] + one.fraction.grid().size[a]);
        }
    }
    Coverage result;
    if (high[0] <= low[0]) return result;
    VolumeGrid block = grid;
    for (std::size_t a = 0; a < 3; ++a)
        block.size[a] = high[a] - low[a];
    block.origin_mm = grid.pointFromIndex(Vector3(low[0], low[1], low[2]));
    result.offset = low;
    result.fraction = Volume(block);
    for (const VoxelCoverage& one : all) {
        if (one.fraction.empty()) continue;
        for (int k = 0; k < one.fraction.size(2); ++k) {
            for (int j = 0; j < one.fraction.size(1); ++j) {
                const float* from = one.fraction.row(j, k);
                float* to = result.fraction.row(j + one.offset[1] - low[1], k + one.offset[2] - low[2]) +
                            (one.offset[0] - low[0]);
                for (int i = 0; i < one.fraction.size(0); ++i)
                    to[i] = std::min(1.0F, to[i] + from[i]);
            }
        }
    }
    return result;
}

double muOfHounsfield(double hounsfield, const PredictionOptions& options) {
    return attenuationFromHounsfield(hounsfield, attenuationPerMm(Material::water, options.energy_kev));
}

}  // namespace

Result<void> PredictionOptions::validate() const {
    return requireRanges({{"energy_kev", energy_kev, kLowestEnergyKev, kHighestEnergyKev, "keV"},
                          {"offset_level", offset_level, -1e6, 1e6, "levels"},
                          {"detector_blur_px", detector_blur_px, 0, 20, "px"},
                          {"smooth_fraction", smooth_fraction, 0, kMostSmooth, ""},
                          {"smooth_sigma_mm", smooth_sigma_mm, 1, 200, "mm"},
                          {"fill_hu", fill_hu, -1000, 4000, "HU"},
                          {"bone_hu", bone_hu, -1000, 3000, "HU"},
                          {"bone_hu_sigma", bone_hu_sigma, 0, 2000, "HU"},
                          {"soft_tissue_hu", soft_tissue_hu, -1000, 1000, "HU"}});
}

Result<PlannedSolids> PlannedSolids::prepare(const Implant* implant, const TriangleMesh* cavity) {
    PlannedSolids result;
    const auto add = [&](const std::string& name, TriangleMesh mesh, Role role, Material material) -> Result<void> {
        Result<MeshProjector> projector = MeshProjector::prepare(std::move(mesh), name);
        if (!projector) return projector.error();
        result.solids_.push_back({name, std::move(*projector), role, material});
        return {};
    };
    if (implant) {
        for (std::size_t p = 0; p < implant->parts.size(); ++p) {
            const ImplantPart& part = implant->parts[p];
            if (p > 0) {
                if (auto good = add(part.name, part.mesh, Role::head, part.material); !good) return good.error();
                continue;
            }
            if (auto good = add(part.name, implant->in_bone, Role::stemInBone, part.material); !good)
                return good.error();
            const auto half_edges = HalfEdgeMesh::build(part.mesh, part.name);
            if (!half_edges) return half_edges.error();
            // Nothing above the resection is no failure: a stem without neck.
            auto above = partBelow(*half_edges, {{0, 0, implant->resection_z_mm}, {0, 0, -1}});
            if (above) {
                if (auto good = add("neck", std::move(*above), Role::neck, part.material); !good) return good.error();
            }
        }
    }
    if (cavity) {
        if (auto good = add("cavity", *cavity, Role::cavity, Material::air); !good) return good.error();
    }
    if (result.solids_.empty()) return invalidOption("plan", "neither implant nor cavity", "at least one of them");
    return result;
}

Result<PlacedPlan> placePlan(const PlannedSolids& solids, const Rigid3& femur_from_cavity, const Volume* ct,
                             const PredictionOptions& options) {
    if (Result<void> good = options.validate(); !good) return good.error();
    PlacedPlan plan;
    plan.femur_from_cavity = femur_from_cavity;
    if (!ct) return plan;
    const bool has_cavity = std::any_of(solids.solids().begin(), solids.solids().end(),
                                        [](const auto& solid) { return solid.role == Role::cavity; });
    std::vector<const PlannedSolids::Solid*> removing;
    for (const PlannedSolids::Solid& solid : solids.solids()) {
        const bool lies_in_cavity = has_cavity && solid.role == Role::stemInBone;
        if (!lies_in_cavity && solid.role != Role::head) removing.push_back(&solid);
    }
    std::vector<VoxelCoverage> coverages(removing.size());
    parallelFor(removing.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)  // solids were checked when they were prepared
            coverages[i] = *voxelize(removing[i]->projector.mesh(), femur_from_cavity, ct->grid(), removing[i]->name);
    });
    for (std::size_t i = 0; i < removing.size(); ++i) {
        const double missing = 1 - coverages[i].volume_mm3 / removing[i]->projector.properties().volume_mm3;
        if (missing > 0.01)
            plan.warnings.push_back(
                fmt::format("{:.0f} % of the {} lies outside the CT: nothing is known to be removed "
                            "there",
                            100 * missing, removing[i]->name));
    }
    Coverage removed = joined(coverages, ct->grid());
    if (removed.fraction.empty()) return plan;
    Volume& values = removed.fraction;
    for (int k = 0; k < values.size(2); ++k) {
        for (int j = 0; j < values.size(1); ++j) {
            float* value = values.row(j, k);
            const float* hounsfield = ct->row(j + removed.offset[1], k + removed.offset[2]) + removed.offset[0];
            for (int i = 0; i < values.size(0); ++i)
                value[i] = value[i] * std::max(0.0F, hounsfield[i] + 1000) - 1000;
        }
    }
    AttenuationOptions attenuation;
    attenuation.mu_water_per_mm = attenuationPerMm(Material::water, options.energy_kev);
    Result<VolumeProjector> projector =
        VolumeProjector::prepare(std::make_shared<const Volume>(std::move(values)), attenuation);
    if (!projector) return projector.error();
    plan.removed = std::make_shared<const VolumeProjector>(std::move(*projector));
    return plan;
}

Image PredictedView::wide(const Image& light) const {
    return gaussianBlurred(light, options_.smooth_sigma_mm / carm_.pixel_mm.mean());
}

Result<PredictedView> PredictedView::prepare(Image image, const CArm& carm, const Rigid3& imager_from_femur,
                                             const PredictionOptions& options) {
    if (Result<void> good = carm.validate(); !good) return good.error();
    if (Result<void> good = options.validate(); !good) return good.error();
    if (Result<void> good = requireTakenBy(carm, image); !good) return good.error();
    PredictedView view;
    view.carm_ = carm;
    view.imager_from_femur_ = imager_from_femur;
    view.options_ = options;
    const auto offset = static_cast<float>(options.offset_level);
    view.primary_ = image;
    for (float& level : view.primary_.pixels())
        level = std::max(0.0F, level - offset);
    view.smooth_ = view.wide(view.primary_);
    for (std::size_t p = 0; p < image.size(); ++p) {
        float& light = view.primary_.pixels()[p];
        float& smooth = view.smooth_.pixels()[p];
        smooth =
            std::min(static_cast<float>(options.smooth_fraction) * smooth, static_cast<float>(kMostSmooth) * light);
        light -= smooth;
    }
    view.wide_primary_ = view.wide(view.primary_);
    view.image_ = std::move(image);
    return view;
}

Result<PredictedImage> PredictedView::predict(const PlannedSolids& solids, const PlacedPlan& plan) const {
    const Stopwatch stopwatch;
    const Rigid3 imager_from_cavity = imager_from_femur_ * plan.femur_from_cavity;
    const bool with_ct = plan.removed != nullptr;
    const double fill = muOfHounsfield(options_.fill_hu, options_);
    const double bone = with_ct ? 0 : muOfHounsfield(options_.bone_hu, options_);
    const double soft = muOfHounsfield(options_.soft_tissue_hu, options_);
    const bool has_cavity = std::any_of(solids.solids().begin(), solids.solids().end(),
                                        [](const auto& solid) { return solid.role == Role::cavity; });

    PredictedImage result;
    result.change = Image(carm_.columns, carm_.rows);
    float longest = 0;  // mm of removed bone
    std::vector<Image> all_lengths(solids.solids().size());
    parallelFor(all_lengths.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)
            all_lengths[i] = solids.solids()[i].projector.project(carm_, imager_from_cavity);
    });
    for (std::size_t i = 0; i < all_lengths.size(); ++i) {
        const PlannedSolids::Solid& solid = solids.solids()[i];
        const Image& lengths = all_lengths[i];
        const double mu = solid.role == Role::cavity ? 0 : attenuationPerMm(solid.material, options_.energy_kev);
        const bool in_bone = solid.role == Role::cavity || (solid.role == Role::stemInBone && !has_cavity);
        double weight = mu;
        if (solid.role == Role::cavity) weight = fill - bone;
        if (solid.role == Role::stemInBone) weight -= has_cavity ? fill : bone;
        if (solid.role == Role::head || (solid.role == Role::neck && !with_ct)) weight -= soft;
        for (std::size_t p = 0; p < lengths.size(); ++p) {
            const float length = lengths.pixels()[p];
            if (!(length > 0)) continue;  // nothing there, or nothing known
            result.change.pixels()[p] += static_cast<float>(weight) * length;
            if (in_bone) longest = std::max(longest, length);
        }
    }
    if (with_ct) {
        const Image removed = plan.removed->project(carm_, imager_from_femur_);
        for (std::size_t p = 0; p < removed.size(); ++p) {
            const float integral = removed.pixels()[p];
            if (std::isfinite(integral)) result.change.pixels()[p] -= integral;
        }
    }
    result.level_uncertainty =
        with_ct ? 0 : attenuationPerMm(Material::water, options_.energy_kev) * options_.bone_hu_sigma / 1000 * longest;

    Image ratio = result.change;
    parallelFor(ratio.size(), 16384, [&](std::size_t begin, std::size_t end) {
        for (std::size_t p = begin; p < end; ++p) {
            float& value = ratio.pixels()[p];
            value = value == 0 ? 1 : std::exp(-value);
        }
    });
    ratio = gaussianBlurred(ratio, options_.detector_blur_px);
    // The kernel's rounding must not touch what the plan does not: far from it the ratio is 1.
    for (float& value : ratio.pixels())
        if (std::abs(value - 1) < 1e-5F) value = 1;
    Image after = primary_;
    for (std::size_t p = 0; p < after.size(); ++p)
        after.pixels()[p] *= ratio.pixels()[p];
    const Image wide_after = wide(after);
    result.image = image_;
    for (std::size_t p = 0; p < after.size(); ++p) {
        const float before = wide_primary_.pixels()[p];
        const float smooth_change = before > 0 ? wide_after.pixels()[p] / before - 1 : 0;
        result.image.pixels()[p] += after.pixels()[p] - primary_.pixels()[p] + smooth_.pixels()[p] * smooth_change;
    }
    result.elapsed_ms = stopwatch.ms();
    return result;
}

}  // namespace fluorocut
