// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/gap_list.hpp"

#include <algorithm>
#include <cassert>

namespace srfs::cfdp {

// ---- SegmentSet ---------------------------------------------------------------------------------------

bool SegmentSet::add(CfdpSegment segment) {
  if (segment.start >= segment.end) return true;
  // The ones it touches melt into it.
  const auto first = std::find_if(segments_.begin(), segments_.end(),
                                  [&](const CfdpSegment& s) { return s.end >= segment.start; });
  auto last = first;
  for (; last != segments_.end() && last->start <= segment.end; ++last) {
    segment.start = std::min(segment.start, last->start);
    segment.end = std::max(segment.end, last->end);
  }
  if (first == last) {
    if (segments_.size() == limit_) return false;
    segments_.insert(first, segment);
    return true;
  }
  *first = segment;
  segments_.erase(first + 1, last);
  return true;
}

std::optional<CfdpSegment> SegmentSet::take(std::uint64_t octets_max) {
  if (segments_.empty()) return std::nullopt;
  CfdpSegment& front = segments_.front();
  const CfdpSegment taken{.start = front.start,
                          .end = front.start + std::min(octets_max, front.end - front.start)};
  front.start = taken.end;
  if (front.start == front.end) segments_.erase(segments_.begin());
  return taken;
}

std::uint64_t SegmentSet::octets() const {
  std::uint64_t octets = 0;
  for (const CfdpSegment& s : segments_) octets += s.end - s.start;
  return octets;
}

// ---- GapList ------------------------------------------------------------------------------------------

GapList::GapList(std::size_t limit, milliseconds delay, milliseconds repeat)
    : limit_(limit), delay_(delay), repeat_(repeat) {
  gaps_.reserve(limit + 1);
}

GapList::Taken GapList::judge(CfdpSegment segment) const {
  if (segment.start > end_) return gaps_.size() < limit_ ? Taken::new_octets : Taken::refused;
  bool is_new = segment.end > end_;
  for (const Gap& gap : gaps_) {
    const CfdpSegment& g = gap.segment;
    if (segment.end <= g.start || segment.start >= g.end) continue;
    if (g.start < segment.start && segment.end < g.end && gaps_.size() >= limit_) return Taken::refused;
    is_new = true;
  }
  return is_new ? Taken::new_octets : Taken::duplicate;
}

void GapList::fill(CfdpSegment segment, MonotonicTime now) {
  assert(judge(segment) != Taken::refused);
  if (segment.start > end_) {
    gaps_.push_back({.segment = {end_, segment.start}, .ask_at = now + delay_});
  }
  end_ = std::max(end_, segment.end);
  bool served = false;
  for (std::size_t i = 0; i < gaps_.size();) {
    Gap& gap = gaps_[i];
    const CfdpSegment g = gap.segment;
    if (segment.end <= g.start || segment.start >= g.end) {
      ++i;
      continue;
    }
    if (gap.asked) {
      served = true;
      time_answer(gap, now);
    }
    const bool front_left = g.start < segment.start;
    const bool back_left = segment.end < g.end;
    if (!front_left && !back_left) {
      gaps_.erase(gaps_.begin() + static_cast<std::ptrdiff_t>(i));
      continue;
    }
    Gap back = gap;
    back.segment.start = segment.end;
    if (gap.asked) back.ask_at = now + repeat_now();
    if (front_left) {
      gap.segment.end = segment.start;
      gap.ask_at = std::min(gap.ask_at, now + delay_);
      gap.asked = false;
      if (back_left) gaps_.insert(gaps_.begin() + static_cast<std::ptrdiff_t>(++i), back);
    } else {
      gap = back;
    }
    ++i;
  }
  judge_order(segment, served, now);
}

void GapList::time_answer(const Gap& gap, MonotonicTime now) {
  if (gap.asked_at <= timed_) return;  // others were served before it
  timed_ = gap.asked_at;
  const nanoseconds took = now - gap.asked_at;
  answer_time_ = answer_time_ ? (3 * *answer_time_ + took) / 4 : took;
}

nanoseconds GapList::repeat_now() const {
  constexpr milliseconds slack(300);
  return answer_time_ ? std::min<nanoseconds>(2 * *answer_time_ + slack, repeat_) : nanoseconds(repeat_);
}

void GapList::judge_order(CfdpSegment segment, bool served, MonotonicTime now) {
  if (!answer_time_) return;
  const MonotonicTime known_to_sender = now - (*answer_time_ + *answer_time_ / 4 + nanoseconds(delay_));
  for (Gap& gap : gaps_) {
    if (!gap.asked) continue;
    if (gap.segment.start >= segment.end) {
      if (served) gap.ask_at = std::max(gap.ask_at, now + repeat_now());
    } else if (gap.segment.end <= segment.start && gap.asked_at < known_to_sender) {
      gap.ask_at = std::min(gap.ask_at, now + delay_);
    }
  }
}

void GapList::set_file_size(std::uint64_t octets, MonotonicTime now) {
  assert(octets >= end_);
  if (octets == end_) return;
  if (!gaps_.empty() && gaps_.back().segment.end == end_) {
    gaps_.back().segment.end = octets;
  } else {
    gaps_.push_back({.segment = {end_, octets}, .ask_at = now + delay_});
  }
  end_ = octets;
}

std::uint64_t GapList::missing_octets() const {
  std::uint64_t octets = 0;
  for (const Gap& gap : gaps_) octets += gap.segment.end - gap.segment.start;
  return octets;
}

std::vector<CfdpSegment> GapList::take_due(std::size_t limit, bool repeat, MonotonicTime now) {
  std::vector<CfdpSegment> due;
  for (Gap& gap : gaps_) {
    if (due.size() == limit) break;
    if (gap.ask_at > now || (gap.asked && !repeat)) continue;
    due.push_back(gap.segment);
    gap.asked = true;
    gap.asked_at = now;
    gap.ask_at = now + repeat_now();
  }
  return due;
}

std::optional<MonotonicTime> GapList::next_due(bool repeat) const {
  std::optional<MonotonicTime> first;
  for (const Gap& gap : gaps_) {
    if (gap.asked && !repeat) continue;
    if (!first || gap.ask_at < *first) first = gap.ask_at;
  }
  return first;
}

void GapList::ask_all(MonotonicTime now) {
  for (Gap& gap : gaps_) {
    gap.ask_at = now;
    gap.asked = false;
  }
}

bool GapList::restore(std::uint64_t end, const std::vector<CfdpSegment>& gaps, MonotonicTime now) {
  if (gaps.size() > limit_ + 1) return false;
  std::uint64_t before = 0;
  for (const CfdpSegment& gap : gaps) {
    if (gap.start < before || gap.end <= gap.start || gap.end > end) return false;
    before = gap.end;
  }
  end_ = end;
  gaps_.clear();
  for (const CfdpSegment& gap : gaps) gaps_.push_back({.segment = gap, .ask_at = now + delay_});
  return true;
}

void GapList::reset(std::uint64_t end, MonotonicTime now) {
  gaps_.clear();
  end_ = end;
  if (end > 0) gaps_.push_back({.segment = {0, end}, .ask_at = now});
}

}  // namespace srfs::cfdp
