// register beads: imager_from_femur per view, from beads in the bone.
#include <filesystem>
#include <memory>
#include <set>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/register.h"
#include "app/cli/numbers.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/io/atomic_file.h"
#include "core/io/pose_file.h"

namespace fluorocut::cli {
namespace {

namespace fs = std::filesystem;

struct Options {
    std::vector<std::string> views;
    std::string beads;
    std::string output;
    std::string coregistered;
    bool bright = false;
    double focal_percent = 100 * BeadUncertainty{}.focal_length;
    FemurBeadOptions registration;
};

nlohmann::ordered_json namesOf(const std::vector<std::size_t>& beads, const BeadLayout& layout) {
    nlohmann::ordered_json names = nlohmann::ordered_json::array();
    for (const std::size_t bead : beads)
        names.push_back(layout.beads[bead].name);
    return names;
}

nlohmann::ordered_json jsonOf(const FemurViewPose& view, const FemurView& seen, const BeadLayout& layout) {
    nlohmann::ordered_json beads = nlohmann::ordered_json::array();
    for (const FemurBead& bead : view.beads) {
        beads.push_back({{"name", layout.beads[bead.bead].name},
                         {"center_px", arrayOf(seen.detections[bead.detection].center_px)},
                         {"residual_px", arrayOf(bead.residual_px)},
                         {"residual_mm", bead.residual_mm},
                         {"used", bead.used}});
    }
    nlohmann::ordered_json json = {{"image", view.name},
                                   {"imager_from_femur", rowsOf(view.imager_from_femur.target_from_source.matrix())},
                                   {"covariance", rowsOf(*view.imager_from_femur.covariance)},
                                   {"noise_covariance", rowsOf(view.noise_covariance)},
                                   {"fre_px", view.fre_px},
                                   {"fre_mm", view.fre_mm},
                                   {"sigma_mm", view.sigma_mm},
                                   {"size_error", view.size_error},
                                   {"beads", beads},
                                   {"missing", namesOf(view.missing, layout)},
                                   {"outside", namesOf(view.outside, layout)},
                                   {"false_shadows", view.unexplained.size()},
                                   {"guided", view.guided},
                                   {"second_best", nullptr}};
    if (view.second_best) {
        json["second_best"] = {{"imager_from_femur", rowsOf(view.second_best->imager_from_layout.matrix())},
                               {"beads", view.second_best->beads},
                               {"rms_px", view.second_best->rms_px},
                               {"angle_deg", degreesFromRadians(view.second_best->angle_rad)},
                               {"why_not", view.second_best->why_not}};
    }
    return json;
}

Result<Report> run(const Options& options, Progress& progress) {
    const Result<BeadLayout> layout = readBeadLayout(options.beads);
    if (!layout) return layout.error();
    std::vector<FemurView> views;
    std::set<std::string> images;
    Pictures pictures;
    for (std::size_t i = 0; i < options.views.size(); ++i) {
        const Result<std::vector<std::string>> files = partsOf("--view", options.views[i], 2, "IMAGE,CARM");
        if (!files) return files.error();
        if (!images.insert((*files)[0]).second)
            return invalidOption("--view", (*files)[0] + " a second time", "another image for each view");
        const double part = 0.5 / static_cast<double>(options.views.size());
        SubProgress detecting(progress, part * static_cast<double>(i), part * static_cast<double>(i + 1));
        Result<FemurView> view = beadViewOf({(*files)[0], (*files)[1]}, *layout, options.bright, pictures, detecting);
        if (!view) return view.error();
        if (!options.coregistered.empty() && i > 0) {
            const fs::path file = fs::path(options.coregistered) / fmt::format("view_{}.json", i + 1);
            const Result<Pose> known = readPose(file, Frame::imager, Frame::imager);
            if (!known) return known.error();
            if (!known->covariance) return invalidInput(file.string(), "no covariance", "the pose's covariance");
            view->imager_from_first = known->target_from_source;
            view->covariance_from_first = *known->covariance;
        }
        views.push_back(std::move(*view));
    }
    FemurBeadOptions registration = options.registration;
    registration.uncertainty.focal_length = options.focal_percent / 100;
    SubProgress solving(progress, 0.5, 1);
    const Result<FemurBeads> result = registerBeads(views, *layout, registration, solving);
    if (!result) return result.error();

    Report report;
    nlohmann::ordered_json files = nlohmann::ordered_json::array();
    if (!options.output.empty()) {
        const auto fileOf = [&](const FemurViewPose& view) {
            for (std::size_t i = 0; i < views.size(); ++i)
                if (views[i].name == view.name) return fmt::format("femur_{}.json", i + 1);
            throw std::logic_error("register beads: a view that nobody gave");
        };
        const Result<void> written = writeWholeFolder(options.output, [&](const fs::path& folder) -> Result<void> {
            for (const FemurViewPose& view : result->views) {
                if (Result<void> good = writePose(folder / fileOf(view), view.imager_from_femur); !good) return good;
            }
            return {};
        });
        if (!written) return written.error();
        for (const FemurViewPose& view : result->views)
            files.push_back((fs::path(options.output) / fileOf(view)).string());
    }
    nlohmann::ordered_json poses = nlohmann::ordered_json::array();
    for (const FemurViewPose& pose : result->views) {
        for (const FemurView& view : views)
            if (view.name == pose.name) poses.push_back(jsonOf(pose, view, *layout));
        report.line("view", fmt::format("{}: {} of {} beads, FRE {:.3f} px, {:.3f} mm; +- {:.2f} mm in the worst "
                                        "direction{}",
                                        pose.name, pose.beads.size(), layout->beads.size(), pose.fre_px, pose.fre_mm,
                                        pose.sigma_mm, pose.guided ? "; found by the other views" : ""));
    }
    report.json = {{"views", poses},
                   {"files", files},
                   {"rejected", result->rejected},
                   {"unexplained_px", result->unexplained_px},
                   {"warnings", result->warnings},
                   {"elapsed_ms", result->elapsed_ms}};
    for (const std::string& one : result->rejected)
        report.line("left out", one);
    for (const std::string& one : result->warnings)
        report.line("warning", one);
    if (!options.output.empty()) report.line("poses", options.output);
    report.judge(result->acceptance);
    return report;
}

}  // namespace

Command declareRegisterBeads(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    FemurBeadOptions& registration = options->registration;
    CLI::App* app = parent.add_subcommand("beads", "imager_from_femur per view, from beads in the bone");
    app->add_option("--view", options->views, "IMAGE,CARM; again for each further view")
        ->required()
        ->allow_extra_args(false);
    app->add_option("--beads", options->beads, "fluorocut/beads/1, frame femur")->required();
    app->add_option("-o,--out", options->output, "Folder for the poses: femur_N.json (fluorocut/pose/1)");
    app->add_option(
        "--coregistered", options->coregistered,
        "Folder that coregister wrote for the same views in the same order: their geometry is then known, and "
        "views that do not fit are refused");
    app->add_flag("--bright", options->bright, "The beads are brighter than what lies around them");
    app->add_option("--focal-percent", options->focal_percent, "Standard deviation of the calibrated focal length")
        ->check(between(0, 20))
        ->capture_default_str();
    app->add_option("--centre-px", registration.uncertainty.principal_point_px,
                    "Standard deviation of the calibrated image centre")
        ->check(between(0, 500))
        ->capture_default_str();
    app->add_option("--bead-sd-mm", registration.uncertainty.bead_mm,
                    "Standard deviation of each bead's place in the femur, per axis")
        ->check(between(0, 5))
        ->capture_default_str();
    app->add_option("--max-fre-px", registration.limits.most_fre_px, "Acceptance limit: residual of the worst view")
        ->check(between(0, 100))
        ->capture_default_str();
    app->add_option("--min-share", registration.limits.least_share, "Acceptance limit: share of the beads found")
        ->check(between(0, 1))
        ->capture_default_str();
    app->add_option("--max-sigma-mm", registration.limits.most_sigma_mm,
                    "Acceptance limit: standard deviation of the beads' middle in its worst direction")
        ->check(between(0, 1000))
        ->capture_default_str();
    app->footer(
        "Examples:\n"
        "  fluorocut-cli register beads --view ap.png,ap.json --view lateral.png,lateral.json --beads femur.json -o "
        "poses\n"
        "  fluorocut-cli coregister --view ap.png,ap.json --view lateral.png,lateral.json -o views\n"
        "  fluorocut-cli register beads --view ap.png,ap.json --view lateral.png,lateral.json --beads femur.json \\\n"
        "      --coregistered views -o poses");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
