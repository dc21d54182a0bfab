// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <random>
#include <string>

#include "base/octets.hpp"
#include "hw_sim/peripheral_model.hpp"
#include "hw_sim/running_clock.hpp"
#include "wire/peripheral_protocol.hpp"

namespace srfs::sim {

/// How a peripheral misbehaves, by fault injection.
enum class PeripheralFault : std::uint8_t {
  none,
  silent,        ///< takes requests, never answers
  late,          ///< answers after an additional delay
  short_answer,  ///< the answer lacks its second half
  garbage,       ///< the answer has the right length and random octets
  babble,        ///< as none, and sends frames unasked all the time (done by the bus side)
};
/// What ends an injected fault by itself.
enum class FaultCure : std::uint8_t { never, restart, power_cycle };

[[nodiscard]] std::optional<PeripheralFault> peripheral_fault(const std::string& name);
[[nodiscard]] const char* to_string(PeripheralFault fault);

struct PeripheralSettings {
  milliseconds boot_time{150};     ///< from power-on or reset to "ready"; until then it answers "booting"
  milliseconds restart_time{20};   ///< silent at the start of it
  microseconds answer_delay{800};  ///< request complete -> answer begins
  std::uint64_t seed = 1;
};

struct PeripheralCounters {
  std::uint64_t requests = 0;
  std::uint64_t invalid_requests = 0;  ///< CRC, length or opcode: not answered
  std::uint64_t unheard_requests = 0;  ///< without power or while restarting
  std::uint64_t answers = 0;
  std::uint64_t dropped_answers = 0;  ///< more than four waiting: the oldest makes room
  std::uint64_t executed = 0;
  std::uint64_t repeats = 0;  ///< "already done"
  std::uint64_t resets = 0;
  std::uint64_t power_cycles = 0;
};

/// One peripheral behind its transport: the request and answer rules of docs/reference/icd_can.md. It keeps
/// the last 16 executed telecommand ids over a RESET and loses them with its power. Pure.
class Peripheral {
 public:
  /// @param model  must outlive this object
  Peripheral(const PeripheralSettings& settings, PeripheralModel& model, RunningTime now);

  void on_request(OctetView message, RunningTime now);
  /// The next answer that is due; call until nullopt. Also ends a restart.
  [[nodiscard]] std::optional<Octets> poll(RunningTime now);
  /// When poll() has something to do; nullopt: nothing waits.
  [[nodiscard]] std::optional<RunningTime> next_deadline() const;

  void set_power(bool on, RunningTime now);
  /// @param delay  of `late`: added to each answer; of `babble`: between two frames, 0 = without a pause
  void set_fault(PeripheralFault fault, milliseconds delay, FaultCure cure) {
    fault_ = fault;
    fault_delay_ = delay;
    cure_ = cure;
  }
  [[nodiscard]] milliseconds fault_delay() const { return fault_delay_; }
  [[nodiscard]] PeripheralFault fault() const { return fault_; }
  [[nodiscard]] bool powered() const { return powered_; }
  /// Powered and past the silent part of its start: takes part in the bus at all.
  [[nodiscard]] bool listening(RunningTime now) const { return powered_ && now >= silent_until_; }
  [[nodiscard]] const PeripheralCounters& counters() const { return counters_; }
  /// The last 256 telecommands it carried out, in order; for an observer, no part of the device.
  [[nodiscard]] const std::deque<std::uint32_t>& history() const { return history_; }

 private:
  struct Waiting {
    RunningTime at;
    Octets octets;
  };
  void start(RunningTime now);
  void answer(const wire::PeripheralResponse& response, RunningTime now);
  [[nodiscard]] wire::PeripheralResult on_command(const wire::CommandRequest& command, bool ready);
  [[nodiscard]] bool known(std::uint32_t telecommand_id) const;

  PeripheralSettings settings_;
  PeripheralModel& model_;
  std::mt19937_64 random_;
  PeripheralCounters counters_;
  PeripheralFault fault_ = PeripheralFault::none;
  milliseconds fault_delay_{0};
  FaultCure cure_ = FaultCure::never;
  bool powered_ = true;
  RunningTime started_;
  RunningTime silent_until_;
  std::optional<RunningTime> restart_at_;
  std::deque<Waiting> waiting_;
  std::deque<std::uint32_t> executed_ids_;
  std::deque<std::uint32_t> history_;
};

}  // namespace srfs::sim
