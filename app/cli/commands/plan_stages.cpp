// plan stages: the progressive cavities of an implant as meshes, and the tool paths that cut them.
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/plan.h"
#include "app/cli/files.h"
#include "app/cli/implants.h"
#include "app/cli/numbers.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/cutting/envelope_check.h"
#include "core/cutting/tool_path_file.h"
#include "core/io/atomic_file.h"
#include "core/io/mesh_file.h"
#include "core/io/pose_file.h"
#include "core/planning/cavity.h"
#include "core/planning/containment.h"
#include "core/procedure/setup.h"
#include "core/procedure/stage_plan.h"
#include "core/procedure/surface_error.h"

namespace fluorocut::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr double kLayerUnasked_mm = 1;  // between stages, when no uncertainty says how much

struct Options {
    ImplantWish implant;
    std::string mesh_unit = "mm";
    std::string pose, registration;
    std::string output;
    CavityOptions cavity;
    std::optional<double> top_mm;
    int stages = 3;
    std::vector<double> insets_mm;
    double probability = ContainmentOptions{}.probability;
    ToolPathOptions path;
    double most_tilt_deg = 0;
};

struct Plan {
    std::optional<double> asked_mm;  // the first inset that the uncertainty asks for
    std::vector<PlannedCut> stages;  // the last one is the final cavity
    std::vector<std::string> warnings;
};

// How sure one is of where the cavity will lie: femur_from_cavity's own covariance and that of the registration, in the
// frame of the outermost of them. Without a covariance in either: nothing. One without counts as exact beside the
// other.
std::optional<Pose> uncertainPose(const Pose& femur_from_cavity, const std::optional<Pose>& registration) {
    const auto exact = [](Pose pose) {
        if (!pose.covariance) pose.covariance = Matrix6::Zero();
        return pose;
    };
    if (!femur_from_cavity.covariance && !(registration && registration->covariance)) return std::nullopt;
    return registration ? exact(*registration) * exact(femur_from_cavity) : femur_from_cavity;
}

// A mesh as it stands, or a stem of the library or of an implant's file, of which what is below the resection counts.
Result<TriangleMesh> implantMesh(Options& options, std::vector<std::string>& notes) {
    const std::string extension = extensionOf(options.implant.name);
    if (extension == ".stl" || extension == ".obj" || extension == ".ply") {
        Result<MeshFile> mesh =
            readMesh(options.implant.name, {.unit = options.mesh_unit == "m" ? LengthUnit::m : LengthUnit::mm});
        if (!mesh) return mesh.error();
        notes = mesh->info.notes;
        return std::move(mesh->mesh);
    }
    Result<ChosenImplant> chosen = implantOf(options.implant);
    if (!chosen) return chosen.error();
    notes = chosen->remarks;
    if (!options.cavity.top_mm) options.cavity.top_mm = chosen->implant.resection_z_mm;
    return std::move(chosen->implant.in_bone);
}

Result<Plan> planStages(const Options& options, const TriangleMesh& implant, const std::optional<Pose>& place,
                        Progress& progress) {
    Plan plan;
    SubProgress first(progress, 0, 0.3);
    Result<Cavity> final = planCavity(implant, options.cavity, first);
    if (!final) return final.error();
    plan.warnings = final->warnings;
    std::vector<double> insets = options.insets_mm;
    if (place) {
        plan.asked_mm = insetFor(wallPoints(final->mesh, final->top_mm), *place, options.probability);
        if (insets.empty() && !(*plan.asked_mm <= kMostInset_mm)) {
            return noSolution(
                "the first stage", fmt::format("covariances that ask for an inset of {:.1f} mm", *plan.asked_mm),
                fmt::format("at most {:g} mm", kMostInset_mm), "register more exactly, or give --insets-mm");
        }
    }
    if (insets.empty()) {
        insets = plan.asked_mm ? stageInsets(options.stages, *plan.asked_mm)
                               : stageInsets(options.stages, (options.stages - 1) * kLayerUnasked_mm);
        if (!plan.asked_mm && options.stages > 1) {
            plan.warnings.push_back(fmt::format(
                "neither --femur-from-cavity nor --registration tells a covariance: the stages are {:g} mm apart, "
                "whatever the registration's error",
                kLayerUnasked_mm));
        }
    }
    if (plan.asked_mm && !(insets.front() >= *plan.asked_mm)) {
        plan.warnings.push_back(fmt::format(
            "the first stage is {:.2f} mm inside the final cavity; to stay inside it with a probability of {:g} it "
            "would have to be {:.2f} mm",
            insets.front(), options.probability, *plan.asked_mm));
    }
    const double share = 0.7 / static_cast<double>(insets.size());
    for (std::size_t n = 0; n < insets.size(); ++n) {
        const double from = 0.3 + share * static_cast<double>(n);
        SubProgress part(progress, from, from + share);
        Result<PlannedCut> stage = planCut(*final, insets[n], options.path, part);
        if (!stage) {
            Error error = stage.error();
            error.where = fmt::format("stage {} of {}: {}", n + 1, insets.size(), error.where);
            return error;
        }
        for (const std::string& warning : stage->path.path().warnings)
            plan.warnings.push_back(fmt::format("stage {}: {}", n + 1, warning));
        plan.stages.push_back(std::move(*stage));
    }
    return plan;
}

