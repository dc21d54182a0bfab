// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/coverage.hpp"

#include <algorithm>

#include <fmt/format.h>

namespace srfs::simulation {

const std::array<StateTableInfo, state_table_count>& state_tables() {
  static const std::array<StateTableInfo, state_table_count> tables{{
      // CCSDS 232.1-B-2, table 5-1; the values are the standard's numbers. ground::AdService passes S6 where
      // a running service begins anew, and S4 with the CLCW that it has: both within one call.
      {"FOP-1",
       {"", "S1", "S2", "S3", "S4", "S5", "S6"},
       {{1, 2},
        {1, 3},
        {1, 5},
        {1, 6},
        {2, 1},
        {2, 3},
        {2, 5},
        {2, 6},
        {3, 1},
        {3, 2},
        {3, 5},
        {3, 6},
        {5, 1},
        {5, 6},
        {6, 1},
        {6, 5}}},
      // Unlock and Set V(R) lead from each to `initiating`, unlock without a CLCW to `seeking`.
      {"AD service",
       {"off", "seeking", "initiating", "on"},
       {{0, 1}, {0, 2}, {1, 0}, {1, 2}, {1, 3}, {2, 0}, {2, 1}, {2, 3}, {3, 0}, {3, 2}}},
      {"FARM-1", {"open", "wait", "lockout"}, {{0, 1}, {0, 2}, {1, 0}, {1, 2}, {2, 0}}},
      // A telecommand leads from each to each.
      {"mode",
       {"safe", "nominal", "low_power", "commissioning", "pass"},
       {{0, 1}, {0, 2}, {0, 3}, {0, 4}, {1, 0}, {1, 2}, {1, 3}, {1, 4}, {2, 0}, {2, 1},
        {2, 3}, {2, 4}, {3, 0}, {3, 1}, {3, 2}, {3, 4}, {4, 0}, {4, 1}, {4, 2}, {4, 3}}},
      {"clock",
       {"unlocked", "locking", "locked", "holdover"},
       {{0, 1}, {1, 0}, {1, 2}, {1, 3}, {2, 1}, {2, 3}, {3, 1}, {3, 2}}},
      // A new switcher recalls what the one before had granted.
      {"slot",
       {"free", "granted", "taken", "reset_ordered", "fencing", "recalled"},
       {{0, 1},
        {1, 0},
        {1, 2},
        {1, 4},
        {1, 5},
        {2, 0},
        {2, 3},
        {2, 5},
        {3, 0},
        {3, 4},
        {3, 5},
        {4, 0},
        {5, 0},
        {5, 4}}},
      // A wait ends with a start; deaths that come fast enough lead from any start to quarantine.
      {"restart",
       {"none", "start", "last_good", "back_off", "quarantine"},
       {{0, 1}, {0, 2}, {1, 2}, {1, 3}, {1, 4}, {2, 1}, {2, 3}, {2, 4}, {3, 1}, {4, 1}}},
      {"version",
       {"candidate", "probation", "committed", "previous", "failed"},
       {{0, 1}, {0, 4}, {1, 0}, {1, 2}, {1, 3}, {1, 4}, {2, 3}, {2, 4}, {3, 1}, {3, 4}, {4, 1}}},
      // The last six: an end that did not reach the disk, and the next process goes on.
      {"update",
       {"none", "verify", "build", "self_test", "store", "swap", "installed", "candidate", "failed",
        "cancelled"},
       {{2, 3}, {2, 8}, {2, 9}, {3, 2}, {3, 4}, {3, 8}, {3, 9}, {4, 2}, {4, 5}, {4, 7},
        {4, 8}, {4, 9}, {5, 6}, {5, 8}, {6, 5}, {6, 8}, {8, 2}, {8, 5}, {8, 9}, {9, 2}}},
      {"scheduled telecommand",
       {"sent", "in schedule", "released", "dropped", "refused"},
       {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {1, 4}}},
  }};
  return tables;
}

void Coverage::note(StateTable table, std::uint64_t object, std::uint8_t state) {
  const auto [found, is_new] = states_.try_emplace({table, object}, state);
  if (is_new || found->second == state) return;
  ++counts_.at(static_cast<std::size_t>(table)).at(found->second).at(state);
  found->second = state;
}

void add(TransitionCounts& to, const TransitionCounts& counts) {
  for (std::size_t table = 0; table < counts.size(); ++table) {
    for (std::size_t from = 0; from < most_states; ++from) {
      for (std::size_t state = 0; state < most_states; ++state)
        to[table][from][state] += counts[table][from][state];
    }
  }
}

std::string report(const TransitionCounts& counts) {
  std::string text = "State transitions\n";
  std::size_t all = 0;
  std::size_t all_seen = 0;
  for (std::size_t i = 0; i < state_table_count; ++i) {
    const StateTableInfo& table = state_tables().at(i);
    const auto arrow = [&table](std::size_t from, std::size_t to) {
      return fmt::format("{} -> {}", table.states.at(from), table.states.at(to));
    };
    std::string never;
    std::size_t seen = 0;
    for (const auto& [from, to] : table.permitted) {
      if (counts[i][from][to] > 0) {
        ++seen;
      } else {
        never += (never.empty() ? "" : ", ") + arrow(from, to);
      }
    }
    std::string beyond;
    for (std::size_t from = 0; from < table.states.size(); ++from) {
      for (std::size_t to = 0; to < table.states.size(); ++to) {
        const std::pair pair{static_cast<std::uint8_t>(from), static_cast<std::uint8_t>(to)};
        const bool is_permitted =
            std::find(table.permitted.begin(), table.permitted.end(), pair) != table.permitted.end();
        if (counts[i][from][to] > 0 && !is_permitted)
          beyond +=
              fmt::format("{}{} ({})", beyond.empty() ? "" : ", ", arrow(from, to), counts[i][from][to]);
      }
    }
    text += fmt::format("  {:22} {:>2} of {:>2}{}{}\n", table.name, seen, table.permitted.size(),
                        never.empty() ? "" : "  never: " + never,
                        beyond.empty() ? "" : "  not in the table: " + beyond);
    all += table.permitted.size();
    all_seen += seen;
  }
  return text + fmt::format("  all {:>3} of {} ({:.0f} %)\n", all_seen, all,
                            100.0 * static_cast<double>(all_seen) / static_cast<double>(all));
}

}  // namespace srfs::simulation
