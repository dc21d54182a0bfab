// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/archive/sqlite_database.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

namespace srfs::ground {
namespace {

constexpr int busy_ms = 5000;  ///< a reader or a checkpoint may hold the file for a moment

DatabaseError error_of(sqlite3* database, int code) {
  return {code, database == nullptr ? sqlite3_errstr(code) : sqlite3_errmsg(database)};
}

class SqliteStatement final : public Statement {
 public:
  SqliteStatement(sqlite3* database, sqlite3_stmt* statement) : database_(database), statement_(statement) {}
  SqliteStatement(const SqliteStatement&) = delete;
  SqliteStatement& operator=(const SqliteStatement&) = delete;
  ~SqliteStatement() override { sqlite3_finalize(statement_); }

  Statement& bind(int place, std::int64_t value) override {
    sqlite3_bind_int64(statement_, place, value);
    return *this;
  }
  Statement& bind(int place, double value) override {
    sqlite3_bind_double(statement_, place, value);
    return *this;
  }
  Statement& bind(int place, std::string_view text) override {
    sqlite3_bind_text64(statement_, place, text.data(), text.size(), SQLITE_TRANSIENT, SQLITE_UTF8);
    return *this;
  }
  Statement& bind(int place, OctetView octets) override {
    sqlite3_bind_blob64(statement_, place, octets.data(), octets.size(), SQLITE_TRANSIENT);
    return *this;
  }
  Statement& bind_null(int place) override {
    sqlite3_bind_null(statement_, place);
    return *this;
  }
  Result<bool, DatabaseError> step() override {
    const int code = sqlite3_step(statement_);
    if (code == SQLITE_ROW) return true;
    if (code == SQLITE_DONE) return false;
    return Err(error_of(database_, code));
  }
  void reset() override {
    sqlite3_reset(statement_);
    sqlite3_clear_bindings(statement_);
  }
  std::int64_t integer(int column) const override { return sqlite3_column_int64(statement_, column); }
  double real(int column) const override { return sqlite3_column_double(statement_, column); }
  std::string text(int column) const override {
    const auto* const octets = static_cast<const char*>(sqlite3_column_blob(statement_, column));
    const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_, column));
    return octets == nullptr ? std::string() : std::string(octets, size);
  }
  Octets octets(int column) const override {
    const auto* const octets = static_cast<const std::uint8_t*>(sqlite3_column_blob(statement_, column));
    const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_, column));
    return octets == nullptr ? Octets() : Octets(octets, octets + size);
  }
  bool is_null(int column) const override { return sqlite3_column_type(statement_, column) == SQLITE_NULL; }

 private:
  sqlite3* database_;
  sqlite3_stmt* statement_;
};

}  // namespace

void SqliteDatabase::Close::operator()(sqlite3* database) const {
  sqlite3_close_v2(database);
}

Result<std::unique_ptr<SqliteDatabase>, DatabaseError> SqliteDatabase::open(const std::filesystem::path& file,
                                                                            Use use) {
  sqlite3* opened = nullptr;
  const int flags = use == Use::write ? SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE : SQLITE_OPEN_READWRITE;
  const int code = sqlite3_open_v2(file.c_str(), &opened, flags | SQLITE_OPEN_NOMUTEX, nullptr);
  std::unique_ptr<SqliteDatabase> database(new SqliteDatabase(opened));
  if (code != SQLITE_OK)
    return Err(DatabaseError{code, fmt::format("{}: {}", file.string(), error_of(opened, code).message)});
  sqlite3_busy_timeout(opened, busy_ms);
  if (use == Use::read) {
    if (const auto only = database->run("PRAGMA query_only=1"); !only) return Err(only.error());
  }
  return database;
}

void SqliteDatabase::set_patience(milliseconds patience) {
  sqlite3_busy_timeout(database_.get(), static_cast<int>(patience.count()));
}

Result<void, DatabaseError> SqliteDatabase::run(const std::string& sql) {
  const int code = sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) return Err(error_of(database_.get(), code));
  return {};
}

/// As synchronous=FULL does it behind each commit: the octets of the write-ahead log are on the medium.
Result<void, DatabaseError> SqliteDatabase::sync() {
  sqlite3_file* log = nullptr;
  int code = sqlite3_file_control(database_.get(), "main", SQLITE_FCNTL_JOURNAL_POINTER, &log);
  if (code == SQLITE_OK && log != nullptr && log->pMethods != nullptr)
    code = log->pMethods->xSync(log, SQLITE_SYNC_NORMAL);
  if (code != SQLITE_OK) return Err(DatabaseError{code, sqlite3_errstr(code)});
  return {};
}

Result<std::unique_ptr<Statement>, DatabaseError> SqliteDatabase::prepare(std::string_view sql) {
  sqlite3_stmt* statement = nullptr;
  const int code =
      sqlite3_prepare_v2(database_.get(), sql.data(), static_cast<int>(sql.size()), &statement, nullptr);
  if (code != SQLITE_OK) return Err(error_of(database_.get(), code));
  return std::make_unique<SqliteStatement>(database_.get(), statement);
}

std::int64_t SqliteDatabase::changes() const {
  return sqlite3_changes64(database_.get());
}

void SqliteDatabase::roll_back() {
  static_cast<void>(run("ROLLBACK"));  // an error: SQLite did it already
}

Result<std::vector<std::string>, DatabaseError> SqliteDatabase::damage() {
  std::vector<std::string> wrong;
  const auto statement = prepare("PRAGMA integrity_check(20)");
  if (!statement) return Err(statement.error());
  while (true) {
    const auto row = (*statement)->step();
    if (!row) return Err(row.error());
    if (!*row) return wrong;
    if ((*statement)->text(0) != "ok") wrong.push_back((*statement)->text(0));
  }
}

}  // namespace srfs::ground
