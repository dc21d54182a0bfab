// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "update/sandbox.hpp"

namespace srfs::update {

/// What the bounded build lane decides (programs/lane): command lines, and what a confined program's end
/// means. Pure.

/// How an installation wants nodes compiled: its share/srfs/node_build.json, with absolute paths.
struct NodeBuild {
  std::vector<std::string> flags;
  std::vector<std::filesystem::path> include;
  std::vector<std::filesystem::path> readable;
  std::filesystem::path library_folder;
  std::vector<std::string> libraries;
  /// Absolute paths of libraries that are linked where they are there. plan_build() takes all: the caller has
  /// removed those that are not.
  std::vector<std::filesystem::path> where_installed = {};
  /// Folder of mission/structures.hpp and .cpp of the mission that flies, if it is not the installation's:
  /// found first, and part of every program.
  std::filesystem::path structures = {};
};
[[nodiscard]] Result<NodeBuild, std::string> decode_node_build(std::string_view json,
                                                               const std::filesystem::path& prefix);

struct Command {
  std::string title;  ///< "compile 1/3 src/main.cpp"
  std::vector<std::string> words;
};
struct BuildPlan {
  std::vector<Command> compile;  ///< in any order
  Command link;
};
inline constexpr const char* compiler = "/usr/bin/g++";
inline constexpr const char* built_program = "program";  ///< in the work folder

/// To be carried out in work/src. @param sources  relative to it; those ending in .cpp are compiled
/// @param header   precompiled beside it, for the same options; or none
[[nodiscard]] BuildPlan plan_build(const NodeBuild& build, const std::vector<std::string>& sources,
                                   const std::vector<std::string>& options, const std::filesystem::path& work,
                                   const std::optional<std::filesystem::path>& header);
/// Compiles work/node.hpp beside itself, and lists what it includes in work/node.d.
[[nodiscard]] Command plan_header(const NodeBuild& build, const std::vector<std::string>& options,
                                  const std::filesystem::path& work);
/// What every node includes.
[[nodiscard]] std::string header_text();
/// Files of a make rule "target: file file \".
[[nodiscard]] std::vector<std::string> files_of_rule(std::string_view rule);

enum class BuildOutcome : std::uint8_t {
  built,
  compiler_failed,  ///< the log has the reason
  time_limit,
  cpu_limit,
  memory_limit,
  process_limit,
  quota,             ///< the work folder was full
  output_too_large,  ///< a file, or the program
  sandbox_failed,    ///< nothing was compiled, or the program could not be stored
  cancelled,
};
[[nodiscard]] std::string_view to_text(BuildOutcome outcome);
/// Whether the log reports a limit is taken from the compiler's words: sources can print them, too, and gain
/// nothing by it.
[[nodiscard]] BuildOutcome judge_build(const Ended& ended, std::string_view log, const Limits& limits);

enum class SelfTestOutcome : std::uint8_t {
  passed,
  failed,   ///< its own verdict
  crashed,  ///< ended otherwise
  hung,     ///< did not end in time
  cpu_limit,
  memory_limit,
  process_limit,
  quota,
  sandbox_failed,
  cancelled,
};
[[nodiscard]] std::string_view to_text(SelfTestOutcome outcome);
inline constexpr int self_test_failed = 6;  ///< exit code of a node, lib/suite/run_node.hpp
[[nodiscard]] SelfTestOutcome judge_self_test(const Ended& ended, const Limits& limits);

/// For people: "signal 11 (Segmentation fault)", "exit code 1", "ended after 10 s".
[[nodiscard]] std::string describe(const Ended& ended);

/// Exit codes of srfs-lane.
enum class LaneExit : int { done = 0, to_blame = 1, environment = 2, limit = 3, cancelled = 4 };
[[nodiscard]] LaneExit exit_of(BuildOutcome outcome);
[[nodiscard]] LaneExit exit_of(SelfTestOutcome outcome);

/// Text of any length in bounded room: its first and its last octets.
class HeadAndTail {
 public:
  explicit HeadAndTail(std::size_t octets) : half_(octets / 2) {}
  void append(std::string_view text);
  [[nodiscard]] std::string text() const;

 private:
  std::size_t half_;
  std::string head_;
  std::string tail_;  ///< up to twice as much as is kept
  std::uint64_t left_out_ = 0;
};

/// The last lines of @p text, of @p octets at most.
[[nodiscard]] std::string last_lines(std::string_view text, std::size_t octets);

}  // namespace srfs::update
