// plan stages: the progressive cavities of an implant, as meshes.
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/plan.h"
#include "app/cli/numbers.h"
#include "app/cli/options.h"
#include "core/io/atomic_file.h"
#include "core/io/mesh_file.h"
#include "core/io/pose_file.h"
#include "core/planning/cavity.h"
#include "core/planning/containment.h"

namespace fluorocut::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr double kLayerUnasked_mm = 1;  // between stages, when no uncertainty says how much

struct Options {
    std::string implant, mesh_unit = "mm";
    std::string pose, registration;
    std::string output;
    CavityOptions cavity;
    std::optional<double> top_mm;
    int stages = 3;
    std::vector<double> insets_mm;
    double probability = ContainmentOptions{}.probability;
};

struct Stage {
    Cavity cavity;
    double inset_mm = 0;
};

struct Plan {
    std::optional<double> asked_mm;  // the first inset that the uncertainty asks for
    std::vector<Stage> stages;       // the last one is the final cavity
    std::vector<std::string> warnings;
};

Result<void> checkInsets(const std::vector<double>& insets_mm) {
    const std::string expected = fmt::format("insets that fall to 0, the first at most {:g} mm", kMostInset_mm);
    for (std::size_t n = 0; n < insets_mm.size(); ++n) {
        const double next = n + 1 < insets_mm.size() ? insets_mm[n + 1] : -1;
        if (!(insets_mm[n] > next && insets_mm[n] >= 0 && insets_mm[n] <= kMostInset_mm))
            return invalidOption("--insets-mm", fmt::format("{:g} in place {}", insets_mm[n], n + 1), expected);
    }
    if (!insets_mm.empty() && insets_mm.back() != 0)
        return invalidOption("--insets-mm", fmt::format("{:g} at the end", insets_mm.back()), expected);
    return {};
}

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

double insetAskedFor(const Cavity& final, const Pose& place, double probability) {
    std::vector<SurfacePoint> walls;
    for (const SurfacePoint& point : surfacePoints(final.mesh)) {
        if (point.position.z() >= final.top_mm - 1e-6) continue;  // the opening
        walls.push_back({place.target_from_source * point.position, place.target_from_source.rotate(point.normal)});
    }
    ContainmentOptions options;
    options.probability = probability;
    return containedInset(walls, place.target_from_source.translation(), *place.covariance, options);
}

Result<Plan> planStages(const Options& options, const TriangleMesh& implant, const std::optional<Pose>& place,
                        Progress& progress) {
    Plan plan;
    SubProgress first(progress, 0, 0.3);
    Result<Cavity> final = planCavity(implant, options.cavity, first);
    if (!final) return final.error();
    plan.warnings = final->warnings;
    std::vector<double> insets = options.insets_mm;
    if (place) plan.asked_mm = insetAskedFor(*final, *place, options.probability);
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
    for (std::size_t n = 0; n < insets.size(); ++n) {
        const double from = 0.3 + 0.7 * static_cast<double>(n) / static_cast<double>(insets.size());
        SubProgress part(progress, from, from + 0.7 / static_cast<double>(insets.size()));
        Result<Cavity> cavity = insetCavity(*final, insets[n], part);
        if (!cavity) {
            Error error = cavity.error();
            error.where = fmt::format("stage {} of {}: {}", n + 1, insets.size(), error.where);
            return error;
        }
        plan.stages.push_back({std::move(*cavity), insets[n]});
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
        stages.push_back({{"stage", n + 1},
                          {"mesh", fmt::format("stage_{}.stl", n + 1)},
                          {"inset_mm", plan.stages[n].inset_mm},
                          {"volume_mm3", cavity.volume_mm3},
                          {"depth_mm", cavity.top_mm - cavity.bottom_mm},
                          {"undercut_mm3", cavity.undercut_mm3},
                          {"unreachable_mm3", cavity.unreachable_mm3},
                          {"unreachable_mm", cavity.unreachable_mm}});
    }
    return {{"schema", "fluorocut/stages/1"},
            {"frame", "cavity"},
            {"implant", fs::path(options.implant).filename().string()},
            {"femur_from_cavity", rowsOf(femur_from_cavity.target_from_source.matrix())},
            {"cutter_radius_mm", options.cavity.cutter_radius_mm},
            {"offset_mm", options.cavity.offset_mm},
            {"top_mm", plan.stages.back().cavity.top_mm},
            {"spacing_mm", options.cavity.spacing_mm},
            {"probability", plan.asked_mm ? Json(options.probability) : Json(nullptr)},
            {"inset_asked_mm", numberOrNull(plan.asked_mm)},
            {"stages", stages},
            {"warnings", plan.warnings}};
}

