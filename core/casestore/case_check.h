// The check behind CaseStore::verify. Used by this folder only.
#pragma once

#include "core/base/progress.h"
#include "core/casestore/case_store.h"
#include "core/casestore/database.h"

namespace fluorocut {

// Of a case at schema `version`, as it is at one moment. Fails only when cancelled.
Result<CaseCheck> checkCase(Database& database, int version, const VerifyOptions& options, Progress& progress);

}  // namespace fluorocut
