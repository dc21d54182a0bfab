// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "update/build_lane.hpp"

namespace srfs::lane {

/// What both uses of the lane share (README.md).
struct Lane {
  std::filesystem::path prefix;
  std::filesystem::path work;  ///< work/job is this run's, work/headers stays
  update::NodeBuild installation;
  update::Confinement confinement;
  int cancel_fd = -1;

  [[nodiscard]] std::filesystem::path job() const { return work / "job"; }
};

/// Prints a line on standard output, at once; there may be no reader.
void say(std::string_view line);

/// For --report; written atomically.
struct Report {
  std::string outcome;
  std::string reason;
  update::Ended ended;
  std::optional<std::uint64_t> octets;  ///< of the program
  std::string sha256;
  std::string last_lines;
  std::optional<bool> precompiled;
};
[[nodiscard]] std::string to_json(const Report& report);

struct BuildOrder {
  std::filesystem::path sources;
  std::string node;
  std::vector<std::string> options;
  unsigned jobs = 2;
  bool precompile = true;
  std::uint64_t program_octets = 64U << 20;
  std::size_t log_octets = 256U << 10;
  std::filesystem::path out;
  std::filesystem::path log;
};
[[nodiscard]] update::LaneExit build(const Lane& lane, const BuildOrder& order, Report& report);

struct SelfTestOrder {
  std::filesystem::path program;
  std::string node;
  std::filesystem::path deployment;
  int domain = 232;
  std::size_t log_octets = 64U << 10;
  std::filesystem::path log;          ///< empty: none
  std::filesystem::path added_nodes;  ///< list of added nodes that the program finds; empty: none
};
[[nodiscard]] update::LaneExit self_test(const Lane& lane, const SelfTestOrder& order, Report& report);

/// The header that every node includes, compiled for these options: work/headers/KEY/node.hpp, with its .gch
/// beside it. Compiled when there is none, or when anything that it includes has changed since; that is done
/// confined, and before any foreign source is there. nullopt: not available; sources are compiled without it.
[[nodiscard]] std::optional<std::filesystem::path> precompiled_header(
    const Lane& lane, const std::vector<std::string>& options);

/// Digest of an open file's octets, copied to @p to, which is replaced atomically. @return why not
struct Copied {
  std::uint64_t octets = 0;
  std::string sha256;
};
[[nodiscard]] Result<Copied, std::string> store(int from, const std::filesystem::path& to, bool executable);

}  // namespace srfs::lane
