// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/holder_fence.hpp"

#include <cassert>

namespace srfs {

bool is_holder(std::uint32_t incarnation, const std::optional<std::uint32_t>& holder) {
  if (!holder) return true;  // any process
  // A holder has made its number known long ago: a process without one is a successor, too.
  return incarnation != 0 && incarnation <= *holder;
}

FenceActions HolderFence::fence(const std::string& payload, std::optional<std::uint32_t> process) {
  assert(!busy());
  target_ = KillHolder{payload, process};
  return {*target_};
}

FenceActions HolderFence::on_killed(bool is_there, const std::optional<std::string>& problem) {
  if (!busy()) return {};
  if (!is_there) return on_exit();
  why_ = problem.value_or("killed, but still there");
  return {AwaitExit{wait_}};
}

FenceActions HolderFence::on_exit() {
  if (!busy()) return {};
  target_.reset();
  return {HolderGone{}};
}

FenceActions HolderFence::on_wait_over() {
  if (!busy()) return {};
  return {FenceUnproven{why_}, *target_};
}

}  // namespace srfs