Result<void> writePlan(const fs::path& folder, const Plan& plan, const Json& json) {
    for (std::size_t n = 0; n < plan.stages.size(); ++n) {
        const fs::path file = folder / json["stages"][n]["mesh"].get<std::string>();
        if (const Result<void> written = writeMesh(file, plan.stages[n].cavity.mesh); !written) return written.error();
    }
    return writeWhole(folder / "stages.json", json.dump(1) + "\n");
}

Result<Report> run(Options options, Progress& progress) {
    if (options.insets_mm.empty() && !(options.stages >= 1))
        return invalidOption("--stages", fmt::format("{}", options.stages), "1 or more");
    if (auto ok = checkInsets(options.insets_mm); !ok) return ok.error();
    options.cavity.top_mm = options.top_mm;
    if (auto ok = options.cavity.validate(); !ok) return ok.error();
    const Result<MeshFile> mesh =
        readMesh(options.implant, {.unit = options.mesh_unit == "m" ? LengthUnit::m : LengthUnit::mm});
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
    Result<Plan> planned = planStages(options, mesh->mesh, uncertainPose(*femur_from_cavity, registration), planning);
    if (!planned) return planned.error();
    planned->warnings.insert(planned->warnings.begin(), mesh->info.notes.begin(), mesh->info.notes.end());

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
        report.line(fmt::format("stage {}", stage["stage"].get<int>()),
                    fmt::format("{}: {:.2f} mm inside the final cavity, {:.0f} mm3, {:.1f} mm deep",
                                stage["mesh"].get<std::string>(), stage["inset_mm"].get<double>(),
                                stage["volume_mm3"].get<double>(), stage["depth_mm"].get<double>()));
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
    CLI::App* app = parent.add_subcommand("stages", "The progressive cavities of an implant, as meshes");
    app->add_option("--implant", options->implant,
                    "Closed mesh of the stem in the frame `cavity` (z along it, proximal positive): STL, OBJ, PLY")
        ->required();
    app->add_option("--mesh-unit", options->mesh_unit, "Unit of the mesh")
        ->check(CLI::IsMember({"mm", "m"}))
        ->capture_default_str();
    app->add_option("--femur-from-cavity", options->pose,
                    "Where the cavity is planned, fluorocut/pose/1; its covariance, if it has one, counts")
        ->required();
    app->add_option("--registration", options->registration,
                    "Pose robot from femur with its covariance (of `register chain`), fluorocut/pose/1");
    app->add_option("--cutter-radius-mm", options->cavity.cutter_radius_mm, "Radius of the cutter's ball")->required();
    app->add_option("-o,--out", options->output, "New folder for stage_1.stl ... and stages.json")->required();
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
    app->footer(
        "Writes stage_K.stl, the frame `cavity`, closed by the plane of the resection, and stages.json\n"
        "(fluorocut/stages/1: what was asked for; of every stage its mesh, inset, volume and depth). The first inset\n"
        "is the least one with which a cavity that the covariances displace stays inside the final one.\n"
        "Example: fluorocut-cli plan stages --implant stem.stl --femur-from-cavity plan.json --registration\n"
        "  robot_from_femur.json --cutter-radius-mm 3 -o stages");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
