// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "nodes/ttc/store/packet_stores.hpp"
#include "nodes/ttc/ttc_core.hpp"
#include "tests/simulation/store_disk.hpp"

namespace srfs::simulation {

/// What ttc's packet stores have taken, and what they owe for it. Its functions check requirements L6 and S8.
class StoreLedger {
 public:
  static constexpr std::size_t usual_segment_octets = 16U << 10;
  /// @param segment_octets  of the stores
  StoreLedger(Kernel& kernel, const mission::Dictionary& dictionary,
              std::size_t segment_octets = usual_segment_octets);
  StoreLedger(const StoreLedger&) = delete;
  StoreLedger& operator=(const StoreLedger&) = delete;

  [[nodiscard]] StoreDiskState& state() { return state_; }
  [[nodiscard]] SegmentDisk& disk(std::uint16_t store) { return accounts_.at(store).disk; }
  /// A process has opened the stores.
  void on_open(const PacketStoresStatus& status);
  void on_end();
  /// A packet was given to its store. @param status  behind it
  void on_append(const StoreItem& item, const PacketStoresStatus& status);
  /// A commit was made, or a part of it.
  void on_commit(const PacketStoresStatus& status);
  /// A batch was read. @param status  behind it
  void on_read(const ReadStore& read, const std::optional<RetrievedPackets>& packets,
               const PacketStoresStatus& status);
  /// Everything that was synced is there, but what was deleted for the quota; and the quota holds.
  void check() const;

  /// A packet leaves for the ground on the playback channel.
  void on_played_back(OctetView packet);
  /// The report says that a retrieval is complete.
  void on_retrieval_completed();

  void lose_power();

  struct Counters {
    std::uint64_t stored = 0;       ///< packets, synced
    std::uint64_t overwritten = 0;  ///< times that segments were deleted for the quota
    std::uint64_t retrieved = 0;    ///< periods whose packets were all compared
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  struct Account {
    SegmentDisk disk;
    std::map<std::uint32_t, std::uint32_t> owed{};     ///< synced: checksum by sequence
    std::map<std::uint32_t, std::uint32_t> pending{};  ///< not yet
    std::uint32_t next_sequence = 0;
    std::size_t quota_octets = 0;   ///< 0: no process has opened it yet
    std::uint64_t appended = 0;     ///< by this process
    std::uint64_t overwritten = 0;  ///< the same
  };
  struct Reading {
    std::uint64_t overwritten = 0;  ///< when it began
    RetrievalCursor begun;
    std::vector<std::uint32_t> expected;
    std::vector<std::uint32_t> got;
  };
  [[nodiscard]] std::uint64_t settle_deletions(Account& account, const PacketStoreStatus& status) const;
  void note_overwritten(Account& account, const PacketStoreStatus& status);
  void settle(Account& account, const PacketStoreStatus& status);
  [[nodiscard]] std::vector<std::uint32_t> expected_of(std::uint16_t store, const RetrievalRange& range,
                                                       const RetrievalCursor& begun) const;

  std::size_t segment_octets_;
  StoreDiskState state_;
  std::map<std::uint16_t, Account> accounts_;
  std::array<std::optional<Reading>, 2> readings_;  ///< of a period; open retrieval
  std::deque<std::vector<std::uint32_t>> read_;     ///< periods that are on their way to the line
  std::map<std::uint32_t, unsigned> played_back_;   ///< while a period is on its way
  Counters counters_;
};

}  // namespace srfs::simulation
