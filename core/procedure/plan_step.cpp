// plan: the cavities of all stages and their tool paths.
#include <fmt/format.h>

#include "core/cutting/tool_path_file.h"
#include "core/io/mesh_file.h"
#include "core/procedure/stage_plan.h"
#include "core/procedure/steps.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;

Result<std::string> addFile(StepOutput& output, ItemKind kind, const std::string& schema, const std::string& file_name,
                            const std::function<Result<void>(const fs::path&)>& write) {
    Result<std::string> bytes = bytesOf(file_name, write);
    if (!bytes) return bytes.error();
    CaseContentItem made;
    made.item.kind = kind;
    made.item.schema = schema;
    made.item.file_name = file_name;
    made.bytes = std::move(*bytes);
    output.products.push_back(std::move(made));
    return output.products.back().hash();
}

}  // namespace

Result<StepOutput> planStep(const ProcedureSetup& setup, const StepInputs& inputs, Progress& progress) {
    const Result<RegistrationResult> registration = inputs.result("register", parseRegistration);
    if (!registration) return registration.error();
    const Pose place = announcedPlace(setup, registration->robot_from_femur);
    const ProcedurePlan& wanted = setup.plan;
    SubProgress first(progress, 0, 0.3);
    const Result<Cavity> final = planCavity(wanted.mesh, wanted.cavity, first);
    if (!final) return final.error();

    PlanResult result;
    StepOutput output;
    result.findings.warnings = final->warnings;
    result.unreachable_mm = final->unreachable_mm;
    const std::vector<SurfacePoint> walls = wallPoints(final->mesh, final->top_mm);
    // Inside the final cavity with the probability that is asked for, and by the bound that the supervisor looks at.
    result.asked_mm =
        std::max(insetFor(walls, place, setup.limits.contained_probability), surfaceError(walls, place).bound_mm);
    std::vector<double> insets = wanted.insets_mm;
    if (insets.empty()) {
        if (!(result.asked_mm <= kMostInset_mm)) {
            return noSolution("the first stage",
                              fmt::format("a registration that asks for an inset of {:.1f} mm", result.asked_mm),
                              fmt::format("at most {:g} mm", kMostInset_mm), "register more exactly");
        }
        insets = stageInsets(wanted.stages, result.asked_mm);
    }
    const double share = 0.7 / static_cast<double>(insets.size());
    for (std::size_t n = 0; n < insets.size(); ++n) {
        const double from = 0.3 + share * static_cast<double>(n);
        SubProgress part(progress, from, from + share);
        const Result<PlannedCut> cut = planCut(*final, insets[n], wanted.path, part);
        if (!cut) {
            Error error = cut.error();
            error.where = fmt::format("{}: {}", stageName(setup, static_cast<int>(n) + 1), error.where);
            return error;
        }
        const Cavity& cavity = cut->cavity;
        const ToolPath& path = cut->path.path();
        const Result<std::string> mesh =
            addFile(output, ItemKind::mesh, "model/stl", fmt::format("stage_{}.stl", n + 1),
                    [&](const fs::path& file) { return writeMesh(file, cavity.mesh); });
        if (!mesh) return mesh.error();
        const Result<std::string> moves =
            addFile(output, ItemKind::plan, "fluorocut/tool-path/1", fmt::format("path_{}.json", n + 1),
                    [&](const fs::path& file) { return writeToolPath(file, path); });
        if (!moves) return moves.error();
        for (const std::string& warning : path.warnings)
            result.findings.warnings.push_back(fmt::format("stage {}: {}", n + 1, warning));
        result.stages.push_back({insets[n], *mesh, *moves, cavity.volume_mm3, cavity.top_mm - cavity.bottom_mm,
                                 cavity.top_mm, path.layers, path.cutting_mm, path.time_s, cut->path.worstByMesh(),
                                 cut->path.worstByVoxels()});
        if (n == 0) result.bound_mm = surfaceError(wallPoints(cavity.mesh, cavity.top_mm), place).bound_mm;
    }
    if (const std::string against = boundAgainstRoom(setup, 1, insets.front(), result.bound_mm); !against.empty())
        result.findings.doubts.push_back(against);
    const double room = insets.front() > 0 ? insets.front() : setup.limits.envelope_delta_mm;
    result.findings.acceptance.push_back(atMost("first stage, 95 % bound", result.bound_mm, room, "mm"));
    std::string list;
    for (const double inset : insets)
        list += fmt::format("{}{:.2f}", list.empty() ? "" : ", ", inset);
    result.findings.summary = fmt::format(
        "{} stage{} planned, {} mm inside the final cavity; the first may lie {:.2f} mm (95 %) from its "
        "place.",
        insets.size(), insets.size() == 1 ? "" : "s", list, result.bound_mm);
    output.json = jsonText(result);
    return output;
}

}  // namespace fluorocut
