#include "core/procedure/by_limits.h"

#include <fmt/format.h>

namespace fluorocut {
namespace {

std::string against(const Outcome& outcome) {
    std::string reasons;
    const auto add = [&](const std::string& reason) { reasons += (reasons.empty() ? "" : "; ") + reason; };
    for (const std::string& doubt : outcome.doubts)
        add(doubt);
    for (const Judgement& judgement : outcome.acceptance)
        if (!judgement.accepted()) add(judgement.sentence());
    if (outcome.acceptance.empty()) add("nothing was held against a limit");
    return reasons;
}

}  // namespace

Result<void> runByLimits(Procedure& procedure, const std::string& who, Progress& progress,
                         const OutcomeListener& on_outcome) {
    const std::size_t all = procedure.steps().size();
    while (procedure.next()) {
        std::size_t accepted = 0;
        for (const StepStanding& standing : procedure.steps())
            accepted += standing.state == StepState::accepted;
        const double share = 1.0 / static_cast<double>(all);
        SubProgress part(progress, share * static_cast<double>(accepted), share * static_cast<double>(accepted + 1));
        Result<std::optional<Outcome>> waiting = procedure.pending();
        if (!waiting) return waiting.error();
        if (!*waiting) {
            Result<Outcome> outcome = procedure.run(part);
            if (!outcome) return outcome.error();
            *waiting = std::move(*outcome);
        }
        const Outcome& outcome = **waiting;
        if (on_outcome) on_outcome(outcome);
        if (const std::string reasons = against(outcome); !reasons.empty()) {
            return noSolution(outcome.step.name(), reasons, "a result within its limits and without doubts",
                              "look at it, then accept or refuse it");
        }
        if (auto done = procedure.decide(true, who, "within its limits"); !done) return done;
    }
    return {};
}

}  // namespace fluorocut
