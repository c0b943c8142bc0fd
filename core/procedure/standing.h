// Where a procedure stands, read off the records of its case and nothing else. Pure.
//
// The steps form a line; each rests on all before it. A step counts by its newest record and that record's last
// decision. It is stale when one before it is no longer accepted, or was accepted anew after it was done.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/casestore/case_store.h"
#include "core/procedure/procedure.h"

namespace fluorocut {

inline constexpr std::string_view kSetupStep = "procedure";  // the step whose result is the setup

std::vector<ProcedureStep> stepsOf(int stages);
// Nothing: no name of a step.
std::optional<ProcedureStep> stepFromName(std::string_view name);

std::vector<StepStanding> standingOf(const CaseContent& content, int stages);

// The newest Step of that name; null: none.
const Step* newestStep(const CaseContent& content, std::string_view name);
const Decision* lastDecision(const CaseContent& content, std::int64_t step_record);

// What a step reads, by role. Every step before it has been done. The setup's own inputs are in it, so that a record
// names all that its result came from. `plan` and `images` results are asked for what they name.
Result<std::vector<StepInput>> inputsOf(const ProcedureStep& step, const CaseContent& content, const CaseStore& store);

// By which stage k is cut: `register`, or `correct k - 1`.
ProcedureStep registrationFor(int stage);

}  // namespace fluorocut
