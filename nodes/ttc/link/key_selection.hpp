// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <mission/structures.hpp>

#include "base/file.hpp"
#include "base/result.hpp"

namespace srfs {

using mission::KeySet;

/// Channels and their usable sets.
using AvailableKeySets = std::vector<std::pair<std::uint8_t, KeySet>>;

/// The set that each channel was switched to; channels that are not in it take set a.
struct KeySelection {
  std::uint64_t generation = 0;  ///< counts changes; of two valid copies the higher one is true
  std::map<std::uint8_t, KeySet> sets;
  friend bool operator==(const KeySelection&, const KeySelection&) = default;
};

/// "generation vc:set ... checksum", one line.
[[nodiscard]] std::string encode_key_selection(const KeySelection& selection);
/// nullopt: not a whole, undamaged copy.
[[nodiscard]] std::optional<KeySelection> decode_key_selection(std::string_view text);

struct FoundKeySelection {
  KeySelection selection;  ///< the newer undamaged copy; set a everywhere when there is none
  unsigned damaged_copies = 0;
  bool existed = false;
};

/// Reads the copies `<path>.0` and `<path>.1`. Blocks on the disk.
[[nodiscard]] FoundKeySelection load_key_selection(const std::filesystem::path& path);
/// Writes both, one after the other; durable when one of them is. Blocks on the disk.
Result<void, FileError> store_key_selection(const std::filesystem::path& path, const KeySelection& selection);

}  // namespace srfs
