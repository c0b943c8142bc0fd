#include "core/experiments/cavity_experiment.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/option_checks.h"
#include "core/base/stopwatch.h"
#include "core/imaging/volume_projector.h"

namespace fluorocut {
namespace {

constexpr double kChiSquare95 = 12.591587;  // 6 degrees of freedom

CavityOffset offsetOf(double x, double y, double z, double roll, double pitch, double yaw) {
    return {{x, y, z}, {radiansFromDegrees(roll), radiansFromDegrees(pitch), radiansFromDegrees(yaw)}};
}

// The image before as the CT shows it at the pose of the image after.
Result<std::vector<CavityView>> beforeFromCt(std::vector<CavityView> views, const Volume& ct) {
    const auto projector = VolumeProjector::prepare(std::make_shared<Volume>(ct));
    if (!projector) return projector.error();
    for (CavityView& view : views) {
        view.before = projector->project(view.carm, view.after_imager_from_femur);
        for (float& pixel : view.before.pixels())
            pixel = std::exp(-pixel);
        view.before_imager_from_femur = view.after_imager_from_femur;
    }
    return views;
}

CavityAnswer answerOf(CavityEstimator estimator, const CavityPatient& patient, const CavitySceneOptions& scenes,
                      const CavityScene& scene, Progress& progress) {
    CavityAnswer answer;
    CavityLocationOptions options;
    options.view_pose = scenes.pose_error;
    const bool paper = estimator == CavityEstimator::paper || estimator == CavityEstimator::paperWithCt;
    options.method = paper ? CavityMethod::paper : CavityMethod::full;
    std::vector<CavityView> views = scene.views;
    if (estimator == CavityEstimator::paperWithCt) {
        auto with_ct = beforeFromCt(views, *patient.known_ct);
        if (!with_ct) {
            answer.refusal = with_ct.error().message();
            return answer;
        }
        views = std::move(*with_ct);
    }
    const Stopwatch stopwatch;
    const Result<CavityLocation> found =
        locateCavity(views, patient.cavity, patient.planned_femur_from_cavity,
                     estimator == CavityEstimator::full ? patient.known_ct : nullptr, options, progress);
    answer.elapsed_ms = stopwatch.ms();
    if (!found) {
        answer.refusal = found.error().message();
        return answer;
    }
    answer.answered = true;
    answer.accepted = accepted(found->acceptance);
    for (const Judgement& judgement : found->acceptance) {
        if (judgement.accepted()) continue;
        answer.refusal = judgement.sentence();
        break;
    }
    const Rigid3& pose = found->femur_from_cavity.target_from_source;
    answer.computed = CavityOffset::from(patient.planned_femur_from_cavity.inverse() * pose, patient.middle);
    const Rigid3 error = scene.truth_femur_from_cavity.inverse() * pose;
    answer.error_mm = (error * patient.middle - patient.middle).norm();
    answer.error_deg = degreesFromRadians(error.rotationAngle());
    answer.yaw_error_deg = degreesFromRadians(logRotation(error.rotation()).z());
    const Vector6 delta = pose.deltaFrom(scene.truth_femur_from_cavity);
    answer.chi_square = delta.dot(found->femur_from_cavity.covariance->ldlt().solve(delta));
    for (const ViewResidual& view : found->views)
        if (!(answer.contour_px >= view.contour_px)) answer.contour_px = view.contour_px;
    return answer;
}

}  // namespace

const char* name(CavityEstimator estimator) {
    switch (estimator) {
        case CavityEstimator::paper:
            return "paper";
        case CavityEstimator::paperWithCt:
            return "paper_with_ct";
        case CavityEstimator::full:
            return "full";
        case CavityEstimator::fullWithoutCt:
            return "full_without_ct";
    }
    return "";
}

const std::array<PaperCavityTrial, kPaperCavityTrials>& paperCavityTable() {
    static const std::array<PaperCavityTrial, kPaperCavityTrials> table{
        {{offsetOf(2, 1, 0, 0, 0, 0), offsetOf(1.93, 1.05, 0.01, 0, 0, 0), 0.09, 0},
         {offsetOf(-2, 1.5, 1, 0, 0, 0), offsetOf(-2.09, 1.42, 0.94, 0.03, 0, -0.01), 0.13, 0.03},
         {offsetOf(0, 0, 0, 2, 4, -2), offsetOf(0.06, 0.03, -0.02, 2.30, 3.54, -0.57), 0.07, 1.53},
         {offsetOf(0, 0, 0, -3, 3, 3), offsetOf(0.11, -0.05, 0.07, -2.18, 3.49, 1.67), 0.14, 1.64},
         {offsetOf(1, -2, -3, 3, 2, 2), offsetOf(0.56, -2.21, -3.30, 2.47, 2.37, 0.43), 0.57, 1.70}}};
    return table;
}

Result<void> CavityExperimentOptions::validate() const {
    if (const auto ok = scenes.validate(); !ok) return ok;
    return requireRanges({{"random_trials", static_cast<double>(random_trials), 0, 1e6, ""},
                          {"random_mm", random_mm, 0, 10, "mm"},
                          {"random_rad", random_rad, 0, 0.2, "rad"}});
}

CavityFigures CavityExperiment::figures(std::size_t estimator, bool of_the_paper) const {
    CavityFigures figures;
    std::vector<double> mm, deg, yaw, ms;
    int covered = 0;
    for (const CavityTrial& trial : trials) {
        if (trial.of_the_paper != of_the_paper) continue;
        const CavityAnswer& answer = trial.answers[estimator];
        ++figures.trials;
        ms.push_back(answer.elapsed_ms);
        if (!answer.answered) continue;
        ++figures.answered;
        figures.accepted += answer.accepted;
        figures.gross += answer.gross();
        figures.gross_accepted += answer.gross() && answer.accepted;
        mm.push_back(answer.error_mm);
        deg.push_back(answer.error_deg);
        yaw.push_back(answer.yaw_error_deg);
        covered += answer.chi_square <= kChiSquare95;
    }
    figures.mm = figuresOf(mm);
    figures.deg = figuresOf(deg);
    figures.yaw_deg = figuresOf(yaw);
    if (figures.answered > 0) figures.covered = static_cast<double>(covered) / figures.answered;
    figures.median_ms = median(ms);
    return figures;
}

Result<CavityExperiment> runCavityExperiment(const CavityExperimentOptions& options, Progress& progress) {
    if (const auto ok = options.validate(); !ok) return ok.error();
    SubProgress making(progress, 0, 0.1);
    const Result<CavityPatient> patient = makeCavityPatient(options.scenes, making);
    if (!patient) return patient.error();
    std::vector<CavityTrial> trials;
    if (options.paper_trials)
        for (const PaperCavityTrial& trial : paperCavityTable())
            trials.push_back({trial.expected, true, {}});
    const Random random(options.seed);
    for (int i = 0; i < options.random_trials; ++i) {
        Random own = random.fork(static_cast<std::uint64_t>(i) + 1000);
        CavityOffset offset;
        for (double& value : offset.shift_mm)
            value = own.uniform(-options.random_mm, options.random_mm);
        for (double& value : offset.roll_pitch_yaw_rad)
            value = own.uniform(-options.random_rad, options.random_rad);
        trials.push_back({offset, false, {}});
    }
    CavityExperiment experiment;
    for (std::size_t i = 0; i < trials.size(); ++i) {
        if (progress.isCancelled()) return cancelled("cavity experiment");
        progress.report(0.1 + 0.9 * static_cast<double>(i) / static_cast<double>(trials.size()), "Table 3");
        Random own = random.fork(i);
        const Result<CavityScene> scene = makeCavityScene(*patient, options.scenes, trials[i].expected, own);
        if (!scene) return scene.error();
        for (const CavityEstimator estimator : options.estimators)
            trials[i].answers.push_back(answerOf(estimator, *patient, options.scenes, *scene, Progress::none()));
    }
    experiment.trials = std::move(trials);
    return experiment;
}

}  // namespace fluorocut