Json numberOrNull(const std::optional<double>& value) {
    return value ? Json(*value) : Json(nullptr);
}

Json jsonOf(const Plan& plan, const Options& options, const Pose& femur_from_cavity) {
    Json stages = Json::array();
    for (std::size_t n = 0; n < plan.stages.size(); ++n) {
        const Cavity& cavity = plan.stages[n].cavity;
        const CheckedToolPath& path = plan.stages[n].path;
        stages.push_back({{"stage", n + 1},
                          {"mesh", fmt::format("stage_{}.stl", n + 1)},
                          {"inset_mm", plan.stages[n].inset_mm},
                          {"volume_mm3", cavity.volume_mm3},
                          {"depth_mm", cavity.top_mm - cavity.bottom_mm},
                          {"layers", path.path().layers},
                          {"cutting_mm", path.path().cutting_mm},
                          {"cutting_time_s", path.path().time_s},
                          {"tool_path", fmt::format("path_{}.json", n + 1)},
                          {"checked", true},  // otherwise there would be no path
                          {"worst_by_mesh_mm", path.worstByMesh()},
                          {"worst_by_voxels_mm", path.worstByVoxels()},
                          {"undercut_mm3", cavity.undercut_mm3},
                          {"unreachable_mm3", cavity.unreachable_mm3},
                          {"unreachable_mm", cavity.unreachable_mm}});
    }
    const Cavity& final = plan.stages.back().cavity;
    return {{"schema", "fluorocut/stages/1"},
            {"frame", "cavity"},
            {"implant", fs::path(options.implant.name).filename().string()},
            {"femur_from_cavity", rowsOf(femur_from_cavity.target_from_source.matrix())},
            {"cutter_radius_mm", options.cavity.cutter_radius_mm},
            {"cutter_length_mm", options.path.cutter.length_mm},
            {"offset_mm", options.cavity.offset_mm},
            {"top_mm", final.top_mm},
            {"spacing_mm", options.cavity.spacing_mm},
            {"probability", plan.asked_mm ? Json(options.probability) : Json(nullptr)},
            {"inset_asked_mm", numberOrNull(plan.asked_mm)},
            {"undercut_mm3", final.undercut_mm3},
            {"unreachable_mm3", final.unreachable_mm3},
            {"unreachable_mm", final.unreachable_mm},
            {"stages", stages},
            {"warnings", plan.warnings}};
}

Result<void> writePlan(const fs::path& folder, const Plan& plan, const Json& json) {
    for (std::size_t n = 0; n < plan.stages.size(); ++n) {
        const fs::path file = folder / json["stages"][n]["mesh"].get<std::string>();
        if (const Result<void> written = writeMesh(file, plan.stages[n].cavity.mesh); !written) return written.error();
        const fs::path path = folder / json["stages"][n]["tool_path"].get<std::string>();
        if (const Result<void> written = writeToolPath(path, plan.stages[n].path.path()); !written)
            return written.error();
    }
    return writeWhole(folder / "stages.json", json.dump(1) + "\n");
}

