// register: robot_from_femur from the images before the first cut.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/base/units.h"
#include "core/procedure/chain_measurement.h"
#include "core/procedure/steps.h"

namespace fluorocut {
namespace {

constexpr double kMostRadius_mm = 5;  // with more there is no registration; less is for the stages' rooms to judge
constexpr std::size_t kBudgetTerms = 6;

// The robot stands still while all images are taken: its error is theirs in common, as the mount's is.
Pose mountWithRobot(const ProcedureSetup& setup, const Rigid3& robot_from_flange) {
    Pose mount = setup.calibration.flange_from_corkscrew;
    const Matrix6 to_mount =
        productByRight(robot_from_flange).inverse() * productByLeft(robot_from_flange, mount.target_from_source);
    *mount.covariance += to_mount * processCovariance(setup) * to_mount.transpose();
    return mount;
}

ChainMeasurementOptions optionsOf(const ProcedureSetup& setup) {
    const ProcedureCalibration& known = setup.calibration;
    const CArm& carm = setup.views.front().carm;
    ChainMeasurementOptions options;
    options.beads.focal_length = known.focal_length_sigma_mm / carm.focal_length_mm;
    options.beads.principal_point_px = known.image_centre_sigma_px;
    options.beads.bead_mm = known.bead_sigma_mm;
    options.beads.unexplained_px = std::max(1e-3, known.local_distortion_mm / carm.pixel_mm.mean());
    options.corkscrew_mm = known.corkscrew_sigma_mm;
    options.distortion_mm = known.local_distortion_mm;
    return options;
}

// How far each view looks from where its scales say beside the view that agrees with it best. NaN for a single view.
std::vector<double> turnsFromScales(const ProcedureSetup& setup, const FemurBeads& beads) {
    std::vector<Rigid3> seen, nominal;
    for (std::size_t i = 0; i < setup.views.size(); ++i) {
        seen.push_back(beads.views[i].imager_from_femur.target_from_source);
        nominal.push_back(nominalImagerFromRoom(setup.views[i].position, 600));  // only its rotation is used
    }
    std::vector<double> turns;
    for (std::size_t i = 0; i < seen.size(); ++i) {
        double least = std::nan("");
        for (std::size_t j = 0; j < seen.size(); ++j) {
            if (j == i) continue;
            const Rigid3 by_image = seen[i] * seen[j].inverse(), by_scale = nominal[i] * nominal[j].inverse();
            const double turn = by_image.rotation().angularDistance(by_scale.rotation());
            if (!(turn >= least)) least = turn;
        }
        turns.push_back(least);
    }
    return turns;
}

// The ends of the cavity's axis.
std::vector<NamedPoint> pointsOf(const ProcedurePlan& plan) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const Vector3& vertex : plan.mesh.vertices) {
        low = std::min(low, vertex.z());
        high = std::max(high, vertex.z());
    }
    if (plan.cavity.top_mm) high = std::min(high, *plan.cavity.top_mm);
    return {{"cavity's bottom", plan.femur_from_cavity * Vector3(0, 0, low)},
            {"cavity's opening", plan.femur_from_cavity * Vector3(0, 0, high)}};
}

}  // namespace

Result<StepOutput> registerStep(const ProcedureSetup& setup, const StepInputs& inputs, Progress& progress) {
    const Result<StageImages> taken = readImages(setup, 0, inputs);
    if (!taken) return taken.error();
    const Rigid3& robot_from_flange = taken->result.robot_from_flange;
    std::vector<ChainImage> images;
    for (std::size_t i = 0; i < setup.views.size(); ++i) {
        const ProcedureView& view = setup.views[i];
        images.push_back({view.name,
                          taken->images[i],
                          view.carm,
                          "the C-arm",
                          view.name,
                          {Frame::robot, Frame::flange, robot_from_flange, std::nullopt}});
    }
    const Result<ChainMeasurement> measured =
        measureChain(images, setup.calibration.corkscrew, setup.patient.beads, mountWithRobot(setup, robot_from_flange),
                     optionsOf(setup), progress);
    if (!measured) return measured.error();
    ChainOptions options;
    options.points = pointsOf(setup.plan);
    options.limits.most_radius95_mm = kMostRadius_mm;
    options.limits.least_probability = setup.limits.least_probability;
    const Result<Chain> chain = solveChain(measured->problem, options);
    if (!chain) return chain.error();

    RegistrationResult result;
    result.robot_from_femur = chain->robot_from_femur;
    result.probability = chain->probability;
    result.view_angle_rad = chain->view_angle_rad;
    const std::vector<double> turns = turnsFromScales(setup, measured->femur);
    for (std::size_t i = 0; i < chain->views.size(); ++i) {
        const ChainViewResult& view = chain->views[i];
        result.views.push_back({view.name, view.used, view.residual_mm, view.residual.tail<3>().norm(),
                                view.probability, turns[i], measured->femur.views[i].imager_from_femur});
        if (turns[i] > setup.limits.most_view_turn_rad) {
            result.findings.doubts.push_back(
                fmt::format("the view {} looks {:.0f} degrees from where the C-arm's scales say; are images exchanged?",
                            view.name, degreesFromRadians(turns[i])));
        }
    }
    for (const std::string& name : chain->outliers)
        result.findings.doubts.push_back("the view " + name + " contradicts the others and was left out");
    const auto worst =
        std::max_element(chain->points.begin(), chain->points.end(),
                         [](const PointBudget& a, const PointBudget& b) { return a.radius95_mm < b.radius95_mm; });
    result.radius95_mm = worst->radius95_mm;
    result.budget_sentence = worst->sentence;
    for (std::size_t i = 0; i < std::min(kBudgetTerms, worst->largest_first.size()); ++i) {
        const std::size_t term = worst->largest_first[i];
        result.budget.push_back({chain->terms[term].text(), worst->shares[term]});
    }
    result.findings.warnings = measured->warnings;
    result.findings.warnings.insert(result.findings.warnings.end(), chain->warnings.begin(), chain->warnings.end());
    result.findings.acceptance = measured->acceptance;
    result.findings.acceptance.insert(result.findings.acceptance.end(), chain->acceptance.begin(),
                                      chain->acceptance.end());
    result.findings.summary = fmt::format("The femur is registered to the robot to {:.2f} mm (95 %) at the {}.",
                                          worst->radius95_mm, worst->point.name);
    return StepOutput{jsonText(result), {}};
}

}  // namespace fluorocut
