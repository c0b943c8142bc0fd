// A record of the audit chain as the file holds it, and what it means. Used by this folder only.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.h"
#include "core/casestore/case_store.h"
#include "core/casestore/database.h"

namespace fluorocut {

struct CaseRecord {
    std::int64_t number = 0;  // 1, 2, 3, ...
    std::string recorded_utc;
    std::string kind;      // one of kRecordKinds
    std::string body;      // JSON object
    std::string previous;  // hash of the record before; empty for the first
    std::string hash;      // of all of the above
};

inline constexpr std::array<std::string_view, 5> kRecordKinds{"created", "item", "step", "decision", "migrated"};

// SHA-256 of the five fields before it, each with its length in front, so that no two records share a text.
std::string hashOf(const CaseRecord& record);

// Appends a record after the newest one; its `hash` says what it became.
Result<CaseRecord> appendRecord(Database& database, std::string_view kind, std::string body);

// Calls `take` for each record in order until it returns false.
template <class Take>
Result<void> forEachRecord(const Database& database, Take&& take) {
    Result<Statement> rows =
        database.prepare("SELECT number, recorded_utc, kind, body, previous, hash FROM record ORDER BY number");
    if (!rows) return rows.error();
    while (true) {
        const Result<bool> row = rows->step();
        if (!row) return row.error();
        if (!*row) return {};
        CaseRecord record{rows->integer(0), rows->text(1), rows->text(2), rows->text(3), rows->text(4), rows->text(5)};
        if (!take(record)) return {};
    }
}

// Whether the case holds content of that hash.
Result<bool> hasContent(const Database& database, std::string_view hash);

struct Creation {
    std::string label, id, software;
};

// To a record's body, after checking every field; and back, as strictly.
Result<std::string> bodyOf(const Creation& creation);
Result<std::string> bodyOf(const Item& item);
Result<std::string> bodyOf(const Step& step);
Result<std::string> bodyOf(const Decision& decision);
std::string bodyOfMigration(int from, int to);
Result<Creation> creationOf(const CaseRecord& record);
Result<Item> itemOf(const CaseRecord& record);
Result<Step> stepOf(const CaseRecord& record);
Result<Decision> decisionOf(const CaseRecord& record);

}  // namespace fluorocut
