// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "nodes/ttc/report/report.hpp"
#include "wire/pus.hpp"

namespace srfs {

using Stage = mission::VerificationStage;

/// Where the reports go, and which ones were asked for.
struct TelecommandOrigin {
  wire::RequestId request = {};
  std::uint16_t apid = 0;       ///< addressed by the telecommand; its reports come from there
  std::uint8_t ack_flags = 0;   ///< wire::ack
  std::uint16_t source_id = 0;  ///< of the sender; the destination of the reports
  std::uint64_t id = 0;         ///< of the accepted telecommand; 0: none yet
};

/// A stage that a telecommand reached or missed: in the report of a node, for the journal, and as its end.
struct StageReached {
  std::uint64_t id = 0;  ///< of the accepted telecommand; 0: where its holder knows it
  Stage stage = Stage::acceptance;
  bool success = true;
  std::uint16_t failure_code = 0;
  std::uint8_t step = 0;
  Octets data = {};     ///< behind the failure code
  bool silent = false;  ///< a success whose report was not wanted

  /// Nothing comes after it.
  [[nodiscard]] bool is_end() const {
    return stage == Stage::completion || (!success && stage != Stage::progress);
  }
  friend bool operator==(const StageReached&, const StageReached&) = default;
};

/// Stages before any execution.
[[nodiscard]] constexpr bool is_before_start(Stage stage) {
  return stage == Stage::acceptance || stage == Stage::routing;
}

/// Whether the sender wants the success report of @p stage. Failures are always reported.
[[nodiscard]] bool wants_success(const TelecommandOrigin& origin, Stage stage);

/// 1,1 1,3 1,7: request id. 1,5: request id, step u8.
[[nodiscard]] Report success_report(const TelecommandOrigin& origin, Stage stage, std::uint8_t step = 0);
/// 1,2 1,4 1,6 1,8 1,10: request id, (1,6: step u8,) failure code u16, @p data (1,2: position of the
/// parameter, 1 = first).
[[nodiscard]] Report failure_report(const TelecommandOrigin& origin, Stage stage, std::uint16_t failure_code,
                                    OctetView data = {}, std::uint8_t step = 0);

}  // namespace srfs
