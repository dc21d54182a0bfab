// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "cfdp/receiver.hpp"
#include "cfdp/sender.hpp"

namespace srfs::cfdp {

/// A transaction that is over, remembered so that its late PDUs are answered and not taken for a new one.
struct Ended {
  TransactionId id;
  Outcome outcome;
  friend bool operator==(const Ended&, const Ended&) = default;
};

/// Everything of an entity that must survive a crash.
struct Checkpoint {
  std::uint64_t entity = 0;         ///< whose it is
  std::uint64_t next_sequence = 0;  ///< lower numbers may be in use
  std::vector<SendState> senders;
  std::vector<ReceiveState> receivers;
  std::vector<Ended> history;  ///< oldest first
  friend bool operator==(const Checkpoint&, const Checkpoint&) = default;
};

enum class CheckpointError : std::uint8_t {
  not_a_checkpoint,  ///< too short, or another kind of file
  other_version,
  damaged,       ///< CRC-32C
  malformed,     ///< right CRC, impossible contents
  other_entity,  ///< of an entity with another id
};
[[nodiscard]] std::string_view to_string(CheckpointError error);

[[nodiscard]] Octets encode_checkpoint(const Checkpoint& checkpoint);
[[nodiscard]] Result<Checkpoint, CheckpointError> decode_checkpoint(OctetView octets);

}  // namespace srfs::cfdp
