// The saved case: one SQLite file that holds everything a case was worked out from, so that it can be told, replayed
// and checked years later.
//
// Content (images, calibrations, poses, plans, results) lies in it once, under the SHA-256 of its bytes. What happened
// is a list of records that only ever grows: an item came in, a step made a result from inputs and options, a person
// (or the limits) accepted or refused it. Each record carries the SHA-256 of itself and of the record before, so that a
// changed, removed or reordered record shows (verify), and triggers refuse UPDATE and DELETE from any program.
//
// Acknowledged means safe: what an add...() returned a value for survives kill -9 and loss of power (write-ahead log,
// synchronous=FULL), as far as the disk tells the truth about its cache.
//
// What the chain cannot show: somebody who rewrites the whole file, all hashes included. Against that, keep the newest
// record's hash (CaseInfo::newest_hash) elsewhere and hand it to verify.
//
// One writer at a time (advisory lock <file>.lock), any number of readers beside it. A store is used by one thread at a
// time. Times are UTC, ISO 8601 to the millisecond: "2026-03-01T09:30:00.125Z".
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"

namespace fluorocut {

// Now, in the form above.
std::string utcNow();

enum class ItemKind { image, volume, mesh, calibration, pose, plan, result };
std::string_view name(ItemKind kind);

// In Item, Step and Decision, `record` and `recorded_utc` are filled in by the case.

struct Item {
    ItemKind kind = ItemKind::result;
    std::string schema = {};  // what the content is: "fluorocut/pose/1", "image/png"
    std::string file_name =
        {};                 // under which it is exported: "before_ap.png"; a plain name, its extension tells the format
    std::string hash = {};  // by the case: SHA-256 of the content
    std::int64_t bytes = 0;  // by the case
    std::int64_t record = 0;
    std::string recorded_utc = {};
};

struct StepInput {
    std::string role = {};  // "ct", "before_ap"
    std::string hash = {};  // of content in this case
};

struct Step {
    std::string name = {};  // "register", "locate-cavity"
    std::vector<StepInput> inputs = {};
    std::string options_json = {};  // an object, kept to the letter
    std::string result = {};        // hash of content in this case
    std::string started_utc = {}, finished_utc = {};
    std::string software = {};  // by the case: "FluoroCut 0.1.0"
    std::int64_t record = 0;
    std::string recorded_utc = {};
};

struct Decision {
    std::int64_t step = 0;  // the record of the step that is judged
    bool accepted = false;
    std::string who = {};
    std::string why = {};
    std::int64_t record = 0;
    std::string recorded_utc = {};  // when it was decided
};

// All records in their order, read at one moment.
struct CaseContent {
    std::vector<Item> items;
    std::vector<Step> steps;
    std::vector<Decision> decisions;
};

// The newest step of that name whose last decision says accepted.
std::optional<Step> lastAccepted(const CaseContent& content, std::string_view step_name);

struct CaseInfo {
    std::string label;     // given at creation
    std::string id;        // random, 32 hexadecimal digits
    std::string software;  // that created it
    std::string created_utc;
    std::string newest_utc;
    std::string newest_hash;
    int schema_version = 0;
    std::int64_t records = 0;
    std::int64_t contents = 0;
    std::int64_t content_bytes = 0;
};

// The first thing that is wrong.
struct CaseFault {
    std::optional<std::int64_t> record;  // nothing: not in a record
    std::string what;                    // one sentence
};

struct CaseCheck {
    std::int64_t records = 0;   // good ones, before the fault if there is one
    std::int64_t contents = 0;  // whose hash is right
    std::string newest_hash;    // of the last good record
    std::optional<CaseFault> fault;
    bool whole() const { return records > 0 && !fault; }
};

struct VerifyOptions {
    std::string known_hash;  // of a record, kept elsewhere: one of the records must have it; empty: not asked
};

class CaseStore {
  public:
    enum class Access { read, write };

    // A new case. Nothing may be there under that name, nor under the names of SQLite's own files beside it.
    static Result<CaseStore> create(const std::filesystem::path& path, const std::string& label);
    // An existing case; to write, one of an older schema is brought to ours first, in one transaction, when it is
    // whole. Fails for a file that is no case (and leaves it alone), for one of a newer version and, to write, while
    // another holds it.
    static Result<CaseStore> open(const std::filesystem::path& path, Access access);

    ~CaseStore();
    CaseStore(CaseStore&&) noexcept;
    CaseStore& operator=(CaseStore&&) noexcept;

    // Each returns what was written, once the disk has it. On a store opened to read they throw std::logic_error.
    Result<Item> addItem(Item item, std::string_view content);  // content below 1 GB
    Result<Step> addStep(Step step);                            // fails when the case lacks an input or the result
    Result<Decision> addDecision(Decision decision);            // fails when `step` is not a step's record

    Result<CaseInfo> info() const;
    Result<CaseContent> content() const;
    // The bytes under a hash; fails when there are none or when they no longer have that hash.
    Result<std::string> bytes(std::string_view hash) const;
    // Every record as a JSON text: {"records": [{"number", "recorded_utc", "kind", "body", "previous", "hash"}, ...]}.
    Result<std::string> recordsJson() const;

    // Computes every hash again. Fails only when cancelled: a file that cannot be read is a fault that was found.
    Result<CaseCheck> verify(const VerifyOptions& options, Progress& progress) const;

  private:
    struct Inside;
    explicit CaseStore(std::unique_ptr<Inside> inside);
    std::unique_ptr<Inside> inside_;
};

}  // namespace fluorocut
