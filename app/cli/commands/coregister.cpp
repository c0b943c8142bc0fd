// coregister: where the imagers of several images were relative to the first, through the corkscrew in all of them.
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/corkscrew_views.h"
#include "app/cli/commands/list.h"
#include "app/cli/files.h"
#include "app/cli/numbers.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/imaging/carm_position.h"
#include "core/io/atomic_file.h"
#include "core/io/pose_file.h"
#include "core/registration/coregistration.h"
#include "core/registration/pose_network.h"

namespace fluorocut::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kSourceToIsocentreMm = 600;  // only the rotation is used

struct Options {
    std::vector<std::string> views;
    std::string corkscrew = "corkscrew";
    std::vector<std::string> robot_poses;
    std::string flange_from_corkscrew;
    std::vector<std::string> angles;
    std::string output;
    double focal_percent = 100 * CalibrationUncertainty{}.focal_length;
    double focal_change_percent = 0.1;
    double dimensions_mm = CalibrationUncertainty{}.dimensions_mm;
    double distortion_mm = CalibrationUncertainty{}.distortion_mm;
    RobotNoise robot;
    double least_angle_deg = degreesFromRadians(CoregistrationLimits{}.least_angle_rad);
    double most_rotation_deg = degreesFromRadians(CoregistrationLimits{}.most_rotation_rad);
    CoregistrationLimits limits;
};

std::vector<std::string> parts(const std::string& text) {
    std::vector<std::string> result{""};
    for (const char c : text) {
        if (c == ',') {
            result.emplace_back();
        } else {
            result.back() += c;
        }
    }
    return result;
}

struct ViewFiles {
    CorkscrewImage files;
    std::string position;
};

Result<std::vector<ViewFiles>> filesOf(const std::vector<std::string>& views) {
    std::vector<ViewFiles> result;
    for (const std::string& view : views) {
        const std::vector<std::string> part = parts(view);
        if (part.size() < 2 || part.size() > 3 || part[0].empty() || part[1].empty())
            return invalidOption("--view", view, "IMAGE,CARM or IMAGE,CARM,POSITION");
        result.push_back({{part[0], part[1]}, part.size() == 3 ? part[2] : ""});
    }
    return result;
}

// "ORBITAL,ANGULATION" in degrees, else what the image's file says.
Result<std::optional<Rigid3>> scalesOf(const Options& options, std::size_t view, const ImageInfo& info) {
    CArmPosition position;
    if (!options.angles.empty()) {
        const std::vector<std::string> part = parts(options.angles[view]);
        double values[2];
        for (std::size_t i = 0; i < 2; ++i) {
            if (part.size() != 2 || !CLI::detail::lexical_cast(part[i], values[i]) || !std::isfinite(values[i]))
                return invalidOption("--angles", options.angles[view], "ORBITAL,ANGULATION in degrees");
        }
        position.orbital_rad = radiansFromDegrees(values[0]);
        position.angulation_rad = radiansFromDegrees(values[1]);
    } else if (info.primary_angle_deg && info.secondary_angle_deg) {
        position.orbital_rad = radiansFromDegrees(*info.primary_angle_deg);
        position.angulation_rad = radiansFromDegrees(*info.secondary_angle_deg);
    } else {
        return std::optional<Rigid3>();
    }
    if (const Result<void> valid = position.validate(); !valid) return valid.error();
    return std::optional<Rigid3>(nominalImagerFromRoom(position, kSourceToIsocentreMm));
}

Result<void> requireOneEach(const char* option, std::size_t found, std::size_t views) {
    if (found == 0 || found == views) return {};
    return invalidOption(option, fmt::format("{}", found), fmt::format("none, or one for each of {} views", views));
}

