#include "core/experiments/procedure_run.h"

#include <algorithm>

#include <fmt/format.h>

#include "core/base/stopwatch.h"
#include "core/cutting/tool_path_file.h"
#include "core/experiments/simulated_operation.h"
#include "core/procedure/content.h"
#include "core/procedure/cutting_motion.h"
#include "core/procedure/step_results.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kScenarioItem = "scenario.json";

std::string stageName(int stage, int stages) {
    return fmt::format("stage {} of {}", stage, stages);
}

// The result of a step of that name, the newest accepted one.
template <class T>
Result<T> resultOf(const CaseStore& store, const CaseContent& content, const std::string& step,
                   Result<T> (*parse)(std::string_view, const std::string&)) {
    const auto accepted = lastAccepted(content, step);
    if (!accepted) return noSolution(step, "not accepted yet", "an accepted step");
    const auto bytes = store.bytes(accepted->result);
    if (!bytes) return bytes.error();
    return parse(*bytes, step);
}

// Nothing: the case is not of a simulation.
Result<std::optional<std::string>> scenarioIn(const CaseStore& store) {
    const auto content = store.content();
    if (!content) return content.error();
    for (const Item& item : content->items) {
        if (item.file_name != kScenarioItem || item.schema != kScenarioSchema) continue;
        auto bytes = store.bytes(item.hash);
        if (!bytes) return bytes.error();
        return std::optional(std::move(*bytes));
    }
    return std::optional<std::string>();
}

// A case that is there is of this scenario, or it is not touched.
Result<void> requireSameScenario(const CaseStore& store, const std::string& text, const fs::path& path) {
    const auto scenario = scenarioIn(store);
    if (!scenario) return scenario.error();
    if (*scenario && **scenario == text) return {};
    if (*scenario) {
        return invalidInput(path.string(), "the case of another scenario", "a new case, or one of this scenario",
                            "give another --case, or the scenario and the seed that it was begun with");
    }
    return invalidInput(path.string(), "a case without a scenario", "a case that was begun by `procedure run`",
                        "give another --case");
}

class Runner {
  public:
    Runner(SimulatedOperation& operation, const RunListener& listener) : operation_(operation), listener_(listener) {}

    Result<ProcedureRun> run(const fs::path& case_file, Progress& progress);
    Result<ProcedureRun> look(CaseStore store);

  private:
    Result<Procedure> begin(CaseStore store, Progress& progress);
    Result<void> replay(const Procedure& procedure);
    Result<StageFigures> figures(const Procedure& procedure, int stage) const;
    Result<void> registered(const Procedure& procedure, ProcedureRun& run) const;
    Result<void> addFigures(const Procedure& procedure, ProcedureRun& run) const;
    CavityOffset offset(const Rigid3& planned, const Rigid3& found) const { return offsetOf(walls_, planned, found); }

    SimulatedOperation& operation_;
    const RunListener& listener_;
    std::vector<SurfacePoint> walls_;
    int stages_ = 0;
};

Result<Procedure> Runner::begin(CaseStore store, Progress& progress) {
    const auto content = store.content();
    if (!content) return content.error();
    if (lastAccepted(*content, "images 0") || !content->steps.empty() || content->items.size() > 1)
        return Procedure::resume(std::move(store), operation_.equipment());
    auto setup = operation_.calibrate(progress);
    if (!setup) return setup.error();
    return Procedure::begin(std::move(store), *setup, operation_.equipment());
}

