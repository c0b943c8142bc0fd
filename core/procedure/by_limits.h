// Runs a procedure to its end by the limits alone: what is within them and without doubts is accepted, anything else
// stops it, with a sentence, and is left for somebody to judge. Nothing is tried twice. For `demo`, experiments, tests:
// where a patient lies, people judge.
#pragma once

#include <functional>
#include <string>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/procedure/procedure.h"

namespace fluorocut {

using OutcomeListener = std::function<void(const Outcome&)>;

// `who` stands in the case with every decision. `on_outcome` hears of each before it is judged; may be empty.
// noSolution: the doubts, or the limits that do not hold; the outcome waits in the case.
Result<void> runByLimits(Procedure& procedure, const std::string& who, Progress& progress = Progress::none(),
                         const OutcomeListener& on_outcome = {});

}  // namespace fluorocut
