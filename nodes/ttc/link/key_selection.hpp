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

#include "base/state_file.hpp"

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

/// `<path>.0` and `<path>.1`.
[[nodiscard]] StateFile<KeySelection> key_selection_file(const std::filesystem::path& path);

}  // namespace srfs
