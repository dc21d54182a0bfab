// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/flag_check.hpp"

#include <algorithm>

namespace srfs {
namespace {

constexpr seconds longest_foreign_lease{180};  // three times the bound of a slot's parts

/// The flags fit the plan, and the lease could be one of it.
bool fits_plan(const srfs_msgs::msg::TaskFlags& flags, const std::vector<suite::Slot>& slots,
               MonotonicTime now) {
  // The switcher may learn of an added or removed payload before this node, or after it. The flag of a holder
  // outside this plan may be at any free place; the other flags must fit.
  const bool known = flags.holder.empty() ||
                     std::any_of(slots.begin(), slots.end(),
                                 [&](const suite::Slot& slot) { return slot.payload == flags.holder; });
  nanoseconds longest_lease = known ? nanoseconds(0) : longest_foreign_lease;
  std::size_t others = 0;
  for (std::size_t i = 0; i < std::max(slots.size(), flags.flags.size()); ++i) {
    const bool flag = i < flags.flags.size() && flags.flags[i];
    if (i >= slots.size() || slots[i].payload.empty()) {
      others += flag ? 1 : 0;
      continue;
    }
    if (flag != (slots[i].payload == flags.holder)) return false;
    longest_lease =
        std::max<nanoseconds>(longest_lease, slots[i].allotted + slots[i].overrun + slots[i].reset);
  }
  if (others != (known ? 0U : 1U)) return false;
  const auto at = static_cast<std::uint64_t>(now.ns());
  constexpr std::uint64_t oldest_ns = 10'000'000'000;  // a flag may be late, and is answered as such
  const bool lease_fits = flags.lease_end_ns + oldest_ns >= at &&
                          flags.lease_end_ns <= at + static_cast<std::uint64_t>(longest_lease.count());
  const bool receipt_fits = flags.tick_received_ns + oldest_ns >= at && flags.tick_received_ns <= at;
  return lease_fits && receipt_fits && microseconds(flags.allotted_us) <= longest_lease;
}

}  // namespace

bool FlagCheck::is_plausible(const srfs_msgs::msg::TaskFlags& flags, const std::vector<suite::Slot>& slots,
                             MonotonicTime now, const RunningSwitcher& running) {
  if (!fits_plan(flags, slots, now)) return false;
  if (flags.switcher_incarnation == believed_switcher_) return true;
  // A switcher not heard before must be the one that holds the switcher's instance lock.
  if (running() != flags.switcher_incarnation) return false;
  believed_switcher_ = flags.switcher_incarnation;
  return true;
}

}  // namespace srfs
