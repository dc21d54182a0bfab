// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/callback_statistics.hpp"

#include <algorithm>
#include <utility>

namespace srfs::ros {

std::string_view to_text(CallbackKind kind) {
  switch (kind) {
    case CallbackKind::timer:
      return "timer";
    case CallbackKind::subscription:
      return "subscription";
    case CallbackKind::service:
      return "service";
    case CallbackKind::client:
      return "client";
    case CallbackKind::descriptor:
      return "descriptor";
    case CallbackKind::posted:
      return "posted";
    case CallbackKind::transition:
      return "transition";
    case CallbackKind::other:
      return "other";
  }
  return "?";
}

CallbackRecord& CallbackStatistics::record(CallbackKind kind, std::string_view name) {
  const auto known = std::find_if(records_.begin(), records_.end(),
                                  [&](const CallbackRecord& r) { return r.kind == kind && r.name == name; });
  if (known != records_.end()) return *known;
  if (records_.size() > most_names) return records_.back();
  if (records_.size() == most_names) {
    kind = CallbackKind::other;
    name = "(others)";
  }
  records_.push_back(
      {.kind = kind, .name = std::string(name), .budget = {}, .run_time = {}, .next_report = {}});
  return records_.back();
}

void CallbackStatistics::set_budget(CallbackKind kind, nanoseconds budget) {
  budgets_.at(static_cast<std::size_t>(kind)) = budget;
}

nanoseconds CallbackStatistics::budget(const CallbackRecord& record) const {
  return record.budget.value_or(budgets_[static_cast<std::size_t>(record.kind)]);
}

bool CallbackStatistics::add(CallbackRecord& record, nanoseconds took, MonotonicTime now) {
  record.run_time.add(took);
  record.total += took;
  if (record.kind != CallbackKind::transition) {
    all_.add(took);
    busy_ += took;
    if (took > longest_.took) longest_ = {&record, took};
  }
  if (took <= budget(record)) return false;
  ++record.over_budget;
  if (record.kind != CallbackKind::transition) ++over_budget_;
  if (now < record.next_report) return false;
  record.next_report = now + report_period;
  return true;
}

CallbackStatistics::Longest CallbackStatistics::take_longest() {
  return std::exchange(longest_, {});
}

void CallbackStatistics::reset() {
  for (CallbackRecord& r : records_) {
    r.run_time.clear();
    r.total = nanoseconds(0);
    r.over_budget = r.failed = r.missed_periods = 0;
  }
}

}  // namespace srfs::ros
