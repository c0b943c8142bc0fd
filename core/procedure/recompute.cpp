#include "core/procedure/recompute.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "core/casestore/sha256.h"
#include "core/procedure/standing.h"
#include "core/procedure/steps.h"

namespace fluorocut {
namespace {

bool calculates(StepKind kind) {
    return kind == StepKind::registration || kind == StepKind::plan || kind == StepKind::locate ||
           kind == StepKind::correct;
}

}  // namespace

bool Recomputation::same() const {
    return std::all_of(steps.begin(), steps.end(), [](const RecomputedStep& step) { return step.same; });
}

Result<Recomputation> recompute(const CaseStore& store, Progress& progress) {
    const Result<CaseContent> content = store.content();
    if (!content) return content.error();
    const ContentReader reader = [&](const std::string& hash) { return store.bytes(hash); };
    std::vector<std::pair<const Step*, ProcedureStep>> todo;
    for (const Step& step : content->steps) {
        const std::optional<ProcedureStep> kind = stepFromName(step.name);
        if (kind && calculates(kind->kind)) todo.emplace_back(&step, *kind);
    }
    std::map<std::string, Result<ProcedureSetup>> setups;  // by hash
    Recomputation recomputation;
    for (std::size_t i = 0; i < todo.size(); ++i) {
        const auto& [step, kind] = todo[i];
        const double share = 1.0 / static_cast<double>(todo.size());
        SubProgress part(progress, share * static_cast<double>(i), share * static_cast<double>(i + 1));
        if (progress.isCancelled()) return cancelled("recomputing the case");
        RecomputedStep one{step->record, step->name, false, {}};
        const StepInputs inputs(step->inputs, reader);
        const std::string setup_hash = inputs.hash("setup");
        auto setup = setups.find(setup_hash);
        if (setup == setups.end()) {
            const Result<std::string> text = inputs.bytes("setup");
            setup = setups.emplace(setup_hash, text ? readSetup(*text, reader) : Result<ProcedureSetup>(text.error()))
                        .first;
        }
        const Result<StepOutput> output =
            setup->second ? calculate(kind, *setup->second, inputs, part) : Result<StepOutput>(setup->second.error());
        if (!output) {
            if (output.error().isCancelled()) return output.error();
            one.what = fmt::format("{} (record {}) can not be computed again: {}", step->name, step->record,
                                   output.error().message());
        } else if (sha256(output->json) != step->result) {
            one.what = fmt::format("{} (record {}, made by {}) comes out differently", step->name, step->record,
                                   step->software);
        } else {
            one.same = true;
        }
        recomputation.steps.push_back(std::move(one));
    }
    return recomputation;
}

}  // namespace fluorocut
