// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "base/file.hpp"
#include "base/octets.hpp"
#include "base/result.hpp"
#include "nodes/ttc/store/segment_files.hpp"
#include "nodes/ttc/store/store_record.hpp"

namespace srfs {

struct PacketStoreConfig {
  std::filesystem::path folder;
  std::size_t quota_octets = 64U << 20;   ///< of all segments; past it the oldest segment is deleted
  std::size_t segment_octets = 1U << 20;  ///< a segment is closed when the next commit would pass it
  std::size_t pending_octets =
      256U << 10;  ///< not yet written; full (the disk fails): the newest packet is refused
};

struct PacketStoreCounters {
  std::uint64_t stored = 0;          ///< records that reached the file
  std::uint64_t refused = 0;         ///< packets lost because the disk fails or the packet is too long
  std::uint64_t full = 0;            ///< packets not taken because the store is bounded and full
  std::uint64_t overwritten = 0;     ///< records deleted with their segment to keep the quota
  std::uint64_t damaged = 0;         ///< places skipped at recovery because no valid record was there
  std::uint64_t damaged_octets = 0;  ///< in them
  std::uint64_t unreadable = 0;      ///< the same while reading back, and segments that could not be read
  std::uint64_t cut_octets = 0;      ///< incomplete tails removed at recovery
  std::uint64_t write_failures = 0;  ///< commits that failed; repeated at the next commit
  std::uint64_t written_octets = 0;  ///< to the medium, headers included
};

/// What a retrieval asks for.
struct RetrievalRange {
  TaiTime from;
  TaiTime to;  ///< inclusive
};

/// Where a retrieval goes on. Starts as {}.
struct RetrievalCursor {
  std::uint32_t segment = 0;
  std::size_t offset = 0;
  /// Set by the first read: records stored later are not part of the retrieval, so it always ends.
  std::optional<std::uint32_t> end_sequence{};
  std::uint32_t begin_sequence = 0;  ///< records before it are not part of the retrieval
};

struct RetrievedPackets {
  std::vector<Octets> packets;
  RetrievalCursor next{};
  bool finished = false;
  std::uint32_t next_sequence = 0;  ///< after the last record that was checked
  bool damaged = false;             ///< a segment that may hold packets of the period could not be read
};

struct PacketStoreStatus {
  std::size_t octets = 0;
  std::size_t quota_octets = 0;
  std::size_t segments = 0;
  std::uint64_t records = 0;
  std::optional<TaiTime> oldest{};
  std::optional<TaiTime> newest{};
  bool failing = false;  ///< the last commit did not reach the disk
  bool full = false;     ///< it is bounded, and the last packet was not taken
  std::uint32_t next_sequence = 0;
  std::uint32_t recovered_sequence = 0;  ///< next_sequence when the store was first opened
  PacketStoreCounters counters{};
};

/// Append-only log of finished telemetry packets in segment files. Every call may block on the disk: it lives
/// on a worker thread, alone. A disk that is missing, full or failing loses packets (counted) and is tried
/// again at every commit; nothing throws.
class PacketStore {
 public:
  /// @param config  its folder is used
  explicit PacketStore(PacketStoreConfig config)
      : config_(std::move(config)), files_(std::make_unique<PosixSegmentFiles>(config_.folder)) {}
  /// @param config  its folder is not used
  PacketStore(PacketStoreConfig config, std::unique_ptr<SegmentFiles> files)
      : config_(std::move(config)), files_(std::move(files)) {}

  /// Reads what is there: cuts an incomplete tail of the last segment, skips and counts damage elsewhere. A
  /// segment that cannot be read is counted and kept, and the next one gets a new number.
  /// A failure is not final: commit() tries again.
  Result<void, FileError> open();

  /// A bounded store takes nothing more when it is full; another one drops its oldest segment.
  void set_bounded(bool bounded);

  /// Takes one packet into the pending octets (no disk access unless it is read back before the next commit).
  void append(const RecordStamp& stamp, OctetView packet);

  /// Writes and syncs what is pending; to be called each second. On failure the pending octets stay for the
  /// next try. So do those that were written and not synced: the kernel reports an error of the disk once,
  /// and what it could not write counts as written for every later sync.
  Result<void, FileError> commit();

  /// The next packets of @p range after @p cursor, at most @p limit_octets of them (at least one record is
  /// read).
  [[nodiscard]] RetrievedPackets read(const RetrievalRange& range, RetrievalCursor cursor,
                                      std::size_t limit_octets);

  [[nodiscard]] bool is_open() const { return opened_; }
  [[nodiscard]] std::uint32_t next_sequence() const { return next_sequence_; }
  [[nodiscard]] PacketStoreStatus status() const;

 private:
  struct Segment {
    std::size_t octets = 0;
    std::uint64_t records = 0;
    std::optional<TaiTime> oldest;
    std::optional<TaiTime> newest;
    std::uint32_t end_sequence = 0;  ///< behind its last record
    bool unreadable = false;         ///< nothing is known of its records
    void count(TaiTime t, std::uint32_t sequence);
    void add(const Segment& later);
  };

  [[nodiscard]] std::size_t octets() const;
  Result<void, FileError> recover(std::uint32_t number, bool last);
  Result<void, FileError> start_segment();
  Result<void, FileError> sync();
  Result<void, FileError> sync_what_is_left();
  Result<void, FileError> write_pending();
  [[nodiscard]] Result<void, SegmentError> keep_quota(std::size_t coming_octets);
  [[nodiscard]] const Octets* content_of(std::uint32_t number);
  [[nodiscard]] std::size_t longest_file() const;

  PacketStoreConfig config_;
  std::unique_ptr<SegmentFiles> files_;  // open is the last segment, or none
  PacketStoreCounters counters_;
  std::map<std::uint32_t, Segment> segments_;  // by number; the last one is written to
  Octets pending_;
  Segment pending_index_;
  Octets unsynced_octets_;  ///< records of the last segment, written and not yet on the medium for sure
  Segment unsynced_index_;
  Segment synced_;  ///< the last segment without them; 0 octets: not even its header
  std::uint32_t next_sequence_ = 0;
  std::optional<std::uint32_t> recovered_sequence_;
  bool opened_ = false;
  bool bounded_ = false;
  bool full_ = false;
  bool gone_ = false;  ///< files vanished at run time: the next commit opens the store again
  bool failing_ = false;
  // The segment a retrieval is in, so that each batch does not read a mebibyte again. Dropped when it is
  // written to.
  std::optional<std::uint32_t> cached_number_;
  Octets cached_;
};

}  // namespace srfs
