// correct k: the registration by all that was measured so far.
//
// Stage j was commanded at C_j = robot_from_cavity and cut at L_j = femur_from_cavity, so that it says of the
// registration
//
//     robot_from_femur = C_j L_j^-1,     covariance: of L_j, carried over, and of the robot's own error in that cut
//
// which is put together with the registration from the first images (pose_fusion.h). What is left after the next cut
// is the error of this estimate and that cut's own.
#include <algorithm>

#include <fmt/format.h>

#include "core/base/chi_square.h"
#include "core/base/units.h"
#include "core/procedure/pose_fusion.h"
#include "core/procedure/steps.h"

namespace fluorocut {
namespace {

struct CutAndFound {
    CutStepResult cut;
    LocationResult location;
    MeasuredPose measured;  // robot_from_femur
    Matrix6 common;         // of all locations, as it shows in this one
};

Result<CutAndFound> readCut(const ProcedureSetup& setup, int stage, const StepInputs& inputs) {
    Result<CutStepResult> cut = inputs.result(fmt::format("cut {}", stage), parseCut);
    if (!cut) return cut.error();
    Result<LocationResult> location = inputs.result(fmt::format("locate {}", stage), parseLocation);
    if (!location) return location.error();
    if (!location->femur_from_cut_cavity.covariance)
        return invalidInput(fmt::format("locate {}", stage), "a pose without covariance", "one with it");
    const Pose commanded{Frame::robot, Frame::cavity, cut->robot_from_cavity,
                         processCovariance(setup, cut->bone_rms_mm, cut->bone_rms_rad)};
    // About its own axis a cavity is found wrong by something else in every cut, as its section differs.
    Pose located = location->femur_from_cut_cavity;
    const Vector3 axis = located.target_from_source.rotationMatrix().col(2);
    located.covariance->bottomRightCorner<3, 3>() +=
        setup.calibration.location_sigma_roll_rad * setup.calibration.location_sigma_roll_rad * axis * axis.transpose();
    const Pose measured = commanded * located.inverse();
    // The same chain with nothing but the common error in it.
    Pose common = location->femur_from_cut_cavity;
    const ProcedureCalibration& known = setup.calibration;
    Vector6 variance;
    variance << Vector3::Constant(known.location_sigma_mm * known.location_sigma_mm),
        Vector3::Constant(known.location_sigma_rad * known.location_sigma_rad);
    common.covariance = Matrix6(variance.asDiagonal());
    const Pose exact{Frame::robot, Frame::cavity, cut->robot_from_cavity, Matrix6(Matrix6::Zero())};
    const Matrix6 shared = *(exact * common.inverse()).covariance;
    return CutAndFound{
        std::move(*cut), std::move(*location), {measured.target_from_source, *measured.covariance}, shared};
}

// How likely is a cut that lies as far off, by what was known before it?
double probabilityOf(const CutAndFound& last) {
    const Pose& used = last.cut.robot_from_femur;
    if (!used.covariance) return 0;
    const Vector6 off = last.measured.pose.deltaFrom(used.target_from_source);
    const Matrix6 spread = *used.covariance + last.measured.covariance + last.common;
    return chiSquareTail(std::max(0.0, off.dot(spread.ldlt().solve(off))), 6);
}

}  // namespace

Result<StepOutput> correctStep(const ProcedureSetup& setup, int stage, const StepInputs& inputs, Progress&) {
    const Result<PlanResult> plan = inputs.result("plan", parsePlan);
    if (!plan) return plan.error();
    const Result<RegistrationResult> registration = inputs.result("register", parseRegistration);
    if (!registration) return registration.error();
    std::vector<CutAndFound> cuts;
    std::vector<MeasuredPose> measurements;
    for (int j = 1; j <= stage; ++j) {
        Result<CutAndFound> cut = readCut(setup, j, inputs);
        if (!cut) return cut.error();
        measurements.push_back(cut->measured);
        cuts.push_back(std::move(*cut));
    }
    const CutAndFound& last = cuts.back();
    const Result<FusedPose> fused =
        fusePoses({registration->robot_from_femur.target_from_source, *registration->robot_from_femur.covariance},
                  measurements, last.common);
    if (!fused) return fused.error();

    CorrectionResult result;
    StepFindings& findings = result.findings;
    result.stage = stage;
    result.robot_from_femur = {Frame::robot, Frame::femur, fused->pose, fused->covariance};
    result.offset = last.location.offset;
    result.announced_mm = last.cut.bound_mm;
    result.probability = probabilityOf(last);
    // The weights as they act at the cavity: those of the femur's origin would mix turns into places.
    const Rigid3& femur_from_cavity = setup.plan.femur_from_cavity;
    const Matrix6 there = productByLeft(fused->pose, femur_from_cavity);
    const Matrix6 weight = there * fused->weights.back() * there.inverse();
    result.gain_place = weight.topLeftCorner<3, 3>().trace() / 3;
    result.gain_turn = weight.bottomRightCorner<3, 3>().trace() / 3;
    const auto stageOf = [&](int k) -> const PlannedStage& { return plan->stages[static_cast<std::size_t>(k - 1)]; };
    const Result<TriangleMesh> mesh = readStageMesh(stage, inputs);
    if (!mesh) return mesh.error();
    result.correction =
        offsetOf(wallPoints(*mesh, stageOf(stage).top_mm), last.cut.robot_from_cavity, fused->pose * femur_from_cavity);

    if (!(result.probability >= setup.limits.least_probability)) {
        findings.doubts.push_back(
            fmt::format("the cut lies {:.2f} mm from its plan where {:.2f} mm (95 %) were announced; so much has a "
                        "probability of {:.1g}",
                        result.offset.most_mm, result.announced_mm, result.probability));
    } else if (!(result.offset.most_mm <= result.announced_mm)) {
        findings.warnings.push_back(fmt::format(
            "the cut lies {:.2f} mm from its plan where {:.2f} mm (95 %) were announced: one in twenty does",
            result.offset.most_mm, result.announced_mm));
    }
    if (stage > 1) {
        const double before = cuts[cuts.size() - 2].location.offset.most_mm;
        if (!(result.offset.most_mm <= before + result.announced_mm)) {
            findings.doubts.push_back(fmt::format("the offset has grown from {:.2f} to {:.2f} mm with this cut", before,
                                                  result.offset.most_mm));
        }
    }
    if (!(fused->probability >= setup.limits.least_probability)) {
        findings.doubts.push_back(fmt::format(
            "the cuts and the registration contradict each other (probability {:.1g})", fused->probability));
    }
    findings.acceptance.push_back(
        atLeast("probability of the cut's offset", result.probability, setup.limits.least_probability, ""));
    if (stage < setup.plan.stages) {
        const Result<TriangleMesh> next = readStageMesh(stage + 1, inputs);
        if (!next) return next.error();
        const double inset = stageOf(stage + 1).inset_mm;
        result.next_inset_mm = inset;
        result.next_bound_mm =
            surfaceError(wallPoints(*next, stageOf(stage + 1).top_mm), announcedPlace(setup, result.robot_from_femur))
                .bound_mm;
        if (const std::string against = boundAgainstRoom(setup, stage + 1, inset, *result.next_bound_mm);
            !against.empty())
            findings.doubts.push_back(against);
        findings.acceptance.push_back(atMost("next stage, 95 % bound", *result.next_bound_mm,
                                             inset > 0 ? inset : setup.limits.envelope_delta_mm, "mm"));
        findings.summary = fmt::format(
            "{} lay {:.2f} mm and {:.2f} degrees off; {:.0f} % of it is corrected, and the next cut is known to "
            "{:.2f} mm (95 %).",
            stageName(setup, stage), result.offset.most_mm, degreesFromRadians(result.offset.turn_rad),
            100 * result.gain_place, *result.next_bound_mm);
    } else {
        findings.acceptance.push_back(
            atMost("final cavity's offset", result.offset.most_mm, setup.limits.envelope_delta_mm, "mm"));
        findings.summary = fmt::format(
            "The final cavity lies {:.2f} mm and {:.2f} degrees from its plan; {:.2f} mm (95 %) had been "
            "announced.",
            result.offset.most_mm, degreesFromRadians(result.offset.turn_rad), result.announced_mm);
    }
    return StepOutput{jsonText(result), {}};
}

}  // namespace fluorocut
