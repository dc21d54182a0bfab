// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/power_cut.hpp"

#include <utility>

namespace srfs {

PowerActions PowerCut::cut(const hw::Peripheral& peripheral) {
  if (std::exchange(line(peripheral).busy, true)) return {};
  return {CutPower{&peripheral}};
}

PowerActions PowerCut::give_back(const std::function<bool(std::string_view payload)>& attended) {
  PowerActions actions;
  for (const hw::Peripheral& peripheral : hw::peripherals) {
    Line& held = line(peripheral);
    if (!held.held || held.busy || !attended(peripheral.payload)) continue;
    held.busy = true;
    actions.emplace_back(GiveBackLines{&peripheral});
  }
  return actions;
}

PowerActions PowerCut::on_cut(const hw::Peripheral& peripheral,
                              const std::optional<Result<void, hw::GpioError>>& set) {
  line(peripheral).busy = false;
  if (!set) return {};
  line(peripheral).held = true;
  if (*set) {
    ++counters_.cut;
    return {ReportPowerCut{&peripheral}};
  }
  if (++counters_.failed % 100 != 1) return {};
  return {ReportCutFailed{&peripheral, counters_.failed, set->error()}};
}

void PowerCut::on_given_back(const hw::Peripheral& peripheral) {
  line(peripheral) = {};
}

}  // namespace srfs
