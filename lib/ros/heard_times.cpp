// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/heard_times.hpp"

#include <algorithm>

namespace srfs::ros {

HeardTimes::Verdict HeardTimes::verdict(const Sender& sender, MonotonicTime sealed) const {
  if (sealed <= sender.floor) return Verdict::too_old;
  return std::binary_search(sender.times.begin(), sender.times.end(), sealed) ? Verdict::again
                                                                              : Verdict::first;
}

HeardTimes::Verdict HeardTimes::look(const GuidPrefix& sender, MonotonicTime sealed) const {
  const auto found = std::find_if(senders_.begin(), senders_.end(),
                                  [&](const Sender& known) { return known.prefix == sender; });
  if (found != senders_.end()) return verdict(*found, sealed);
  return sealed <= forgotten_ ? Verdict::too_old : Verdict::first;
}

HeardTimes::Verdict HeardTimes::add(const GuidPrefix& prefix, MonotonicTime sealed) {
  if (const Verdict known = look(prefix, sealed); known != Verdict::first) return known;
  Sender& sender = remember(prefix);
  auto& times = sender.times;
  times.insert(std::upper_bound(times.begin(), times.end(), sealed), sealed);
  if (times.size() == most) {
    sender.floor = times[most - least - 1];
    times.erase(times.begin(), times.end() - least);
  }
  return Verdict::first;
}

HeardTimes::Sender& HeardTimes::remember(const GuidPrefix& prefix) {
  auto found = std::find_if(senders_.begin(), senders_.end(),
                            [&](const Sender& known) { return known.prefix == prefix; });
  if (found == senders_.end()) {
    if (senders_.size() == most_senders) {
      forgotten_ = std::max(forgotten_, senders_.back().times.back());
      senders_.pop_back();
    }
    found = senders_.insert(senders_.end(), {prefix, forgotten_, {}});
  }
  std::rotate(senders_.begin(), found, found + 1);
  return senders_.front();
}

}  // namespace srfs::ros
