// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/archive/database.hpp"

#include <utility>

#include <fmt/format.h>
#include <sqlite3.h>

namespace srfs::ground {
namespace {

constexpr int busy_ms = 5000;  ///< a reader or a checkpoint may hold the file for a moment

DatabaseError error_of(sqlite3* database, int code) {
  return {code, database == nullptr ? sqlite3_errstr(code) : sqlite3_errmsg(database)};
}

}  // namespace

Statement::Statement(Statement&& other) noexcept
    : database_(other.database_), statement_(std::exchange(other.statement_, nullptr)) {}

Statement::~Statement() {
  sqlite3_finalize(statement_);
}

Statement& Statement::bind(int place, std::int64_t value) {
  sqlite3_bind_int64(statement_, place, value);
  return *this;
}

Statement& Statement::bind(int place, double value) {
  sqlite3_bind_double(statement_, place, value);
  return *this;
}

Statement& Statement::bind(int place, std::string_view text) {
  sqlite3_bind_text64(statement_, place, text.data(), text.size(), SQLITE_TRANSIENT, SQLITE_UTF8);
  return *this;
}

Statement& Statement::bind(int place, OctetView octets) {
  sqlite3_bind_blob64(statement_, place, octets.data(), octets.size(), SQLITE_TRANSIENT);
  return *this;
}

Statement& Statement::bind_null(int place) {
  sqlite3_bind_null(statement_, place);
  return *this;
}

Result<bool, DatabaseError> Statement::step() {
  const int code = sqlite3_step(statement_);
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  return Err(error_of(database_, code));
}

Result<void, DatabaseError> Statement::run() {
  const auto done = step();
  reset();
  if (!done) return Err(done.error());
  return {};
}

void Statement::reset() {
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
}

std::int64_t Statement::integer(int column) const {
  return sqlite3_column_int64(statement_, column);
}

double Statement::real(int column) const {
  return sqlite3_column_double(statement_, column);
}

std::string Statement::text(int column) const {
  const auto* const octets = static_cast<const char*>(sqlite3_column_blob(statement_, column));
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_, column));
  return octets == nullptr ? std::string() : std::string(octets, size);
}

Octets Statement::octets(int column) const {
  const auto* const octets = static_cast<const std::uint8_t*>(sqlite3_column_blob(statement_, column));
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_, column));
  return octets == nullptr ? Octets() : Octets(octets, octets + size);
}

bool Statement::is_null(int column) const {
  return sqlite3_column_type(statement_, column) == SQLITE_NULL;
}

void Database::Close::operator()(sqlite3* database) const {
  sqlite3_close_v2(database);
}

Result<Database, DatabaseError> Database::open(const std::filesystem::path& file, Use use) {
  sqlite3* opened = nullptr;
  const int flags = use == Use::write ? SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE : SQLITE_OPEN_READWRITE;
  const int code = sqlite3_open_v2(file.c_str(), &opened, flags | SQLITE_OPEN_NOMUTEX, nullptr);
  Database database(opened);
  if (code != SQLITE_OK)
    return Err(DatabaseError{code, fmt::format("{}: {}", file.string(), error_of(opened, code).message)});
  sqlite3_busy_timeout(opened, busy_ms);
  if (use == Use::read) {
    if (const auto only = database.run("PRAGMA query_only=1"); !only) return Err(only.error());
  }
  return database;
}

void Database::set_patience(milliseconds patience) {
  sqlite3_busy_timeout(database_.get(), static_cast<int>(patience.count()));
}

Result<void, DatabaseError> Database::run(const std::string& sql) {
  const int code = sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) return Err(error_of(database_.get(), code));
  return {};
}

Result<Statement, DatabaseError> Database::prepare(std::string_view sql) {
  sqlite3_stmt* statement = nullptr;
  const int code =
      sqlite3_prepare_v2(database_.get(), sql.data(), static_cast<int>(sql.size()), &statement, nullptr);
  if (code != SQLITE_OK) return Err(error_of(database_.get(), code));
  return Statement(database_.get(), statement);
}

Result<std::int64_t, DatabaseError> Database::number(std::string_view sql) {
  auto statement = prepare(sql);
  if (!statement) return Err(statement.error());
  const auto row = statement->step();
  if (!row) return Err(row.error());
  return *row ? statement->integer(0) : 0;
}

int Database::changes() const {
  return sqlite3_changes(database_.get());
}

std::int64_t Database::last_id() const {
  return sqlite3_last_insert_rowid(database_.get());
}

}  // namespace srfs::ground
