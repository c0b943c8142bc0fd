#include "core/experiments/planned_operation.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/geometry/mesh_distance.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/primitives.h"
#include "core/io/mesh_file.h"
#include "core/io/resources.h"
#include "core/io/volume_file.h"
#include "core/planning/femur_shaft.h"
#include "core/planning/implant_file.h"
#include "core/planning/templating.h"
#include "core/simulation/acrylic_phantom.h"
#include "core/simulation/femur_phantom.h"

namespace fluorocut {
namespace {

constexpr double kAirHu = -1000;
// Of a bead's surface from the cavity: more than any first cut goes astray.
constexpr double kBeadClearance = 3.0;
constexpr double kBeadReach = 40;      // from the cavity's axis
constexpr double kBeadsBelow = 12;     // the cavity's bottom
constexpr double kAboveResection = 4;  // so that a tilted stem's top lies within the walls' levels

Result<Volume> patientVolume(const Scenario& scenario, Progress& progress) {
    const ScenarioPatient& patient = scenario.patient;
    switch (patient.kind) {
        case PatientKind::femur: {
            FemurOptions options;
            options.side = patient.side == Side::left ? BodySide::left : BodySide::right;
            options.voxel_mm = patient.voxel_mm;
            options.seed = patient.phantom_seed;
            options.soft_tissue = options.pelvis = patient.soft_tissue;
            auto femur = generateFemur(options, progress);
            if (!femur) return femur.error();
            return std::move(femur->ct);
        }
        case PatientKind::acrylic: {
            AcrylicOptions options;
            options.size_mm = patient.block_mm;
            options.voxel_mm = patient.voxel_mm;
            auto block = generateAcrylicBlock(options, progress);
            if (!block) return block.error();
            return std::move(block->ct);
        }
        case PatientKind::ct: {
            auto file = readVolume(patient.ct, {}, progress);
            if (!file) return file.error();
            return std::move(file->volume);
        }
    }
    throw std::logic_error("PatientKind outside its enumeration");
}

Result<FemurShaft> shaftOf(const Scenario& scenario, const Volume& ct, Progress& progress) {
    FemurShaftOptions search;
    search.side = scenario.patient.side;
    if (scenario.placement.axis_mm)
        search.axis = AxisLine{(*scenario.placement.axis_mm)[1], (*scenario.placement.axis_mm)[0]};
    return findFemurShaft(ct, search, progress);
}

void takeImplant(PlannedOperation& plan, const Implant& implant) {
    plan.implant = fmt::format("{} {}", implant.family, implant.size);
    plan.mesh = implant.in_bone;
    plan.top_mm = implant.resection_z_mm;
}

Result<void> templateStem(const Scenario& scenario, const Volume& ct, PlannedOperation& plan, Progress& progress) {
    SubProgress finding(progress, 0, 0.3), walling(progress, 0.3, 0.7), trying(progress, 0.7, 1);
    const auto shaft = shaftOf(scenario, ct, finding);
    if (!shaft) return shaft.error();
    const StemSeat seat{shaft->axis.proximal, shaft->axis.direction(), shaft->medial, shaft->side};
    const AxisLine axis{shaft->axis.distal, shaft->axis.proximal + kAboveResection * shaft->axis.direction()};
    const auto walls = findBoneWalls(ct, axis, {}, walling);
    if (!walls) return walls.error();
    std::vector<Implant> sizes;
    const auto path = findResource("implants", scenario.implant.stem);
    if (!path) return path.error();
    const auto family = readImplantFamily(*path);
    if (!family) return family.error();
    for (const StemSize& size : family->sizes) {
        if (!scenario.implant.size.empty() && size.name != scenario.implant.size) continue;
        auto implant = makeImplant(*family, {size.name, shaft->side});
        if (!implant) return implant.error();
        sizes.push_back(std::move(*implant));
    }
    if (sizes.empty())
        return invalidOption("implant.size", scenario.implant.size, "a size of " + scenario.implant.stem);
    const auto proposal = proposeStem(sizes, *walls, seat, {}, trying);
    if (!proposal) return proposal.error();
    for (const Implant& implant : sizes)
        if (implant.size == proposal->size) takeImplant(plan, implant);
    plan.femur_from_cavity = proposal->femur_from_cavity;
    plan.remarks.push_back(fmt::format("templated: {}, {:.2f} mm of room", plan.implant, -proposal->excess_mm));
    return {};
}

Result<void> shapeAndPlace(const Scenario& scenario, const Volume& ct, PlannedOperation& plan, Progress& progress) {
    const ScenarioImplant& wanted = scenario.implant;
    const std::optional<Rigid3>& given = scenario.placement.femur_from_cavity;
    if (!wanted.stem.empty() && !given) return templateStem(scenario, ct, plan, progress);
    if (!wanted.stem.empty()) {
        const auto implant = loadImplant(wanted.stem, {wanted.size, scenario.patient.side});
        if (!implant) return implant.error();
        takeImplant(plan, *implant);
    } else if (wanted.cuboid_mm) {
        const Vector3& size = *wanted.cuboid_mm;
        plan.implant = fmt::format("cuboid {:g} x {:g} x {:g} mm", size.x(), size.y(), size.z());
        plan.mesh = makeBox(size);
        for (Vector3& vertex : plan.mesh.vertices)
            vertex.z() -= 0.5 * size.z();
        plan.top_mm = 0;
    } else {
        auto mesh = readMesh(wanted.mesh);
        if (!mesh) return mesh.error();
        plan.implant = wanted.mesh.stem().string();
        plan.top_mm = mesh->info.properties.max_corner.z();
        plan.mesh = std::move(mesh->mesh);
    }
    if (given) {
        plan.femur_from_cavity = *given;
    } else if (scenario.patient.kind == PatientKind::acrylic) {
        plan.femur_from_cavity = Rigid3::fromTranslation({0, 0, 0.5 * scenario.patient.block_mm.z() - plan.top_mm});
    } else {
        const auto shaft = shaftOf(scenario, ct, progress);
        if (!shaft) return shaft.error();
        plan.femur_from_cavity =
            StemSeat{shaft->axis.proximal, shaft->axis.direction(), shaft->medial, shaft->side}.femurFromCavity(
                plan.top_mm);
    }
    return {};
}

// Air above the resection, near the axis; voxels that the plane passes through keep their part.
void openWound(Volume& ct, const PlannedOperation& plan, double radius_mm) {
    const VolumeGrid& grid = ct.grid();
    const Rigid3 cavity_from_femur = plan.femur_from_cavity.inverse();
    const Matrix3 axes = cavity_from_femur.rotationMatrix() * grid.direction;
    const double thick = axes.row(2).cwiseAbs().dot(grid.spacing_mm);  // of a voxel, along the cavity's z
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) {
                const Vector3 p = cavity_from_femur * grid.pointFromIndex(Vector3(i, j, k));
                const double above = std::clamp(0.5 + (p.z() - plan.top_mm) / thick, 0.0, 1.0);
                float& hu = ct(i, j, k);
                if (above > 0 && p.head<2>().norm() < radius_mm && hu > kAirHu)
                    hu += static_cast<float>(above * (kAirHu - hu));
            }
}

// Places where a bead is in bone all round, clear of the cavity.
Result<std::vector<Vector3>> placesForBeads(const Scenario& scenario, const Volume& ct, const PlannedOperation& plan) {
    const auto wall = MeshDistance::build(plan.mesh, "implant");
    if (!wall) return wall.error();
    const VolumeGrid& grid = ct.grid();
    const double radius = 0.5 * scenario.beads.diameter_mm;
    const auto inBone = [&](const Vector3& point) {
        return sampleLinear(ct, grid.indexFromPoint(point), static_cast<float>(kAirHu)) >
               scenario.patient.bone_above_hu;
    };
    std::vector<Vector3> places;
    constexpr double kStep = 2.5;
    for (double z = plan.bottom_mm - kBeadsBelow; z < plan.top_mm - 4; z += kStep)
        for (double y = -kBeadReach; y <= kBeadReach; y += kStep)
            for (double x = -kBeadReach; x <= kBeadReach; x += kStep) {
                const Vector3 in_cavity(x, y, z), place = plan.femur_from_cavity * in_cavity;
                if (!inBone(place)) continue;
                bool all_round = true;
                for (int axis = 0; axis < 3 && all_round; ++axis)
                    all_round =
                        inBone(place + radius * Vector3::Unit(axis)) && inBone(place - radius * Vector3::Unit(axis));
                if (all_round &&
                    wall->signedDistance(in_cavity) > radius + kBeadClearance + std::max(0.0, scenario.cut.offset_mm))
                    places.push_back(place);
            }
    return places;
}

// The farthest from all that have been chosen, again and again.
Result<BeadLayout> spreadBeads(const Scenario& scenario, const Volume& ct, const PlannedOperation& plan) {
    auto places = placesForBeads(scenario, ct, plan);
    if (!places) return places.error();
    if (places->size() < static_cast<std::size_t>(scenario.beads.count)) {
        return noSolution("beads", fmt::format("{} places in the bone beside the cavity", places->size()),
                          fmt::format("at least {}, {:g} mm from the cavity", scenario.beads.count, kBeadClearance),
                          "lower patient.bone_above_hu, or take fewer or smaller beads");
    }
    BeadLayout layout;
    layout.frame = Frame::femur;
    const Vector3 middle = plan.femur_from_cavity * Vector3(0, 0, 0.5 * (plan.top_mm + plan.bottom_mm));
    std::vector<double> distance;
    for (const Vector3& place : *places)
        distance.push_back(1e6 + (place - middle).norm());
    for (int n = 0; n < scenario.beads.count; ++n) {
        const auto far =
            static_cast<std::size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
        const Vector3 chosen = (*places)[far];
        layout.beads.push_back({fmt::format("b{}", n + 1), chosen, scenario.beads.diameter_mm});
        for (std::size_t i = 0; i < places->size(); ++i)
            distance[i] = std::min(distance[i], ((*places)[i] - chosen).norm());
    }
    if (auto ok = layout.validate(); !ok) return ok.error();
    return layout;
}

}  // namespace

Result<PlannedOperation> planOperation(const Scenario& scenario, Progress& progress) {
    if (auto ok = scenario.validate(); !ok) return ok.error();
    SubProgress making(progress, 0, 0.5), placing(progress, 0.5, 0.9);
    auto ct = patientVolume(scenario, making);
    if (!ct) return ct.error();
    PlannedOperation plan;
    if (auto ok = shapeAndPlace(scenario, *ct, plan, placing); !ok) return ok.error();
    plan.femur_from_cavity =
        plan.femur_from_cavity * Rigid3::fromTranslation({0, 0, -scenario.placement.below_resection_mm});
    if (auto ok = requireSolid(plan.mesh, "implant"); !ok) return ok.error();
    plan.bottom_mm = meshProperties(plan.mesh).min_corner.z();
    if (scenario.placement.open_wound_mm > 0) openWound(*ct, plan, scenario.placement.open_wound_mm);
    if (progress.isCancelled()) return cancelled("planned operation");
    auto beads = spreadBeads(scenario, *ct, plan);
    if (!beads) return beads.error();
    plan.beads = std::move(*beads);
    plan.ct = std::make_shared<const Volume>(std::move(*ct));
    progress.report(1, "planned");
    return plan;
}

}  // namespace fluorocut
