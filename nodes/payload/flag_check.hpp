// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include <srfs_msgs/msg/task_flags.hpp>

#include "base/time.hpp"
#include "suite/deployment.hpp"

namespace srfs {

/// Whether a flag can be true: exactly the holder's flag, in its place if the plan has it, a lease that this
/// plan can give, from the switcher that runs. Pure.
class FlagCheck {
 public:
  /// Incarnation of the process that holds the switcher's instance lock; nullopt: there is none.
  using RunningSwitcher = std::function<std::optional<std::uint32_t>()>;

  /// @param slots    of its bus
  /// @param running  asked about a switcher that was not heard before
  [[nodiscard]] bool is_plausible(const srfs_msgs::msg::TaskFlags& flags,
                                  const std::vector<suite::Slot>& slots, MonotonicTime now,
                                  const RunningSwitcher& running);

 private:
  std::uint32_t believed_switcher_ = 0;
};

}  // namespace srfs