Report reportOf(const Coregistration& result, const std::vector<CorkscrewView>& seen, const Options& options) {
    Report report;
    nlohmann::ordered_json views = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < result.views.size(); ++i) {
        const CoregisteredView& view = result.views[i];
        const double focal_mm = seen[i].carm.focal_length_mm;
        views.push_back({{"image", view.name},
                         {"view_from_first", rowsOf(view.view_from_first.target_from_source.matrix())},
                         {"covariance", rowsOf(*view.view_from_first.covariance)},
                         {"imager_from_corkscrew", rowsOf(view.imager_from_corkscrew.target_from_source.matrix())},
                         {"imager_from_" + std::string(name(result.base)),
                          rowsOf(view.imager_from_base.target_from_source.matrix())},
                         {"angle_to_first_deg", degreesFromRadians(view.angle_to_first_rad)},
                         {"place_sd_mm", view.worst_place_mm},
                         {"rotation_sd_deg", degreesFromRadians(view.worst_rotation_rad)},
                         {"focal_length_mm", focal_mm * (1 + view.shared[0])},
                         {"focal_length_sd_mm", focal_mm * view.shared_sigma[0]},
                         {"residual", arrayOf(view.seen_minus_predicted)},
                         {"rms_px", seen[i].pose.rms_px}});
        const std::string place =
            i == 0 ? "the first"
                   : fmt::format("looks {:.2f} degrees from the first, known to {:.3f} mm, {:.3f} degrees",
                                 degreesFromRadians(view.angle_to_first_rad), view.worst_place_mm,
                                 degreesFromRadians(view.worst_rotation_rad));
        report.line("view", fmt::format("{}: {}; focal length {:.2f} +- {:.2f} mm", view.name, place,
                                        focal_mm * (1 + view.shared[0]), focal_mm * view.shared_sigma[0]));
    }
    report.json = {
        {"folder", options.output.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(options.output)},
        {"views", views},
        {"covariance", rowsOf(result.covariance)},
        {"base", name(result.base)},
        {"chi_square",
         result.degrees_of_freedom > 0 ? nlohmann::ordered_json(result.chi_square) : nlohmann::ordered_json(nullptr)},
        {"degrees_of_freedom", result.degrees_of_freedom},
        {"widest_angle_deg", degreesFromRadians(result.widest_angle_rad)},
        {"warnings", result.warnings},
        {"elapsed_ms", result.elapsed_ms}};
    for (const std::string& one : result.warnings)
        report.line("warning", one);
    if (!options.output.empty()) report.line("poses", options.output);
    report.judge(result.acceptance);
    return report;
}

// view_1.json, view_2.json, ...: view_from_first; corkscrew_1.json, ...: imager_from_corkscrew.
Result<void> write(const fs::path& folder, const Coregistration& result) {
    return writeWholeFolder(folder, [&](const fs::path& temporary) -> Result<void> {
        for (std::size_t i = 0; i < result.views.size(); ++i) {
            const CoregisteredView& view = result.views[i];
            const std::string number = std::to_string(i + 1);
            for (const auto& [stem, pose] :
                 {std::pair("view_", &view.view_from_first), std::pair("corkscrew_", &view.imager_from_corkscrew)}) {
                if (Result<void> good = writePose(temporary / (stem + number + ".json"), *pose); !good) return good;
            }
        }
        return {};
    });
}

