#include "app/desktop/sample_case.h"

#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "core/base/units.h"
#include "core/base/utc.h"
#include "core/fiducial/femur_beads.h"
#include "core/imaging/standard_views.h"
#include "core/io/resources.h"
#include "core/planning/bone_walls.h"
#include "core/planning/cavity.h"
#include "core/planning/femur_shaft.h"
#include "core/planning/implant_file.h"
#include "core/planning/templating.h"
#include "core/simulation/calibration_objects.h"
#include "core/simulation/femur_phantom.h"
#include "core/simulation/virtual_operating_room.h"
#include "ui/session/case_document.h"

namespace fluorocut::desktop {
namespace {

constexpr double kAboveResectionMm = 6;  // of bone walls, so that a tilted stem's top lies within them
constexpr double kCutterRadiusMm = 3;

struct Direction {
    const char* name;
    double orbital_deg, angulation_deg;
};
// AP and lateral are what a hip is planned in; those between make depth well known.
constexpr std::array<Direction, 6> kDirections{
    {{"AP", 0, 0}, {"LAO 30", 30, 0}, {"LAO 60", 60, 5}, {"Lateral", 90, 0}, {"RAO 30", -30, 5}, {"RAO 60", -60, -5}}};

// Beside the canal and in the trochanters, none behind another for long.
BeadLayout beadsIn(const FemurLandmarks& femur) {
    static constexpr std::array<std::array<double, 3>, 10> kPlaces{{{10, -6, 40},
                                                                    {16, 7, 31},
                                                                    {6, 11, 19},
                                                                    {-8, 9, 7},
                                                                    {10, -10, 0},
                                                                    {-9, -8, -12},
                                                                    {10, 4, -23},
                                                                    {-4, 11, -34},
                                                                    {6, -11, -45},
                                                                    {-9, 3, -54}}};
    BeadLayout layout;
    layout.frame = Frame::femur;
    for (const auto& [x, y, z] : kPlaces) {
        Bead bead;
        bead.name = std::string("b").append(std::to_string(layout.beads.size() + 1));
        bead.center_mm = {x, y, z};
        for (const Vector3& middle : femur.shaft_axis_mm)
            if (z < 0 && std::abs(middle.z() - z) < 6) bead.center_mm += Vector3(middle.x(), middle.y(), 0);
        layout.beads.push_back(std::move(bead));
    }
    return layout;
}

// A calibrated flat panel: no bending, and its data sheet is right.
OperatingRoomOptions roomOptions(const SampleOptions& options) {
    OperatingRoomOptions room;
    room.nominal_carm = standardCArm().binned(2);
    room.focal_length_error_mm = room.focal_length_sag_mm = room.principal_point_error_px = 0;
    room.intensifier = IntensifierOptions::none();
    // The room's axes are the patient's. Head and tip of a stem in the picture, little of the air beside the hip.
    room.planned_room_from_femur = Rigid3::fromTranslation({18, 0, 20});
    room.xray.brightness = 0.45;  // for bone: what is thin becomes white
    room.patient_offset_mm = 4;
    room.return_offset_mm = 8;
    room.xray.photons_per_pixel = options.photons_per_pixel;
    room.seed = 5;
    return room;
}

Result<std::vector<ui::CaseView>> takePictures(const std::shared_ptr<const Volume>& ct, const BeadLayout& layout,
                                               const SampleOptions& options, Progress& progress) {
    const OperatingRoomOptions room_options = roomOptions(options);
    Result<VirtualOperatingRoom> room = VirtualOperatingRoom::create(ct, room_options);
    if (!room) return room.error();
    Result<HeldObject> beads = heldBeads("beads", layout, HeldBy::patient, Rigid3(), Material::steel);
    if (!beads) return beads.error();
    if (const Result<void> held = room->hold(std::move(*beads)); !held) return held.error();

    std::vector<ui::CaseView> views;
    for (const Direction& direction : kDirections) {
        progress.report(static_cast<double>(views.size()) / kDirections.size(), "taking pictures");
        if (progress.isCancelled()) return cancelled("the sample case");
        ui::CaseView view;
        view.name = direction.name;
        view.position = {radiansFromDegrees(direction.orbital_deg), radiansFromDegrees(direction.angulation_deg),
                         Vector3::Zero()};
        ImageRequest request;
        request.position = view.position;
        Result<AcquiredImage> taken = room->acquire(request, Progress::none());
        if (!taken) return taken.error();
        view.carm = room_options.nominal_carm;
        view.before.image = std::make_shared<const Image>(std::move(taken->image));
        views.push_back(std::move(view));
    }
    return views;
}

Result<void> registerViews(std::vector<ui::CaseView>& views, const BeadLayout& layout, Progress& progress) {
    std::vector<FemurView> shadows;
    BeadDetectionOptions detection;
    detection.least_diameter_px = 3.5;  // 6 at the isocentre
    detection.most_diameter_px = 12;
    for (const ui::CaseView& view : views) {
        progress.report(0.8 * static_cast<double>(shadows.size()) / static_cast<double>(views.size()), "finding beads");
        if (progress.isCancelled()) return cancelled("the sample case");
        Result<BeadDetections> found = detectBeads(*view.before.image, detection);
        if (!found) return found.error();
        FemurView shadow;
        shadow.name = view.name;
        shadow.detections = std::move(found->beads);
        shadow.carm = view.carm;
        shadows.push_back(std::move(shadow));
    }
    SubProgress solving(progress, 0.8, 1);
    const Result<FemurBeads> beads = registerBeads(shadows, layout, {}, solving);
    if (!beads) return beads.error();
    for (ui::CaseView& view : views) {
        view.before.unregistered_because = "its beads were not recognised";
        for (const FemurViewPose& pose : beads->views) {
            if (pose.name != view.name) continue;
            view.before.imager_from_femur = pose.imager_from_femur;
            view.before.registration_mm = pose.fre_mm;
            view.before.unregistered_because.clear();
        }
    }
    return {};
}

Result<ui::ImplantPlan> planStem(const Volume& ct, const FemurShaft& shaft, const SampleOptions& options,
                                 Progress& progress) {
    const StemSeat seat{shaft.axis.proximal, shaft.axis.direction(), shaft.medial, shaft.side};
    const AxisLine axis{shaft.axis.distal, shaft.axis.proximal + kAboveResectionMm * shaft.axis.direction()};
    SubProgress walling(progress, 0, 0.5);
    const Result<BoneWalls> walls = findBoneWalls(ct, axis, {}, walling);
    if (!walls) return walls.error();

    const auto path = findResource("implants", "straight");
    if (!path) return path.error();
    const Result<ImplantFamily> family = readImplantFamily(*path);
    if (!family) return family.error();
    std::vector<Implant> sizes;
    for (const StemSize& size : family->sizes) {
        Result<Implant> implant = makeImplant(*family, {.size = size.name, .side = shaft.side});
        if (!implant) return implant.error();
        sizes.push_back(std::move(*implant));
    }
    SubProgress trying(progress, 0.5, 0.7);
    const Result<TemplateProposal> proposal = proposeStem(sizes, *walls, seat, {}, trying);
    if (!proposal) return proposal.error();
    std::size_t chosen = 0;
    for (std::size_t i = 0; i < sizes.size(); ++i)
        if (sizes[i].size == proposal->size) chosen = i;

    ui::ImplantPlan plan;
    plan.family = "straight";
    plan.size = proposal->size;
    plan.implant = std::make_shared<const Implant>(sizes[chosen]);
    plan.mesh = std::make_shared<const TriangleMesh>(sizes[chosen].parts.front().mesh);
    plan.femur_from_implant = proposal->femur_from_cavity;
    plan.cutter_radius_mm = kCutterRadiusMm;
    plan.insets_mm = stageInsets(options.stages, options.first_inset_mm);
    CavityOptions cavity_options;
    cavity_options.cutter_radius_mm = kCutterRadiusMm;
    SubProgress milling(progress, 0.7, 1);
    const Result<Cavity> cavity = planCavity(sizes[chosen].in_bone, cavity_options, milling);
    if (!cavity) return cavity.error();
    for (const double inset : plan.insets_mm) {
        if (progress.isCancelled()) return cancelled("the sample case");
        Result<Cavity> stage = insetCavity(*cavity, inset);
        if (!stage) return stage.error();
        plan.cavities.push_back(std::make_shared<const TriangleMesh>(std::move(stage->mesh)));
    }
    return plan;
}

}  // namespace

Result<ui::CaseState> makeSampleCase(const SampleOptions& options, Progress& progress) {
    ui::CaseState state;
    state.patient = "Sample (simulated)";
    state.side = "left";
    state.calibrated_utc = utcNow();

    FemurOptions femur_options;
    femur_options.voxel_mm = options.voxel_mm;
    SubProgress generating(progress, 0, 0.2);
    Result<FemurPhantom> femur = generateFemur(femur_options, generating);
    if (!femur) return femur.error();
    const auto ct = std::make_shared<const Volume>(std::move(femur->ct));
    state.ct = ct;

    const BeadLayout layout = beadsIn(femur->landmarks);
    SubProgress taking(progress, 0.2, 0.45);
    Result<std::vector<ui::CaseView>> views = takePictures(ct, layout, options, taking);
    if (!views) return views.error();
    SubProgress registering(progress, 0.45, 0.6);
    if (const Result<void> done = registerViews(*views, layout, registering); !done) return done.error();
    state.views = std::move(*views);
    for (const Bead& bead : layout.beads)
        state.beads.push_back(bead.center_mm);

    SubProgress finding(progress, 0.6, 0.7);
    const Result<FemurShaft> shaft = findFemurShaft(*ct, {}, finding);
    if (!shaft) return shaft.error();
    state.canal = ui::CanalAxis{shaft->axis.distal, shaft->axis.proximal};
    SubProgress planning(progress, 0.7, 1);
    Result<ui::ImplantPlan> plan = planStem(*ct, *shaft, options, planning);
    if (!plan) return plan.error();
    state.plan = std::move(*plan);
    return state;
}

Result<ui::CaseState> sampleCase(const std::filesystem::path& cache, Progress& progress) {
    std::error_code ignored;
    if (std::filesystem::exists(cache, ignored)) {
        Result<ui::CaseState> kept = ui::readCase(cache, progress);
        if (kept || kept.error().isCancelled()) return kept;
    }
    SubProgress making(progress, 0, 0.95);
    Result<ui::CaseState> made = makeSampleCase({}, making);
    if (!made) return made;
    std::filesystem::create_directories(cache.parent_path(), ignored);
    // Its place is taken only once it is whole: two programs may do this at once.
    (void)ui::writeCase(cache, *made);
    return made;
}

}  // namespace fluorocut::desktop
