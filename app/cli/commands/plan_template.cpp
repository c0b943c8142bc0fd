// plan template: which size of a stem to begin with, and where, from a CT or from walls drawn in two views.
#include <filesystem>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/plan.h"
#include "app/cli/commands/register.h"
#include "app/cli/figures/template_figure.h"
#include "app/cli/files.h"
#include "app/cli/numbers.h"
#include "app/cli/options.h"
#include "app/cli/patient.h"
#include "core/base/units.h"
#include "core/io/atomic_file.h"
#include "core/io/image_file.h"
#include "core/io/mesh_file.h"
#include "core/io/pose_file.h"
#include "core/io/resources.h"
#include "core/planning/contour_file.h"
#include "core/planning/femur_shaft.h"
#include "core/planning/implant_file.h"
#include "core/planning/templating.h"

namespace fluorocut::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kAboveResectionMm = 6;  // of bone walls, so that a tilted stem's top lies within them

struct Options {
    std::string ct;
    std::vector<std::string> views;
    std::string family, side;
    std::vector<double> axis_mm;
    double head_mm = 32, neck_mm = 0;
    TemplateOptions fit;
    std::string output, proposal, stem, figure;
};

struct Proposed {
    TemplateProposal proposal;
    StemSeat seat;
    std::string seat_from;
    Implant implant;
};

