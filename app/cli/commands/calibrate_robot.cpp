// calibrate robot: where the corkscrew sits on the robot's flange, from robot poses and corkscrew poses.
#include <filesystem>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/list.h"
#include "app/cli/files.h"
#include "app/cli/numbers.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/io/pose_file.h"
#include "core/registration/hand_eye_file.h"
#include "core/registration/next_robot_pose.h"

namespace fluorocut::cli {
namespace {

struct Options {
    std::string observations;
    std::string output;
    double robot_mm = 0;
    double robot_deg = 0;
    HandEyeOptions calibration;
    double most_rotation_deg = degreesFromRadians(HandEyeLimits{}.most_rotation_rad);
    double turn_deg = degreesFromRadians(NextPoseOptions{}.most_turn_rad);
};

nlohmann::ordered_json jsonOf(const NextPose& next) {
    return {{"sentence", next.sentence},
            {"imager", next.imager},
            {"robot_from_flange", rowsOf(next.robot_from_flange.matrix())},
            {"imager_from_corkscrew", rowsOf(next.imager_from_corkscrew.matrix())},
            {"place_sd_before_mm", next.place_before_mm},
            {"place_sd_after_mm", next.place_after_mm},
            {"rotation_sd_before_deg", degreesFromRadians(next.rotation_before_rad)},
            {"rotation_sd_after_deg", degreesFromRadians(next.rotation_after_rad)}};
}

Report reportOf(const HandEyeCalibration& result, const std::vector<HandEyeObservation>& observations,
                const Result<NextPose>& next, const Options& options) {
    Report report;
    nlohmann::ordered_json residuals = nlohmann::ordered_json::array(), rejected = nlohmann::ordered_json::array(),
                           imagers = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < observations.size(); ++i) {
        const HandEyeResidual& one = result.residuals[i];
        residuals.push_back({{"name", one.name},
                             {"imager", observations[i].imager},
                             {"mm", one.place_mm},
                             {"deg", degreesFromRadians(one.rotation_rad)},
                             {"seen_minus_predicted", arrayOf(one.seen_minus_predicted)},
                             {"standard_deviations", one.distance},
                             {"rejected", one.rejected}});
        if (one.rejected) rejected.push_back(one.name);
    }
    for (const ImagerPlacement& one : result.imagers) {
        imagers.push_back({{"name", one.name},
                           {"imager_from_robot", rowsOf(one.imager_from_robot.target_from_source.matrix())},
                           {"covariance", rowsOf(*one.imager_from_robot.covariance)}});
    }
    const Pose& pose = result.flange_from_corkscrew;
    report.json = {{"file", options.output},
                   {"flange_from_corkscrew", rowsOf(pose.target_from_source.matrix())},
                   {"covariance", rowsOf(*pose.covariance)},
                   {"place_sd_mm", result.worst_place_mm},
                   {"rotation_sd_deg", degreesFromRadians(result.worst_rotation_rad)},
                   {"observations", observations.size()},
                   {"used", result.used()},
                   {"rms_mm", result.rms_place_mm},
                   {"rms_deg", degreesFromRadians(result.rms_rotation_rad)},
                   {"noise_factor", result.noise_factor},
                   {"residuals", residuals},
                   {"rejected", rejected},
                   {"imagers", imagers},
                   {"next_pose", next ? jsonOf(*next) : nlohmann::ordered_json(nullptr)},
                   {"weak_directions", result.weak_directions},
                   {"warnings", result.warnings},
                   {"elapsed_ms", result.elapsed_ms}};
    report.line("pose", options.output);
    report.line("place", listText(pose.target_from_source.translation(), "{:.3f}") +
                             fmt::format(" mm in the flange, +- {:.3f} mm at worst", result.worst_place_mm));
    const Vector3 angles = pose.target_from_source.twistRollPitch();
    report.line("rotation", fmt::format("twist {:.3f}, roll {:.3f}, pitch {:.3f} degrees, +- {:.3f} at worst",
                                        degreesFromRadians(angles.x()), degreesFromRadians(angles.y()),
                                        degreesFromRadians(angles.z()), degreesFromRadians(result.worst_rotation_rad)));
    for (const HandEyeResidual& one : result.residuals) {
        report.line("residual", fmt::format("{}: {:.3f} mm, {:.3f} degrees{}", one.name, one.place_mm,
                                            degreesFromRadians(one.rotation_rad), one.rejected ? ", left out" : ""));
    }
    for (const std::string& one : result.weak_directions)
        report.line("weak", one);
    for (const std::string& one : result.warnings)
        report.line("warning", one);
    if (next) report.line("next pose", next->sentence);
    report.judge(result.acceptance);
    return report;
}

Result<Report> run(const Options& options, Progress& progress) {
    const Result<HandEyeFile> file = readHandEyeFile(options.observations);
    if (!file) return file.error();
    std::vector<std::filesystem::path> inputs = file->inputs;
    inputs.emplace_back(options.observations);
    if (const Result<void> good = checkOutput(options.output, inputs, {".json"}); !good) return good.error();

    HandEyeOptions calibration = options.calibration;
    calibration.robot_place_mm = options.robot_mm;
    calibration.robot_rotation_rad = radiansFromDegrees(options.robot_deg);
    calibration.limits.most_rotation_rad = radiansFromDegrees(options.most_rotation_deg);
    std::vector<HandEyeObservation> observations;
    for (const HandEyeEntry& entry : file->entries)
        observations.push_back(entry.observation);
    Result<HandEyeCalibration> result = calibrateHandEye(observations, calibration, progress);
    if (!result) {
        Error error = result.error();
        error.where = options.observations + ", " + error.where;
        return error;
    }
    // From the last pose taken, with the C-arm where it is then.
    std::size_t imager = 0;
    while (result->imagers[imager].name != observations.back().imager)
        ++imager;
    NextPoseOptions further;
    further.most_turn_rad = radiansFromDegrees(options.turn_deg);
    const Result<NextPose> next =
        suggestNextPose(*result, observations.back().robot_from_flange, imager, calibration, further);
    if (!next) result->warnings.push_back(next.error().message());
    if (progress.isCancelled()) return cancelled("calibrate robot");
    if (const Result<void> written = writePose(options.output, result->flange_from_corkscrew); !written)
        return written.error();
    return reportOf(*result, observations, next, options);
}

}  // namespace

