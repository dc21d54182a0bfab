// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/time.hpp"
#include "wire/cfdp_pdu.hpp"

namespace srfs::cfdp {

/// What a fault does to its transaction (CCSDS 727.0-B-5, 4.8).
enum class FaultHandler : std::uint8_t {
  cancel,   ///< ends it and notifies the peer
  suspend,  ///< rests until resume(), or until the peer is heard again
  ignore,   ///< goes on
  abandon,  ///< ends it without notice
};

/// One handler for each condition code. A link that is down for long must not cost what was transferred, so
/// the limits that time reaches suspend; what time does not heal cancels.
class FaultHandlers {
 public:
  constexpr FaultHandlers() {
    for (const auto condition : {wire::CfdpCondition::positive_ack_limit, wire::CfdpCondition::nak_limit,
                                 wire::CfdpCondition::inactivity, wire::CfdpCondition::keep_alive_limit}) {
      set(condition, FaultHandler::suspend);
    }
  }
  constexpr FaultHandlers& set(wire::CfdpCondition condition, FaultHandler handler) {
    handlers_[static_cast<std::size_t>(condition)] = handler;
    return *this;
  }
  [[nodiscard]] constexpr FaultHandler of(wire::CfdpCondition condition) const {
    return handlers_[static_cast<std::size_t>(condition)];
  }

 private:
  std::array<FaultHandler, 16> handlers_{};  // cancel
};

/// Of one entity. All bounds are set aside when it is made.
struct Settings {
  std::uint64_t own_entity = 1;
  std::uint64_t peer_entity = 2;
  std::uint8_t entity_id_octets = 2;        ///< of the PDUs of own transactions
  std::uint8_t sequence_number_octets = 4;  ///< likewise
  bool crc = false;                         ///< likewise; frames have their own
  wire::CfdpChecksumType checksum = wire::CfdpChecksumType::modular;
  std::size_t file_data_octets = 950;  ///< most file octets in a PDU, however large PDUs may be

  milliseconds ack_interval{5'000};  ///< EOF or Finished sent -> its ACK
  unsigned ack_limit = 10;           ///< times one is sent
  /// Longer than the way to the peer and back, with all queues between; until an answer was timed, and at
  /// most.
  milliseconds nak_interval{3'000};
  unsigned nak_limit = 10;        ///< times asked after EOF without one new octet
  milliseconds nak_delay{200};    ///< gap seen -> asked for: leaves time for PDUs out of order
  milliseconds nak_spacing{500};  ///< from one NAK of a file to the next: gaps are asked for together
  milliseconds inactivity_interval{60'000};
  unsigned inactivity_limit = 3;  ///< sender: EOF is sent again so often when Finished does not come
  std::uint64_t keep_alive_limit_octets = 0;  ///< peer this much behind: fault; 0: not watched
  FaultHandlers fault_handlers{};

  std::size_t transactions_max = 16;  ///< sent and received together
  /// Of them received at most: the others are kept for sending. Beyond, a new file takes the place of one
  /// that was announced and never came.
  std::size_t receiving_max = 8;
  /// Quota: what is there of all files that are being received, together. A file that announces more is
  /// refused at once; nothing is set aside for what is only announced.
  std::uint64_t receiving_octets_max = 256U << 20;
  std::uint64_t free_floor_octets = 64U << 20;  ///< so much of the disk is left to others by what is received
  bool safe_names = false;                      ///< received files are named by safe_name()
  std::size_t gaps_max = 256;                   ///< of one transaction; data that would make more is dropped
  std::size_t history_max = 64;                 ///< ended transactions whose late PDUs are still known
  std::size_t replies_max = 32;                 ///< ACKs waiting for the link; the newest is dropped
  std::size_t events_max = 64;                  ///< not yet taken; the oldest is dropped
  std::uint64_t file_octets_max = 1U << 30;     ///< larger files are refused, either way
  /// Receiver: a crash costs at most so many file octets that travel again, for each transaction. Each
  /// checkpoint costs the disk a sync.
  std::size_t checkpoint_octets = 4U << 10;
  std::size_t reserve_octets =
      32U << 10;  ///< sender: passed over by a crash at most, until the receiver asks for them
  std::size_t work_octets = 256U << 10;  ///< most octets read by one advance() to check a file
};

/// What was dropped or done, since the entity was made.
struct Counters {
  std::array<std::uint64_t, wire::cfdp_pdu_error_count> malformed{};  ///< by CfdpPduError
  std::uint64_t pdus_received = 0;                                    ///< well-formed
  std::uint64_t pdus_sent = 0;
  std::uint64_t class_1 = 0;     ///< unacknowledged mode: refused
  std::uint64_t not_for_us = 0;  ///< other entities than own and peer
  std::uint64_t no_room = 0;     ///< new transaction refused
  std::uint64_t displaced = 0;   ///< file awaited in vain, ended for a new one
  std::uint64_t no_transaction =
      0;                         ///< of a transaction that is not known (answered where the standard says so)
  std::uint64_t late = 0;        ///< of a transaction that ended
  std::uint64_t unexpected = 0;  ///< a PDU its transaction has no use for now
  std::uint64_t duplicate_data = 0;    ///< file data that was there already
  std::uint64_t dropped_data = 0;      ///< too many gaps, or the disk refused it
  std::uint64_t dropped_segments = 0;  ///< asked for by NAK, and too many to remember
  std::uint64_t dropped_replies = 0;
  std::uint64_t dropped_events = 0;
  std::uint64_t checkpoints = 0;
  std::uint64_t checkpoint_failures = 0;
};

}  // namespace srfs::cfdp
