// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/lifecycle.hpp"

#include <algorithm>
#include <array>

namespace srfs::ros {
namespace {

using S = State;
using T = Trigger;

constexpr std::array table{
    LifecycleRow{S::unconfigured, T::configure, S::configuring, 1, "configure"},
    LifecycleRow{S::configuring, T::success, S::inactive, 10, "transition_success"},
    LifecycleRow{S::configuring, T::failure, S::unconfigured, 11, "transition_failure"},
    LifecycleRow{S::configuring, T::error, S::error_processing, 12, "transition_error"},

    LifecycleRow{S::inactive, T::cleanup, S::cleaning_up, 2, "cleanup"},
    LifecycleRow{S::cleaning_up, T::success, S::unconfigured, 20, "transition_success"},
    LifecycleRow{S::cleaning_up, T::failure, S::inactive, 21, "transition_failure"},
    LifecycleRow{S::cleaning_up, T::error, S::error_processing, 22, "transition_error"},

    LifecycleRow{S::inactive, T::activate, S::activating, 3, "activate"},
    LifecycleRow{S::activating, T::success, S::active, 30, "transition_success"},
    LifecycleRow{S::activating, T::failure, S::inactive, 31, "transition_failure"},
    LifecycleRow{S::activating, T::error, S::error_processing, 32, "transition_error"},

    LifecycleRow{S::active, T::deactivate, S::deactivating, 4, "deactivate"},
    LifecycleRow{S::deactivating, T::success, S::inactive, 40, "transition_success"},
    LifecycleRow{S::deactivating, T::failure, S::active, 41, "transition_failure"},
    LifecycleRow{S::deactivating, T::error, S::error_processing, 42, "transition_error"},

    LifecycleRow{S::unconfigured, T::unconfigured_shutdown, S::shutting_down, 5, "shutdown"},
    LifecycleRow{S::inactive, T::inactive_shutdown, S::shutting_down, 6, "shutdown"},
    LifecycleRow{S::active, T::active_shutdown, S::shutting_down, 7, "shutdown"},
    LifecycleRow{S::shutting_down, T::success, S::finalized, 50, "transition_success"},
    LifecycleRow{S::shutting_down, T::failure, S::finalized, 51, "transition_failure"},
    LifecycleRow{S::shutting_down, T::error, S::error_processing, 52, "transition_error"},

    LifecycleRow{S::error_processing, T::success, S::unconfigured, 60, "transition_success"},
    LifecycleRow{S::error_processing, T::failure, S::finalized, 61, "transition_failure"},
    LifecycleRow{S::error_processing, T::error, S::finalized, 62, "transition_error"},
};

// 99 is lifecycle_msgs/msg/Transition TRANSITION_CALLBACK_ERROR, for private use.
constexpr std::array error_rows{
    LifecycleRow{S::unconfigured, T::error, S::error_processing, 99, "raise_error"},
    LifecycleRow{S::inactive, T::error, S::error_processing, 99, "raise_error"},
    LifecycleRow{S::active, T::error, S::error_processing, 99, "raise_error"},
};

}  // namespace

std::span<const LifecycleRow> lifecycle_table() {
  return table;
}

const LifecycleRow* find_row(State from, Trigger trigger) {
  const auto found = std::find_if(table.begin(), table.end(), [&](const LifecycleRow& r) {
    return r.from == from && r.trigger == trigger;
  });
  return found == table.end() ? nullptr : &*found;
}

const LifecycleRow* find_error_row(State from) {
  const auto found = std::find_if(error_rows.begin(), error_rows.end(),
                                  [&](const LifecycleRow& r) { return r.from == from; });
  return found == error_rows.end() ? nullptr : &*found;
}

const LifecycleRow* find_request(State from, std::uint8_t id, std::string_view label) {
  if (!is_primary(from)) return nullptr;  // one transition at a time
  const auto found = std::find_if(table.begin(), table.end(), [&](const LifecycleRow& r) {
    return r.from == from && (label.empty() ? r.transition_id == id : r.label == label);
  });
  return found == table.end() ? nullptr : &*found;
}

std::string_view label(State state) {
  switch (state) {
    case S::unknown:
      return "unknown";
    case S::unconfigured:
      return "unconfigured";
    case S::inactive:
      return "inactive";
    case S::active:
      return "active";
    case S::finalized:
      return "finalized";
    case S::configuring:
      return "configuring";
    case S::cleaning_up:
      return "cleaningup";
    case S::shutting_down:
      return "shuttingdown";
    case S::activating:
      return "activating";
    case S::deactivating:
      return "deactivating";
    case S::error_processing:
      return "errorprocessing";
  }
  return "unknown";
}

bool is_primary(State state) {
  return state == S::unconfigured || state == S::inactive || state == S::active || state == S::finalized;
}

Trigger to_trigger(CallbackReturn outcome) {
  return outcome == CallbackReturn::success   ? T::success
         : outcome == CallbackReturn::failure ? T::failure
                                              : T::error;
}

std::optional<State> primary_state(std::string_view text) {
  for (const State state : {S::unconfigured, S::inactive, S::active, S::finalized}) {
    if (label(state) == text) return state;
  }
  return std::nullopt;
}

}  // namespace srfs::ros
