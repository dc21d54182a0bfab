// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string_view>
#include <variant>
#include <vector>

#include "base/result.hpp"
#include "hw/gpio.hpp"
#include "suite/peripheral.hpp"

namespace srfs {

// What the power cut decides; carried out by the adapter in the given order. One job for a line at a time.

/// Take the lines of the GPIO chip, unless they are held for this peripheral, and switch it off: nothing of
/// that if its payload has a process by then. Answer with on_cut() or on_refused().
struct CutPower {
  suite::Peripheral peripheral;
};
/// Give the lines back that are held for this peripheral. Answer with on_given_back() or on_refused().
struct GiveBackLines {
  suite::Peripheral peripheral;
};
/// It is off.
struct ReportPowerCut {
  suite::Peripheral peripheral;
};
/// For the log, with every hundredth try.
struct ReportCutFailed {
  suite::Peripheral peripheral;
  std::uint32_t tries = 0;  ///< that failed, of all peripherals
  hw::GpioError why = hw::GpioError::gone;
};

using PowerAction = std::variant<CutPower, GiveBackLines, ReportPowerCut, ReportCutFailed>;
using PowerActions = std::vector<PowerAction>;

/// Switches peripherals off whose payload, the owner of the switch, has no process. A line of a GPIO chip has
/// one owner at a time: it is held while the payload is away and given back when it has a process again,
/// which switches its peripheral on as after every start. Pure; one thread.
class PowerCut {
 public:
  /// Where peripherals are now. A line that is held for another one than it belongs to from now on waits for
  /// the payload of that one.
  void place(const std::vector<suite::Peripheral>& peripherals);
  /// Nothing happens while an earlier job for its line goes on.
  [[nodiscard]] PowerActions cut(const suite::Peripheral& peripheral);
  /// To call often. @param attended  whether a payload has a process; asked about held lines only
  [[nodiscard]] PowerActions give_back(const std::function<bool(std::string_view payload)>& attended);
  /// @param set  nullopt: its payload has a process again
  [[nodiscard]] PowerActions on_cut(const suite::Peripheral& peripheral,
                                    const std::optional<Result<void, hw::GpioError>>& set);
  void on_given_back(const suite::Peripheral& peripheral);
  /// The worker had no room.
  void on_refused(const suite::Peripheral& peripheral) { line(peripheral).busy = false; }
  /// All lines were given back; the counters go on.
  void close() { lines_ = {}; }

  struct Counters {
    std::uint32_t cut = 0;
    std::uint32_t failed = 0;
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  struct Line {
    bool busy = false;  ///< a job on the worker
    std::optional<suite::Peripheral> held;
  };
  [[nodiscard]] Line& line(const suite::Peripheral& peripheral) { return lines_.at(peripheral.power_line); }

  std::array<Line, suite::Peripheral::power_lines> lines_{};  ///< by power line
  Counters counters_;
};

}  // namespace srfs
