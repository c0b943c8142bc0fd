// A thin hold on SQLite for the saved case: connections and statements that close themselves, errors as Error. Used by
// this folder only.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/result.h"

struct sqlite3;
struct sqlite3_stmt;

namespace fluorocut {

class Statement {
  public:
    // Parameters are numbered from 1. What is bound must outlive the next step().
    Statement& bind(int parameter, std::int64_t value);
    Statement& bindText(int parameter, std::string_view value);
    Statement& bindBytes(int parameter, std::string_view value);

    // True: there is a row to read. False: done.
    Result<bool> step();
    std::int64_t integer(int column) const;
    std::string text(int column) const;
    std::string_view bytes(int column) const;  // until the next step()

  private:
    friend class Database;
    Statement(sqlite3* connection, sqlite3_stmt* statement, std::string file);

    sqlite3* connection_;
    std::unique_ptr<sqlite3_stmt, void (*)(sqlite3_stmt*)> statement_;
    std::string file_;
    int bind_status_ = 0;
};

class Database {
  public:
    enum class Mode { read, write };

    // The file must exist. Writing: write-ahead log, and a commit returns once the disk has it (synchronous=FULL).
    static Result<Database> open(const std::filesystem::path& path, Mode mode);
    static Result<Database> inMemory();

    Result<void> run(const std::string& sql);  // statements without rows to read
    Result<Statement> prepare(const std::string& sql) const;
    // The first column of the first row; nothing without a row.
    Result<std::optional<std::int64_t>> integer(const std::string& sql) const;

  private:
    Database(sqlite3* connection, std::string file);

    std::unique_ptr<sqlite3, void (*)(sqlite3*)> connection_;
    std::string file_;
};

// All or nothing: rolled back unless committed. Begun at once (`write`) so that two writers cannot meet in the middle.
class Transaction {
  public:
    static Result<Transaction> begin(Database& database, Database::Mode mode);
    ~Transaction();
    Transaction(Transaction&& other) noexcept;
    Transaction& operator=(Transaction&&) = delete;
    Result<void> commit();

  private:
    explicit Transaction(Database& database) : database_(&database) {}
    Database* database_;
};

}  // namespace fluorocut
