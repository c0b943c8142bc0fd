#include "core/casestore/database.h"

#include <utility>

#include <sqlite3.h>

namespace fluorocut {
namespace {

Error errorOf(sqlite3* connection, const std::string& file, int status) {
    const std::string text = connection != nullptr ? sqlite3_errmsg(connection) : sqlite3_errstr(status);
    switch (status & 0xff) {
        case SQLITE_CORRUPT:
        case SQLITE_NOTADB:
            return invalidInput(file, "a damaged file (" + text + ")", "a whole case", "take the last good copy");
        case SQLITE_FULL:
            return outputFailed(file, text, "free some space");
        case SQLITE_BUSY:
        case SQLITE_LOCKED:
            return outputFailed(file, text, "another program is using the case: close it");
        case SQLITE_READONLY:
        case SQLITE_CANTOPEN:
            return outputFailed(file, text, "copy the case to a folder that can be written");
        case SQLITE_CONSTRAINT:
            return invalidInput(file, text, "records that only follow one another");
        default:
            return outputFailed(file, text);
    }
}

}  // namespace

Statement::Statement(sqlite3* connection, sqlite3_stmt* statement, std::string file)
    : connection_(connection),
      statement_(statement, [](sqlite3_stmt* open) { sqlite3_finalize(open); }),
      file_(std::move(file)) {}

Statement& Statement::bind(int parameter, std::int64_t value) {
    bind_status_ |= sqlite3_bind_int64(statement_.get(), parameter, value);
    return *this;
}

Statement& Statement::bindText(int parameter, std::string_view value) {
    bind_status_ |=
        sqlite3_bind_text64(statement_.get(), parameter, value.data(), value.size(), SQLITE_STATIC, SQLITE_UTF8);
    return *this;
}

Statement& Statement::bindBytes(int parameter, std::string_view value) {
    // A null pointer would be NULL, not an empty blob.
    const char* data = value.empty() ? "" : value.data();
    bind_status_ |= sqlite3_bind_blob64(statement_.get(), parameter, data, value.size(), SQLITE_STATIC);
    return *this;
}

Result<bool> Statement::step() {
    if (bind_status_ != SQLITE_OK) {
        return invalidInput(file_, "content that does not fit into a case", "less than 1 GB in one piece");
    }
    const int status = sqlite3_step(statement_.get());
    if (status == SQLITE_ROW) return true;
    if (status == SQLITE_DONE) return false;
    return errorOf(connection_, file_, status);
}

std::int64_t Statement::integer(int column) const {
    return sqlite3_column_int64(statement_.get(), column);
}

std::string_view Statement::bytes(int column) const {
    const auto* data = static_cast<const char*>(sqlite3_column_blob(statement_.get(), column));
    const int size = sqlite3_column_bytes(statement_.get(), column);
    return data != nullptr ? std::string_view(data, static_cast<std::size_t>(size)) : std::string_view();
}

std::string Statement::text(int column) const {
    return std::string(bytes(column));
}

Database::Database(sqlite3* connection, std::string file)
    : connection_(connection, [](sqlite3* open) { sqlite3_close_v2(open); }), file_(std::move(file)) {}

Result<Database> Database::open(const std::filesystem::path& path, Mode mode) {
    sqlite3* raw = nullptr;
    // A shared-memory file beside the case is needed to read it, so that a reader opens it for writing as well and is
    // kept from writing by query_only.
    const int status = sqlite3_open_v2(path.c_str(), &raw, SQLITE_OPEN_READWRITE, nullptr);
    Database database(raw, path.string());
    if (status != SQLITE_OK) return errorOf(raw, path.string(), status);
    sqlite3_busy_timeout(raw, 5000);
    sqlite3_db_config(raw, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);  // a file from elsewhere may hold a hostile schema
    sqlite3_db_config(raw, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    const Result<void> set = database.run(mode == Mode::read ? "PRAGMA query_only = 1; PRAGMA cell_size_check = 1"
                                                             : "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; "
                                                               "PRAGMA cell_size_check = 1");
    if (!set) return set.error();
    return database;
}

Result<Database> Database::inMemory() {
    sqlite3* raw = nullptr;
    const int status = sqlite3_open(":memory:", &raw);
    Database database(raw, "memory");
    if (status != SQLITE_OK) return errorOf(raw, "memory", status);
    return database;
}

Result<void> Database::run(const std::string& sql) {
    const int status = sqlite3_exec(connection_.get(), sql.c_str(), nullptr, nullptr, nullptr);
    if (status != SQLITE_OK) return errorOf(connection_.get(), file_, status);
    return {};
}

Result<Statement> Database::prepare(const std::string& sql) const {
    sqlite3_stmt* statement = nullptr;
    const int status =
        sqlite3_prepare_v2(connection_.get(), sql.c_str(), static_cast<int>(sql.size()), &statement, nullptr);
    if (status != SQLITE_OK) return errorOf(connection_.get(), file_, status);
    return Statement(connection_.get(), statement, file_);
}

Result<std::optional<std::int64_t>> Database::integer(const std::string& sql) const {
    Result<Statement> statement = prepare(sql);
    if (!statement) return statement.error();
    const Result<bool> row = statement->step();
    if (!row) return row.error();
    if (!*row) return std::optional<std::int64_t>();
    return std::optional(statement->integer(0));
}

Result<Transaction> Transaction::begin(Database& database, Database::Mode mode) {
    const Result<void> begun = database.run(mode == Database::Mode::write ? "BEGIN IMMEDIATE" : "BEGIN");
    if (!begun) return begun.error();
    return Transaction(database);
}

Transaction::Transaction(Transaction&& other) noexcept : database_(std::exchange(other.database_, nullptr)) {}

Transaction::~Transaction() {
    if (database_ != nullptr) static_cast<void>(database_->run("ROLLBACK"));
}

Result<void> Transaction::commit() {
    const Result<void> committed = database_->run("COMMIT");
    if (committed) database_ = nullptr;
    return committed;
}

}  // namespace fluorocut