Result<Report> run(const Options& options, Progress& progress) {
    const Result<std::vector<ViewFiles>> files = filesOf(options.views);
    if (!files) return files.error();
    for (const auto& [option, count] :
         {std::pair("--robot-pose", options.robot_poses.size()), std::pair("--angles", options.angles.size())}) {
        if (const Result<void> good = requireOneEach(option, count, files->size()); !good) return good.error();
    }
    const Result<CorkscrewLayout> layout = layoutOf(options.corkscrew);
    if (!layout) return layout.error();
    CalibrationUncertainty known;
    known.focal_length = options.focal_percent / 100;
    known.dimensions_mm = options.dimensions_mm;
    known.distortion_mm = options.distortion_mm;
    CoregistrationOptions coregistration;
    coregistration.robot_place_mm = options.robot.place_mm;
    coregistration.robot_rotation_rad = radiansFromDegrees(options.robot.rotation_deg);
    coregistration.limits = options.limits;
    coregistration.limits.least_angle_rad = radiansFromDegrees(options.least_angle_deg);
    coregistration.limits.most_rotation_rad = radiansFromDegrees(options.most_rotation_deg);
    if (!options.flange_from_corkscrew.empty()) {
        const Result<Pose> mount = readPose(options.flange_from_corkscrew, Frame::flange, Frame::corkscrew);
        if (!mount) return mount.error();
        coregistration.flange_from_corkscrew = *mount;
    }

    Pictures pictures;
    std::vector<CorkscrewView> seen;
    std::vector<CoregistrationView> views;
    for (std::size_t i = 0; i < files->size(); ++i) {
        const double part = 0.9 / static_cast<double>(files->size());
        SubProgress looking(progress, part * static_cast<double>(i), part * static_cast<double>(i + 1));
        Result<CorkscrewView> view = viewOf((*files)[i].files, *layout, known, pictures, looking);
        if (!view) return view.error();
        CoregistrationView one;
        one.name = (*files)[i].files.image.string();
        one.position = (*files)[i].position;
        one.imager_from_corkscrew = view->pose.imager_from_corkscrew.target_from_source;
        one.evidence = posesOnly(view->evidence);
        if (!options.robot_poses.empty()) {
            const Result<Pose> robot = readPose(options.robot_poses[i], Frame::robot, Frame::flange);
            if (!robot) return robot.error();
            one.robot_from_flange = robot->target_from_source;
        }
        const Result<std::optional<Rigid3>> scales = scalesOf(options, i, view->info);
        if (!scales) return scales.error();
        one.imager_from_room = *scales;
        views.push_back(std::move(one));
        seen.push_back(std::move(*view));
    }
    coregistration.shared = priorOf(*layout, seen.front().carm, known, options.focal_change_percent / 100);
    coregistration.relinearise = [&](std::size_t i, const Rigid3& pose,
                                     const Eigen::VectorXd& parameters) -> Result<PoseEvidence> {
        Result<PoseEvidence> answer = askAgain(seen[i], *layout, pose, parameters);
        if (!answer) return answer;
        return posesOnly(std::move(*answer));
    };
    SubProgress solving(progress, 0.9, 1);
    Result<Coregistration> result = coregisterViews(views, coregistration, solving);
    if (!result) return result.error();
    for (const CorkscrewView& view : seen)
        result->warnings.insert(result->warnings.end(), view.pose.warnings.begin(), view.pose.warnings.end());
    if (!options.output.empty()) {
        if (const Result<void> written = write(options.output, *result); !written) return written.error();
    }
    return reportOf(*result, seen, options);
}

}  // namespace

Command declareCoregister(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("coregister", "Poses of all views relative to the first, by the corkscrew");
    app->add_option("--view", options->views,
                    "IMAGE,CARM[,POSITION]; again for each further view. Views of one POSITION (any name): the C-arm "
                    "did not move between them")
        ->required()
        ->allow_extra_args(false);
    app->add_option("--corkscrew", options->corkscrew, "fluorocut/corkscrew/1, or a built-in corkscrew's name")
        ->capture_default_str();
    app->add_option(
           "--robot-pose", options->robot_poses,
           "robot_from_flange (fluorocut/pose/1) of each view, in their order, when a robot holds the corkscrew")
        ->allow_extra_args(false);
    app->add_option("--flange-from-corkscrew", options->flange_from_corkscrew,
                    "From calibrate robot; needed when the robot moved between the views");
    app->add_option(
           "--angles", options->angles,
           "ORBITAL,ANGULATION of each view on the C-arm's scales, degrees: finds swapped views. Default: as a "
           "DICOM image says")
        ->allow_extra_args(false);
    app->add_option("-o,--out", options->output,
                    "Folder for the poses: view_N.json (view_from_first), corkscrew_N.json (imager_from_corkscrew)");
    app->add_option("--focal-percent", options->focal_percent, "Standard deviation of the calibrated focal length")
        ->check(between(0, 50))
        ->capture_default_str();
    app->add_option("--focal-change-percent", options->focal_change_percent,
                    "Standard deviation of its change from position to position of the gantry")
        ->check(between(0, 50))
        ->capture_default_str();
    declareDimensions(*app, options->dimensions_mm);
    declareDistortion(*app, options->distortion_mm);
    declareRobotNoise(*app, options->robot);
    app->add_option("--min-angle-deg", options->least_angle_deg,
                    "Acceptance limit: angle between the two views that differ most")
        ->check(between(0, 90))
        ->capture_default_str();
    declareLimits(*app, options->limits.most_place_mm, "a point carried from the first view",
                  options->most_rotation_deg, "a view's rotation");
    app->footer(
        "Examples:\n"
        "  fluorocut-cli coregister --view ap.png,ap.json --view lateral.png,lateral.json -o views\n"
        "  fluorocut-cli coregister --view a.png,c.json,1 --view b.png,c.json,1 --view d.png,c.json,2 \\\n"
        "      --robot-pose a.json --robot-pose b.json --robot-pose d.json --flange-from-corkscrew mount.json");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
