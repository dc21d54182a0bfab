// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"

struct sqlite3;
struct sqlite3_stmt;

namespace srfs::ground {

struct DatabaseError {
  int code = 0;         ///< of SQLite
  std::string message;  ///< ready to print
};

/// One prepared statement. Bind, step, read columns; reset() to use it again.
class Statement {
 public:
  Statement(sqlite3* database, sqlite3_stmt* statement) : database_(database), statement_(statement) {}
  Statement(Statement&& other) noexcept;
  Statement& operator=(Statement&&) = delete;
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  ~Statement();

  Statement& bind(int place, std::int64_t value);
  Statement& bind(int place, double value);
  Statement& bind(int place, std::string_view text);
  Statement& bind(int place, OctetView octets);
  Statement& bind_null(int place);
  /// @return whether there is a row
  [[nodiscard]] Result<bool, DatabaseError> step();
  /// One without rows, then reset.
  [[nodiscard]] Result<void, DatabaseError> run();
  void reset();

  [[nodiscard]] std::int64_t integer(int column) const;
  [[nodiscard]] double real(int column) const;
  [[nodiscard]] std::string text(int column) const;
  [[nodiscard]] Octets octets(int column) const;
  [[nodiscard]] bool is_null(int column) const;

 private:
  sqlite3* database_;
  sqlite3_stmt* statement_;
};

/// One SQLite file. Errors are values.
class Database {
 public:
  enum class Use : std::uint8_t { read, write };
  /// @param use  write: the file is made if it is not there
  [[nodiscard]] static Result<Database, DatabaseError> open(const std::filesystem::path& file, Use use);

  /// How long a statement waits for another process that has the file.
  void set_patience(milliseconds patience);
  /// Statements without parameters and rows.
  [[nodiscard]] Result<void, DatabaseError> run(const std::string& sql);
  [[nodiscard]] Result<Statement, DatabaseError> prepare(std::string_view sql);
  /// The only column of the only row.
  [[nodiscard]] Result<std::int64_t, DatabaseError> number(std::string_view sql);
  /// Rows that the last statement changed or inserted.
  [[nodiscard]] int changes() const;
  [[nodiscard]] std::int64_t last_id() const;

 private:
  struct Close {
    void operator()(sqlite3* database) const;
  };
  explicit Database(sqlite3* database) : database_(database) {}
  std::unique_ptr<sqlite3, Close> database_;
};

}  // namespace srfs::ground
