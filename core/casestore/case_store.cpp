#include "core/casestore/case_store.h"

#include <random>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/casestore/case_check.h"
#include "core/casestore/case_record.h"
#include "core/casestore/case_schema.h"
#include "core/casestore/database.h"
#include "core/casestore/file_lock.h"
#include "core/casestore/sha256.h"
#include "core/io/atomic_file.h"

namespace fluorocut {

namespace fs = std::filesystem;

struct CaseStore::Inside {
    std::optional<FileLock> lock;  // of a writer; let go after the database is closed
    Database database;
    int version;

    Database& toWrite() {
        if (!lock) throw std::logic_error("writing to a case that was opened to read");
        return database;
    }
};

namespace {

constexpr const char* kSoftware = "FluoroCut " FLUOROCUT_VERSION;

// One file, one lock, whatever link or relative path led to it.
Result<fs::path> resolved(const fs::path& path) {
    std::error_code code;
    fs::path absolute = fs::weakly_canonical(fs::absolute(path, code), code);
    if (code || !absolute.has_filename()) return invalidInput(path.string(), "no usable path", "the name of a case");
    return absolute;
}

std::string randomId() {
    std::random_device device;
    return fmt::format("{:08x}{:08x}{:08x}{:08x}", device(), device(), device(), device());
}

Result<void> makeTables(const fs::path& path, const std::string& label) {
    const Result<std::string> body = bodyOf(Creation{label, randomId(), kSoftware});
    if (!body) return body.error();
    Result<Database> database = Database::open(path, Database::Mode::write);
    if (!database) return database.error();
    Result<Transaction> all = Transaction::begin(*database, Database::Mode::write);
    if (!all) return all.error();
    const Result<void> made = database->run(
        fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {};", kCaseApplication, kCaseSchema) +
        caseTables(kCaseSchema));
    if (!made) return made.error();
    if (const auto first = appendRecord(*database, "created", *body); !first) return first.error();
    return all->commit();
}

// Its schema's version.
Result<int> requireCase(const Database& database, const std::string& file) {
    const Error no_case = invalidInput(file, "a file of another kind", "a case of FluoroCut", "name another one");
    const Result<std::optional<std::int64_t>> application = database.integer("PRAGMA application_id");
    if (!application) return application.error().code == ErrorCode::invalidInput ? no_case : application.error();
    if (application->value_or(0) != kCaseApplication) return no_case;
    const Result<std::optional<std::int64_t>> version = database.integer("PRAGMA user_version");
    if (!version) return version.error();
    const std::int64_t found = version->value_or(0);
    if (found < 1 || found > kCaseSchema) {
        return invalidInput(file, fmt::format("a case of schema version {}", found),
                            fmt::format("version 1 to {}", kCaseSchema),
                            found > kCaseSchema ? "open it with a newer FluoroCut" : "");
    }
    return static_cast<int>(found);
}

Result<void> migrate(Database& database, const std::string& file, int from) {
    Result<Transaction> all = Transaction::begin(database, Database::Mode::write);
    if (!all) return all.error();
    // A case that is not whole must not come out looking as if it were.
    const Result<CaseCheck> check = checkCase(database, from, {}, Progress::none());
    if (!check) return check.error();
    if (!check->whole()) {
        return invalidInput(file, check->fault->what, "a whole case to bring to the present version",
                            "take the last good copy");
    }
    if (const auto moved = migrateTables(database, from); !moved) return moved.error();
    const auto told = appendRecord(database, "migrated", bodyOfMigration(from, kCaseSchema));
    if (!told) return told.error();
    return all->commit();
}

Result<void> requireContent(const Database& database, const std::string& hash, const std::string& where) {
    const Result<bool> has = hasContent(database, hash);
    if (!has) return has.error();
    if (!*has) return invalidInput(where, hash, "the hash of content in the case", "add it as an item first");
    return {};
}

}  // namespace

std::optional<Step> lastAccepted(const CaseContent& content, std::string_view step_name) {
    for (auto step = content.steps.rbegin(); step != content.steps.rend(); ++step) {
        if (step->name != step_name) continue;
        for (auto decision = content.decisions.rbegin(); decision != content.decisions.rend(); ++decision) {
            if (decision->step != step->record) continue;
            if (decision->accepted) return *step;
            break;
        }
    }
    return {};
}

CaseStore::CaseStore(std::unique_ptr<Inside> inside) : inside_(std::move(inside)) {}
CaseStore::~CaseStore() = default;
CaseStore::CaseStore(CaseStore&&) noexcept = default;
CaseStore& CaseStore::operator=(CaseStore&&) noexcept = default;

Result<CaseStore> CaseStore::create(const fs::path& path, const std::string& label) {
    const Result<fs::path> file = resolved(path);
    if (!file) return file.error();
    {
        const Result<FileLock> lock = FileLock::take(*file);
        if (!lock) return lock.error();
        // SQLite would take a -wal or -journal left by another file for this one's and play it into it.
        for (const char* ending : {"", "-wal", "-shm", "-journal"}) {
            const fs::path taken = file->string() + ending;
            std::error_code code;
            if (fs::exists(fs::symlink_status(taken, code))) {
                return invalidOption("case " + taken.string(), "something of that name", "a new file",
                                     "nothing is overwritten: name another one");
            }
        }
        const Result<void> made =
            writeWhole(*file, [&](const fs::path& temporary) { return makeTables(temporary, label); });
        if (!made) return made.error();
    }
    return open(*file, Access::write);
}

Result<CaseStore> CaseStore::open(const fs::path& path, Access access) {
    const Result<fs::path> file = resolved(path);
    if (!file) return file.error();
    std::error_code code;
    if (!fs::is_regular_file(*file, code)) {
        return invalidInput(path.string(), fs::exists(*file, code) ? "no regular file" : "no such file",
                            "a case of FluoroCut");
    }
    std::optional<FileLock> lock;
    if (access == Access::write) {
        Result<FileLock> taken = FileLock::take(*file);
        if (!taken) return taken.error();
        lock.emplace(std::move(*taken));
    }
    Result<Database> database = Database::open(*file, Database::Mode::read);
    if (!database) return database.error();
    const Result<int> version = requireCase(*database, path.string());
    if (!version) return version.error();
    if (access == Access::write) {  // only now: a file of another kind is not touched
        database = Database::open(*file, Database::Mode::write);
        if (!database) return database.error();
        if (*version < kCaseSchema) {
            if (const auto done = migrate(*database, path.string(), *version); !done) return done.error();
        }
    }
    return CaseStore(std::make_unique<Inside>(
        Inside{std::move(lock), std::move(*database), access == Access::write ? kCaseSchema : *version}));
}

Result<Item> CaseStore::addItem(Item item, std::string_view content) {
    Database& database = inside_->toWrite();
    item.hash = sha256(content);
    item.bytes = static_cast<std::int64_t>(content.size());
    Result<std::string> body = bodyOf(item);
    if (!body) return body.error();
    Result<Transaction> all = Transaction::begin(database, Database::Mode::write);
    if (!all) return all.error();
    const Result<bool> has = hasContent(database, item.hash);
    if (!has) return has.error();
    if (!*has) {
        Result<Statement> insert = database.prepare("INSERT INTO blob VALUES (?1, ?2)");
        if (!insert) return insert.error();
        const Result<bool> done = insert->bindText(1, item.hash).bindBytes(2, content).step();
        if (!done) return done.error();
    }
    const Result<CaseRecord> record = appendRecord(database, "item", std::move(*body));
    if (!record) return record.error();
    if (const Result<void> safe = all->commit(); !safe) return safe.error();
    item.record = record->number;
    item.recorded_utc = record->recorded_utc;
    return item;
}

Result<Step> CaseStore::addStep(Step step) {
    Database& database = inside_->toWrite();
    step.software = kSoftware;
    Result<std::string> body = bodyOf(step);
    if (!body) return body.error();
    Result<Transaction> all = Transaction::begin(database, Database::Mode::write);
    if (!all) return all.error();
    for (const StepInput& input : step.inputs) {
        const auto has = requireContent(database, input.hash, "step " + step.name + ", input " + input.role);
        if (!has) return has.error();
    }
    const auto has = requireContent(database, step.result, "step " + step.name + ", result");
    if (!has) return has.error();
    const Result<CaseRecord> record = appendRecord(database, "step", std::move(*body));
    if (!record) return record.error();
    if (const Result<void> safe = all->commit(); !safe) return safe.error();
    step.record = record->number;
    step.recorded_utc = record->recorded_utc;
    return step;
}

Result<Decision> CaseStore::addDecision(Decision decision) {
    Database& database = inside_->toWrite();
    Result<std::string> body = bodyOf(decision);
    if (!body) return body.error();
    Result<Transaction> all = Transaction::begin(database, Database::Mode::write);
    if (!all) return all.error();
    Result<Statement> judged = database.prepare("SELECT 1 FROM record WHERE number = ?1 AND kind = 'step'");
    if (!judged) return judged.error();
    const Result<bool> found = judged->bind(1, decision.step).step();
    if (!found) return found.error();
    if (!*found) return invalidInput("decision, step", std::to_string(decision.step), "the record of a step");
    const Result<CaseRecord> record = appendRecord(database, "decision", std::move(*body));
    if (!record) return record.error();
    if (const Result<void> safe = all->commit(); !safe) return safe.error();
    decision.record = record->number;
    decision.recorded_utc = record->recorded_utc;
    return decision;
}

Result<CaseInfo> CaseStore::info() const {
    Result<Transaction> moment = Transaction::begin(inside_->database, Database::Mode::read);
    if (!moment) return moment.error();
    CaseInfo info;
    info.schema_version = inside_->version;
    std::optional<Error> failed;
    const Result<void> read = forEachRecord(inside_->database, [&](const CaseRecord& record) {
        if (info.records == 0) {
            const Result<Creation> creation = creationOf(record);
            if (creation) {
                info.label = creation->label, info.id = creation->id, info.software = creation->software;
                info.created_utc = record.recorded_utc;
            } else {
                failed = creation.error();
            }
        }
        ++info.records;
        info.newest_utc = record.recorded_utc;
        info.newest_hash = record.hash;
        return !failed;
    });
    if (failed) return *failed;
    if (!read) return read.error();
    const auto contents = inside_->database.integer("SELECT count(*) FROM blob");
    const auto bytes = inside_->database.integer("SELECT sum(length(content)) FROM blob");
    if (!contents) return contents.error();
    if (!bytes) return bytes.error();
    info.contents = contents->value_or(0);
    info.content_bytes = bytes->value_or(0);
    return info;
}

Result<CaseContent> CaseStore::content() const {
    CaseContent content;
    std::optional<Error> failed;
    const auto keep = [&failed](auto& list, auto value) {
        if (value) {
            list.push_back(std::move(*value));
        } else {
            failed = value.error();
        }
    };
    const Result<void> read = forEachRecord(inside_->database, [&](const CaseRecord& record) {
        if (record.kind == "item") keep(content.items, itemOf(record));
        if (record.kind == "step") keep(content.steps, stepOf(record));
        if (record.kind == "decision") keep(content.decisions, decisionOf(record));
        return !failed;
    });
    if (failed) return *failed;
    if (!read) return read.error();
    return content;
}

Result<std::string> CaseStore::bytes(std::string_view hash) const {
    Result<Statement> row = inside_->database.prepare("SELECT content FROM blob WHERE hash = ?1");
    if (!row) return row.error();
    const Result<bool> found = row->bindText(1, hash).step();
    if (!found) return found.error();
    if (!*found) return invalidInput("content " + std::string(hash), "nothing of that hash", "content of the case");
    std::string content(row->bytes(0));
    if (sha256(content) != hash) {
        return invalidInput("content " + std::string(hash), "bytes of another hash", "the bytes that were stored",
                            "take the last good copy of the case");
    }
    return content;
}

Result<std::string> CaseStore::recordsJson() const {
    nlohmann::ordered_json records = nlohmann::ordered_json::array();
    const Result<void> read = forEachRecord(inside_->database, [&](const CaseRecord& record) {
        records.push_back({{"number", record.number},
                           {"recorded_utc", record.recorded_utc},
                           {"kind", record.kind},
                           {"body", record.body},
                           {"previous", record.previous},
                           {"hash", record.hash}});
        return true;
    });
    if (!read) return read.error();
    constexpr auto kReplace = nlohmann::ordered_json::error_handler_t::replace;
    return nlohmann::ordered_json{{"schema", "fluorocut/case-records/1"}, {"records", std::move(records)}}.dump(
               2, ' ', false, kReplace) +
           "\n";
}

Result<CaseCheck> CaseStore::verify(const VerifyOptions& options, Progress& progress) const {
    Result<Transaction> moment = Transaction::begin(inside_->database, Database::Mode::read);
    if (!moment) return moment.error();
    return checkCase(inside_->database, inside_->version, options, progress);
}

}  // namespace fluorocut
