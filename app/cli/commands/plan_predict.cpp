// plan predict: what the X-ray will look like after the cut and with the implant in.
#include <algorithm>
#include <filesystem>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/plan.h"
#include "app/cli/commands/register.h"
#include "app/cli/figures/plan_figure.h"
#include "app/cli/files.h"
#include "app/cli/implants.h"
#include "app/cli/options.h"
#include "app/cli/patient.h"
#include "core/io/atomic_file.h"
#include "core/io/image_file.h"
#include "core/io/mesh_file.h"
#include "core/io/pose_file.h"
#include "core/planning/predicted_image.h"

namespace fluorocut::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Options {
    std::vector<std::string> views;
    ImplantWish implant;
    std::string femur_from_cavity, cavity, ct, output, figure;
    std::vector<std::string> stages;  // outlined only
    PredictionOptions prediction;
};

struct View {
    std::string name;
    PredictedView prepared;
};

Result<View> readView(const std::string& text, const PredictionOptions& options) {
    const Result<std::vector<std::string>> parts = partsOf("--view", text, 3, "IMAGE,CARM,POSE");
    if (!parts) return parts.error();
    Result<ImageFile> image = readImage((*parts)[0]);
    if (!image) return image.error();
    const Result<CArm> carm = readImager((*parts)[1]);
    if (!carm) return carm.error();
    const Result<Pose> pose = readPose((*parts)[2], Frame::imager, Frame::femur);
    if (!pose) return pose.error();
    Result<PredictedView> prepared =
        PredictedView::prepare(std::move(image->image), *carm, pose->target_from_source, options);
    if (!prepared) {
        Error error = prepared.error();
        error.where = (*parts)[0] + ", " + error.where;
        return error;
    }
    return View{fs::path((*parts)[0]).filename().string(), std::move(*prepared)};
}

Result<TriangleMesh> readSolid(const std::string& path) {
    Result<MeshFile> file = readMesh(path);
    if (!file) return file.error();
    return std::move(file->mesh);
}

Result<Report> run(const Options& options, Progress& progress) {
    std::vector<fs::path> inputs{options.femur_from_cavity, options.cavity, options.ct, options.implant.name};
    for (const std::string& view : options.views) {
        const Result<std::vector<std::string>> parts = partsOf("--view", view, 3, "IMAGE,CARM,POSE");
        if (!parts) return parts.error();
        inputs.insert(inputs.end(), parts->begin(), parts->end());
    }
    std::erase_if(inputs, [](const fs::path& path) { return path.empty(); });
    const bool one = options.views.size() == 1;
    if (one) {
        if (auto good = checkOutput(options.output, inputs, {".png", ".tif", ".tiff", ".mha", ".nrrd", ".dcm"}); !good)
            return good.error();
    }
    if (!options.figure.empty()) {
        if (auto good = checkOutput(options.figure, inputs, {".png"}); !good) return good.error();
    }
    if (auto good = options.prediction.validate(); !good) return good.error();
    if (options.implant.name.empty() && options.cavity.empty())
        return invalidOption("plan predict", "neither --implant nor --cavity", "at least one of them");

    const Result<Pose> pose = readPose(options.femur_from_cavity, Frame::femur, Frame::cavity);
    if (!pose) return pose.error();
    const Rigid3& femur_from_cavity = pose->target_from_source;
    Report report;
    report.json["warnings"] = Json::array();
    const auto warn = [&](const std::string& sentence) {
        report.json["warnings"].push_back(sentence);
        report.line("warning", sentence);
    };

    std::vector<PlanFigureSolid> outlined;
    std::optional<ChosenImplant> chosen;
    if (!options.implant.name.empty()) {
        Result<ChosenImplant> read = implantOf(options.implant);
        if (!read) return read.error();
        chosen = std::move(*read);
        const Implant& implant = chosen->implant;
        report.json["implant"] = {{"family", implant.family}, {"size", implant.size}, {"side", name(implant.side)}};
        report.line("implant", fmt::format("{} {} {}", implant.family, implant.size, name(implant.side)));
        for (const std::string& remark : chosen->remarks)
            warn("guessed: " + remark);
        for (const ImplantPart& part : implant.parts)
            outlined.push_back({part.name, part.mesh});
    }
    std::optional<TriangleMesh> cavity;
    if (!options.cavity.empty()) {
        Result<TriangleMesh> read = readSolid(options.cavity);
        if (!read) return read.error();
        cavity = std::move(*read);
        outlined.push_back({"cavity", *cavity});
    }
    for (const std::string& stage : options.stages) {
        Result<TriangleMesh> read = readSolid(stage);
        if (!read) return read.error();
        outlined.push_back({fs::path(stage).stem().string(), std::move(*read)});
    }
    const Result<PlannedSolids> solids =
        PlannedSolids::prepare(chosen ? &chosen->implant : nullptr, cavity ? &*cavity : nullptr);
    if (!solids) return solids.error();

    std::shared_ptr<const Volume> ct;
    if (!options.ct.empty()) {
        SubProgress reading(progress, 0, 0.6);
        Result<std::shared_ptr<const Volume>> read = loadCt(options.ct, reading);
        if (!read) return read.error();
        ct = std::move(*read);
    }
    const Result<PlacedPlan> plan = placePlan(*solids, femur_from_cavity, ct.get(), options.prediction);
    if (!plan) return plan.error();
    for (const std::string& warning : plan->warnings)
        warn(warning);

    std::vector<PlanFigureView> figure;
    report.json["views"] = Json::array();
    for (std::size_t v = 0; v < options.views.size(); ++v) {
        if (progress.isCancelled()) return cancelled("plan predict");
        progress.report(0.6 + 0.3 * static_cast<double>(v) / static_cast<double>(options.views.size()), "predicting");
        const Result<View> view = readView(options.views[v], options.prediction);
        if (!view) return view.error();
        Result<PredictedImage> predicted = view->prepared.predict(*solids, *plan);
        if (!predicted) return predicted.error();
        const std::string file = one ? options.output : fmt::format("predicted_{}.tif", v + 1);
        const auto [least, most] =
            std::minmax_element(predicted->change.pixels().begin(), predicted->change.pixels().end());
        report.json["views"].push_back({{"file", file},
                                        {"least_change", *least},
                                        {"most_change", *most},
                                        {"level_uncertainty", predicted->level_uncertainty},
                                        {"elapsed_ms", predicted->elapsed_ms}});
        report.line(view->name, fmt::format("{}: line integrals change by {:.2f} to {:.2f}; {:.0f} ms", file, *least,
                                            *most, predicted->elapsed_ms));
        if (!ct)
            report.line("",
                        fmt::format("without a CT: bone taken as {:g} +- {:g} HU, so levels in the cavity are known "
                                    "to {:.0f} %",
                                    options.prediction.bone_hu, options.prediction.bone_hu_sigma,
                                    100 * predicted->level_uncertainty));
        figure.push_back({view->name, view->prepared.image(), std::move(predicted->image), view->prepared.carm(),
                          view->prepared.imagerFromFemur() * femur_from_cavity});
    }
    if (!options.figure.empty()) {
        const Result<ColorImage> drawn = planFigure(figure, outlined);
        if (!drawn) return drawn.error();
        if (auto written = writeFigure(options.figure, *drawn); !written) return written.error();
        report.json["figure"] = options.figure;
        report.line("figure", options.figure);
    }
    if (one) {
        if (auto written = writeImage(options.output, figure[0].predicted); !written) return written.error();
    } else {
        const Result<void> written = writeWholeFolder(options.output, [&](const fs::path& folder) -> Result<void> {
            for (std::size_t v = 0; v < figure.size(); ++v) {
                if (auto good = writeImage(folder / fmt::format("predicted_{}.tif", v + 1), figure[v].predicted); !good)
                    return good;
            }
            return {};
        });
        if (!written) return written.error();
        report.json["folder"] = options.output;
    }
    return report;
}

}  // namespace

