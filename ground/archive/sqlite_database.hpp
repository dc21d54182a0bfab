// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "ground/archive/database.hpp"

struct sqlite3;

namespace srfs::ground {

/// One SQLite file.
class SqliteDatabase final : public Database {
 public:
  enum class Use : std::uint8_t { read, write };
  /// @param use  write: the file is made if it is not there
  [[nodiscard]] static Result<std::unique_ptr<SqliteDatabase>, DatabaseError> open(
      const std::filesystem::path& file, Use use);

  /// How long a statement waits for another process that has the file.
  void set_patience(milliseconds patience);

  Result<void, DatabaseError> run(const std::string& sql) override;
  Result<std::unique_ptr<Statement>, DatabaseError> prepare(std::string_view sql) override;
  std::int64_t changes() const override;
  Result<void, DatabaseError> begin() override { return run("BEGIN IMMEDIATE"); }
  Result<void, DatabaseError> commit() override { return run("COMMIT"); }
  void roll_back() override;
  Result<void, DatabaseError> sync() override;
  int connection() const override { return 1; }
  bool is_shared() const override { return false; }
  Result<std::vector<std::string>, DatabaseError> damage() override;

 private:
  struct Close {
    void operator()(sqlite3* database) const;
  };
  explicit SqliteDatabase(sqlite3* database) : database_(database) {}
  std::unique_ptr<sqlite3, Close> database_;
};

}  // namespace srfs::ground
