// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs::ground {

struct DatabaseError {
  int code = 0;         ///< of SQLite; 0: another database's
  std::string message;  ///< ready to print
};

/// One prepared statement. Bind, step, read columns; reset() to use it again. Its SQL is what SQLite and
/// PostgreSQL both understand, with ? for each value.
class Statement {
 public:
  Statement() = default;
  virtual ~Statement() = default;
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  /// @param place  of the value, from 1
  virtual Statement& bind(int place, std::int64_t value) = 0;
  virtual Statement& bind(int place, double value) = 0;
  virtual Statement& bind(int place, std::string_view text) = 0;
  virtual Statement& bind(int place, OctetView octets) = 0;
  virtual Statement& bind_null(int place) = 0;
  /// @return whether there is a row
  [[nodiscard]] virtual Result<bool, DatabaseError> step() = 0;
  virtual void reset() = 0;

  /// @param column  of the row, from 0
  [[nodiscard]] virtual std::int64_t integer(int column) const = 0;
  [[nodiscard]] virtual double real(int column) const = 0;
  [[nodiscard]] virtual std::string text(int column) const = 0;
  [[nodiscard]] virtual Octets octets(int column) const = 0;
  [[nodiscard]] virtual bool is_null(int column) const = 0;

  /// One whose rows do not matter, then reset.
  [[nodiscard]] Result<void, DatabaseError> run();
};

/// A connection to a database. Of one thread; while a statement has rows left, no other one is used. Errors
/// are values.
class Database {
 public:
  Database() = default;
  virtual ~Database() = default;
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  /// Statements without values and rows.
  [[nodiscard]] virtual Result<void, DatabaseError> run(const std::string& sql) = 0;
  [[nodiscard]] virtual Result<std::unique_ptr<Statement>, DatabaseError> prepare(std::string_view sql) = 0;
  /// Rows that the last statement changed or inserted.
  [[nodiscard]] virtual std::int64_t changes() const = 0;

  /// Until commit() or roll_back(), nobody else writes.
  [[nodiscard]] virtual Result<void, DatabaseError> begin() = 0;
  /// An error: what was written since begin() is lost, or the connection was, and nobody knows.
  [[nodiscard]] virtual Result<void, DatabaseError> commit() = 0;
  virtual void roll_back() = 0;
  /// What is committed survives a power failure when this returns; a PostgreSQL has seen to it in commit().
  [[nodiscard]] virtual Result<void, DatabaseError> sync() { return {}; }

  /// Which connection this is: another one after the first was lost.
  [[nodiscard]] virtual int connection() const = 0;
  /// Other programs write, too, between the transactions of this one.
  [[nodiscard]] virtual bool is_shared() const = 0;
  /// Damage that it finds itself, a line each.
  [[nodiscard]] virtual Result<std::vector<std::string>, DatabaseError> damage() = 0;

  /// The only column of the only row; 0: no row.
  [[nodiscard]] Result<std::int64_t, DatabaseError> number(std::string_view sql);
};

/// The statements of a database, each prepared once. Bounded by the program's own SQL. Ends before the
/// database.
class PreparedStatements {
 public:
  [[nodiscard]] Result<Statement*, DatabaseError> of(Database& database, const std::string& sql);

 private:
  std::map<std::string, std::unique_ptr<Statement>, std::less<>> statements_;
};

}  // namespace srfs::ground
