// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hw/fake/readiness.hpp"
#include "hw/gpio.hpp"
#include "hw/pulse_source.hpp"
#include "hw/watchdog.hpp"

namespace srfs::hw {

/// Pulses put in by the test.
class FakePulseSource : public PulseSource {
 public:
  [[nodiscard]] int fd() const override { return readiness_.fd(); }
  [[nodiscard]] std::optional<Pulse> read() override {
    if (pulses_.empty()) return std::nullopt;
    const Pulse pulse = pulses_.front();
    pulses_.pop_front();
    if (pulses_.empty()) readiness_.clear();
    return pulse;
  }
  [[nodiscard]] std::string reason() const override { return gone ? "fake" : ""; }
  [[nodiscard]] const PulseCounters& counters() const override { return counters_; }

  void deliver(Pulse pulse) {
    pulses_.push_back(pulse);
    ++counters_.received;
    readiness_.set();
  }
  bool gone = false;

 private:
  Readiness readiness_;
  std::deque<Pulse> pulses_;
  PulseCounters counters_;
};

/// Twelve lines with a history of what was written.
class FakeGpioLines : public GpioLines {
 public:
  [[nodiscard]] Result<void, GpioError> set_line(std::uint8_t line, bool on) override {
    if (fail_with) return error(*fail_with);
    if (line >= gpio_power_count) return error(GpioError::no_line);
    levels[line] = on;
    history.emplace_back(line, on);
    ++counters_.writes;
    return {};
  }
  [[nodiscard]] Result<bool, GpioError> read_line(std::uint8_t line) override {
    if (fail_with) return error(*fail_with);
    if (line >= levels.size()) return error(GpioError::no_line);
    ++counters_.reads;
    return levels[line];
  }
  [[nodiscard]] Result<std::uint8_t, GpioError> read_bank() override {
    if (fail_with) return error(*fail_with);
    ++counters_.reads;
    std::uint8_t bank = 0;
    for (std::uint8_t n = 0; n < gpio_input_count; ++n) {
      if (levels[gpio_first_input + n]) bank = static_cast<std::uint8_t>(bank | 1U << n);
    }
    return bank;
  }
  [[nodiscard]] const GpioCounters& counters() const override { return counters_; }

  std::array<bool, gpio_first_input + gpio_input_count> levels{};
  std::vector<std::pair<std::uint8_t, bool>> history;
  std::optional<GpioError> fail_with;

 private:
  tl::unexpected<GpioError> error(GpioError e) {
    ++counters_.errors;
    return Err(e);
  }
  GpioCounters counters_;
};

/// Counts the feeding.
class FakeWatchdog : public Watchdog {
 public:
  [[nodiscard]] Result<void, WatchdogError> feed() override {
    if (gone) {
      ++counters_.failed;
      return Err(WatchdogError::gone);
    }
    ++counters_.fed;
    return {};
  }
  [[nodiscard]] std::optional<seconds> timeout() const override { return device_timeout; }
  [[nodiscard]] Result<void, WatchdogError> disarm() override {
    if (!may_disarm) return Err(WatchdogError::not_allowed);
    disarmed = true;
    return {};
  }
  [[nodiscard]] std::string reason() const override { return gone ? "fake" : ""; }
  [[nodiscard]] const WatchdogCounters& counters() const override { return counters_; }

  [[nodiscard]] const WatchdogFacts& facts() const override { return device_facts; }

  std::optional<seconds> device_timeout;
  WatchdogFacts device_facts;
  bool may_disarm = false;
  bool disarmed = false;
  bool gone = false;

 private:
  WatchdogCounters counters_;
};

}  // namespace srfs::hw
