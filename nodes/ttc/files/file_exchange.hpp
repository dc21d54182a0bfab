// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "cfdp/transfer_folders.hpp"

namespace srfs {

struct FileExchangeCounters {
  std::uint64_t received = 0;   ///< PDUs from the link
  std::uint64_t sent = 0;       ///< PDUs to the link
  std::uint64_t dropped = 0;    ///< PDUs that found the queue full; the ground repeats them
  std::uint64_t malformed = 0;  ///< packets of the APID that carry no PDU
};

/// Octets that files may send now.
struct FilesRoom {
  /// @param may_send  of them, where a mode bounds the downlink
  FilesRoom(std::size_t in_queue, std::size_t may_send) : queue(in_queue), octets(may_send) {}
  // NOLINTNEXTLINE(google-explicit-constructor): nothing but the queue bounds them
  FilesRoom(std::size_t in_queue) : FilesRoom(in_queue, in_queue) {}

  std::size_t queue;   ///< room in the downlink's queue
  std::size_t octets;  ///< the same or less
};

/// Between the link, which never waits, and the folders of files, which may wait for the disk: collects PDUs
/// and says when the worker of the folders has something to do. One turn at a time. Pure.
class FileExchange {
 public:
  static constexpr std::size_t received_max = 256;
  static constexpr std::size_t received_per_turn = 64;  ///< so that a turn on a slow disk stays short
  static constexpr std::size_t pdu_octets_max = 1000;
  static constexpr milliseconds scan_period{2000};   ///< how often the outbox is scanned
  static constexpr milliseconds retry_period{1000};  ///< after a worker without room

  /// @param refill_octets room in the downlink's queue from which on it is filled again; pdu_octets_max and
  /// its packet header at least, which is also what a mode must allow
  explicit FileExchange(std::size_t refill_octets) : refill_octets_(refill_octets) {}

  /// A Space Packet of APID 2045.
  void on_packet(OctetView packet);
  /// The ground was heard: files that rest go on.
  void on_contact() { contact_ = contact_ || resting_; }

  /// Something was changed at the folders between turns.
  void on_change() { changed_ = true; }

  /// The next turn, when one is due. @param frame where the next packet of the downlink comes to lie
  [[nodiscard]] std::optional<cfdp::TransferTurn> next_turn(FilesRoom room, MonotonicTime now,
                                                            cfdp::FrameFill frame = {});
  /// @return Space Packets for the downlink
  [[nodiscard]] std::vector<Octets> on_turn(cfdp::TransferTurnResult& result);
  /// The worker did not take the turn, or could not open the folders: what was in it is lost, as on the line.
  void on_turn_refused(MonotonicTime now);
  /// When next_turn() has something without another input; room that is missing is another input.
  [[nodiscard]] std::optional<MonotonicTime> next_due(FilesRoom room) const;

  [[nodiscard]] const FileExchangeCounters& counters() const { return counters_; }

 private:
  [[nodiscard]] bool may_send(FilesRoom room) const;

  std::size_t refill_octets_;
  std::vector<Octets> received_;
  bool running_ = false;
  bool contact_ = false;
  bool changed_ = false;
  bool resting_ = true;  ///< not known before the first turn
  MonotonicTime scan_at_;
  MonotonicTime not_before_;
  std::optional<MonotonicTime> transfer_due_ = MonotonicTime();
  std::uint16_t sequence_count_ = 0;
  FileExchangeCounters counters_;
};

}  // namespace srfs
