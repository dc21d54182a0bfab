// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/command_loss_timer.hpp"

#include <array>
#include <sstream>

#include <fmt/format.h>

#include "base/checked_text.hpp"

namespace srfs {
namespace {

/// More is damage; far below what overflows.
constexpr nanoseconds longest_silence = std::chrono::hours(24 * 365 * 100);
constexpr std::uint32_t most_steps = 1'000'000'000;
constexpr std::array cycle{CommandLossStep::line, CommandLossStep::keys, CommandLossStep::restart};

CommandLossStep step_of(std::uint32_t number) {
  return number == 1 ? CommandLossStep::safe_mode : cycle.at((number - 2) % cycle.size());
}

}  // namespace

CommandLossTimer::CommandLossTimer(std::string boot_id, std::string_view stored, seconds patience,
                                   MonotonicTime now)
    : boot_id_(std::move(boot_id)), patience_(patience), begun_(now), process_begun_(now) {
  plan_save(now);
  std::istringstream in(without_check(stored).value_or(""));
  std::string boot;
  std::int64_t at_ns = 0;
  std::int64_t silent_ns = 0;
  std::int64_t last_step_ns = 0;
  std::uint32_t steps = 0;
  if (!(in >> boot >> at_ns >> silent_ns >> steps >> last_step_ns) || steps > most_steps) return;
  if (silent_ns < 0 || silent_ns > longest_silence.count() || last_step_ns < 0 || last_step_ns > silent_ns)
    return;
  before_ = nanoseconds(silent_ns);
  steps_ = steps;
  last_step_ = nanoseconds(last_step_ns);
  const MonotonicTime at{nanoseconds(at_ns)};
  saved_ = before_;
  if (boot == boot_id_) {
    if (at <= now) before_ += now - at;
  } else if (next_step() == CommandLossStep::restart) {
    // The computer has restarted, by this step or by itself. Without a record of it, on a disk that fails, it
    // would be restarted again as soon as the step is due, and for ever.
    ++steps_;
    last_step_ = before_;
  }
}

std::optional<CommandLossTimer::Loss> CommandLossTimer::on_contact(MonotonicTime now) {
  const std::optional<Loss> loss = lost() ? std::optional(Loss{silent(now), steps_}) : std::nullopt;
  begun_ = now;
  before_ = last_step_ = nanoseconds(0);
  steps_ = 0;
  // A record that says more than is true would let the next process act too early.
  if (saved_ > longest_save_period || loss) next_save_ = now;
  return loss;
}

nanoseconds CommandLossTimer::until_next(MonotonicTime now) const {
  return std::max(next_step_at() - silent(now), nanoseconds(0));
}

CommandLossStep CommandLossTimer::next_step() const {
  return step_of(steps_ + 1);
}

nanoseconds CommandLossTimer::next_step_at() const {
  if (steps_ == 0) return patience_;
  const bool after_restart = step_of(steps_) == CommandLossStep::restart;
  return last_step_ + (after_restart ? restart_period() - 2 * step_period() : nanoseconds(step_period()));
}

std::optional<CommandLossTimer::Step> CommandLossTimer::take_step(MonotonicTime now) {
  if (until_next(now) > nanoseconds(0)) return std::nullopt;
  ++steps_;
  last_step_ = silent(now);
  saved_ = last_step_;
  plan_save(now);
  return Step{step_of(steps_), steps_, last_step_, until_next(now)};
}

std::string CommandLossTimer::stored_text(MonotonicTime now) const {
  return with_check(
      fmt::format("{} {} {} {} {}", boot_id_, now.ns(), silent(now).count(), steps_, last_step_.count()));
}

bool CommandLossTimer::take_save(MonotonicTime now) {
  if (now < next_save_) return false;
  saved_ = silent(now);
  plan_save(now);
  return true;
}

/// Often at first: in a loop of short boots at least half of each counts.
void CommandLossTimer::plan_save(MonotonicTime now) {
  next_save_ = now + std::clamp<nanoseconds>(now - process_begun_, shortest_save_period, longest_save_period);
}

}  // namespace srfs
