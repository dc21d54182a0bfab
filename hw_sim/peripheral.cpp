// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/peripheral.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace srfs::sim {
namespace {

constexpr std::size_t remembered_ids = 16;
constexpr std::size_t history_length = 256;
constexpr std::size_t most_waiting = 4;

constexpr std::array<std::pair<PeripheralFault, const char*>, 6> fault_names{
    {{PeripheralFault::none, "none"},
     {PeripheralFault::silent, "silent"},
     {PeripheralFault::late, "late"},
     {PeripheralFault::short_answer, "short"},
     {PeripheralFault::garbage, "garbage"},
     {PeripheralFault::babble, "babble"}}};

template <class... T>
struct Overloaded : T... {
  using T::operator()...;
};
template <class... T>
Overloaded(T...) -> Overloaded<T...>;

}  // namespace

std::optional<PeripheralFault> peripheral_fault(const std::string& name) {
  for (const auto& [fault, text] : fault_names) {
    if (name == text) return fault;
  }
  return std::nullopt;
}

const char* to_string(PeripheralFault fault) {
  for (const auto& [value, text] : fault_names) {
    if (value == fault) return text;
  }
  return "?";
}

Peripheral::Peripheral(const PeripheralSettings& settings, PeripheralModel& model, RunningTime now)
    : settings_(settings), model_(model), random_(settings.seed) {
  start(now);
}

void Peripheral::start(RunningTime now) {
  started_ = now;
  silent_until_ = now + settings_.restart_time;
  restart_at_.reset();
}

void Peripheral::set_power(bool on, RunningTime now) {
  if (on == powered_) return;
  powered_ = on;
  waiting_.clear();
  executed_ids_.clear();
  model_.set_power(on);
  if (!on && cure_ != FaultCure::never) fault_ = PeripheralFault::none;
  if (on) {
    ++counters_.power_cycles;
    start(now);
  }
}

bool Peripheral::known(std::uint32_t telecommand_id) const {
  return std::find(executed_ids_.begin(), executed_ids_.end(), telecommand_id) != executed_ids_.end();
}

wire::PeripheralResult Peripheral::on_command(const wire::CommandRequest& command, bool ready) {
  if (known(command.telecommand_id)) {
    ++counters_.repeats;
    return wire::PeripheralResult::already_done;
  }
  if (!ready) return wire::PeripheralResult::cannot_now;
  const wire::PeripheralResult result = model_.execute(command.function, command.arguments);
  if (result != wire::PeripheralResult::done) return result;  // a refused command may come again and succeed
  ++counters_.executed;
  history_.push_back(command.telecommand_id);
  if (history_.size() > history_length) history_.pop_front();
  executed_ids_.push_back(command.telecommand_id);
  if (executed_ids_.size() > remembered_ids) executed_ids_.pop_front();
  return result;
}

void Peripheral::on_request(OctetView message, RunningTime now) {
  if (!listening(now) || restart_at_) {
    ++counters_.unheard_requests;
    return;
  }
  const auto request = wire::decode_request(message);
  if (!request) {
    ++counters_.invalid_requests;
    return;
  }
  ++counters_.requests;
  const bool ready = now >= started_ + settings_.boot_time;
  const auto status = ready ? wire::PeripheralStatus::ready : wire::PeripheralStatus::booting;
  wire::PeripheralResponse response{request->sequence, {}};
  response.body = std::visit(
      Overloaded{
          [&](const wire::WakeUpRequest&) -> decltype(response.body) {
            const auto uptime = std::chrono::duration_cast<milliseconds>(now - started_).count();
            return wire::WakeUpResponse{status, static_cast<std::uint32_t>(uptime),
                                        ready ? model_.measure() : Octets{}};
          },
          [&](const wire::CommandRequest& command) -> decltype(response.body) {
            return wire::CommandResponse{command.telecommand_id, on_command(command, ready)};
          },
          [&](const wire::ResetRequest&) -> decltype(response.body) { return wire::ResetResponse{status}; }},
      request->body);
  answer(response, now);
  // The answer goes out before the processor restarts; 5 ms cover its time on the bus.
  if (std::holds_alternative<wire::ResetRequest>(request->body))
    restart_at_ = now + settings_.answer_delay + milliseconds(5);
}

void Peripheral::answer(const wire::PeripheralResponse& response, RunningTime now) {
  Octets octets = wire::encode(response);
  RunningTime at = now + settings_.answer_delay;
  switch (fault_) {
    case PeripheralFault::none:
    case PeripheralFault::babble:
      break;
    case PeripheralFault::silent:
      return;
    case PeripheralFault::late:
      at += fault_delay_;
      break;
    case PeripheralFault::short_answer:
      octets.resize((octets.size() + 1) / 2);
      break;
    case PeripheralFault::garbage:
      for (std::uint8_t& octet : octets) octet = static_cast<std::uint8_t>(random_());
      break;
  }
  if (waiting_.size() == most_waiting) {
    waiting_.pop_front();
    ++counters_.dropped_answers;
  }
  waiting_.push_back({at, std::move(octets)});
}

std::optional<Octets> Peripheral::poll(RunningTime now) {
  if (!waiting_.empty() && waiting_.front().at <= now) {
    Octets octets = std::move(waiting_.front().octets);
    waiting_.pop_front();
    ++counters_.answers;
    return octets;
  }
  if (restart_at_ && *restart_at_ <= now) {
    ++counters_.resets;
    waiting_.clear();
    if (cure_ == FaultCure::restart) fault_ = PeripheralFault::none;
    model_.restart();
    start(*restart_at_);
  }
  return std::nullopt;
}

std::optional<RunningTime> Peripheral::next_deadline() const {
  std::optional<RunningTime> next = restart_at_;
  if (!waiting_.empty() && (!next || waiting_.front().at < *next)) next = waiting_.front().at;
  return next;
}

}  // namespace srfs::sim
