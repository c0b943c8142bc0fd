#include "core/simulation/femur_phantom.h"

#include <algorithm>
#include <cmath>

#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/base/stopwatch.h"
#include "core/simulation/implicit.h"
#include "core/simulation/pelvis_shape.h"
#include "core/simulation/soft_tissue.h"
#include "core/simulation/voxel_count.h"

namespace fluorocut {
namespace {

constexpr int kBlock = 8;  // voxels; whole blocks far from bone skip its evaluation
constexpr double kAirHu = -1000;

// The part of a voxel on the negative side of a surface at signed distance f: a box filter across the surface.
double covered(double f, double voxel_mm) {
    return std::clamp(0.5 - f / voxel_mm, 0.0, 1.0);
}

double mixed(double from, double to, double fraction) {
    return from + fraction * (to - from);
}

// Everything that a left hip is made of, in the frame `bone`.
struct Patient {
    const FemurOptions& options;
    FemurShape shape;
    FemurTissue bone;
    SoftTissue soft;
    PelvisShape pelvis;
    LatticeNoise noise;
    std::optional<RemovedImplant> removed;

    Patient(const FemurOptions& o, const FemurShape& s)
        : options(o),
          shape(s),
          bone(shape, o.densities, o.seed),
          soft(s.scale(), s.headCenter(), o.fat_mm, o.seed),
          pelvis(s.headCenter(), s.headRadius(), s.scale()),
          noise(o.seed ^ 0x165667b1u) {
        if (o.removed_implant) {
            removed.emplace(shape, *o.removed_implant, shape.canalWidth(shape.isthmusLevel()), o.seed);
        }
    }

    double surroundings(const Vector3& p, const SoftTissue::Box& box) const {
        if (box.allInside(options.voxel_mm)) return box.tissue(p);
        const double part = covered(box.skin(p), options.voxel_mm);
        return part > 0 ? mixed(kAirHu, box.tissue(p), part) : kAirHu;
    }

    double withPelvis(const Vector3& p, double around) const {
        const double f = pelvis.outer(p);
        const double part = covered(f, options.voxel_mm);
        if (part > 0) return mixed(around, pelvis.tissue(p, -f, noise, options.densities.trabecular_hu), part);
        // Joint space and capsule: cartilage and fluid.
        const double joint = (p - shape.headCenter()).norm() - shape.headRadius();
        if (options.soft_tissue && f < 4 && joint < 5) return mixed(around, 65, implicit::smoothStep(4, 2, f));
        return around;
    }

