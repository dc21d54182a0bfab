// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/goal_state.hpp"

#include <algorithm>

namespace srfs::ros {
namespace {

using S = GoalState;
using E = GoalEvent;

constexpr std::array table{
    GoalRow{S::accepted, E::execute, S::executing},      GoalRow{S::accepted, E::cancel_goal, S::canceling},

    GoalRow{S::executing, E::cancel_goal, S::canceling}, GoalRow{S::executing, E::succeed, S::succeeded},
    GoalRow{S::executing, E::abort, S::aborted},

    GoalRow{S::canceling, E::succeed, S::succeeded},     GoalRow{S::canceling, E::abort, S::aborted},
    GoalRow{S::canceling, E::canceled, S::canceled},
};

}  // namespace

std::span<const GoalRow> goal_table() {
  return table;
}

std::optional<GoalState> next_state(GoalState from, GoalEvent event) {
  const auto found = std::find_if(table.begin(), table.end(),
                                  [&](const GoalRow& row) { return row.from == from && row.event == event; });
  if (found == table.end()) return std::nullopt;
  return found->to;
}

bool is_terminal(GoalState state) {
  return state == S::succeeded || state == S::canceled || state == S::aborted;
}

bool is_active(GoalState state) {
  return state == S::accepted || state == S::executing || state == S::canceling;
}

bool is_cancelable(GoalState state) {
  return next_state(state, E::cancel_goal).has_value();
}

std::string_view label(GoalState state) {
  switch (state) {
    case S::unknown:
      return "unknown";
    case S::accepted:
      return "accepted";
    case S::executing:
      return "executing";
    case S::canceling:
      return "canceling";
    case S::succeeded:
      return "succeeded";
    case S::canceled:
      return "canceled";
    case S::aborted:
      return "aborted";
  }
  return "unknown";
}

GoalState goal_state(std::int8_t status) {
  const bool known =
      status >= static_cast<std::int8_t>(S::accepted) && status <= static_cast<std::int8_t>(S::aborted);
  return known ? static_cast<GoalState>(status) : S::unknown;
}

}  // namespace srfs::ros
