// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "ground/archive/archive.hpp"
#include "ground/pass/pass_session.hpp"

namespace srfs::ground::pass {

/// How a recorded telecommand ended, by the verification reports that are there. A time-tagged one has ended
/// when it is in the schedule. Pure.
[[nodiscard]] LookedUp judge_recorded(const StoredTelecommand& stored, const std::optional<ScriptStep>& step,
                                      const mission::Dictionary& dictionary);

/// What the archive of a server knows of a plan. Reads the disk.
class PassMemory {
 public:
  PassMemory(const mission::Dictionary& dictionary, std::filesystem::path archive)
      : dictionary_(dictionary), file_(std::move(archive)) {}

  /// @param ordered  when, by the clock of this machine
  [[nodiscard]] LookedUp look_up(const std::string& token, const std::optional<ScriptStep>& step,
                                 UtcTime ordered);
  /// nullopt: the archive cannot be read.
  [[nodiscard]] std::optional<std::size_t> open_gaps();

 private:
  [[nodiscard]] Result<Archive*, std::string> opened();

  const mission::Dictionary& dictionary_;
  std::filesystem::path file_;
  std::unique_ptr<Archive> archive_;
};

}  // namespace srfs::ground::pass
