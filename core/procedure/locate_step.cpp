// locate k: where in the femur the cavity of stage k was really cut.
#include <fmt/format.h>

#include "core/base/units.h"
#include "core/cavity/cavity_location.h"
#include "core/cutting/removal.h"
#include "core/procedure/chain_measurement.h"
#include "core/procedure/steps.h"

namespace fluorocut {
namespace {

// Of the way in above a cavity's top that is looked for too: a cavity that lies deeper than planned has no lid. Beyond
// what a cut goes astray it tells nothing, and would bring more of the wound into the picture.
constexpr double kWayIn_mm = 3;
constexpr double kBlurred_px = 3;

// imager_from_femur of every view, by the beads in the bone.
Result<FemurBeads> posesOf(const ProcedureSetup& setup, const StageImages& taken, Progress& progress) {
    std::vector<FemurView> views;
    for (std::size_t i = 0; i < setup.views.size(); ++i) {
        Result<FemurView> view =
            beadViewOf(setup.views[i].name, taken.images[i], setup.views[i].carm, setup.patient.beads);
        if (!view) return view.error();
        views.push_back(std::move(*view));
    }
    const ProcedureCalibration& known = setup.calibration;
    FemurBeadOptions options;
    options.uncertainty.focal_length = known.focal_length_sigma_mm / setup.views.front().carm.focal_length_mm;
    options.uncertainty.principal_point_px = known.image_centre_sigma_px;
    options.uncertainty.bead_mm = known.bead_sigma_mm;
    Result<FemurBeads> beads = registerBeads(views, setup.patient.beads, options, progress);
    if (beads && !beads->rejected.empty())
        return noSolution("beads", beads->rejected.front(), "the femur's beads in every view", "take the images again");
    return beads;
}

// Where the beads are seen, and what is blurred around them: no CT has them sharp.
std::vector<CoveredDisc> shadowsOf(const BeadLayout& beads, const CavityView& view) {
    std::vector<CoveredDisc> shadows;
    for (const Bead& bead : beads.beads) {
        const Vector3 at = view.after_imager_from_femur * bead.center_mm;
        const double px_per_mm = view.carm.focal_length_mm / (at.z() * view.carm.pixel_mm.mean());
        shadows.push_back({view.carm.project(at), 0.5 * bead.diameter_mm * px_per_mm + kBlurred_px});
    }
    return shadows;
}

}  // namespace

Result<StepOutput> locateStep(const ProcedureSetup& setup, int stage, const StepInputs& inputs, Progress& progress) {
    const Result<PlanResult> plan = inputs.result("plan", parsePlan);
    if (!plan) return plan.error();
    const Result<StageImages> after = readImages(setup, stage, inputs);
    if (!after) return after.error();
    const Result<TriangleMesh> mesh = readStageMesh(stage, inputs);
    if (!mesh) return mesh.error();
    const double top_mm = plan->stages[static_cast<std::size_t>(stage - 1)].top_mm;
    const Result<ToolPath> path = readStagePath(stage, inputs);
    if (!path) return path.error();
    const TriangleMesh milled = milledShape(*path, top_mm + kWayIn_mm);
    SubProgress seeing(progress, 0, 0.3), locating(progress, 0.3, 1);
    const Result<FemurBeads> beads = posesOf(setup, *after, seeing);
    if (!beads) return beads.error();
    std::vector<CavityView> views;
    for (std::size_t i = 0; i < setup.views.size(); ++i) {
        CavityView view;
        view.name = setup.views[i].name;
        view.after = after->images[i];
        view.carm = setup.views[i].carm;
        view.after_imager_from_femur = beads->views[i].imager_from_femur.target_from_source;
        view.covered = shadowsOf(setup.patient.beads, view);
        views.push_back(std::move(view));
    }
    if (!setup.patient.ct) {
        // The images before the first cut stand in its place.
        const Result<StageImages> before = readImages(setup, 0, inputs);
        if (!before) return before.error();
        const Result<FemurBeads> poses = posesOf(setup, *before, Progress::none());
        if (!poses) return poses.error();
        for (std::size_t i = 0; i < views.size(); ++i) {
            views[i].before = before->images[i];
            views[i].before_imager_from_femur = poses->views[i].imager_from_femur.target_from_source;
        }
    }
    CavityLocationOptions options;
    options.mu_water_per_mm = setup.patient.mu_water_per_mm;
    const Result<CavityLocation> found =
        locateCavity(views, milled, setup.plan.femur_from_cavity, setup.patient.ct, options, locating);
    if (!found) return found.error();

    LocationResult result;
    result.stage = stage;
    result.femur_from_cut_cavity = found->femur_from_cavity;
    const std::vector<SurfacePoint> walls = wallPoints(*mesh, top_mm);
    result.offset = offsetOf(walls, setup.plan.femur_from_cavity, result.femur_from_cut_cavity.target_from_source);
    result.bound_mm = surfaceError(walls, result.femur_from_cut_cavity).bound_mm;
    result.weak_directions = found->weak_directions;
    for (std::size_t i = 0; i < found->views.size(); ++i) {
        const ViewResidual& view = found->views[i];
        result.views.push_back({view.name, view.rms_log, view.pose_sigmas, view.evidence, beads->views[i].fre_px,
                                beads->views[i].imager_from_femur});
        if (!(view.pose_sigmas <= options.limits.most_view_sigmas)) {
            result.findings.doubts.push_back(
                fmt::format("the view {} contradicts the others: its pose had to be changed by {:.1f} standard "
                            "deviations",
                            view.name, view.pose_sigmas));
        }
        if (!(view.evidence >= options.limits.least_evidence)) {
            result.findings.doubts.push_back(
                fmt::format("the view {} shows {:.0f} % of the cavity's contrast; is it an image after the cut?",
                            view.name, 100 * view.evidence));
        }
    }
    result.findings.warnings = beads->warnings;
    result.findings.warnings.insert(result.findings.warnings.end(), found->warnings.begin(), found->warnings.end());
    for (const std::string& weak : found->weak_directions)
        result.findings.warnings.push_back(weak);
    result.findings.acceptance = beads->acceptance;
    result.findings.acceptance.insert(result.findings.acceptance.end(), found->acceptance.begin(),
                                      found->acceptance.end());
    result.findings.summary = fmt::format(
        "The cavity of {} lies {:.2f} mm and {:.2f} degrees from its plan (at its worst place), known to {:.2f} mm "
        "(95 %).",
        stageName(setup, stage), result.offset.most_mm, degreesFromRadians(result.offset.turn_rad), result.bound_mm);
    return StepOutput{jsonText(result), {}};
}

}  // namespace fluorocut
