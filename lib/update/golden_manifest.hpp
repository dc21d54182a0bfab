// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace srfs::update {

/// What distinguishes a deliberate change from damage.
enum class ScrubKind : std::uint8_t {
  program,  ///< executable or library of the installation: one with another build id was installed
  version,  ///< program in a version store: never changes
  text,     ///< key, deployment, dictionary: writing one changes its time of modification; rot does not
};

/// How a file was when it was taken for good.
struct GoldenFile {
  std::string path;  ///< absolute, no link
  ScrubKind kind = ScrubKind::text;
  std::string sha256;
  std::uint64_t octets = 0;
  std::int64_t modified_ns = 0;  ///< since 1970, of the file system
  std::uint32_t mode = 0;
  std::string build_id;  ///< of a program; empty: it has none

  friend bool operator==(const GoldenFile&, const GoldenFile&) = default;
};

/// How it is now.
struct FoundFile {
  std::string sha256;
  std::uint64_t octets = 0;
  std::int64_t modified_ns = 0;
  std::string build_id;
  bool settled = true;  ///< it was not written to for a while
};

enum class ScrubVerdict : std::uint8_t {
  good,
  damaged,
  changed,    ///< on purpose: never repaired
  unsettled,  ///< it differs, and a write may be in progress: to be checked again
};
/// @param found  nullopt: there is no file, or it cannot be read
[[nodiscard]] ScrubVerdict judge(const GoldenFile& golden, const std::optional<FoundFile>& found);

/// The files that are watched. Pure.
struct GoldenManifest {
  static constexpr std::size_t most_files = 256;
  std::uint64_t revision = 0;
  std::vector<GoldenFile> files;  ///< by path

  [[nodiscard]] const GoldenFile* find(std::string_view path) const;
  void put(GoldenFile file);
  /// 16 digits that stand for the programs' build ids; empty: there are none.
  [[nodiscard]] std::string build() const;

  friend bool operator==(const GoldenManifest&, const GoldenManifest&) = default;
};

/// One line of JSON and its CRC-32C.
[[nodiscard]] std::string encode(const GoldenManifest& manifest);
/// nullopt: damaged.
[[nodiscard]] std::optional<GoldenManifest> decode_golden(std::string_view text);

}  // namespace srfs::update
