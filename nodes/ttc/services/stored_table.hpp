// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "base/octets.hpp"
#include "base/state_file.hpp"
#include "nodes/ttc/report/verification.hpp"

namespace srfs {

/// The table of a service as it stands on disk, as a whole: a change is there or it is not.
struct StoredTable {
  std::uint64_t generation = 0;  ///< counts the changes; of two copies the higher one holds
  Octets content = {};           ///< the service's own
  friend bool operator==(const StoredTable&, const StoredTable&) = default;
};
[[nodiscard]] std::string encode_table(const StoredTable& table);
/// nullopt: damaged.
[[nodiscard]] std::optional<StoredTable> decode_table(std::string_view stored);
/// PATH.0 and PATH.1, each with CRC-32C.
[[nodiscard]] StateFile<StoredTable> stored_table_file(const std::filesystem::path& path);

/// What the start found of a table.
struct FoundTable {
  std::optional<StoredTable> table = {};
  bool damaged = false;  ///< there was one, and no copy is sound
};

/// A table was changed by a telecommand, and is to be stored.
struct TableChange {
  TelecommandOrigin origin;
  StoredTable table;
};

}  // namespace srfs
