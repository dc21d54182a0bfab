// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string_view>

#include "hw/gpio.hpp"
#include "hw/peripherals.hpp"
#include "ros/worker.hpp"

namespace srfs {

/// Switches peripherals off whose payload, the owner of the switch, has no process. A line of a GPIO chip has
/// one owner at a time: it is held while the payload is away and given back when it has a process again,
/// which switches its peripheral on as after every start. Work thread; the lines are used on the worker
/// alone.
class PowerCut {
 public:
  struct Hooks {
    std::function<std::unique_ptr<hw::GpioLines>()> open;    ///< nullptr: there are none; on the worker
    std::function<bool(std::string_view payload)> attended;  ///< whether it has a process; on both threads
    /// After each try; nullopt: it is off.
    std::function<void(const hw::Peripheral&, std::optional<hw::GpioError>)> done;
  };
  /// @param worker  must outlive this object, and be drained before its end
  PowerCut(ros::Worker& worker, Hooks hooks) : worker_(worker), hooks_(std::move(hooks)) {}

  /// Nothing happens when the payload has a process again by then, or while an earlier try goes on.
  void cut(const hw::Peripheral& peripheral);
  /// Gives back the lines of payloads that have a process. To call often.
  void give_back();

 private:
  struct Held {
    std::unique_ptr<hw::GpioLines> lines;
    bool busy = false;  ///< a job on the worker
    bool held = false;
  };
  enum class Outcome : std::uint8_t { attended, off, failed };

  ros::Worker& worker_;
  Hooks hooks_;
  std::array<Held, hw::peripherals.size()> held_;  ///< by power line
};

}  // namespace srfs