// The cuts that the case has, as they were executed: the path in the case, by the registration in the case.
Result<void> Runner::replay(const Procedure& procedure) {
    const auto content = procedure.store().content();
    if (!content) return content.error();
    for (int stage = 1; stage <= stages_; ++stage) {
        const auto cut = resultOf(procedure.store(), *content, fmt::format("cut {}", stage), parseCut);
        if (!cut) {
            // One that was done and waits for its judgement has been executed too.
            const auto waiting = procedure.pending();
            if (!waiting) return waiting.error();
            if (!*waiting || !((*waiting)->step == ProcedureStep{StepKind::cut, stage})) return {};
        }
        const Step* newest = nullptr;
        for (const Step& step : content->steps)
            if (step.name == fmt::format("cut {}", stage)) newest = &step;
        const auto bytes = procedure.store().bytes(newest->result);
        if (!bytes) return bytes.error();
        const auto done = parseCut(*bytes, newest->name);
        if (!done) return done.error();
        const auto plan = resultOf(procedure.store(), *content, "plan", parsePlan);
        if (!plan) return plan.error();
        const PlannedStage& planned = plan->stages[static_cast<std::size_t>(stage - 1)];
        const auto path_bytes = procedure.store().bytes(planned.path);
        if (!path_bytes) return path_bytes.error();
        const auto path = readBytes("path.json", *path_bytes, readToolPath);
        if (!path) return path.error();
        const auto steps = cuttingMotion(*path, {done->robot_from_cavity, operation_.robotFromCutter(),
                                                 procedure.setup().plan.path.openPlane(planned.top_mm)});
        if (!steps) return steps.error();
        if (auto ok = operation_.replay(stageName(stage, stages_), *steps); !ok) return ok;
    }
    return {};
}

Result<StageFigures> Runner::figures(const Procedure& procedure, int stage) const {
    const CaseStore& store = procedure.store();
    const auto content = store.content();
    if (!content) return content.error();
    const auto cut = resultOf(store, *content, fmt::format("cut {}", stage), parseCut);
    if (!cut) return cut.error();
    const auto truth = operation_.truthOfCut(stageName(stage, stages_), cut->robot_from_cavity);
    if (!truth) return truth.error();
    const Rigid3& planned = procedure.setup().plan.femur_from_cavity;
    StageFigures figures;
    figures.stage = stage;
    figures.inset_mm = cut->inset_mm;
    figures.truth = offset(planned, truth->femur_from_cavity);
    figures.bound_mm = cut->bound_mm;
    figures.held = figures.truth.most_mm <= figures.bound_mm;
    figures.robot_rms_mm = truth->rms_mm;
    figures.time_s = cut->time_s;
    figures.greatest_force_n = cut->greatest_force_n;
    // Located, accepted or waiting for somebody to look.
    for (const Step& step : content->steps) {
        if (step.name != fmt::format("locate {}", stage)) continue;
        const auto bytes = store.bytes(step.result);
        if (!bytes) return bytes.error();
        const auto location = parseLocation(*bytes, step.name);
        if (!location) return location.error();
        figures.estimate = offset(planned, location->femur_from_cut_cavity.target_from_source);
        figures.estimate_bound_mm = location->bound_mm;
        const PlannedOperation& plan = operation_.plan();
        const Rigid3 to_middle = Rigid3::fromTranslation({0, 0, 0.5 * (plan.top_mm + plan.bottom_mm)});
        const Rigid3 error = (truth->femur_from_cavity * to_middle).inverse() *
                             (location->femur_from_cut_cavity.target_from_source * to_middle);
        figures.estimate_error_in_cavity = error.deltaFrom(Rigid3());
        figures.estimate_error = offset(truth->femur_from_cavity, location->femur_from_cut_cavity.target_from_source);
    }
    return figures;
}

Result<void> Runner::registered(const Procedure& procedure, ProcedureRun& run) const {
    const auto content = procedure.store().content();
    if (!content) return content.error();
    const auto result = resultOf(procedure.store(), *content, "register", parseRegistration);
    if (!result) return {};  // not yet
    run.registered95_mm = result->radius95_mm;
    const Rigid3& planned = procedure.setup().plan.femur_from_cavity;
    run.registered =
        offset(planned, operation_.femurFromRobot() * result->robot_from_femur.target_from_source * planned);
    return {};
}