Command declarePlanPredict(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("predict", "What the X-ray will look like, on top of the real one");
    app->add_option("--view", options->views,
                    "IMAGE,CARM,POSE: image, fluorocut/carm/1, pose imager from femur; again "
                    "for each view")
        ->required();
    app->add_option("--implant", options->implant.name, "Name in the library, fluorocut/implant/1, or a mesh");
    declareChoice(*app, options->implant);
    app->add_option("--femur-from-cavity", options->femur_from_cavity, "Pose femur from cavity, fluorocut/pose/1")
        ->required();
    app->add_option("--cavity", options->cavity, "Mesh of the cavity; default: what the stem fills in bone");
    app->add_option("--stage", options->stages, "Mesh of a stage, outlined in the figure; again for each");
    app->add_option("--ct", options->ct, "CT: file, DICOM folder, or a built-in patient: femur, acrylic");
    app->add_option("-o,--out", options->output,
                    "Predicted image: .png .tif .mha .nrrd .dcm; for several views a folder, new or empty")
        ->required();
    app->add_option("--figure", options->figure, "Picture of before and after with outlines: .png");
    PredictionOptions& p = options->prediction;
    app->add_option("--offset-level", p.offset_level, "Level of no photons")->capture_default_str();
    app->add_option("--blur-px", p.detector_blur_px, "The detector's blur, px")->capture_default_str();
    app->add_option("--scatter", p.smooth_fraction, "Scatter and glare, of the mean level around")
        ->capture_default_str();
    app->add_option("--fill-hu", p.fill_hu, "What fills the gap between cavity and stem, HU")->capture_default_str();
    app->add_option("--bone-hu", p.bone_hu, "Without a CT: mean of the bone removed, HU")->capture_default_str();
    app->add_option("--bone-hu-sigma", p.bone_hu_sigma, "and how far it may be off, HU")->capture_default_str();
    app->add_option("--energy-kev", p.energy_kev, "Effective energy of the beam")->capture_default_str();
    app->footer(
        "Example: fluorocut-cli plan predict --view ap.png,carm.json,ap.json --implant straight --size 12 "
        "--femur-from-cavity stem.json -o predicted.png --figure predicted-figure.png");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
