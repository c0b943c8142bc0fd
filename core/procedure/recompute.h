// Does a case's content give what the case says it gives? Every step that only calculates is calculated again from the
// inputs that its record names, and its result's hash compared: bit for bit, whether it was accepted or not.
//
// A result that differs was changed, or comes of another version or another kind of processor: RecomputedStep says by
// what it was made.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/casestore/case_store.h"

namespace fluorocut {

struct RecomputedStep {
    std::int64_t record = 0;
    std::string name;
    bool same = false;
    std::string what;  // why not, one sentence
};

struct Recomputation {
    std::vector<RecomputedStep> steps;
    bool same() const;  // all of them; a case without any has nothing that differs
};

// Fails when it is cancelled, and when the case cannot be read.
Result<Recomputation> recompute(const CaseStore& store, Progress& progress = Progress::none());

}  // namespace fluorocut