Result<ProcedureRun> Runner::run(const fs::path& case_file, Progress& progress) {
    Stopwatch watch;
    const PlannedOperation& plan = operation_.plan();
    walls_ = wallPoints(plan.mesh, plan.top_mm);
    stages_ = operation_.scenario().cut.stages;
    const std::string text = textOf(operation_.scenario());
    std::error_code ignored;
    const bool there = fs::exists(case_file, ignored);
    auto store = there ? CaseStore::open(case_file, CaseStore::Access::write)
                       : CaseStore::create(case_file, operation_.scenario().name);
    if (!store) return store.error();
    ProcedureRun run;
    run.implant = plan.implant;
    run.remarks = plan.remarks;
    run.resumed = there;
    if (there) {
        if (auto same = requireSameScenario(*store, text, case_file); !same) return same.error();
    } else {
        Item item;
        item.kind = ItemKind::plan;
        item.schema = kScenarioSchema;
        item.file_name = kScenarioItem;
        if (auto added = store->addItem(item, text); !added) return added.error();
    }
    SubProgress preparing(progress, 0, 0.3), working(progress, 0.3, 1);
    auto procedure = begin(std::move(*store), preparing);
    if (!procedure) return procedure.error();
    if (const auto info = procedure->store().info(); info) run.case_id = info->id;
    if (there) {
        if (auto replayed = replay(*procedure); !replayed) return replayed.error();
    }
    run.prepare_ms = watch.ms();

    Stopwatch running;
    const auto heard = [&](const Outcome& outcome) {
        if (listener_.outcome) listener_.outcome(outcome);
        if (outcome.step.kind != StepKind::locate || !listener_.stage) return;
        if (const auto found = figures(*procedure, outcome.step.stage); found) listener_.stage(*found);
    };
    const auto done = runByLimits(*procedure, operation_.scenario().name + ", by the limits", working, heard);
    run.run_ms = running.ms();
    run.finished = done.ok();
    if (!done) {
        const auto waiting = procedure->pending();
        if (done.error().isCancelled() || !waiting || !*waiting) return done.error();
        run.stopped = done.error().message();
    }
    if (auto ok = addFigures(*procedure, run); !ok) return ok.error();
    return run;
}

Result<void> Runner::addFigures(const Procedure& procedure, ProcedureRun& run) const {
    if (auto ok = registered(procedure, run); !ok) return ok;
    for (int stage = 1; stage <= stages_; ++stage) {
        auto found = figures(procedure, stage);
        if (!found) break;  // not cut
        run.stages.push_back(std::move(*found));
    }
    return {};
}

Result<ProcedureRun> Runner::look(CaseStore store) {
    const PlannedOperation& plan = operation_.plan();
    walls_ = wallPoints(plan.mesh, plan.top_mm);
    stages_ = operation_.scenario().cut.stages;
    ProcedureRun run;
    run.implant = plan.implant;
    run.remarks = plan.remarks;
    run.resumed = true;
    auto procedure = Procedure::resume(std::move(store), {});
    if (!procedure) return procedure.error();
    if (const auto info = procedure->store().info(); info) run.case_id = info->id;
    if (auto replayed = replay(*procedure); !replayed) return replayed.error();
    run.finished = !procedure->next();
    if (auto ok = addFigures(*procedure, run); !ok) return ok.error();
    return run;
}

}  // namespace

Result<ProcedureRun> runProcedure(const Scenario& scenario, const fs::path& case_file, Progress& progress,
                                  const RunListener& listener) {
    Stopwatch watch;
    SubProgress making(progress, 0, 0.15), running(progress, 0.15, 1);
    auto operation = SimulatedOperation::create(scenario, making);
    if (!operation) return operation.error();
    const double made_ms = watch.ms();
    auto run = Runner(*operation, listener).run(case_file, running);
    if (run) run->prepare_ms += made_ms;
    return run;
}

Result<std::optional<ProcedureRun>> lookAtProcedure(const fs::path& case_file, Progress& progress) {
    auto store = CaseStore::open(case_file, CaseStore::Access::read);
    if (!store) return store.error();
    const auto text = scenarioIn(*store);
    if (!text) return text.error();
    if (!*text) return std::optional<ProcedureRun>();
    const auto scenario = parseScenario(**text, case_file);
    if (!scenario) return scenario.error();
    auto operation = SimulatedOperation::create(*scenario, progress);
    if (!operation) return operation.error();
    auto run = Runner(*operation, {}).look(std::move(*store));
    if (!run) return run.error();
    return std::optional(std::move(*run));
}

}  // namespace fluorocut
