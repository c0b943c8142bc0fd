// The tables of a saved case, by version. Used by this folder only.
//
// No version 1 was ever released; it stands for the first step of the way by which later versions migrate: one function
// per step in case_schema.cpp, all in one transaction with the record that tells of it.
#pragma once

#include <string>

#include "core/base/result.h"
#include "core/casestore/database.h"

namespace fluorocut {

inline constexpr int kCaseApplication = 0x464c4354;  // "FLCT", in the file's header
inline constexpr int kCaseSchema = 2;

// Tables and triggers of version 1 (content and records) or 2 (and `head`: which record is the newest, so that taking
// off the newest ones shows).
std::string caseTables(int version);

// Brings an open case, at `from` < kCaseSchema, to kCaseSchema. To be called in a transaction for writing.
Result<void> migrateTables(Database& database, int from);

// What of tables and triggers differs from what they are at `version`, in words; empty when nothing does.
Result<std::string> tableDifference(const Database& database, int version);

}  // namespace fluorocut
