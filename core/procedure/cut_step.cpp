// time-out k and cut k: what must be confirmed, and the path of the plan as a motion of the robot.
#include <memory>

#include <fmt/format.h>

#include "core/base/utc.h"
#include "core/cutting/envelope_check.h"
#include "core/cutting/tool_path_file.h"
#include "core/procedure/cut_run.h"
#include "core/procedure/json_archive.h"
#include "core/procedure/steps.h"

namespace fluorocut {
namespace {

// Where the cutter believed to have been, frame `cavity` as commanded.
CaseContentItem traceItem(const CutRun& run, const CutOrder& order, const Rigid3& robot_from_cavity) {
    const Rigid3 cavity_from_robot = robot_from_cavity.inverse();
    nlohmann::ordered_json times = nlohmann::ordered_json::array(), places = times, forces = times;
    for (const CutSample& sample : run.trace) {
        times.push_back(sample.time_s);
        places.push_back(arrayOf(Vector3(cavity_from_robot * sample.robot_from_cutter.translation())));
        forces.push_back(sample.force_n);
    }
    CaseContentItem item;
    item.item.kind = ItemKind::result;
    item.item.schema = "fluorocut/cut-trace/1";
    item.item.file_name = fmt::format("cut_{}_trace.json", order.stage);
    item.bytes = nlohmann::ordered_json{{"schema", "fluorocut/cut-trace/1"},
                                        {"frame", "cavity"},
                                        {"done", run.done},
                                        {"time_s", std::move(times)},
                                        {"cutter_mm", std::move(places)},
                                        {"force_n", std::move(forces)}}
                     .dump() +
                 "\n";
    return item;
}

Result<CheckedMotion> checkedTwice(std::shared_ptr<const MotionProposal> proposal, const MotionEnvelope& envelope) {
    const Result<CheckToken> by_mesh = MeshMotionChecker(envelope).check(proposal);
    if (!by_mesh) return by_mesh.error();
    const Result<CheckToken> by_voxels = VoxelMotionChecker(envelope).check(proposal);
    if (!by_voxels) return by_voxels.error();
    return CheckedMotion::make(*by_mesh, *by_voxels);
}

}  // namespace

Result<StepOutput> timeOutStep(const ProcedureSetup& setup, int stage, const std::string& now_utc) {
    TimeOutResult result;
    result.stage = stage;
    result.patient = setup.patient.name;
    result.side = setup.patient.side;
    result.implant = setup.plan.implant;
    result.stage_name = stageName(setup, stage);
    result.calibrated_utc = setup.calibration.calibrated_utc;
    result.calibration_age_s = secondsBetween(result.calibrated_utc, now_utc);
    result.findings.acceptance.push_back(atLeast("calibration's age", result.calibration_age_s / 3600, 0, "h"));
    result.findings.summary =
        fmt::format("{}: {} side, {}, {}; calibrated {:.1f} h ago. Is all of that so?", result.patient, result.side,
                    result.implant, result.stage_name, result.calibration_age_s / 3600);
    return StepOutput{jsonText(result), {}};
}

Result<StepOutput> cutStep(const ProcedureSetup& setup, CutOrder order, const StepInputs& inputs, Supervisor& robot,
                           std::optional<CaseContentItem>& interrupted, Progress& progress) {
    const Result<PlanResult> plan = inputs.result("plan", parsePlan);
    if (!plan) return plan.error();
    const PlannedStage& stage = plan->stages[static_cast<std::size_t>(order.stage - 1)];
    const Result<TriangleMesh> mesh = readStageMesh(order.stage, inputs);
    if (!mesh) return mesh.error();
    const Result<ToolPath> path = readStagePath(order.stage, inputs);
    if (!path) return path.error();
    const double open_mm = setup.plan.path.openPlane(stage.top_mm);
    Result<TriangleMesh> envelope = openedUpward(*mesh, open_mm);
    if (!envelope) return envelope.error();

    const Rigid3 robot_from_cavity = order.robot_from_femur.target_from_source * setup.plan.femur_from_cavity;
    const Result<RobotFeedback> standing = whereItStands(robot);
    if (!standing) return standing.error();
    Result<std::vector<MotionStep>> steps =
        cuttingMotion(*path, {robot_from_cavity, standing->robot_from_cutter, open_mm});
    if (!steps) return steps.error();
    const auto proposal = std::make_shared<const MotionProposal>(
        MotionProposal{stageName(setup, order.stage), order.registration.id, std::move(*steps)});
    Result<CheckedMotion> motion =
        checkedTwice(proposal, {setup.plan.path.cutter, std::move(*envelope), open_mm, robot_from_cavity});
    if (!motion) return motion.error();

    MotionRequest request;
    request.registration = order.registration;
    request.registration.error_bound_mm =
        surfaceError(wallPoints(*mesh, stage.top_mm), announcedPlace(setup, order.robot_from_femur)).bound_mm;
    request.inset_mm = stage.inset_mm;
    request.motion = *motion;
    request.time_out = order.time_out;
    CutRun run;
    if (const Result<void> done = runCut(robot, request, run, progress); !done) {
        if (!run.trace.empty()) {
            interrupted = traceItem(run, order, robot_from_cavity);
            interrupted->item.file_name = fmt::format("cut_{}_interrupted.json", order.stage);
        }
        Error error = done.error();
        error.where = fmt::format("{}: {}", stageName(setup, order.stage), error.where);
        return error;
    }

    StepOutput output;
    output.products.push_back(traceItem(run, order, robot_from_cavity));
    CutStepResult result;
    result.stage = order.stage;
    result.registration = order.registration.id;
    result.robot_from_femur = order.robot_from_femur;
    result.robot_from_cavity = robot_from_cavity;
    result.inset_mm = stage.inset_mm;
    result.bound_mm = request.registration.error_bound_mm;
    result.checkers = {motion->firstChecker(), motion->secondChecker()};
    result.length_mm = run.length_mm;
    result.time_s = run.time_s;
    result.greatest_force_n = run.greatest_force_n;
    result.bone_rms_mm = run.bone_rms_mm;
    result.bone_rms_rad = run.bone_rms_rad;
    result.bone_most_mm = run.bone_most_mm;
    result.trace = output.products.back().hash();
    result.findings.acceptance.push_back(atLeast("share of the path that was run", run.done, 1, ""));
    if (!std::isfinite(run.bone_rms_mm))
        result.findings.doubts.emplace_back("the bone's monitor was silent during the cut");
    result.findings.summary =
        fmt::format("{} cut in {:.0f} s, with at most {:.0f} N; it may lie {:.2f} mm (95 %) from its place.",
                    stageName(setup, order.stage), run.time_s, run.greatest_force_n, result.bound_mm);
    output.json = jsonText(result);
    return output;
}

}  // namespace fluorocut
