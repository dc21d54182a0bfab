// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/log_limit.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace srfs::log {

bool RateLimit::Bucket::has_room(MonotonicTime now, int burst, nanoseconds interval) const {
  return full_at - now <= interval * (burst - 1);
}

bool RateLimit::Bucket::take(MonotonicTime now, int burst, nanoseconds interval) {
  if (!has_room(now, burst, interval)) return false;
  full_at = std::max(full_at, now) + interval;
  return true;
}

RateLimit::Entry& RateLimit::entry_of(Site site) {
  const std::size_t hash = reinterpret_cast<std::uintptr_t>(site.file) / 16 + site.line * std::size_t{37};
  auto& set = entries_[hash % sets];
  const auto known = std::find_if(set.begin(), set.end(), [&](const Entry& e) { return e.site == site; });
  if (known != set.end()) return *known;
  auto& oldest = *std::min_element(set.begin(), set.end(), [](const Entry& a, const Entry& b) {
    return a.bucket.full_at < b.bucket.full_at;
  });
  forgotten_ += oldest.held_back;
  oldest = Entry{.site = site, .bucket = {}, .held_back = 0};
  return oldest;
}

RateLimit::Verdict RateLimit::on_line(Site site, MonotonicTime now) {
  Entry& entry = entry_of(site);
  const bool write = entry.bucket.has_room(now, site_burst, site_interval) &&
                     all_.take(now, all_burst, all_interval) &&
                     entry.bucket.take(now, site_burst, site_interval);
  if (write) return {.write = true, .held_back = std::exchange(entry.held_back, 0)};
  ++held_back_;
  if (entry.held_back != std::numeric_limits<std::uint32_t>::max()) ++entry.held_back;
  return {};
}

std::optional<RateLimit::Due> RateLimit::take_due(MonotonicTime now) {
  for (auto& set : entries_) {
    for (Entry& entry : set) {
      if (entry.held_back == 0 || !entry.bucket.has_room(now, site_burst, site_interval)) continue;
      if (!all_.take(now, all_burst, all_interval)) return std::nullopt;
      entry.bucket.take(now, site_burst, site_interval);
      return Due{.site = entry.site, .held_back = std::exchange(entry.held_back, 0)};
    }
  }
  return std::nullopt;
}

}  // namespace srfs::log
