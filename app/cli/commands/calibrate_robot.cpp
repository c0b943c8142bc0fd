// calibrate robot: where the corkscrew sits on the robot's flange, from robot poses and corkscrew poses.
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/corkscrew_views.h"
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
    std::string refined;  // corkscrew
    double dimensions_mm = 0.05;
    double distortion_mm = CalibrationUncertainty{}.distortion_mm;
    double focal_percent = 0;
    RobotNoise robot;
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
                const std::vector<std::string>& parameters, const Result<NextPose>& next, const Options& options) {
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
    if (!parameters.empty()) {
        nlohmann::ordered_json estimated = nlohmann::ordered_json::array();
        for (std::size_t i = 0; i < parameters.size(); ++i) {
            const auto p = static_cast<Eigen::Index>(i);
            estimated.push_back({{"name", parameters[i]},
                                 {"change", result.shared.front()[p]},
                                 {"sd", std::sqrt(result.shared_covariance(p, p))}});
        }
        report.json["parameters"] = estimated;
        report.json["corkscrew"] = options.refined;
        report.line("corkscrew", options.refined);
    }
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

// What the file's entries say, its images looked at.
struct Seen {
    std::vector<HandEyeObservation> observations;
    std::vector<CorkscrewView> views;  // of the images, when all are
    std::optional<CorkscrewLayout> layout;
    SharedPrior prior;
    std::vector<std::string> warnings;
};

Result<Seen> look(const HandEyeFile& file, const Options& options, Progress& progress) {
    Seen seen;
    const bool refine = !options.refined.empty();
    if (!file.corkscrew.empty()) {
        Result<CorkscrewLayout> layout = layoutOf(file.corkscrew.string());
        if (!layout) return layout.error();
        seen.layout = std::move(*layout);
    }
    CalibrationUncertainty known;
    if (refine) known.dimensions_mm = options.dimensions_mm;
    known.distortion_mm = options.distortion_mm;
    Pictures pictures;
    if (refine) known.focal_length = options.focal_percent / 100;
    for (std::size_t i = 0; i < file.entries.size(); ++i) {
        const HandEyeEntry& entry = file.entries[i];
        HandEyeObservation observation = entry.observation;
        if (entry.image.empty()) {
            if (refine) {
                return invalidInput(options.observations + ", " + observation.name, "a pose, with --refine-dimensions",
                                    "images: a pose says nothing of the corkscrew's dimensions");
            }
            seen.observations.push_back(std::move(observation));
            continue;
        }
        const double part = 1 / static_cast<double>(file.entries.size());
        SubProgress one(progress, part * static_cast<double>(i), part * static_cast<double>(i + 1));
        Result<CorkscrewView> view = viewOf({entry.image, entry.carm}, *seen.layout, known, pictures, one);
        if (!view) {
            // An image without a pose is left out like one that contradicts the others; a missing file is not.
            if (view.error().code != ErrorCode::noSolution) return view.error();
            seen.warnings.push_back("left out: " + view.error().message());
            continue;
        }
        observation.imager_from_corkscrew = view->pose.imager_from_corkscrew.target_from_source;
        observation.covariance = view->own_covariance;
        if (refine) {
            observation.evidence = view->evidence;
            seen.prior = priorOf(*seen.layout, view->carm, known, 0);
            seen.views.push_back(std::move(*view));
        }
        seen.observations.push_back(std::move(observation));
    }
    return seen;
}

Result<Report> run(const Options& options, Progress& progress) {
    const Result<HandEyeFile> file = readHandEyeFile(options.observations);
    if (!file) return file.error();
    std::vector<std::filesystem::path> inputs = file->inputs;
    inputs.emplace_back(options.observations);
    if (const Result<void> good = checkOutput(options.output, inputs, {".json"}); !good) return good.error();
    if (!options.refined.empty()) {
        if (const Result<void> good = checkOutput(options.refined, inputs, {".json"}); !good) return good.error();
    }

    HandEyeOptions calibration = options.calibration;
    calibration.robot_place_mm = options.robot.place_mm;
    calibration.robot_rotation_rad = radiansFromDegrees(options.robot.rotation_deg);
    calibration.limits.most_rotation_rad = radiansFromDegrees(options.most_rotation_deg);
    SubProgress looking(progress, 0, 0.8), solving(progress, 0.8, 1);
    Result<Seen> seen = look(*file, options, looking);
    if (!seen) return seen.error();
    std::vector<HandEyeObservation>& observations = seen->observations;
    if (!options.refined.empty()) {
        calibration.shared = seen->prior;
        calibration.relinearise = [&](std::size_t i, const Rigid3& pose, const Eigen::VectorXd& parameters) {
            return askAgain(seen->views[i], *seen->layout, pose, parameters);
        };
    }
    Result<HandEyeCalibration> result = calibrateHandEye(observations, calibration, solving);
    if (!result) {
        Error error = result.error();
        error.where = options.observations + ", " + error.where;
        return error;
    }
    result->warnings.insert(result->warnings.begin(), seen->warnings.begin(), seen->warnings.end());
    if (options.refined.empty() && seen->layout && result->noise_factor > calibration.limits.most_noise_factor) {
        result->warnings.emplace_back(
            "the corkscrew's dimensions may be off: --refine-dimensions estimates them with the calibration");
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
    if (!options.refined.empty()) {
        const CorkscrewLayout refined = withParameters(*seen->layout, result->shared.front());
        if (const Result<void> valid = refined.validate(); !valid) return valid.error();
        if (const Result<void> written = writeCorkscrew(options.refined, refined); !written) return written.error();
    }
    if (const Result<void> written = writePose(options.output, result->flange_from_corkscrew); !written)
        return written.error();
    return reportOf(*result, observations, calibration.shared.names, next, options);
}

}  // namespace

Command declareCalibrateRobot(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("robot", "Where the corkscrew sits on the robot's flange");
    app->add_option("--observations", options->observations, "Robot poses and corkscrew poses, fluorocut/hand-eye/1")
        ->required();
    app->add_option("-o,--out", options->output, "flange_from_corkscrew, fluorocut/pose/1: .json")->required();
    app->add_option("--refine-dimensions", options->refined,
                    "From images: estimate the corkscrew's dimensions too, and write it, fluorocut/corkscrew/1: .json");
    declareDimensions(*app, options->dimensions_mm);
    declareDistortion(*app, options->distortion_mm);
    app->add_option("--focal-percent", options->focal_percent,
                    "With --refine-dimensions: standard deviation of the calibrated focal length; 0: exact. What the "
                    "images tell of it is no better than their distortion map")
        ->check(between(0, 50))
        ->capture_default_str();
    declareRobotNoise(*app, options->robot);
    app->add_option("--max-turn-deg", options->turn_deg, "Of the suggested next pose, from the last one")
        ->check(between(1, 180))
        ->capture_default_str();
    declareLimits(*app, options->calibration.limits.most_place_mm, "the corkscrew's place, worst direction",
                  options->most_rotation_deg, "its rotation, worst axis");
    app->footer(
        "Three poses of the robot, turned about two axes, are enough; eight reach 0.05 mm. The C-arm stands still\n"
        "between observations whose \"imager\" is the same. The file:\n"
        "  {\"schema\": \"fluorocut/hand-eye/1\", \"observations\": [\n"
        "    {\"name\": \"1\", \"imager\": \"ap\", \"robot_from_flange\": [[..4],[..4],[..4],[0,0,0,1]],\n"
        "     \"imager_from_corkscrew\": [[..4],[..4],[..4],[0,0,0,1]], \"covariance\": [[..6], ..6]}, ...]}\n"
        "Instead of matrices \"robot_from_flange_file\" and \"imager_from_corkscrew_file\" name poses\n"
        "(fluorocut/pose/1), or \"image\" names a picture, with \"carm\" and \"corkscrew\" beside \"observations\".\n"
        "\"covariance\" (of imager_from_corkscrew) may be left out: then the noise is estimated.\n"
        "Examples:\n"
        "  fluorocut-cli calibrate robot --observations poses.json -o flange_from_corkscrew.json\n"
        "  fluorocut-cli calibrate robot --observations images.json --refine-dimensions measured.json -o pose.json");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
