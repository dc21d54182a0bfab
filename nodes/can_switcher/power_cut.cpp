// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/power_cut.hpp"

#include <utility>

namespace srfs {

void PowerCut::place(const std::vector<suite::Peripheral>& peripherals) {
  for (const suite::Peripheral& peripheral : peripherals) {
    if (Line& there = line(peripheral); there.held) there.held = peripheral;
  }
}

PowerActions PowerCut::cut(const suite::Peripheral& peripheral) {
  if (std::exchange(line(peripheral).busy, true)) return {};
  return {CutPower{peripheral}};
}

PowerActions PowerCut::give_back(const std::function<bool(std::string_view payload)>& attended) {
  PowerActions actions;
  for (Line& line : lines_) {
    if (!line.held || line.busy || !attended(line.held->payload)) continue;
    line.busy = true;
    actions.emplace_back(GiveBackLines{*line.held});
  }
  return actions;
}

PowerActions PowerCut::on_cut(const suite::Peripheral& peripheral,
                              const std::optional<Result<void, hw::GpioError>>& set) {
  line(peripheral).busy = false;
  if (!set) return {};
  line(peripheral).held = peripheral;
  if (*set) {
    ++counters_.cut;
    return {ReportPowerCut{peripheral}};
  }
  if (++counters_.failed % 100 != 1) return {};
  return {ReportCutFailed{peripheral, counters_.failed, set->error()}};
}

void PowerCut::on_given_back(const suite::Peripheral& peripheral) {
  line(peripheral) = {};
}

}  // namespace srfs
