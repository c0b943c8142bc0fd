#include "core/procedure/procedure.h"

#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "core/base/utc.h"
#include "core/procedure/standing.h"
#include "core/procedure/step_results.h"
#include "core/procedure/steps.h"

namespace fluorocut {
namespace {

std::string fileNameOf(const ProcedureStep& step) {
    std::string text = step.name();
    for (char& c : text)
        if (c == ' ') c = '_';
    return text + ".json";
}

std::string schemaOf(const ProcedureStep& step) {
    std::string text = step.name();
    return "fluorocut/step-" + text.substr(0, text.find(' ')) + "/1";
}

Result<Outcome> outcomeOf(const ProcedureStep& step, std::int64_t record, const std::string& json) {
    Result<StepFindings> findings = parseFindings(json, step.name());
    if (!findings) return findings.error();
    return Outcome{step,
                   record,
                   std::move(findings->summary),
                   std::move(findings->warnings),
                   std::move(findings->doubts),
                   std::move(findings->acceptance)};
}

Error notThere(const std::string& found, const std::string& expected, const std::string& advice = {}) {
    return invalidOption("procedure", found, expected, advice);
}

}  // namespace

struct Procedure::Inside {
    CaseStore store;
    ProcedureEquipment equipment;
    ProcedureSetup setup;
    CaseContent content;

    std::vector<StepStanding> steps() const { return standingOf(content, setup.plan.stages); }

    std::optional<StepStanding> first() const {
        for (const StepStanding& standing : steps())
            if (standing.state != StepState::accepted) return standing;
        return std::nullopt;
    }

    Result<void> reload() {
        Result<CaseContent> read = store.content();
        if (!read) return read.error();
        content = std::move(*read);
        return {};
    }

    ContentReader reader() const {
        return [this](const std::string& hash) { return store.bytes(hash); };
    }

    // Every image there is, so that none is taken for another.
    std::vector<std::string> imageHashes() const {
        std::vector<std::string> hashes;
        for (const Item& item : content.items)
            if (item.kind == ItemKind::image) hashes.push_back(item.hash);
        return hashes;
    }

