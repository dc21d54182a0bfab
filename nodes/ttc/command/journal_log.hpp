// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/file.hpp"
#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs {

/// One record of a journal: its content is the owner's; kind 0 is a whole state, all others are changes to
/// the state before them.
struct JournalRecord {
  std::uint8_t kind = 0;
  Octets payload;
  friend bool operator==(const JournalRecord&, const JournalRecord&) = default;
};

inline constexpr std::uint8_t journal_snapshot_kind = 0;
/// Magic u16, kind u8, payload octets u24, generation u32, index u32, payload, CRC-32C of all before.
inline constexpr std::size_t journal_record_overhead = 18;
inline constexpr std::size_t journal_segment_octets = 512U << 10;

/// Where the two segments of a journal are kept. Every call may block on the disk.
class JournalMedium {
 public:
  static constexpr unsigned segments = 2;
  virtual ~JournalMedium() = default;
  /// The whole segment, empty when there is none.
  [[nodiscard]] virtual Octets read(unsigned segment) = 0;
  /// Not on the medium before sync(). After power loss any part of it may be there.
  virtual Result<void, FileError> write(unsigned segment, std::size_t offset, OctetView octets) = 0;
  /// Returns when everything written to the segment is on the medium.
  virtual Result<void, FileError> sync(unsigned segment) = 0;
};

/// What a scan of one segment found.
struct JournalSegment {
  std::uint32_t generation = 0;  ///< 0: no valid record
  bool whole = false;            ///< its snapshot is valid
  std::vector<JournalRecord> records;
  std::size_t end = 0;             ///< offset behind the last record
  std::uint32_t next_index = 0;    ///< of the record after it
  std::size_t damaged_octets = 0;  ///< between valid records; what follows the last one is the tail
};

/// Finds the records of the newest generation in a segment, past damage too. Records behind them, of an older
/// use of the segment, are ignored.
[[nodiscard]] JournalSegment scan_journal_segment(OctetView octets);

/// Append-only log in two segments that are written in turn: a segment begins with a snapshot and goes on
/// with changes; when it is full the next snapshot goes to the other one, which counts once it is synced. At
/// power loss at any instant everything that was synced is found again. A damaged snapshot costs nothing
/// while the segment before it is whole.
class JournalLog {
 public:
  explicit JournalLog(JournalMedium& medium) : medium_(medium) {}

  struct Found {
    std::vector<JournalRecord> records;  ///< in order; a snapshot replaces what came before
    std::size_t damaged_octets = 0;      ///< in places where a record should be
    bool existed = false;                ///< something was there
  };
  [[nodiscard]] Found load();

  /// Adds changes behind the last record. @param sync return when they are on the medium.
  /// After a failure, and before the first snapshot of this process, only snapshot() may follow.
  Result<void, FileError> append(const std::vector<JournalRecord>& records, bool sync);
  /// Begins the other segment with a whole state; synced. After a failure the older segment still counts.
  Result<void, FileError> snapshot(const Octets& state);

  /// Of the current segment.
  [[nodiscard]] std::size_t used_octets() const { return end_; }

 private:
  JournalMedium& medium_;
  unsigned current_ = 1;  ///< holds the newest whole snapshot; the other one is written next
  std::uint32_t generation_ = 0;
  std::uint32_t next_index_ = 0;
  std::size_t end_ = 0;
};

}  // namespace srfs
