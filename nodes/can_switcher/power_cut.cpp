// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/power_cut.hpp"

namespace srfs {

void PowerCut::cut(const hw::Peripheral& peripheral) {
  Held& held = held_.at(peripheral.power_line);
  if (held.busy) return;
  struct Try {
    Outcome outcome = Outcome::attended;
    hw::GpioError error = hw::GpioError::gone;
  };
  held.busy = worker_.ask(
      [this, &held, &peripheral] {
        Try result;
        if (hooks_.attended(peripheral.payload)) return result;
        if (!held.lines) held.lines = hooks_.open();
        const auto set = held.lines ? held.lines->set_line(peripheral.power_line, false)
                                    : Result<void, hw::GpioError>(Err(hw::GpioError::gone));
        result.outcome = set ? Outcome::off : Outcome::failed;
        if (!set) result.error = set.error();
        return result;
      },
      [this, &held, &peripheral](const Try& result) {
        held.busy = false;
        if (result.outcome == Outcome::attended) return;
        held.held = true;
        const bool off = result.outcome == Outcome::off;
        hooks_.done(peripheral, off ? std::nullopt : std::optional(result.error));
      });
}

void PowerCut::give_back() {
  for (const hw::Peripheral& peripheral : hw::peripherals) {
    Held& held = held_.at(peripheral.power_line);
    if (!held.held || held.busy || !hooks_.attended(peripheral.payload)) continue;
    held.busy = worker_.post([&held] { held.lines.reset(); },
                             [&held] {
                               held.busy = false;
                               held.held = false;
                             });
  }
}

}  // namespace srfs
