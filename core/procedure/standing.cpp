#include "core/procedure/standing.h"

#include <algorithm>
#include <charconv>
#include <utility>

#include <fmt/format.h>

#include "core/procedure/step_results.h"

namespace fluorocut {
namespace {

constexpr std::pair<StepKind, std::string_view> kNames[] = {
    {StepKind::images, "images"},  {StepKind::registration, "register"},
    {StepKind::plan, "plan"},      {StepKind::timeOut, "time-out"},
    {StepKind::cut, "cut"},        {StepKind::locate, "locate"},
    {StepKind::correct, "correct"}};

bool hasStage(StepKind kind) {
    return kind != StepKind::registration && kind != StepKind::plan;
}

}  // namespace

std::string ProcedureStep::name() const {
    for (const auto& [of, text] : kNames) {
        if (of != kind) continue;
        return hasStage(kind) ? fmt::format("{} {}", text, stage) : std::string(text);
    }
    return {};
}

std::optional<ProcedureStep> stepFromName(std::string_view name) {
    for (const auto& [kind, text] : kNames) {
        if (!name.starts_with(text)) continue;
        std::string_view rest = name.substr(text.size());
        if (!hasStage(kind)) {
            if (rest.empty()) return ProcedureStep{kind, 0};
            continue;
        }
        int stage = -1;
        if (rest.size() < 2 || rest.front() != ' ') continue;
        rest.remove_prefix(1);
        const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), stage);
        if (error == std::errc() && end == rest.data() + rest.size() && stage >= 0) return ProcedureStep{kind, stage};
    }
    return std::nullopt;
}

std::vector<ProcedureStep> stepsOf(int stages) {
    std::vector<ProcedureStep> steps{{StepKind::images, 0}, {StepKind::registration, 0}, {StepKind::plan, 0}};
    for (int k = 1; k <= stages; ++k) {
        for (const StepKind kind :
             {StepKind::timeOut, StepKind::cut, StepKind::images, StepKind::locate, StepKind::correct})
            steps.push_back({kind, k});
    }
    return steps;
}

ProcedureStep registrationFor(int stage) {
    return stage <= 1 ? ProcedureStep{StepKind::registration, 0} : ProcedureStep{StepKind::correct, stage - 1};
}

const Step* newestStep(const CaseContent& content, std::string_view name) {
    const auto found =
        std::find_if(content.steps.rbegin(), content.steps.rend(), [&](const Step& step) { return step.name == name; });
    return found == content.steps.rend() ? nullptr : &*found;
}

const Decision* lastDecision(const CaseContent& content, std::int64_t step_record) {
    const auto found = std::find_if(content.decisions.rbegin(), content.decisions.rend(),
                                    [&](const Decision& decision) { return decision.step == step_record; });
    return found == content.decisions.rend() ? nullptr : &*found;
}

std::vector<StepStanding> standingOf(const CaseContent& content, int stages) {
    std::vector<StepStanding> standings;
    std::string broken;            // the first step before that is not accepted
    std::int64_t newest_base = 0;  // newest record among the accepted steps before
    std::string newest_name;
    for (const ProcedureStep& step : stepsOf(stages)) {
        StepStanding standing;
        standing.step = step;
        const Step* done = newestStep(content, step.name());
        const Decision* decision = done ? lastDecision(content, done->record) : nullptr;
        if (!done) {
            standing.state = broken.empty() ? StepState::ready : StepState::waiting;
        } else {
            standing.record = done->record;
            if (decision && !decision->accepted) {
                standing.state = StepState::refused;
                standing.why = fmt::format("{}: {}", decision->who, decision->why);
            } else if (!broken.empty()) {
                standing.state = StepState::stale;
                standing.why = fmt::format("{} is no longer accepted", broken);
            } else if (newest_base > done->record) {
                standing.state = StepState::stale;
                standing.why = fmt::format("{} was done anew", newest_name);
            } else {
                standing.state = decision ? StepState::accepted : StepState::done;
            }
        }
        if (standing.state != StepState::accepted && broken.empty()) broken = step.name();
        if (standing.state == StepState::accepted && standing.record > newest_base) {
            newest_base = standing.record;
            newest_name = step.name();
        }
        standings.push_back(std::move(standing));
    }
    return standings;
}

Result<std::vector<StepInput>> inputsOf(const ProcedureStep& step, const CaseContent& content, const CaseStore& store) {
    std::vector<StepInput> inputs;
    Result<void> good;
    const auto add = [&](const ProcedureStep& of) -> const Step* {
        const Step* done = newestStep(content, of.name());
        if (!done) {
            if (good) good = invalidInput("case", "no result of " + of.name(), "one, before " + step.name());
            return nullptr;
        }
        inputs.push_back({of.name(), done->result});
        return done;
    };
    const auto addImages = [&](int stage) {
        const Step* done = add({StepKind::images, stage});
        if (!done) return;
        const Result<std::string> text = store.bytes(done->result);
        const Result<ImagesResult> taken = text ? parseImages(*text, done->name) : Result<ImagesResult>(text.error());
        if (!taken) {
            if (good) good = taken.error();
            return;
        }
        for (const TakenImage& image : taken->images)
            inputs.push_back({fmt::format("images {} {}", stage, image.view), image.hash});
    };
    const auto addPlan = [&](const std::vector<int>& meshes, const std::vector<int>& paths) {
        const Step* done = add({StepKind::plan, 0});
        if (!done) return;
        const Result<std::string> text = store.bytes(done->result);
        const Result<PlanResult> plan = text ? parsePlan(*text, done->name) : Result<PlanResult>(text.error());
        if (!plan) {
            if (good) good = plan.error();
            return;
        }
        const int stages = static_cast<int>(plan->stages.size());
        for (const int k : meshes) {
            if (k <= stages)
                inputs.push_back({fmt::format("mesh {}", k), plan->stages[static_cast<std::size_t>(k - 1)].mesh});
        }
        for (const int k : paths) {
            if (k <= stages)
                inputs.push_back({fmt::format("path {}", k), plan->stages[static_cast<std::size_t>(k - 1)].path});
        }
    };

    const Step* setup = newestStep(content, kSetupStep);
    if (!setup) return invalidInput("case", "no procedure in it", "one that was begun", "begin one in a new case");
    inputs.push_back({"setup", setup->result});
    for (const StepInput& input : setup->inputs)
        inputs.push_back(input);
    const int k = step.stage;
    switch (step.kind) {
        case StepKind::images:
            if (k > 0) add({StepKind::cut, k});
            break;
        case StepKind::registration:
            addImages(0);
            break;
        case StepKind::plan:
            add({StepKind::registration, 0});
            break;
        case StepKind::timeOut:
            add({StepKind::plan, 0});
            break;
        case StepKind::cut:
            addPlan({k}, {k});
            add(registrationFor(k));
            add({StepKind::timeOut, k});
            break;
        case StepKind::locate:
            addPlan({k}, {k});
            addImages(0);  // in the place of a CT where there is none
            addImages(k);
            break;
        case StepKind::correct:
            addPlan({k, k + 1}, {});
            add({StepKind::registration, 0});
            for (int j = 1; j <= k; ++j) {
                add({StepKind::cut, j});
                add({StepKind::locate, j});
            }
            break;
    }
    if (!good) return good.error();
    return inputs;
}

}  // namespace fluorocut