Command declareCalibrateRobot(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("robot", "Where the corkscrew sits on the robot's flange");
    app->add_option("--observations", options->observations, "Robot poses and corkscrew poses, fluorocut/hand-eye/1")
        ->required();
    app->add_option("-o,--out", options->output, "flange_from_corkscrew, fluorocut/pose/1: .json")->required();
    app->add_option("--robot-sd-mm", options->robot_mm, "Standard deviation of the robot's place, per axis")
        ->check(between(0, 100))
        ->capture_default_str();
    app->add_option("--robot-sd-deg", options->robot_deg, "Standard deviation of the robot's rotation, per axis")
        ->check(between(0, 50))
        ->capture_default_str();
    app->add_option("--max-turn-deg", options->turn_deg, "Of the suggested next pose, from the last one")
        ->check(between(1, 180))
        ->capture_default_str();
    app->add_option("--max-place-mm", options->calibration.limits.most_place_mm,
                    "Acceptance limit: standard deviation of the corkscrew's place, worst direction")
        ->check(between(0, 1000))
        ->capture_default_str();
    app->add_option("--max-rotation-deg", options->most_rotation_deg,
                    "Acceptance limit: standard deviation of its rotation, worst axis")
        ->check(between(0, 180))
        ->capture_default_str();
    app->footer(
        "Three poses of the robot, turned about two axes, are enough; eight reach 0.05 mm. The C-arm stands still\n"
        "between observations whose \"imager\" is the same. The file:\n"
        "  {\"schema\": \"fluorocut/hand-eye/1\", \"observations\": [\n"
        "    {\"name\": \"1\", \"imager\": \"ap\", \"robot_from_flange\": [[..4],[..4],[..4],[0,0,0,1]],\n"
        "     \"imager_from_corkscrew\": [[..4],[..4],[..4],[0,0,0,1]], \"covariance\": [[..6], ..6]}, ...]}\n"
        "Instead of matrices \"robot_from_flange_file\" and \"imager_from_corkscrew_file\" name poses\n"
        "(fluorocut/pose/1). \"covariance\" (of imager_from_corkscrew) may be left out: then the noise is estimated.\n"
        "Example:\n"
        "  fluorocut-cli calibrate robot --observations poses.json -o flange_from_corkscrew.json");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