    double withFemur(const Vector3& p, double around) const {
        const double voxel = options.voxel_mm;
        const auto [f, endosteal] = shape.walls(p);
        if (f > voxel) return around;
        double spongy = 0;
        const double in_canal = covered(endosteal, voxel);
        if (in_canal > 0) spongy = bone.inside(p, -endosteal);
        if (!removed) {
            const double part = covered(f, voxel);
            return mixed(around, in_canal < 1 ? mixed(bone.cortical(p), spongy, in_canal) : spongy, part);
        }
        const double cavity = removed->cavity(p, f);
        spongy =
            mixed(spongy, 0.55 * options.densities.cortical_hu, removed->sclerosis(cavity) * (spongy > 0 ? 1 : 0.3));
        spongy = mixed(spongy, options.removed_implant->cement_hu, covered(removed->plug(p), voxel));
        double value = in_canal < 1 ? mixed(bone.cortical(p), spongy, in_canal) : spongy;
        const double in_cavity = covered(cavity, voxel);
        if (in_cavity > 0) value = mixed(value, removed->filling(p), in_cavity);
        // Where head and neck were, fluid and scar.
        const double gone = covered(removed->resected(p), voxel);
        const double instead = options.soft_tissue ? 30 : kAirHu;
        value = mixed(value, instead, gone);
        return mixed(around, value, covered(f, voxel));
    }
};

struct Extent {
    Vector3 low, high;
};

// What the volume holds: the femur with a margin, or the hip with its soft tissue.
Extent extent(const FemurOptions& options, double scale, const Vector3& head, double radius) {
    if (!options.soft_tissue && !options.pelvis) {
        return {Vector3(head.x() - radius - 8, std::min(head.y() - radius, -20 * scale) - 12, -options.shaft_length_mm),
                Vector3(32 * scale,
                        36 * scale + options.shaft_length_mm * options.shaft_length_mm / (2 * options.bow_radius_mm),
                        std::max(head.z() + radius, 62 * scale) + 8)};
    }
    return {Vector3(head.x() - 86 * scale, -96 * scale, -options.shaft_length_mm),
            Vector3(84 * scale, 106 * scale, head.z() + 76 * scale)};
}

VolumeGrid makeGrid(const FemurOptions& options, const Extent& box) {
    VolumeGrid grid;
    for (int axis = 0; axis < 3; ++axis) {
        grid.size[static_cast<std::size_t>(axis)] =
            static_cast<int>(std::ceil((box.high[axis] - box.low[axis]) / options.voxel_mm));
    }
    grid.spacing_mm = Vector3::Constant(options.voxel_mm);
    grid.origin_mm = box.low + Vector3::Constant(0.5 * options.voxel_mm);
    return grid;
}

// Without its canal fitted.
FemurShape plainShape(const FemurOptions& options) {
    const CanalShape canal = typicalCanal(options.dorr);
    const double scale = options.head_diameter_mm / 46;
    return FemurShape({options.head_diameter_mm, options.femoral_offset_mm, options.neck_shaft_angle_rad,
                       options.anteversion_rad, options.neck_base_mm, options.bow_radius_mm,
                       options.canal_flare_index.value_or(canal.flare_index),
                       options.isthmus_canal_mm.value_or(canal.isthmus_mm * scale)});
}

FemurLandmarks landmarksOf(const FemurShape& shape, const FemurOptions& options) {
    FemurLandmarks marks;
    const double s = shape.scale();
    marks.head_center_mm = shape.headCenter();
    marks.head_radius_mm = shape.headRadius();
    marks.neck_base_mm = shape.neckBase();
    marks.neck_direction = shape.neckDirection();
    for (double z = 0; z >= -options.shaft_length_mm; z -= 10)
        marks.shaft_axis_mm.push_back(shape.shaftAxis(z));
    marks.greater_trochanter_mm = shape.extremePoint(Vector3::UnitZ(), s * Vector3(6, 0, 60));
    marks.lesser_trochanter_mm = shape.extremePoint(Vector3(-0.72, 0.7, 0).normalized(), s * Vector3(-24, 23, 0));
    marks.isthmus_mm = shape.shaftAxis(shape.isthmusLevel());
    marks.isthmus_outer_mm = shape.outerWidth(shape.isthmusLevel());
    marks.isthmus_canal_mm = shape.canalWidth(shape.isthmusLevel());
    marks.canal_flare_index = shape.canalWidth(shape.flareLevel()) / marks.isthmus_canal_mm;
    return marks;
}

// Left to right: the mirror image in x, voxel by voxel.
void mirror(FemurPhantom& phantom) {
    const VolumeGrid& left = phantom.ct.grid();
    VolumeGrid grid = left;
    grid.origin_mm.x() = -(left.origin_mm.x() + (left.size[0] - 1) * left.spacing_mm.x());
    std::vector<float> voxels = std::move(phantom.ct.voxels());
    const auto row = static_cast<std::size_t>(grid.size[0]);
    for (std::size_t begin = 0; begin < voxels.size(); begin += row)
        std::reverse(voxels.begin() + static_cast<std::ptrdiff_t>(begin),
                     voxels.begin() + static_cast<std::ptrdiff_t>(begin + row));
    phantom.ct = Volume(grid, std::move(voxels));

    FemurLandmarks& marks = phantom.landmarks;
    for (Vector3* point : {&marks.head_center_mm, &marks.neck_base_mm, &marks.neck_direction,
                           &marks.greater_trochanter_mm, &marks.lesser_trochanter_mm, &marks.isthmus_mm})
        point->x() = -point->x();
    for (Vector3& point : marks.shaft_axis_mm)
        point.x() = -point.x();
    if (phantom.removed_implant) {
        RemovedImplantFacts& facts = *phantom.removed_implant;
        facts.resection_point.x() = -facts.resection_point.x();
        facts.resection_normal.x() = -facts.resection_normal.x();
        for (Vector3& point : facts.cavity_axis)
            point.x() = -point.x();
    }
}

void fillBlock(const Patient& patient, Volume& ct, const std::array<int, 3>& first) {
    const VolumeGrid& grid = ct.grid();
    const double voxel = grid.spacing_mm.x();
    std::array<int, 3> end;
    for (std::size_t axis = 0; axis < 3; ++axis)
        end[axis] = std::min(first[axis] + kBlock, grid.size[axis]);
    const Vector3 center =
        grid.pointFromIndex(Vector3(first[0], first[1], first[2]) + Vector3::Constant(0.5 * (kBlock - 1)));
    // The implicit functions are not exact distances away from the surface: a generous margin.
    const double reach = 2.5 * 0.5 * std::sqrt(3.0) * kBlock * voxel + 4;
    const bool femur_near = patient.shape.outer(center) < reach;
    const bool pelvis_near = patient.options.pelvis && patient.pelvis.outer(center) < reach;
    SoftTissue::Box soft;
    bool in_air = true;
    if (patient.options.soft_tissue) {
        const Vector3 half = Vector3::Constant(0.5 * kBlock * voxel);
        soft = patient.soft.box(center - half, center + half);
        in_air = soft.allOutside(voxel);
    }
    if (in_air && !pelvis_near && !femur_near) return;  // the volume was filled with air
    for (int k = first[2]; k < end[2]; ++k)
        for (int j = first[1]; j < end[1]; ++j)
            for (int i = first[0]; i < end[0]; ++i) {
                const Vector3 p = grid.pointFromIndex(Vector3(i, j, k));
                double value = in_air ? kAirHu : patient.surroundings(p, soft);
                if (pelvis_near) value = patient.withPelvis(p, value);
                if (femur_near) value = patient.withFemur(p, value);
                ct(i, j, k) = static_cast<float>(value);
            }
}

}  // namespace

CanalShape typicalCanal(DorrType type) {
    switch (type) {
        case DorrType::A:
            return {5.0, 9.2};
        case DorrType::B:
            return {3.8, 12.0};
        case DorrType::C:
            return {2.7, 16.5};
    }
    throw std::logic_error("typicalCanal: unknown Dorr type");
}

Result<void> FemurOptions::validate() const {
    if (auto ok = requireRange("head_diameter_mm", head_diameter_mm, 36, 60, "mm"); !ok) return ok;
    if (auto ok = requireRange("femoral_offset_mm", femoral_offset_mm, 25, 65, "mm"); !ok) return ok;
    if (auto ok = requireRange("neck_shaft_angle_rad", neck_shaft_angle_rad, radiansFromDegrees(105),
                               radiansFromDegrees(150), "rad (105 to 150 degrees)");
        !ok) {
        return ok;
    }
    if (auto ok = requireRange("anteversion_rad", anteversion_rad, radiansFromDegrees(-20), radiansFromDegrees(45),
                               "rad (-20 to 45 degrees)");
        !ok) {
        return ok;
    }
    if (auto ok = requireRange("neck_base_mm", neck_base_mm, 0, 40, "mm"); !ok) return ok;
    if (auto ok = requireRange("bow_radius_mm", bow_radius_mm, 500, 1e6, "mm"); !ok) return ok;
    if (auto ok = requireRange("shaft_length_mm", shaft_length_mm, 40, 250, "mm"); !ok) return ok;
    const CanalShape canal = typicalCanal(dorr);
    if (auto ok = requireRange("canal_flare_index", canal_flare_index.value_or(canal.flare_index), 1.5, 8, ""); !ok) {
        return ok;
    }
    if (auto ok = requireRange("isthmus_canal_mm", isthmus_canal_mm.value_or(canal.isthmus_mm), 4, 30, "mm"); !ok) {
        return ok;
    }
    if (auto ok = requireRange("densities.cortical_hu", densities.cortical_hu, 300, 3000, "HU"); !ok) return ok;
    if (auto ok = requireRange("densities.trabecular_hu", densities.trabecular_hu, 0, 1000, "HU"); !ok) return ok;
    if (auto ok = requireRange("densities.marrow_hu", densities.marrow_hu, -150, 150, "HU"); !ok) return ok;
    if (auto ok = requireRange("fat_mm", fat_mm, 2, 60, "mm"); !ok) return ok;
    if (auto ok = requireRange("voxel_mm", voxel_mm, 0.2, 4, "mm"); !ok) return ok;
    if (removed_implant) {
        if (auto ok = removed_implant->validate(); !ok) return ok;
    }
    const Extent box = extent(*this, head_diameter_mm / 46, plainShape(*this).headCenter(), 0.5 * head_diameter_mm);
    return requireVoxelCount(((box.high - box.low) / voxel_mm + Vector3::Ones()).prod());
}

Result<FemurShape> femurShape(const FemurOptions& options) {
    if (auto ok = options.validate(); !ok) return ok.error();
    FemurShape shape = plainShape(options);
    if (auto ok = shape.fitCanal({options.isthmus_canal_mm.has_value(), options.canal_flare_index.has_value()}); !ok)
        return ok.error();
    return shape;
}

Result<FemurPhantom> generateFemur(const FemurOptions& options, Progress& progress) {
    const Stopwatch stopwatch;
    constexpr const char* kStep = "generating the femur";
    progress.report(0, kStep);
    const auto shape = femurShape(options);
    if (!shape) return shape.error();
    const Patient patient(options, *shape);

    const VolumeGrid grid =
        makeGrid(options, extent(options, shape->scale(), shape->headCenter(), shape->headRadius()));
    FemurPhantom phantom{Volume(grid, kAirHu), landmarksOf(*shape, options), std::nullopt, 0};
    if (patient.removed) phantom.removed_implant = patient.removed->facts();

    // Layer by layer, so that progress and cancellation stay on this thread; inside a layer, rows of blocks in
    // parallel.
    for (int z = 0; z < grid.size[2]; z += kBlock) {
        if (progress.isCancelled()) return cancelled(kStep);
        progress.report(double(z) / grid.size[2], kStep);
        const int rows = (grid.size[1] + kBlock - 1) / kBlock;
        parallelFor(static_cast<std::size_t>(rows), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t row = begin; row < end; ++row)
                for (int x = 0; x < grid.size[0]; x += kBlock)
                    fillBlock(patient, phantom.ct, {x, static_cast<int>(row) * kBlock, z});
        });
    }
    if (options.side == BodySide::right) mirror(phantom);
    progress.report(1, kStep);
    phantom.elapsed_ms = stopwatch.ms();
    return phantom;
}

}  // namespace fluorocut
