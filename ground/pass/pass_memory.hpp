// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

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
  PassMemory(const mission::Dictionary& dictionary, ArchivePlace archive)
      : dictionary_(dictionary), place_(std::move(archive)) {}

  /// What is not recorded was not sent, provided that the archive reaches back to the order.
  /// @param ordered  when, by the clock of this machine
  [[nodiscard]] LookedUp look_up(const std::string& token, const std::optional<ScriptStep>& step,
                                 UtcTime ordered);
  /// nullopt: the archive cannot be read.
  [[nodiscard]] std::optional<std::size_t> open_gaps();

 private:
  [[nodiscard]] Result<Archive*, std::string> opened();

  const mission::Dictionary& dictionary_;
  ArchivePlace place_;
  std::unique_ptr<Archive> archive_;
};

}  // namespace srfs::ground::pass
