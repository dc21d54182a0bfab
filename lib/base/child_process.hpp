// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "base/process.hpp"
#include "base/result.hpp"

namespace srfs {

/// A program that this process started and has to bury. What it writes to its standard output and standard
/// error comes through output().
class ChildProcess {
 public:
  /// Never blocks for longer than an exec takes. The child has nothing on its standard input, no blocked
  /// signals, the scheduling policy SCHED_OTHER and a process group of its own; descriptors that are not
  /// close-on-exec are inherited.
  /// @param command  program (a path) and arguments
  [[nodiscard]] static Result<ChildProcess, std::string> start(const std::vector<std::string>& command);

  ChildProcess(ChildProcess&&) = default;
  ChildProcess& operator=(ChildProcess&&) = delete;
  /// Kills it (SIGKILL) when it still runs, and waits for its end.
  ~ChildProcess();

  [[nodiscard]] const Process& process() const { return process_; }
  /// Non-blocking; end of file when the child and its children have closed it.
  [[nodiscard]] int output() const { return output_.get(); }

  struct End {
    std::optional<int> exit_code;  ///< nullopt: a signal
    int signal = 0;
  };
  /// Buries it. @return nullopt: it still runs
  [[nodiscard]] std::optional<End> take_end();

 private:
  ChildProcess(Process process, Fd output) : process_(std::move(process)), output_(std::move(output)) {}

  Process process_;
  Fd output_;
  std::optional<End> end_;
};

/// "exit code 3", "signal 11 (SIGSEGV)"
[[nodiscard]] std::string to_text(const ChildProcess::End& end);

}  // namespace srfs
