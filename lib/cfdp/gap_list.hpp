// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/time.hpp"
#include "wire/cfdp_pdu.hpp"

namespace srfs::cfdp {

using wire::CfdpSegment;

/// Parts of a file, in order, apart from one another, bounded in number.
class SegmentSet {
 public:
  explicit SegmentSet(std::size_t limit) : limit_(limit) { segments_.reserve(limit); }

  /// @return false: would be one part too many, nothing changed
  bool add(CfdpSegment segment);
  /// Takes up to @p octets_max from the beginning.
  [[nodiscard]] std::optional<CfdpSegment> take(std::uint64_t octets_max);
  [[nodiscard]] bool empty() const { return segments_.empty(); }
  [[nodiscard]] const std::vector<CfdpSegment>& segments() const { return segments_; }
  [[nodiscard]] std::uint64_t octets() const;
  void clear() { segments_.clear(); }

 private:
  std::size_t limit_;
  std::vector<CfdpSegment> segments_;
};

/// What a receiver lacks of a file, and when to ask for it (again). Bounded: data that would make one gap too
/// many is refused.
///
/// How long an answer takes is measured. A sender serves what it was asked for in order of offset, and before
/// new data; so data behind a gap that was asked for longer ago shows that the gap's data was lost again, and
/// data in front of it shows that its turn will come. A sender with another order costs octets that travel
/// twice, no more.
class GapList {
 public:
  struct Gap {
    CfdpSegment segment;
    MonotonicTime ask_at;
    bool asked = false;
    MonotonicTime asked_at = {};  ///< the last time
  };

  /// @param delay   gap seen -> asked for
  /// @param repeat  asked for -> asked for again, before an answer was timed, and at most
  GapList(std::size_t limit, milliseconds delay, milliseconds repeat);

  enum class Taken : std::uint8_t { new_octets, duplicate, refused };
  /// What data of @p segment would be. Nothing changes.
  [[nodiscard]] Taken judge(CfdpSegment segment) const;
  /// Data of @p segment is there. A gap whose beginning was just filled is being served: its rest and what
  /// was asked for behind it are not asked for before the repeat interval; a part in front that was left out
  /// is lost again.
  void fill(CfdpSegment segment, MonotonicTime now);
  /// The file ends at @p octets, not before end().
  void set_file_size(std::uint64_t octets, MonotonicTime now);

  /// Behind the last octet that is there (or that the file is known to have).
  [[nodiscard]] std::uint64_t end() const { return end_; }
  [[nodiscard]] std::uint64_t missing_octets() const;
  [[nodiscard]] bool complete() const { return gaps_.empty(); }
  [[nodiscard]] const std::vector<Gap>& gaps() const { return gaps_; }

  /// Gaps due now, at most @p limit; they count as asked for. @param repeat also those asked for before
  [[nodiscard]] std::vector<CfdpSegment> take_due(std::size_t limit, bool repeat, MonotonicTime now);
  [[nodiscard]] std::optional<MonotonicTime> next_due(bool repeat) const;
  /// Everything is asked for at once.
  void ask_all(MonotonicTime now);

  /// As a checkpoint had it. @return false: not in order, overlapping or too many
  [[nodiscard]] bool restore(std::uint64_t end, const std::vector<CfdpSegment>& gaps, MonotonicTime now);
  /// Nothing is there.
  void reset(std::uint64_t end, MonotonicTime now);

 private:
  void time_answer(const Gap& gap, MonotonicTime now);
  void judge_order(CfdpSegment segment, bool served, MonotonicTime now);
  [[nodiscard]] nanoseconds repeat_now() const;

  std::size_t limit_;
  milliseconds delay_;
  milliseconds repeat_;
  std::uint64_t end_ = 0;
  std::optional<nanoseconds> answer_time_;  // smoothed: asked -> first data
  MonotonicTime timed_;                     // asking whose answer was timed last
  std::vector<Gap> gaps_;  // in order, apart; one more than limit_ has room: the gap before the end of file
};

}  // namespace srfs::cfdp
