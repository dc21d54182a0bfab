// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/archive/database.hpp"

namespace srfs::ground {

Result<void, DatabaseError> Statement::run() {
  const auto done = step();
  reset();
  if (!done) return Err(done.error());
  return {};
}

Result<std::int64_t, DatabaseError> Database::number(std::string_view sql) {
  const auto statement = prepare(sql);
  if (!statement) return Err(statement.error());
  const auto row = (*statement)->step();
  if (!row) return Err(row.error());
  const std::int64_t number = *row ? (*statement)->integer(0) : 0;
  (*statement)->reset();
  return number;
}

Result<Statement*, DatabaseError> PreparedStatements::of(Database& database, const std::string& sql) {
  auto found = statements_.find(sql);
  if (found == statements_.end()) {
    auto statement = database.prepare(sql);
    if (!statement) return Err(statement.error());
    found = statements_.emplace(sql, std::move(*statement)).first;
  }
  return found->second.get();
}

}  // namespace srfs::ground
