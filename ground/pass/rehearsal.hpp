// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/child_process.hpp"
#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::ground::pass {

/// Takes what a program says.
using Said = std::function<void(std::string_view)>;
/// Whether there is something to read. @param stop  as of termination_signals(), or -1: never
[[nodiscard]] bool is_stopped(int stop);
/// Runs a program to its end, at most @p patience long, or until @p stop is readable; then it is killed.
/// @return its exit code; the error is ready to print
[[nodiscard]] Result<int, std::string> run_program(const std::vector<std::string>& command,
                                                   nanoseconds patience, const Said& said, int stop);

/// A simulated spacecraft with its suite, in a folder of its own, for a rehearsal. It ends with the object.
class Rehearsal {
 public:
  /// Starts hw_sim and the suite. Blocks until all nodes that flight needs are up, for some minutes at most.
  /// @param programs  folder of hw_sim and srfs
  /// @param var  made; nothing may run there
  /// @param stop  when it is readable, what was started ends
  /// @return the error is ready to print
  [[nodiscard]] static Result<Rehearsal, std::string> start(const std::filesystem::path& programs,
                                                            const std::string& deployment,
                                                            const std::filesystem::path& var, int stop);
  Rehearsal(Rehearsal&& other) noexcept
      : programs_(std::move(other.programs_)),
        options_(std::move(other.options_)),
        hw_sim_(std::exchange(other.hw_sim_, std::nullopt)) {}
  Rehearsal& operator=(Rehearsal&&) = delete;
  /// Takes the suite down, then the simulated spacecraft.
  ~Rehearsal();

 private:
  Rehearsal(std::filesystem::path programs, std::vector<std::string> options, ChildProcess hw_sim)
      : programs_(std::move(programs)), options_(std::move(options)), hw_sim_(std::move(hw_sim)) {}
  /// Of `srfs`.
  [[nodiscard]] std::vector<std::string> command(const std::string& verb,
                                                 const std::vector<std::string>& more) const;

  std::filesystem::path programs_;
  std::vector<std::string> options_;  ///< of srfs: deployment and VAR
  std::optional<ChildProcess> hw_sim_;
};

}  // namespace srfs::ground::pass
