// corkscrew pose: the 6D pose of the corkscrew from one X-ray image.
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/list.h"
#include "app/cli/figures/corkscrew_figure.h"
#include "app/cli/files.h"
#include "app/cli/numbers.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/fiducial/corkscrew_pose.h"
#include "core/io/image_file.h"
#include "core/io/pose_file.h"
#include "core/io/resources.h"

namespace fluorocut::cli {
namespace {

namespace fs = std::filesystem;

struct Options {
    std::string image;
    std::string carm;
    std::string corkscrew = "corkscrew";
    std::string initial;
    std::string output;
    std::string figure;
    int frame = 1;
    double focal_percent = 100 * CalibrationUncertainty{}.focal_length;
    double most_rotation_deg = degreesFromRadians(CorkscrewPoseLimits{}.most_rotation_rad);
    CorkscrewPoseOptions pose;
};

nlohmann::ordered_json jsonOf(const CorkscrewAlternative& other) {
    return {{"imager_from_corkscrew", rowsOf(other.imager_from_corkscrew.matrix())},
            {"score", other.score},
            {"log_likelihood_ratio", std::isfinite(other.log_likelihood_ratio)
                                         ? nlohmann::ordered_json(other.log_likelihood_ratio)
                                         : nlohmann::ordered_json(nullptr)},
            {"angle_deg", degreesFromRadians(other.angle_rad)},
            {"why_rejected", other.why_not}};
}

Report reportOf(const CorkscrewPose& result, const CArm& carm, const Options& options) {
    const Rigid3& pose = result.imager_from_corkscrew.target_from_source;
    const Matrix6& covariance = *result.imager_from_corkscrew.covariance;
    const Vector3 angles = pose.twistRollPitch();
    const Vector3 at = pose.translation();
    Report report;
    report.json = {
        {"image", options.image},
        {"file", options.output.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(options.output)},
        {"imager_from_corkscrew", rowsOf(pose.matrix())},
        {"covariance", rowsOf(covariance)},
        {"noise_covariance", rowsOf(result.noise_covariance)},
        {"twist_deg", degreesFromRadians(angles[0])},
        {"roll_deg", degreesFromRadians(angles[1])},
        {"pitch_deg", degreesFromRadians(angles[2])},
        {"origin_px", arrayOf(carm.project(at))},
        {"rms_px", result.rms_px},
        {"score", result.score},
        {"visible", result.visible},
        {"metal_is_bright", result.metal_is_bright},
        {"tracked", result.tracked},
        {"second_best", result.second_best ? jsonOf(*result.second_best) : nlohmann::ordered_json(nullptr)},
        {"warnings", result.warnings},
        {"elapsed_ms", result.elapsed_ms}};
    const auto sigma = [&](int i) { return std::sqrt(covariance(i, i)); };
    report.line("place", fmt::format("{:.3f}, {:.3f}, {:.2f} +- {:.3f}, {:.3f}, {:.2f} mm", at.x(), at.y(), at.z(),
                                     sigma(0), sigma(1), sigma(2)));
    report.line("twist, roll, pitch", fmt::format("{:.3f}, {:.3f}, {:.3f} degrees", degreesFromRadians(angles[0]),
                                                  degreesFromRadians(angles[1]), degreesFromRadians(angles[2])));
    report.line("turned about x, y, z", fmt::format("+- {:.3f}, {:.3f}, {:.3f} degrees", degreesFromRadians(sigma(3)),
                                                    degreesFromRadians(sigma(4)), degreesFromRadians(sigma(5))));
    report.line("seen", fmt::format("{:.0f} % of the wires where they should be, lines to {:.3f} px",
                                    100 * result.score, result.rms_px));
    report.line("second best", result.second_best ? result.second_best->why_not
                               : result.tracked   ? "not looked for: followed from the initial pose"
                                                  : "none that comes near");
    for (const std::string& one : result.warnings)
        report.line("warning", one);
    report.line("took", fmt::format("{:.0f} ms", result.elapsed_ms));
    if (!options.output.empty()) report.line("pose", options.output);
    report.judge(result.acceptance);
    return report;
}

Result<Report> run(const Options& options, Progress& progress) {
    const Result<fs::path> corkscrew = findResource("fiducials", options.corkscrew);
    if (!corkscrew) return corkscrew.error();
    std::vector<fs::path> inputs{options.image, options.carm, *corkscrew};
    if (!options.initial.empty()) inputs.emplace_back(options.initial);
    if (!options.output.empty())
        if (const Result<void> good = checkOutput(options.output, inputs, {".json"}); !good) return good.error();
    if (!options.figure.empty())
        if (const Result<void> good = checkOutput(options.figure, inputs, {".png"}); !good) return good.error();

    const Result<CArm> carm = readImager(options.carm);
    if (!carm) return carm.error();
    const Result<CorkscrewLayout> layout = readCorkscrew(*corkscrew);
    if (!layout) return layout.error();
    const Result<ImageFile> file = readImage(options.image, {.frame = options.frame});
    if (!file) return file.error();
    if (file->info.width != carm->columns || file->info.height != carm->rows) {
        return invalidInput(options.image, fmt::format("{} x {} pixels", file->info.width, file->info.height),
                            fmt::format("the {} x {} of {}", carm->columns, carm->rows, options.carm),
                            "give the C-arm file that belongs to this image");
    }
    CorkscrewPoseOptions pose = options.pose;
    pose.calibration.focal_length = options.focal_percent / 100;
    pose.limits.most_rotation_rad = radiansFromDegrees(options.most_rotation_deg);
    if (!options.initial.empty()) {
        const Result<Pose> initial = readPose(options.initial, Frame::imager, Frame::corkscrew);
        if (!initial) return initial.error();
        pose.initial = initial->target_from_source;
    }
    SubProgress estimating(progress, 0, 0.95);
    Result<CorkscrewPose> result = estimateCorkscrewPose(file->image, *carm, *layout, pose, estimating);
    if (!result) {
        Error error = result.error();
        if (!error.isCancelled()) error.where = options.image + ", " + error.where;
        return error;
    }
    if (!options.figure.empty()) {
        const ColorImage figure =
            corkscrewFigure(file->image, *carm, *layout, result->imager_from_corkscrew.target_from_source);
        if (const Result<void> written = writeFigure(options.figure, figure); !written) return written.error();
    }
    if (!options.output.empty()) {
        if (const Result<void> written = writePose(options.output, result->imager_from_corkscrew); !written)
            return written.error();
    }
    return reportOf(*result, *carm, options);
}

Command declarePose(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("pose", "Where the corkscrew is, from one image");
    app->add_option("image", options->image, "X-ray image, not straightened: the C-arm's map is applied to the lines")
        ->required();
    app->add_option("--carm", options->carm, "C-arm, fluorocut/carm/1, with its distortion map")->required();
    app->add_option("--corkscrew", options->corkscrew, "Corkscrew, fluorocut/corkscrew/1, or a built-in one's name")
        ->capture_default_str();
    app->add_option("--initial", options->initial,
                    "imager_from_corkscrew of the image before, fluorocut/pose/1: spares the search, and decides\n"
                    "between poses that look the same");
    app->add_option("-o,--out", options->output, "imager_from_corkscrew with its covariance, fluorocut/pose/1: .json");
    app->add_option("--figure", options->figure, "The image with the pose drawn over it: .png");
    app->add_option("--frame", options->frame, "Of files with several, counted from 1")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    const auto known = [&](const char* name, double& value, const char* text) {
        app->add_option(name, value, text)->check(between(0, 100))->capture_default_str()->group("Known to, +-");
    };
    known("--focal-sd-percent", options->focal_percent, "Focal length");
    known("--centre-sd-mm", options->pose.calibration.principal_point_mm, "Image centre, at the detector");
    known("--distortion-sd-mm", options->pose.calibration.distortion_mm, "What the map leaves, at the detector");
    known("--dimensions-sd-mm", options->pose.calibration.dimensions_mm, "The corkscrew's dimensions");
    const auto limit = [&](const char* name, double& value, const char* text) {
        app->add_option(name, value, text)->check(between(0, 1000))->capture_default_str()->group("Acceptance limits");
    };
    limit("--max-rotation-deg", options->most_rotation_deg, "Standard deviation about the worst axis");
    limit("--max-in-plane-mm", options->pose.limits.most_in_plane_mm, "Standard deviation in the image plane");
    limit("--max-depth-mm", options->pose.limits.most_depth_mm, "Standard deviation of the depth");
    limit("--max-rms-px", options->pose.limits.most_rms_px, "Residual of the lines");
    app->footer(
        "Examples:\n"
        "  fluorocut-cli phantom corkscrew -o shot.png --carm carm.json\n"
        "  fluorocut-cli corkscrew pose shot.png --carm carm.json -o pose.json --figure overlay.png\n"
        "  fluorocut-cli corkscrew pose next.png --carm carm.json --initial pose.json --json");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace

Command declareCorkscrew(CLI::App& parent) {
    CLI::App* app = parent.add_subcommand("corkscrew", "The corkscrew in an X-ray image");
    app->fallthrough();
    const Command pose = declarePose(*app);
    app->footer("`fluorocut-cli corkscrew pose --help` tells its options.");
    return {app, [pose](Progress& progress) -> Result<Report> {
                if (pose.app->parsed()) return pose.run(progress);
                return invalidOption("corkscrew", "nothing to do", "pose", "see --help");
            }};
}

}  // namespace fluorocut::cli