Json numberOrNull(double value) {
    return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Result<std::vector<Implant>> implantsOf(const Options& options, Side side) {
    const auto path = findResource("implants", options.family);
    if (!path) return path.error();
    const Result<ImplantFamily> family = readImplantFamily(*path);
    if (!family) return family.error();
    std::vector<Implant> sizes;
    for (const StemSize& size : family->sizes) {
        Result<Implant> implant = makeImplant(*family, {size.name, side, options.head_mm, options.neck_mm});
        if (!implant) return implant.error();
        sizes.push_back(std::move(*implant));
    }
    return sizes;
}

std::optional<Side> sideAsked(const Options& options) {
    if (options.side.empty()) return std::nullopt;
    return options.side == "left" ? Side::left : Side::right;
}

Result<Proposed> fromCt(const Options& options, Progress& progress) {
    SubProgress reading(progress, 0, 0.3);
    const Result<std::shared_ptr<const Volume>> ct = loadCt(options.ct, reading);
    if (!ct) return ct.error();
    FemurShaftOptions search;
    search.side = sideAsked(options);
    if (!options.axis_mm.empty()) {
        const Eigen::Map<const Vector3> proximal(options.axis_mm.data()), distal(options.axis_mm.data() + 3);
        search.axis = AxisLine{distal, proximal};
    }
    SubProgress finding(progress, 0.3, 0.5);
    const Result<FemurShaft> shaft = findFemurShaft(**ct, search, finding);
    if (!shaft) return shaft.error();
    Proposed result;
    result.seat = {shaft->axis.proximal, shaft->axis.direction(), shaft->medial, shaft->side};
    result.seat_from =
        search.axis ? "the axis given" : "the CT: axis of the shaft's canal, resection where the neck begins";
    const AxisLine axis{shaft->axis.distal, shaft->axis.proximal + kAboveResectionMm * shaft->axis.direction()};
    SubProgress walling(progress, 0.5, 0.8);
    const Result<BoneWalls> walls = findBoneWalls(**ct, axis, {}, walling);
    if (!walls) return walls.error();
    Result<std::vector<Implant>> sizes = implantsOf(options, shaft->side);
    if (!sizes) return sizes.error();
    SubProgress trying(progress, 0.8, 0.95);
    Result<TemplateProposal> proposal = proposeStem(*sizes, *walls, result.seat, options.fit, trying);
    if (!proposal) return proposal.error();
    result.proposal = std::move(*proposal);
    for (Implant& implant : *sizes)
        if (implant.size == result.proposal.size) result.implant = std::move(implant);
    if (!options.figure.empty()) {
        const Result<ColorImage> figure =
            templateFigure(**ct, *walls, result.implant, result.proposal.femur_from_cavity);
        if (!figure) return figure.error();
        if (auto written = writeFigure(options.figure, *figure); !written) return written.error();
    }
    return result;
}

Result<Proposed> fromViews(const Options& options, Progress& progress) {
    std::vector<CanalView> views;
    for (const std::string& text : options.views) {
        const auto parts = partsOf("--view", text, 4, "IMAGE,CARM,POSE,CONTOURS");
        if (!parts) return parts.error();
        CanalView view;
        view.name = (*parts)[0];
        Result<CArm> carm = readImager((*parts)[1]);
        if (!carm) return carm.error();
        const Result<ImageFile> image = readImage((*parts)[0]);
        if (!image) return image.error();
        if (image->info.width != carm->columns || image->info.height != carm->rows)
            return invalidInput((*parts)[0], fmt::format("{} x {} pixels", image->info.width, image->info.height),
                                fmt::format("the {} x {} of {}", carm->columns, carm->rows, (*parts)[1]),
                                "give each image the C-arm that it was taken with");
        const Result<Pose> pose = readPose((*parts)[2], Frame::imager, Frame::femur);
        if (!pose) return pose.error();
        view.view = {std::move(*carm), pose->target_from_source, pose->covariance.value_or(Matrix6::Zero())};
        Result<std::vector<DrawnWall>> walls = readContours((*parts)[3]);
        if (!walls) return walls.error();
        view.walls = std::move(*walls);
        views.push_back(std::move(view));
    }
    const Result<StemSeat> seat = seatFromViews(views);
    if (!seat) return seat.error();
    if (const auto asked = sideAsked(options); asked && *asked != seat->side)
        return invalidInput("--view", fmt::format("walls of a {} femur", name(seat->side)),
                            fmt::format("a {} one", name(*asked)), "check --side and which wall is which");
    Proposed result;
    result.seat = *seat;
    result.seat_from = "the walls drawn: axis between them, resection at their proximal ends";
    Result<std::vector<Implant>> sizes = implantsOf(options, seat->side);
    if (!sizes) return sizes.error();
    Result<TemplateProposal> proposal = proposeStem(*sizes, views, *seat, options.fit, progress);
    if (!proposal) return proposal.error();
    result.proposal = std::move(*proposal);
    for (Implant& implant : *sizes)
        if (implant.size == result.proposal.size) result.implant = std::move(implant);
    return result;
}

Json jsonOf(const LeastWall& wall) {
    if (!std::isfinite(wall.thickness_mm)) return nullptr;
    return {{"thickness_mm", wall.thickness_mm},
            {"below_resection_mm", wall.below_mm},
            {"side", wall.side},
            {"place_in_femur_mm", arrayOf(wall.place)},
            {"cut", wall.cut}};
}

Json jsonOf(const Options& options, const Proposed& proposed) {
    const TemplateProposal& proposal = proposed.proposal;
    Json fill = Json::array(), trials = Json::array();
    for (const FillLevel& level : proposal.fill)
        fill.push_back({{"below_resection_mm", level.below_mm},
                        {"stem_mm", arrayOf(level.stem_mm)},
                        {"canal_mm", arrayOf(level.canal_mm)},
                        {"medio_lateral", level.medioLateral()},
                        {"antero_posterior", level.anteroPosterior()},
                        {"area", level.area}});
    for (const SizeTrial& trial : proposal.trials)
        trials.push_back({{"size", trial.size},
                          {"fits", trial.fits},
                          {"excess_mm", numberOrNull(trial.excess_mm)},
                          {"femur_from_cavity",
                           std::isfinite(trial.excess_mm) ? rowsOf(trial.femur_from_cavity.matrix()) : Json(nullptr)},
                          {"reason", trial.reason}});
    return {{"schema", "fluorocut/template/1"},
            {"family", proposed.implant.family},
            {"size", proposal.size},
            {"side", name(proposed.implant.side)},
            {"femur_from_cavity", rowsOf(proposal.femur_from_cavity.matrix())},
            {"head_center_in_femur_mm", arrayOf(Vector3(proposal.femur_from_cavity * proposed.implant.head_center))},
            {"seat",
             {{"from", proposed.seat_from},
              {"resection_in_femur_mm", arrayOf(proposed.seat.point)},
              {"axis", arrayOf(proposed.seat.axis)},
              {"medial", arrayOf(proposed.seat.medial)}}},
            {"least_wall_limit_mm", options.fit.least_wall_mm},
            {"most_reaming_mm", options.fit.most_reaming_mm},
            {"room_mm", -proposal.excess_mm},
            {"least_wall", jsonOf(proposal.least_wall)},
            {"least_wall_where_cut", jsonOf(proposal.least_cut)},
            {"fill", fill},
            {"next_size", proposal.next_size_reason.empty() ? Json(nullptr) : Json(proposal.next_size_reason)},
            {"tried", trials},
            {"warnings", proposal.warnings},
            {"elapsed_ms", proposal.elapsed_ms}};
}

std::string wallText(const LeastWall& wall) {
    return fmt::format("{:.1f} mm, {} side, {:.0f} mm below the resection{}", wall.thickness_mm, wall.side,
                       wall.below_mm, wall.cut ? " (cut into)" : " (not cut into)");
}

Result<Report> run(const Options& options, Progress& progress) {
    if (options.ct.empty() == options.views.empty())
        return invalidOption("plan template", options.ct.empty() ? "neither --ct nor --view" : "both --ct and --view",
                             "one of them");
    if (options.ct.empty() && options.views.size() < 2)
        return invalidOption("--view", "one view", "two or more, about a quarter turn apart");
    if (options.ct.empty() && !(options.axis_mm.empty() && options.figure.empty()))
        return invalidOption(options.figure.empty() ? "--axis-mm" : "--figure", "it with --view", "it with --ct");
    if (auto good = options.fit.validate(); !good) return good.error();
    std::vector<std::filesystem::path> inputs;
    if (!options.ct.empty()) inputs.emplace_back(options.ct);
    for (const std::string& text : options.views)
        if (const auto parts = partsOf("--view", text, 4, "IMAGE,CARM,POSE,CONTOURS"); parts)
            inputs.insert(inputs.end(), parts->begin(), parts->end());
    for (const auto& [file, extensions] : {std::pair(&options.output, std::vector<std::string>{".json"}),
                                           std::pair(&options.proposal, std::vector<std::string>{".json"}),
                                           std::pair(&options.stem, std::vector<std::string>{".stl", ".obj", ".ply"}),
                                           std::pair(&options.figure, std::vector<std::string>{".png"})})
        if (!file->empty())
            if (auto good = checkOutput(*file, inputs, extensions); !good) return good.error();

    Result<Proposed> proposed = options.ct.empty() ? fromViews(options, progress) : fromCt(options, progress);
    if (!proposed) return proposed.error();
    const TemplateProposal& proposal = proposed->proposal;
    progress.report(0.95, "writing");
    const Json json = jsonOf(options, *proposed);
    if (!options.proposal.empty())
        if (auto written = writeWhole(options.proposal, json.dump(1) + "\n"); !written) return written.error();
    if (!options.stem.empty())
        if (auto written = writeMesh(options.stem, proposed->implant.in_bone); !written) return written.error();
    const Pose pose{Frame::femur, Frame::cavity, proposal.femur_from_cavity, std::nullopt};
    if (auto written = writePose(options.output, pose); !written) return written.error();

    Report report;
    report.json = json;
    report.json.erase("schema");
    report.json["pose"] = options.output;
    report.line("size",
                fmt::format("{} {}, {}", proposed->implant.family, proposal.size, name(proposed->implant.side)));
    report.line("room", fmt::format("{:.2f} mm all round before a limit is reached", -proposal.excess_mm));
    for (const FillLevel& level : proposal.fill)
        report.line(fmt::format("{:.0f} mm below", level.below_mm),
                    fmt::format("fills {:.0f} % medio-lateral, {:.0f} % antero-posterior, {:.0f} % of the area",
                                100 * level.medioLateral(), 100 * level.anteroPosterior(), 100 * level.area));
    if (std::isfinite(proposal.least_wall.thickness_mm)) report.line("least wall", wallText(proposal.least_wall));
    if (std::isfinite(proposal.least_cut.thickness_mm)) report.line("least where cut", wallText(proposal.least_cut));
    if (!proposal.next_size_reason.empty()) report.line("larger", proposal.next_size_reason);
    for (const SizeTrial& trial : proposal.trials)
        if (trial.fits && trial.size != proposal.size)
            report.line("smaller", fmt::format("size {} has {:.2f} mm of room", trial.size, -trial.excess_mm));
    report.line("pose", options.output);
    for (const std::string& warning : proposal.warnings)
        report.line("warning", warning);
    return report;
}

}  // namespace