    Result<CutOrder> orderFor(int stage) const;
    Result<StepOutput> work(const ProcedureStep& step, const StepInputs& inputs, Progress& progress);
    Result<Outcome> write(const ProcedureStep& step, const StepInputs& inputs, const StepOutput& output,
                          const std::string& started_utc);
};

// Everything that speaks for the cut, as the records of the case have it now.
Result<CutOrder> Procedure::Inside::orderFor(int stage) const {
    const std::string now = utcNow();
    CutOrder order;
    order.stage = stage;

    const ProcedureStep basis = registrationFor(stage);
    RegistrationStanding& registration = order.registration;
    for (const StepStanding& standing : steps()) {
        if (!(standing.step == basis)) continue;
        registration.fresh = standing.state == StepState::accepted;
        registration.stale_because = standing.why;
    }
    const Step* found = newestStep(content, basis.name());
    if (!found) return notThere("no result of " + basis.name(), "one that is accepted");
    registration.id = found->result;
    if (const Decision* decision = lastDecision(content, found->record); decision && decision->accepted)
        registration.accepted_by = decision->who;
    // As old as the first of the images that it rests on last.
    if (const Step* images = newestStep(content, ProcedureStep{StepKind::images, basis.stage}.name()))
        registration.age_s = secondsBetween(images->started_utc, now);
    const Result<std::string> text = store.bytes(found->result);
    if (!text) return text.error();
    if (basis.kind == StepKind::registration) {
        Result<RegistrationResult> result = parseRegistration(*text, basis.name());
        if (!result) return result.error();
        order.robot_from_femur = result->robot_from_femur;
    } else {
        Result<CorrectionResult> result = parseCorrection(*text, basis.name());
        if (!result) return result.error();
        order.robot_from_femur = result->robot_from_femur;
    }

    TimeOut& time_out = order.time_out;
    time_out.patient.in_case = setup.patient.name;
    time_out.side.in_case = setup.patient.side;
    time_out.implant.in_case = setup.plan.implant;
    time_out.stage.in_case = stageName(setup, stage);
    time_out.calibration_age_s = secondsBetween(setup.calibration.calibrated_utc, now);
    const Step* shown = newestStep(content, ProcedureStep{StepKind::timeOut, stage}.name());
    const Decision* confirmed = shown ? lastDecision(content, shown->record) : nullptr;
    if (confirmed && confirmed->accepted) {
        const Result<std::string> items = store.bytes(shown->result);
        if (!items) return items.error();
        const Result<TimeOutResult> result = parseTimeOut(*items, shown->name);
        if (!result) return result.error();
        time_out.patient.confirmed = result->patient;
        time_out.side.confirmed = result->side;
        time_out.implant.confirmed = result->implant;
        time_out.stage.confirmed = result->stage_name;
        time_out.calibration_age_confirmed = result->calibrated_utc == setup.calibration.calibrated_utc;
        time_out.confirmed_by = confirmed->who;
    }
    return order;
}

Result<StepOutput> Procedure::Inside::work(const ProcedureStep& step, const StepInputs& inputs, Progress& progress) {
    const bool acts = step.kind == StepKind::cut || step.kind == StepKind::images;
    if (acts && (!equipment.robot || !equipment.images))
        return notThere("no equipment for " + step.name(), "a C-arm and a robot");
    switch (step.kind) {
        case StepKind::images:
            return imagesStep(setup, step.stage, imageHashes(), equipment, progress);
        case StepKind::timeOut:
            return timeOutStep(setup, step.stage, utcNow());
        case StepKind::cut: {
            Result<CutOrder> order = orderFor(step.stage);
            if (!order) return order.error();
            std::optional<CaseContentItem> interrupted;
            Result<StepOutput> cut = cutStep(setup, std::move(*order), inputs, *equipment.robot, interrupted, progress);
            if (interrupted) {
                if (auto kept = store.addItem(interrupted->item, interrupted->bytes); !kept) return kept.error();
                if (auto read = reload(); !read) return read.error();
            }
            return cut;
        }
        default:
            return calculate(step, setup, inputs, progress);
    }
}

Result<Outcome> Procedure::Inside::write(const ProcedureStep& step, const StepInputs& inputs, const StepOutput& output,
                                         const std::string& started_utc) {
    for (const CaseContentItem& product : output.products) {
        if (auto added = store.addItem(product.item, product.bytes); !added) return added.error();
    }
    Item item;
    item.kind = ItemKind::result;
    item.schema = schemaOf(step);
    item.file_name = fileNameOf(step);
    const Result<Item> result = store.addItem(item, output.json);
    if (!result) return result.error();
    Step record;
    record.name = step.name();
    record.inputs = inputs.list();
    record.options_json = fmt::format("{{\"stage\": {}}}", step.stage);
    record.result = result->hash;
    record.started_utc = started_utc;
    record.finished_utc = utcNow();
    const Result<Step> added = store.addStep(record);
    if (!added) return added.error();
    if (auto read = reload(); !read) return read.error();
    return outcomeOf(step, added->record, output.json);
}

Procedure::Procedure(std::unique_ptr<Inside> inside) : inside_(std::move(inside)) {}
Procedure::Procedure(Procedure&&) noexcept = default;
Procedure& Procedure::operator=(Procedure&&) noexcept = default;
Procedure::~Procedure() = default;

Result<Procedure> Procedure::begin(CaseStore store, const ProcedureSetup& setup, ProcedureEquipment equipment) {
    const std::string started = utcNow();
    const Result<CaseContent> content = store.content();
    if (!content) return content.error();
    if (newestStep(*content, kSetupStep))
        return notThere("a case with a procedure in it", "one without", "resume it, or begin a new case");
    const Result<SetupItems> items = setupItems(setup);
    if (!items) return items.error();
    std::string hash;
    for (const CaseContentItem& one : items->items) {
        const Result<Item> added = store.addItem(one.item, one.bytes);
        if (!added) return added.error();
        hash = added->hash;
    }
    Step step;
    step.name = kSetupStep;
    step.inputs = items->inputs;
    step.options_json = "{}";
    step.result = hash;
    step.started_utc = started;
    step.finished_utc = utcNow();
    if (auto added = store.addStep(step); !added) return added.error();
    return resume(std::move(store), equipment);
}

Result<Procedure> Procedure::resume(CaseStore store, ProcedureEquipment equipment) {
    auto inside = std::make_unique<Inside>(Inside{std::move(store), equipment, {}, {}});
    if (auto read = inside->reload(); !read) return read.error();
    const Step* begun = newestStep(inside->content, kSetupStep);
    if (!begun) return notThere("a case without a procedure", "one that was begun", "begin one");
    const Result<std::string> text = inside->store.bytes(begun->result);
    if (!text) return text.error();
    Result<ProcedureSetup> setup = readSetup(*text, inside->reader());
    if (!setup) return setup.error();
    inside->setup = std::move(*setup);
    return Procedure(std::move(inside));
}

const ProcedureSetup& Procedure::setup() const {
    return inside_->setup;
}

const CaseStore& Procedure::store() const {
    return inside_->store;
}

std::vector<StepStanding> Procedure::steps() const {
    return inside_->steps();
}

std::optional<ProcedureStep> Procedure::next() const {
    const std::optional<StepStanding> first = inside_->first();
    return first ? std::optional(first->step) : std::nullopt;
}

Result<std::optional<Outcome>> Procedure::pending() const {
    const std::optional<StepStanding> first = inside_->first();
    if (!first || first->state != StepState::done) return std::optional<Outcome>();
    const Step* step = newestStep(inside_->content, first->step.name());
    const Result<std::string> text = inside_->store.bytes(step->result);
    if (!text) return text.error();
    Result<Outcome> outcome = outcomeOf(first->step, step->record, *text);
    if (!outcome) return outcome.error();
    return std::optional(std::move(*outcome));
}

Result<Outcome> Procedure::run(Progress& progress) {
    const std::optional<StepStanding> first = inside_->first();
    if (!first) return notThere("every step accepted", "a step that is still to be done");
    if (first->state == StepState::done)
        return notThere(first->step.name() + ", done and not judged", "a judgement first", "accept or refuse it");
    const std::string started = utcNow();
    Result<std::vector<StepInput>> list = inputsOf(first->step, inside_->content, inside_->store);
    if (!list) return list.error();
    const StepInputs inputs(std::move(*list), inside_->reader());
    const Result<StepOutput> output = inside_->work(first->step, inputs, progress);
    if (!output) return output.error();
    return inside_->write(first->step, inputs, *output, started);
}

Result<void> Procedure::decide(bool accept, const std::string& who, const std::string& why) {
    const std::optional<StepStanding> first = inside_->first();
    if (!first || first->state != StepState::done)
        return notThere("no outcome that waits for a judgement", "one", "run the next step");
    Decision decision;
    decision.step = first->record;
    decision.accepted = accept;
    decision.who = who;
    decision.why = why;
    if (auto added = inside_->store.addDecision(decision); !added) return added.error();
    return inside_->reload();
}

Result<void> Procedure::withdraw(const ProcedureStep& step, const std::string& who, const std::string& why) {
    for (const StepStanding& standing : inside_->steps()) {
        if (!(standing.step == step)) continue;
        if (standing.state != StepState::accepted)
            return notThere(step.name() + ", which is not accepted", "an accepted step");
        Decision decision;
        decision.step = standing.record;
        decision.accepted = false;
        decision.who = who;
        decision.why = why;
        if (auto added = inside_->store.addDecision(decision); !added) return added.error();
        return inside_->reload();
    }
    return notThere(step.name() + ", which is no step of it", "one of its steps");
}

}  // namespace fluorocut
