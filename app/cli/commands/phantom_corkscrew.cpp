// phantom corkscrew: a C-arm's picture of the corkscrew, with its true pose.
#include <array>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/phantom_images.h"
#include "app/cli/files.h"
#include "app/cli/numbers.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/experiments/corkscrew_scenes.h"
#include "core/io/image_file.h"
#include "core/io/pose_file.h"
#include "core/io/resources.h"

namespace fluorocut::cli {
namespace {

struct CorkscrewCommand {
    std::string output;
    std::string corkscrew = "corkscrew";
    std::string carm;
    std::string pose;
    double twist_deg = 30, roll_deg = 20, pitch_deg = 15;
    std::vector<double> at_mm;
    double photons = CorkscrewSceneOptions().photons;
    double blur_px = CorkscrewSceneOptions().blur_px;
    bool clutter = false;
    std::string beads, beads_pose;
    bool inverted = false;
    std::string truth;
    std::uint64_t seed = 1;
};

Result<Rigid3> poseOf(const CorkscrewCommand& command, const CArm& carm) {
    if (!command.pose.empty()) {
        const Result<Pose> pose = readPose(command.pose, Frame::imager, Frame::corkscrew);
        if (!pose) return pose.error();
        return pose->target_from_source;
    }
    const Vector3 at = command.at_mm.empty() ? Vector3(0, 0, 0.7 * carm.focal_length_mm)
                                             : Vector3(command.at_mm[0], command.at_mm[1], command.at_mm[2]);
    return Rigid3::fromTranslation(at) * Rigid3::fromTwistRollPitch(radiansFromDegrees(command.twist_deg),
                                                                    radiansFromDegrees(command.roll_deg),
                                                                    radiansFromDegrees(command.pitch_deg));
}

Result<void> checkFiles(const CorkscrewCommand& command, const std::filesystem::path& layout_file) {
    const std::vector<std::filesystem::path> inputs{layout_file, command.carm, command.pose, command.beads,
                                                    command.beads_pose};
    if (auto ok = checkOutput(command.output, inputs, {".png", ".tif", ".tiff", ".mha", ".nrrd", ".dcm"}); !ok)
        return ok;
    return command.truth.empty() ? Result<void>() : checkOutput(command.truth, inputs, {".json"});
}

Result<Report> runCorkscrew(const CorkscrewCommand& command, Progress& progress) {
    const Result<std::filesystem::path> layout_file = findResource("fiducials", command.corkscrew);
    if (!layout_file) return layout_file.error();
    if (auto ok = checkFiles(command, *layout_file); !ok) return ok.error();
    const Result<CorkscrewLayout> layout = readCorkscrew(*layout_file);
    if (!layout) return layout.error();
    CorkscrewSceneOptions options;
    options.layout = *layout;
    options.carm = CArm();
    if (!command.carm.empty()) {
        const Result<CArm> carm = readImager(command.carm);
        if (!carm) return carm.error();
        options.carm = *carm;
    }
    const Result<Rigid3> pose = poseOf(command, *options.carm);
    if (!pose) return pose.error();
    // Depths are for poses that are drawn; this one is given.
    options.least_depth_mm = 0.65 * options.carm->focal_length_mm;
    options.most_depth_mm = 0.74 * options.carm->focal_length_mm;
    options.photons = command.photons;
    options.blur_px = command.blur_px;
    options.seed = command.seed;
    options.inverted = command.inverted ? 1 : 0;
    if (!command.beads.empty()) {
        Result<BeadLayout> beads = readBeadLayout(command.beads);
        if (!beads) return beads.error();
        const Result<Pose> beads_pose = readPose(command.beads_pose, Frame::imager, beads->frame);
        if (!beads_pose) return beads_pose.error();
        options.beads = std::move(*beads);
        options.imager_from_beads = beads_pose->target_from_source;
    }
    if (command.clutter) options.clutter = CorkscrewClutter::surgery();
    SubProgress preparing(progress, 0, 0.8);
    const Result<CorkscrewScenes> scenes = CorkscrewScenes::prepare(options, preparing);
    if (!scenes) return scenes.error();
    const Result<CorkscrewScene> scene = scenes->sceneAt(0, *pose);
    if (!scene) return scene.error();
    if (progress.isCancelled()) return cancelled("phantom");

    ImageWriteOptions writing;
    writing.pixel_spacing_mm = options.carm->pixel_mm;
    if (auto ok = writeImage(command.output, scene->image, writing); !ok) return ok.error();
    if (!command.truth.empty()) {
        Pose truth;
        truth.target = Frame::imager;
        truth.source = Frame::corkscrew;
        truth.target_from_source = *pose;
        if (auto ok = writePose(command.truth, truth); !ok) return ok.error();
    }
    const Vector3 angles_deg = pose->twistRollPitch() * degreesFromRadians(1);
    Report report;
    report.json = {{"file", command.output},
                   {"size", {scene->image.width(), scene->image.height()}},
                   {"corkscrew", layout_file->string()},
                   {"imager_from_corkscrew", rowsOf(pose->matrix())},
                   {"visible", scene->visible},
                   {"covered", scene->covered},
                   {"objects", scene->objects},
                   {"inverted", scene->inverted}};
    report.line("picture", command.output);
    report.line("size", fmt::format("{} x {} px", scene->image.width(), scene->image.height()));
    report.line("corkscrew", layout_file->string());
    report.line("twist, roll, pitch", listText(angles_deg, "{:.6g}") + " degrees");
    report.line("at", listText(pose->translation(), "{:.6g}") + " mm");
    report.line("visible", fmt::format("{:.0f} % of the wires, {:.0f} % of it behind metal", 100 * scene->visible,
                                       100 * scene->covered));
    if (!scene->objects.empty()) report.line("beside it", scene->objects);
    if (!command.truth.empty()) {
        report.json["truth"] = command.truth;
        report.line("truth", command.truth);
    }
    return report;
}

}  // namespace

Command declarePhantomCorkscrew(CLI::App& phantom) {
    const auto command = std::make_shared<CorkscrewCommand>();
    CLI::App* app = phantom.add_subcommand("corkscrew", "A C-arm's picture of the corkscrew");
    app->add_option("-o,--out", command->output, "Picture, 16 bits: .png .tiff .mha .nrrd .dcm")->required();
    app->add_option("--corkscrew", command->corkscrew, "Corkscrew, fluorocut/corkscrew/1, or one built in by name")
        ->capture_default_str();
    app->add_option("--carm", command->carm, "C-arm, fluorocut/carm/1 (default: 512 x 512 pixels of 0.32 mm at 1 m)");
    CLI::Option* pose =
        app->add_option("--pose", command->pose, "Pose imager from corkscrew; instead of the next four");
    for (const auto& [name, value, what] :
         {std::tuple("--twist-deg", &command->twist_deg, "About the shaft"),
          std::tuple("--roll-deg", &command->roll_deg, "The shaft out of the image plane"),
          std::tuple("--pitch-deg", &command->pitch_deg, "The shaft in the image plane")}) {
        app->add_option(name, *value, what)->check(between(-360, 360))->capture_default_str()->excludes(pose);
    }
    app->add_option("--at-mm", command->at_mm, "Of its middle from the source: x y z (default: 0 0 and 0.7 of the way)")
        ->expected(3)
        ->check(between(-10000, 10000))
        ->excludes(pose);
    app->add_option("--photons", command->photons, "Per pixel where the picture is of middling brightness")
        ->check(between(1, 1e7))
        ->capture_default_str();
    app->add_option("--blur-px", command->blur_px, "Standard deviation of the detector's blur")
        ->check(between(0, 20))
        ->capture_default_str();
    app->add_flag("--clutter", command->clutter, "A hip and, as the seed has it, screws, clamp, spindle, retractor");
    CLI::Option* beads =
        app->add_option("--beads", command->beads, "Steel beads beside it, fluorocut/beads/1: those in a femur");
    CLI::Option* beads_pose =
        app->add_option("--beads-pose", command->beads_pose, "Their pose, fluorocut/pose/1: imager from femur");
    beads->needs(beads_pose);
    beads_pose->needs(beads);
    app->add_flag("--inverted", command->inverted, "More photons are darker");
    app->add_option("--truth", command->truth, "True pose, .json: imager from corkscrew");
    app->add_option("--seed", command->seed, "Of noise and clutter")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str();
    app->footer(
        "Examples:\n"
        "  fluorocut-cli phantom corkscrew -o corkscrew.png --truth truth.json\n"
        "  fluorocut-cli phantom corkscrew --roll-deg -40 --at-mm 10 -5 680 --clutter --seed 7 -o surgery.png\n"
        "  fluorocut-cli phantom corkscrew --pose pose.json --beads femur.json --beads-pose imager_from_femur.json -o "
        "view.png");
    return {app, [command](Progress& progress) { return runCorkscrew(*command, progress); }};
}

}  // namespace fluorocut::cli
