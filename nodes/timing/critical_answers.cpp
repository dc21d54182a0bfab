// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/critical_answers.hpp"

#include <algorithm>
#include <utility>

#include "ros/lifecycle.hpp"

namespace srfs {

WatchdogBudget watchdog_budget(nanoseconds period, int misses, nanoseconds start_deadline) {
  // A node and the one upstream of it die together: the one behind is found while the other is counted out,
  // and once more by its own upstream.
  const nanoseconds detection = 2 * (misses + 1) * period;
  constexpr nanoseconds killing =
      seconds(1);  // of a process that hangs: backtrace, SIGTERM, SIGKILL, its exit
  const nanoseconds recovery = detection + killing + start_deadline;
  const nanoseconds check = 2 * critical_check_period;  // until the next question, and its answer
  constexpr nanoseconds feeding = seconds(1);
  return {recovery, recovery + check, recovery + check + feeding};
}

CriticalAnswers::CriticalAnswers(std::vector<std::string> nodes, std::uint32_t incarnation,
                                 nanoseconds lifetime)
    : names_(std::move(nodes)),
      nodes_(names_.size()),
      lifetime_(lifetime),
      next_nonce_(std::uint64_t{incarnation} << 32U) {}

std::uint64_t CriticalAnswers::ask(std::size_t node, MonotonicTime now) {
  ++counters_.asked;
  nodes_[node].nonce = ++next_nonce_;
  nodes_[node].asked = now;
  return next_nonce_;
}

void CriticalAnswers::on_answer(std::size_t node, std::uint64_t nonce, std::uint8_t state) {
  Node& asked = nodes_[node];
  if (nonce != asked.nonce) {
    ++counters_.wrong_nonce;
    return;
  }
  asked.nonce = 0;  // once
  if (state != static_cast<std::uint8_t>(ros::State::active)) {
    ++counters_.not_active;
    return;
  }
  ++counters_.answered;
  asked.proof = asked.asked;
}

void CriticalAnswers::on_cpu(std::size_t node, pid_t pid, const CpuTotals& totals, MonotonicTime now) {
  Node& observed = nodes_[node];
  if (std::exchange(observed.pid, pid) != pid) observed.cpu.clear();
  observed.cpu.add(now, totals);
}

bool CriticalAnswers::holds(std::size_t node, MonotonicTime now) const {
  const auto& proof = nodes_[node].proof;
  if (!proof) return false;
  const nanoseconds waited = nodes_[node].cpu.since(*proof).waited;
  return now - *proof <= lifetime_ + std::min(waited, longest_excuse);
}

}  // namespace srfs
