#include "core/casestore/case_schema.h"

#include <map>

#include <fmt/format.h>

namespace fluorocut {
namespace {

// INSERT OR REPLACE deletes without asking the triggers for DELETE: the triggers before INSERT refuse it.
constexpr const char* kContentAndRecords = R"sql(
CREATE TABLE blob (hash TEXT NOT NULL PRIMARY KEY, content BLOB NOT NULL) STRICT;
CREATE TRIGGER blob_is_new BEFORE INSERT ON blob WHEN EXISTS (SELECT 1 FROM blob WHERE hash = NEW.hash)
    BEGIN SELECT RAISE(ABORT, 'content is never replaced'); END;
CREATE TRIGGER blob_stays BEFORE UPDATE ON blob BEGIN SELECT RAISE(ABORT, 'content is never changed'); END;
CREATE TRIGGER blob_remains BEFORE DELETE ON blob BEGIN SELECT RAISE(ABORT, 'content is never removed'); END;
CREATE TABLE record (number INTEGER PRIMARY KEY, recorded_utc TEXT NOT NULL, kind TEXT NOT NULL, body TEXT NOT NULL,
    previous TEXT NOT NULL, hash TEXT NOT NULL) STRICT;
CREATE TRIGGER record_follows BEFORE INSERT ON record
    WHEN NEW.number <> (SELECT coalesce(max(number), 0) + 1 FROM record)
        OR NEW.previous <> coalesce((SELECT hash FROM record ORDER BY number DESC LIMIT 1), '')
    BEGIN SELECT RAISE(ABORT, 'records are only appended'); END;
CREATE TRIGGER record_stays BEFORE UPDATE ON record BEGIN SELECT RAISE(ABORT, 'records are never changed'); END;
CREATE TRIGGER record_remains BEFORE DELETE ON record BEGIN SELECT RAISE(ABORT, 'records are never removed'); END;
)sql";

constexpr const char* kHead = R"sql(
CREATE TABLE head (one INTEGER PRIMARY KEY CHECK (one = 1), number INTEGER NOT NULL, hash TEXT NOT NULL) STRICT;
INSERT INTO head SELECT 1, coalesce(max(number), 0),
    coalesce((SELECT hash FROM record ORDER BY number DESC LIMIT 1), '') FROM record;
CREATE TRIGGER head_is_one BEFORE INSERT ON head BEGIN SELECT RAISE(ABORT, 'there is one newest record'); END;
CREATE TRIGGER head_remains BEFORE DELETE ON head BEGIN SELECT RAISE(ABORT, 'there is a newest record'); END;
CREATE TRIGGER head_is_newest BEFORE UPDATE ON head
    WHEN NEW.one <> OLD.one OR NEW.number <> (SELECT max(number) FROM record)
        OR NEW.hash <> (SELECT hash FROM record ORDER BY number DESC LIMIT 1)
    BEGIN SELECT RAISE(ABORT, 'only the newest record is the newest'); END;
CREATE TRIGGER record_is_newest AFTER INSERT ON record
    BEGIN UPDATE head SET number = NEW.number, hash = NEW.hash; END;
)sql";

Result<void> fromVersion1(Database& database) {
    return database.run(kHead);
}

// What the file says of every table, index and trigger.
Result<std::map<std::string, std::string>> tablesOf(const Database& database) {
    Result<Statement> rows = database.prepare("SELECT type || ' ' || name, coalesce(sql, '') FROM sqlite_master");
    if (!rows) return rows.error();
    std::map<std::string, std::string> tables;
    while (true) {
        const Result<bool> row = rows->step();
        if (!row) return row.error();
        if (!*row) return tables;
        tables[rows->text(0)] = rows->text(1);
    }
}

}  // namespace

std::string caseTables(int version) {
    return version == 1 ? kContentAndRecords : std::string(kContentAndRecords) + kHead;
}

Result<void> migrateTables(Database& database, int from) {
    if (from < 2) {
        if (const Result<void> done = fromVersion1(database); !done) return done.error();
    }
    return database.run(fmt::format("PRAGMA user_version = {}", kCaseSchema));
}

Result<std::string> tableDifference(const Database& database, int version) {
    Result<Database> fresh = Database::inMemory();
    if (!fresh) return fresh.error();
    if (const Result<void> made = fresh->run(caseTables(version)); !made) return made.error();
    const auto expected = tablesOf(*fresh), found = tablesOf(database);
    if (!expected) return expected.error();
    if (!found) return found.error();
    for (const auto& [table, sql] : *expected) {
        const auto same = found->find(table);
        if (same == found->end()) return table + " is missing";
        if (same->second != sql) return table + " was changed";
    }
    for (const auto& [table, sql] : *found) {
        if (!expected->contains(table)) return table + " does not belong there";
    }
    return std::string();
}

}  // namespace fluorocut
