// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "update/package.hpp"

namespace srfs {

/// How `srfs-lane` (programs/lane) is called and what it answers. Pure.

struct LaneFolders {
  std::filesystem::path program;      ///< srfs-lane
  std::filesystem::path prefix;       ///< the installed SRFS that is built against
  std::filesystem::path work;         ///< everything below belongs to one update, and goes with it
  std::filesystem::path lane;         ///< the lane's own, which keeps what it has precompiled
  std::vector<std::string> required;  ///< layers of the sandbox without which nothing is run
  /// The structs of the mission that flies; empty: those that SRFS was built with.
  std::filesystem::path structures = {};

  [[nodiscard]] std::filesystem::path sources() const { return work / "sources"; }
  [[nodiscard]] std::filesystem::path built(const std::string& node) const { return work / node; }
  /// The list of added nodes that a new node is tested with.
  [[nodiscard]] std::filesystem::path added_nodes() const { return work / "added_nodes"; }
  [[nodiscard]] std::filesystem::path log() const { return work / "log"; }
  [[nodiscard]] std::filesystem::path report() const { return work / "report.json"; }
};

[[nodiscard]] std::vector<std::string> build_command(const LaneFolders& folders,
                                                     const update::Manifest& manifest);
[[nodiscard]] std::vector<std::string> self_test_command(const LaneFolders& folders,
                                                         const update::Manifest& manifest,
                                                         const std::filesystem::path& deployment);

struct LaneReport {
  bool good = false;   ///< built, or passed
  std::string reason;  ///< otherwise: "compiler_failed: 1 error"
  std::string program_sha256;
  std::uint64_t program_octets = 0;
  std::uint64_t took_ms = 0;
};
/// @param json  of srfs-lane --report; what is no report is a failure with a reason
/// @param end   how srfs-lane ended, for the reason then
[[nodiscard]] LaneReport read_lane_report(std::string_view json, std::string_view end);

}  // namespace srfs