Command declarePlanTemplate(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("template", "Propose a stem's size and place, from a CT or from two views");
    app->add_option("--ct", options->ct, "CT: file, DICOM folder, or the built-in femur");
    app->add_option(
        "--view", options->views,
        "IMAGE,CARM,POSE,CONTOURS: pose imager from femur; the canal's walls, fluorocut/contours/1. Twice or "
        "more");
    app->add_option("--family", options->family, "Family of implants: its name in resources/implants, or a file")
        ->required();
    app->add_option("--side", options->side, "Otherwise told from the CT or from the walls")
        ->check(CLI::IsMember({"left", "right"}));
    app->add_option("--axis-mm", options->axis_mm,
                    "x,y,z,x,y,z: two points in the canal, the first at the level of the resection, the second in the "
                    "shaft below; otherwise found in the CT")
        ->delimiter(',')
        ->expected(6);
    app->add_option("--least-wall-mm", options->fit.least_wall_mm, "What the stem must leave of a wall it cuts into")
        ->capture_default_str();
    app->add_option("--most-reaming-mm", options->fit.most_reaming_mm, "How far it may reach into the cortex")
        ->capture_default_str();
    app->add_option("--head-mm", options->head_mm, "Diameter of the head")->capture_default_str();
    app->add_option("--neck-mm", options->neck_mm, "What the head adds to the neck")->capture_default_str();
    app->add_option("-o,--out", options->output, "Pose femur from cavity, fluorocut/pose/1, for `plan stages`")
        ->required();
    app->add_option("--proposal", options->proposal, "All of the proposal, fluorocut/template/1 (what --json prints)");
    app->add_option("--stem", options->stem, "Mesh of the stem's part in bone, for `plan stages`: .stl .obj .ply");
    app->add_option("--figure", options->figure, "The stem in slices of the CT: .png");
    app->footer(
        "A starting point for the surgeon. The largest size is proposed that lies in the canal, reaches into the\n"
        "cortex by no more than --most-reaming-mm and leaves at least --least-wall-mm there.\n"
        "Example: fluorocut-cli plan template --ct femur --family straight -o stem.json --stem stem.stl --figure\n"
        "  stem.png");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
