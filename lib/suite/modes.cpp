// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/modes.hpp"

#include <algorithm>
#include <set>

#include <fmt/format.h>

namespace srfs::suite {
namespace {

constexpr std::size_t longest_mode = 24;   // of /mode
constexpr std::size_t longest_order = 60;  // of the event that reports one
constexpr std::size_t longest_shed = 80;

std::vector<std::string> read_orders(const ConfigSection& section, const char* key) {
  std::vector<std::string> orders = section.texts(key);
  const bool fine = orders.size() <= ModeSettings::most_orders &&
                    std::all_of(orders.begin(), orders.end(), [](const std::string& order) {
                      return !order.empty() && order.size() <= longest_order;
                    });
  if (!fine) {
    throw section.bad(key, fmt::format("{} telecommands at most, each as 'eps.switch_load load=2 state=off', "
                                       "{} characters at most",
                                       ModeSettings::most_orders, longest_order));
  }
  return orders;
}

ModeReaction read_reaction(const ConfigSection& section) {
  ModeReaction r;
  r.hold = read_orders(section, "hold");
  r.once = read_orders(section, "once");
  r.work = section.boolean("work", r.work);
  if (section.has("beacon_ms"))
    r.beacon_period = std::chrono::milliseconds(section.integer("beacon_ms", 1000, 600'000));
  r.open_retrieval = section.boolean("open_retrieval", r.open_retrieval);
  if (section.has("downlink_octets_s"))
    r.downlink_octets_s = static_cast<std::uint32_t>(section.integer("downlink_octets_s", 0, 10'000'000));
  section.finish();
  return r;
}

ModeCause read_cause(const ConfigSection& section) {
  ModeCause c;
  c.name = section.text("name");
  if (c.name.empty() || c.name.size() > longest_mode || c.name.find(',') != std::string::npos)
    throw section.bad("name", fmt::format("1 to {} characters without comma", longest_mode));
  c.structure = section.text("structure");
  c.field = section.text("field");
  c.below = section.has("enter_below");
  if (c.below == section.has("enter_above"))
    throw section.bad("enter_below",
                      "one of enter_below (with over_above) and enter_above (with over_below)");
  c.enter = section.number(c.below ? "enter_below" : "enter_above", -1e12, 1e12);
  c.leave = section.number(c.below ? "over_above" : "over_below", -1e12, 1e12);
  if (c.below ? c.leave < c.enter : c.leave > c.enter)
    throw section.bad(c.below ? "over_above" : "over_below", "a threshold that leaves a hysteresis");
  c.samples = static_cast<int>(section.integer("samples", 1, 1000, c.samples));
  c.stale = std::chrono::seconds(section.integer("stale_s", 0, 86'400, 120));
  c.mode = section.text("mode", ModeSettings::safe);
  c.returns = section.boolean("returns", c.returns);
  section.finish();
  return c;
}

}  // namespace

ModeReaction ModeSettings::reaction(const std::string& mode, const std::string& node) const {
  const auto rows = table.find(mode);
  if (rows == table.end()) return {};
  const auto row = rows->second.find(node);
  return row == rows->second.end() ? ModeReaction{} : row->second;
}

bool ModeSettings::concerns(const std::string& node) const {
  return std::any_of(table.begin(), table.end(),
                     [&](const auto& mode) { return mode.second.contains(node); });
}

ModeSettings read_modes(const ConfigSection& section) {
  ModeSettings s;
  s.silence = std::chrono::milliseconds(section.integer("silence_ms", 5000, 600'000, s.silence.count()));
  s.repeat = std::chrono::milliseconds(section.integer("repeat_ms", 500, 600'000, s.repeat.count()));
  s.lost = std::chrono::milliseconds(section.integer("lost_ms", 1000, 3'600'000, s.lost.count()));
  s.critical = section.texts("critical");
  const ConfigSection table = section.section("table");
  for (const std::string& mode : table.keys()) {
    if (mode.empty() || mode.size() > longest_mode)
      throw table.bad(mode, fmt::format("a mode's name of 1 to {} characters", longest_mode));
    const ConfigSection rows = table.section(mode);
    s.shed[mode] = rows.text("shed", "");
    if (s.shed[mode].size() > longest_shed)
      throw rows.bad("shed", fmt::format("{} characters at most", longest_shed));
    auto& of_mode = s.table[mode];
    for (const std::string& node : rows.keys()) {
      if (node == "shed") continue;
      of_mode[node] = read_reaction(rows.section(node));
    }
    rows.finish();
  }
  if (!s.knows(ModeSettings::safe)) throw section.bad("table", "a row for the mode safe");
  std::set<std::string> names;
  for (const ConfigSection& entry : section.sections("causes")) {
    s.causes.push_back(read_cause(entry));
    if (!names.insert(s.causes.back().name).second) throw entry.bad("name", "a name that no other cause has");
    if (!s.knows(s.causes.back().mode)) throw entry.bad("mode", "a mode of the table");
  }
  if (s.causes.size() > ModeSettings::most_causes)
    throw section.bad("causes", fmt::format("{} entries at most", ModeSettings::most_causes));
  section.finish();
  return s;
}

}  // namespace srfs::suite
