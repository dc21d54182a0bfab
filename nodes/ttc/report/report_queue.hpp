// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "nodes/ttc/report/verification.hpp"

namespace srfs {

/// Outcomes of telecommands since the start of the node. Stages whose report was not wanted are counted too.
struct VerificationCounters {
  std::uint32_t accepted = 0;
  std::uint32_t rejected = 0;
  std::uint32_t started = 0;
  std::uint32_t completed = 0;
  std::uint32_t failed = 0;  ///< at start or later
};

/// The newest telecommand and the last stage it reached, for the beacon.
struct LastTelecommand {
  TelecommandOrigin origin;
  StageReached reached;
};

/// Reports on their way to the ground, in order. Everything that handles telecommands writes into one queue,
/// which also honours their acknowledgement flags.
class ReportQueue {
 public:
  void success(const TelecommandOrigin& origin, Stage stage, std::uint8_t step = 0);
  void failure(const TelecommandOrigin& origin, Stage stage, std::uint16_t failure_code, OctetView data = {},
               std::uint8_t step = 0);
  /// It was carried out at once: start and completion.
  void done(const TelecommandOrigin& origin) {
    success(origin, Stage::start);
    success(origin, Stage::completion);
  }
  /// What was reported before, once more: neither counted nor remembered.
  /// @param stored it may not be in the packet store yet
  void success_again(const TelecommandOrigin& origin, Stage stage, bool stored);
  void failure_again(const TelecommandOrigin& origin, Stage stage, std::uint16_t failure_code, OctetView data,
                     std::uint8_t step, bool stored);
  /// A report that is no verification: the answer to a request, which is not stored.
  void put(Report report);

  [[nodiscard]] std::vector<Report> take() { return std::exchange(reports_, {}); }
  /// Stages of telecommands with an id since the last call, whether or not their report was wanted.
  [[nodiscard]] std::vector<StageReached> take_stages() { return std::exchange(stages_, {}); }
  [[nodiscard]] const VerificationCounters& counters() const { return counters_; }
  /// nullopt: none yet.
  [[nodiscard]] const std::optional<LastTelecommand>& last() const { return last_; }

 private:
  void remember(const TelecommandOrigin& origin, const StageReached& reached);

  std::vector<Report> reports_;
  std::vector<StageReached> stages_;
  VerificationCounters counters_;
  std::optional<LastTelecommand> last_;
};

}  // namespace srfs
