// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "base/sha256.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

inline constexpr const char* dictionary_cache_name = "dictionary.cache";  ///< in STATE

/// A dictionary that was read, in one file, for the next start: reading its YAML takes most of the time of a
/// short command. It is used when its digest is that of all it was made of, and else made anew; without it
/// everything works as with it. Blocks on the disk.
class DictionaryCache {
 public:
  static constexpr std::size_t octets_max = 16U << 20;

  /// @param file  is replaced whole. @param dictionary, fragments  as of Dictionary::load; files that cannot
  /// be read are reported by that, too
  DictionaryCache(std::filesystem::path file, const std::filesystem::path& dictionary,
                  const std::vector<mission::Fragment>& fragments);

  /// nullopt: there is none of these files by this program.
  [[nodiscard]] std::optional<mission::Dictionary> load() const;
  /// Where it cannot be written, there is none the next time.
  void keep(mission::Dictionary& dictionary) const;

 private:
  std::filesystem::path file_;
  std::optional<Sha256::Digest> sources_;  ///< nullopt: a file cannot be read
};

}  // namespace srfs::ground
