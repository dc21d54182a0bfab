// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/report/verification.hpp"

namespace srfs {

/// One telecommand on board. TelecommandParser makes it from its packet; from there it is moved from stage to
/// stage, and each holds beside it what it adds.
struct Telecommand {
  TelecommandOrigin origin;                   ///< the id is filled in when it is recorded
  const mission::Command* command = nullptr;  ///< of the dictionary; nullptr: it has none
  Octets arguments = {};                      ///< without the function id
  MonotonicTime expiry = {};                  ///< not begun by its node after this
  bool repeated = false;                      ///< may have been done before a restart
};

/// Why a telecommand is refused (1,2 or 1,10).
struct Refusal {
  std::uint16_t code = 0;
  Octets parameter = {};
  Stage stage = Stage::acceptance;  ///< routing: no application process can accept it
};

/// A telecommand after the decision and before anything is done: it waits for its record.
struct JudgedTelecommand {
  Telecommand telecommand;
  std::optional<Refusal> refusal = {};
  std::uint64_t refusal_serial = 0;  ///< filled in when the refusal is recorded; 0: it is not
  // Filled in by the PersistenceGate.
  MonotonicTime received = {};   ///< when its last octet was read
  std::uint64_t generation = 0;  ///< of the journal that has its record
  bool durable = true;           ///< that is on disk
};

/// How far an accepted telecommand got.
struct TelecommandProgress {
  bool taken = false;  ///< its node has persisted it
  bool started = false;
  std::uint8_t last_step = 0;
  bool other_boot = false;  ///< accepted before this boot: its expiry means nothing, it may not begin now
};

}  // namespace srfs
