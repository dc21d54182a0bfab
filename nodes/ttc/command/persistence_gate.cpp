// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/persistence_gate.hpp"

#include <algorithm>
#include <cassert>

namespace srfs {

bool PersistenceGate::enter(JudgedTelecommand judged, std::uint64_t generation, MonotonicTime now) {
  if (!has_room()) {
    ++counters_.refused;
    return false;
  }
  judged.received = now;
  judged.generation = generation;
  waiting_.push_back(std::move(judged));
  while (!waiting_.empty() && waiting_.front().generation <= durable_) pass_front(true);
  return true;
}

void PersistenceGate::hold(Report report, std::uint64_t generation, MonotonicTime now) {
  held_.push_back(Held{
      .report = std::move(report), .generation = generation, .deadline = now + report_deadlines * deadline_});
  if (held_.size() > held_capacity) release_front(false);
  while (!held_.empty() && held_.front().generation <= durable_) release_front(true);
}

void PersistenceGate::on_write_done(bool success, MonotonicTime now) {
  assert(writing_);
  const std::uint64_t generation = *writing_;
  writing_.reset();
  if (success) {
    durable_ = generation;
  } else {
    retry_ = now + retry_period;
  }
  while (!waiting_.empty() && waiting_.front().generation <= generation) pass_front(success);
  while (!held_.empty() && held_.front().generation <= generation) release_front(success);
}

void PersistenceGate::on_time(MonotonicTime now) {
  if (retry_ && *retry_ <= now) retry_.reset();
  while (!waiting_.empty() && waiting_.front().received + deadline_ <= now) pass_front(false);
  while (!held_.empty() && held_.front().deadline <= now) release_front(false);
}

std::optional<MonotonicTime> PersistenceGate::next_due() const {
  std::optional<MonotonicTime> due = retry_;
  const auto sooner = [&due](MonotonicTime t) { due = due ? std::min(*due, t) : t; };
  if (!waiting_.empty()) sooner(waiting_.front().received + deadline_);
  if (!held_.empty()) sooner(held_.front().deadline);
  return due;
}

void PersistenceGate::release_front(bool sure) {
  released_.push_back({std::move(held_.front().report), sure});
  held_.pop_front();
}

void PersistenceGate::pass_front(bool durable) {
  JudgedTelecommand judged = std::move(waiting_.front());
  waiting_.pop_front();
  judged.durable = durable;
  ++(durable ? counters_.passed : counters_.passed_undurable);
  passed_.push_back(std::move(judged));
}

}  // namespace srfs
