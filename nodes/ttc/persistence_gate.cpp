#include "nodes/ttc/persistence_gate.hpp"

#include <algorithm>
#include <cassert>

namespace srfs {

bool PersistenceGate::enter(JudgedTelecommand judged, std::uint64_t generation, MonotonicTime now) {
  if (!has_room()) {
    ++counters_.refused;
    return false;
  }
  waiting_.push_back(Waiting{.telecommand = {.judged = std::move(judged), .received = now, .durable = true},
                             .generation = generation,
                             .deadline = now + deadline_});
  while (!waiting_.empty() && waiting_.front().generation <= durable_) pass_front(true);
  return true;
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
}

void PersistenceGate::on_time(MonotonicTime now) {
  if (retry_ && *retry_ <= now) retry_.reset();
  while (!waiting_.empty() && waiting_.front().deadline <= now) pass_front(false);
}

std::optional<MonotonicTime> PersistenceGate::next_due() const {
  if (waiting_.empty()) return retry_;
  const MonotonicTime deadline = waiting_.front().deadline;
  return retry_ ? std::min(*retry_, deadline) : deadline;
}

void PersistenceGate::pass_front(bool durable) {
  GatedTelecommand telecommand = std::move(waiting_.front().telecommand);
  waiting_.pop_front();
  telecommand.durable = durable;
  ++(durable ? counters_.passed : counters_.passed_undurable);
  passed_.push_back(std::move(telecommand));
}

}  // namespace srfs
