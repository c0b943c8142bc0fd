#include "core/casestore/case_check.h"

#include <algorithm>
#include <set>
#include <string>

#include <fmt/format.h>

#include "core/casestore/case_record.h"
#include "core/casestore/case_schema.h"
#include "core/casestore/sha256.h"

namespace fluorocut {
namespace {

std::string unreadable(const Error& error) {
    return fmt::format("cannot be read: {}", error.message());
}

class Checker {
  public:
    Checker(const Database& database, Progress& progress) : database_(database), progress_(progress) {}

    // Empty when the record is as it was written and what it names is there; otherwise what is wrong with it.
    Result<std::string> wrongWith(const CaseRecord& record, const std::string& previous, std::int64_t number) {
        if (record.number != number) return fmt::format("is missing: the next one is number {}", record.number);
        if (record.previous != previous) return std::string("does not follow the record before it");
        if (record.hash != hashOf(record)) return std::string("was changed: its hash is not that of what it says");
        return wrongContent(record);
    }

    std::int64_t contents() const { return static_cast<std::int64_t>(good_.size()); }

  private:
    // A body that hashes right was written by somebody; whether it can be one of ours is asked all the same.
    Result<std::string> wrongContent(const CaseRecord& record) {
        if ((record.number == 1) != (record.kind == "created")) return std::string("is not where a case begins");
        if (record.kind == "created") {
            const Result<Creation> creation = creationOf(record);
            return creation ? std::string() : unreadable(creation.error());
        }
        if (record.kind == "item") {
            const Result<Item> item = itemOf(record);
            if (!item) return unreadable(item.error());
            return wrongBytes(item->hash, item->bytes);
        }
        if (record.kind == "step") {
            const Result<Step> step = stepOf(record);
            if (!step) return unreadable(step.error());
            steps_.insert(record.number);
            for (const StepInput& input : step->inputs) {
                if (!good_.contains(input.hash))
                    return std::string("names as its input content that no item before it has");
            }
            return good_.contains(step->result) ? std::string() : "names as its result content that no item before has";
        }
        if (record.kind == "decision") {
            const Result<Decision> decision = decisionOf(record);
            if (!decision) return unreadable(decision.error());
            return steps_.contains(decision->step) ? std::string() : "judges a step that is not there";
        }
        return record.kind == "migrated" ? std::string() : "is of no known kind";
    }

    Result<std::string> wrongBytes(const std::string& hash, std::int64_t bytes) {
        Result<Statement> row = database_.prepare("SELECT content FROM blob WHERE hash = ?1");
        if (!row) return row.error();
        const Result<bool> found = row->bindText(1, hash).step();
        if (!found) return found.error();
        if (!*found) return std::string("names content that is missing");
        const std::string_view content = row->bytes(0);
        if (static_cast<std::int64_t>(content.size()) != bytes) return std::string("names content of another size");
        if (good_.contains(hash)) return std::string();
        Sha256 digest;
        constexpr std::size_t kPiece = 4 << 20;  // 20 ms, so that cancelling is noticed
        for (std::size_t at = 0; at < content.size(); at += kPiece) {
            if (progress_.isCancelled()) return cancelled("case verify");
            digest.add(content.substr(at, kPiece));
        }
        if (digest.finish() != hash) return std::string("names content that was changed");
        good_.insert(hash);
        return std::string();
    }

    const Database& database_;
    Progress& progress_;
    std::set<std::string> good_;  // hashes of content that has that hash
    std::set<std::int64_t> steps_;
};

Result<CaseCheck> check(Database& database, int version, const VerifyOptions& options, Progress& progress) {
    CaseCheck done;
    const auto faultAt = [&done](std::optional<std::int64_t> record, std::string what) {
        if (!done.fault) done.fault = CaseFault{record, std::move(what)};
    };
    const Result<std::optional<std::int64_t>> count = database.integer("SELECT count(*) FROM record");
    if (!count) return count.error();
    const double total = std::max<double>(1, static_cast<double>(count->value_or(0)));

    Checker checker(database, progress);
    bool known = options.known_hash.empty();
    std::optional<Error> stopped;
    const Result<void> read = forEachRecord(database, [&](const CaseRecord& record) {
        progress.report(static_cast<double>(done.records) / total, "checking the records");
        if (progress.isCancelled()) {
            stopped = cancelled("case verify");
            return false;
        }
        const Result<std::string> wrong = checker.wrongWith(record, done.newest_hash, done.records + 1);
        if (!wrong && wrong.error().isCancelled()) {
            stopped = wrong.error();
            return false;
        }
        if (!wrong || !wrong->empty()) {
            faultAt(done.records + 1,
                    fmt::format("record {} {}", done.records + 1, wrong ? *wrong : unreadable(wrong.error())));
            return false;
        }
        ++done.records;
        done.newest_hash = record.hash;
        known = known || record.hash == options.known_hash;
        return true;
    });
    if (stopped) return *stopped;
    if (!read) faultAt(done.records + 1, fmt::format("record {} {}", done.records + 1, unreadable(read.error())));
    done.contents = checker.contents();
    if (done.fault) return done;

    if (done.records == 0) faultAt(1, "record 1 is missing: the case holds no record at all");
    if (version >= 2) {
        Result<Statement> head = database.prepare("SELECT number, hash, count(*) OVER () FROM head");
        if (!head) return head.error();
        const Result<bool> row = head->step();
        if (!row) return row.error();
        if (!*row || head->integer(2) != 1) {
            faultAt({}, "the note of which record is the newest is missing or not alone");
        } else if (head->integer(0) > done.records) {
            faultAt(done.records + 1,
                    fmt::format("record {} is missing: {} were written", done.records + 1, head->integer(0)));
        } else if (head->integer(0) != done.records || head->text(1) != done.newest_hash) {
            faultAt(done.records, fmt::format("record {} is not the one that was written as the newest", done.records));
        }
    }
    if (!known) faultAt({}, "no record has the hash " + options.known_hash + ": the case is another or was rewritten");
    const Result<std::optional<std::int64_t>> blobs = database.integer("SELECT count(*) FROM blob");
    if (!blobs) return blobs.error();
    if (blobs->value_or(0) != done.contents) faultAt({}, "there is content that no record names");
    const Result<std::string> difference = tableDifference(database, version);
    if (!difference) return difference.error();
    if (!difference->empty()) faultAt({}, "the tables are not those of a case: " + *difference);
    Result<Statement> integrity = database.prepare("PRAGMA integrity_check(1)");
    if (!integrity) return integrity.error();
    const Result<bool> row = integrity->step();
    if (!row) return row.error();
    if (!*row || integrity->text(0) != "ok") faultAt({}, "the file is damaged: " + integrity->text(0));
    return done;
}

}  // namespace

Result<CaseCheck> checkCase(Database& database, int version, const VerifyOptions& options, Progress& progress) {
    Result<CaseCheck> done = check(database, version, options, progress);
    if (done || done.error().isCancelled()) return done;
    CaseCheck unreadable;
    unreadable.fault = CaseFault{{}, "the file cannot be read: " + done.error().message()};
    return unreadable;
}

}  // namespace fluorocut