Result<Report> run(Options options, Progress& progress) {
    if (options.insets_mm.empty() && !(options.stages >= 1))
        return invalidOption("--stages", fmt::format("{}", options.stages), "1 or more");
    if (auto ok = checkInsets("--insets-mm", options.insets_mm); !ok) return ok.error();
    if (auto ok = requireNewFolder(options.output); !ok) return ok.error();
    options.cavity.top_mm = options.top_mm;
    if (auto ok = options.cavity.validate(); !ok) return ok.error();
    options.path.cutter.radius_mm = options.cavity.cutter_radius_mm;
    options.path.most_tilt_rad = radiansFromDegrees(options.most_tilt_deg);
    if (auto ok = options.path.validate(); !ok) return ok.error();
    std::vector<std::string> notes;
    const Result<TriangleMesh> mesh = implantMesh(options, notes);
    if (!mesh) return mesh.error();
    const Result<Pose> femur_from_cavity = readPose(options.pose, Frame::femur, Frame::cavity);
    if (!femur_from_cavity) return femur_from_cavity.error();
    std::optional<Pose> registration;
    if (!options.registration.empty()) {
        Result<Pose> read = readPose(options.registration, Frame::robot, Frame::femur);
        if (!read) return read.error();
        registration = std::move(*read);
    }
    SubProgress planning(progress, 0, 0.9);
    Result<Plan> planned = planStages(options, *mesh, uncertainPose(*femur_from_cavity, registration), planning);
    if (!planned) return planned.error();
    planned->warnings.insert(planned->warnings.begin(), notes.begin(), notes.end());

    const Json json = jsonOf(*planned, options, *femur_from_cavity);
    progress.report(0.9, "writing");
    const Result<void> written =
        writeWholeFolder(options.output, [&](const fs::path& folder) { return writePlan(folder, *planned, json); });
    if (!written) return written.error();

    Report report;
    report.json = json;
    report.json.erase("schema");
    report.json["folder"] = options.output;
    Json files = Json::array({"stages.json"});
    for (const Json& stage : json["stages"]) {
        files.push_back(stage["mesh"]);
        files.push_back(stage["tool_path"]);
        report.line(
            fmt::format("stage {}", stage["stage"].get<int>()),
            fmt::format("{}: {:.2f} mm inside the final cavity, {:.0f} mm3, {:.1f} mm deep, {:.0f} s of cutting",
                        stage["mesh"].get<std::string>(), stage["inset_mm"].get<double>(),
                        stage["volume_mm3"].get<double>(), stage["depth_mm"].get<double>(),
                        stage["cutting_time_s"].get<double>()));
    }
    report.json["files"] = files;
    report.line("undercut", fmt::format("{:.1f} mm3", planned->stages.back().cavity.undercut_mm3));
    report.line("left by the cutter",
                fmt::format("{:.1f} mm3, {:.2f} mm thick at most", planned->stages.back().cavity.unreachable_mm3,
                            planned->stages.back().cavity.unreachable_mm));
    report.line("folder", options.output);
    for (const std::string& warning : planned->warnings)
        report.line("warning", warning);
    return report;
}

}  // namespace

Command declarePlanStages(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("stages", "The progressive cavities of an implant and their tool paths");
    app->add_option(
           "--implant", options->implant.name,
           "Closed mesh of the stem, already in the frame `cavity` (z along it, proximal positive): STL, OBJ,\n"
           "PLY; or one of `implant list`, or a file of `implant import`")
        ->required();
    declareChoice(*app, options->implant);
    app->add_option("--mesh-unit", options->mesh_unit, "Unit of the mesh")
        ->check(CLI::IsMember({"mm", "m"}))
        ->capture_default_str();
    app->add_option("--femur-from-cavity", options->pose,
                    "Where the cavity is planned, fluorocut/pose/1; its covariance, if it has one, counts")
        ->required();
    app->add_option("--registration", options->registration,
                    "Pose robot from femur with its covariance (of `register chain`), fluorocut/pose/1");
    app->add_option("--cutter-radius-mm", options->cavity.cutter_radius_mm, "Radius of the cutter's ball")->required();
    app->add_option("-o,--out", options->output, "New folder for stage_K.stl, path_K.json and stages.json")->required();
    app->add_option("--stages", options->stages, "How many, the final cavity included")
        ->check(CLI::Range(1, 20))
        ->capture_default_str();
    app->add_option("--insets-mm", options->insets_mm,
                    "How far inside the final cavity each stage lies, instead of what the covariance asks for: 2,1,0")
        ->delimiter(',');
    app->add_option("--probability", options->probability, "That the first stage stays inside the final cavity")
        ->check(between(0.5, 0.9999))
        ->capture_default_str();
    app->add_option("--offset-mm", options->cavity.offset_mm, "Cement mantle (+) or press fit (-)")
        ->capture_default_str();
    app->add_option("--top-mm", options->top_mm,
                    "z of the resection; otherwise the mesh's highest point, so state it when the mesh has a neck");
    app->add_option("--spacing-mm", options->cavity.spacing_mm, "Of the voxels that it is planned on")
        ->capture_default_str();
    app->add_option("--cutter-length-mm", options->path.cutter.length_mm,
                    "Of what may touch bone, from the ball's centre")
        ->capture_default_str();
    app->add_option("--step-down-mm", options->path.step_down_mm, "Between layers")->capture_default_str();
    app->add_option("--step-over-mm", options->path.step_over_mm, "Between loops in a layer")->capture_default_str();
    app->add_option("--max-tilt-deg", options->most_tilt_deg, "Of the spindle from z; 0: one direction for all moves")
        ->check(between(0, 60))
        ->capture_default_str();
    app->footer(
        "Writes stage_K.stl, the frame `cavity`, closed by the plane of the resection; path_K.json\n"
        "(fluorocut/tool-path/1), which two checks let pass; and stages.json (fluorocut/stages/1: what was asked for;\n"
        "of every stage its files, inset, volume, depth, layers and cutting time). The first inset is the least one "
        "with\n"
        "which a cavity that the covariances displace stays inside the final one.\n"
        "Example: fluorocut-cli plan stages --implant stem.stl --femur-from-cavity plan.json --registration\n"
        "  robot_from_femur.json --cutter-radius-mm 3 -o stages");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
