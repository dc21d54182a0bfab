// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/time.hpp"

namespace srfs::rescue {

/// Whether any process holds an instance lock of VAR/run: a node runs.
[[nodiscard]] bool suite_runs(const std::filesystem::path& var);
/// Sets the stopping flag, so that nothing revives a node, and kills (SIGKILL) the nodes: the holders of the
/// instance locks, and those that are still being loaded. Blocks for three seconds at most. @return whether
/// none is left
bool end_suite(const std::filesystem::path& var);

/// Runs a program that has this process' standard output. Blocks until it ends, @p limit at most; then it is
/// killed. @param meanwhile  called several times a second. @return empty: exit code 0 or 1 (some nodes came,
/// the ring goes on); else what went wrong
[[nodiscard]] std::string run_program(const std::vector<std::string>& command, nanoseconds limit,
                                      const std::function<void()>& meanwhile);

}  // namespace srfs::rescue
