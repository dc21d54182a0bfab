// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/time.hpp"

namespace srfs {

/// Whether the process that has a payload's instance lock now is the one that held the bus.
/// @param incarnation  of that process; 0: it has not made it known yet
/// @param holder       incarnation of the holder; nullopt: not known
[[nodiscard]] bool is_holder(std::uint32_t incarnation, const std::optional<std::uint32_t>& holder);

// What the fence decides; carried out by the adapter in the given order.

/// Send SIGKILL to the process that is_holder() (holder_kill.hpp). Answer with on_killed(). What was awaited
/// of an earlier try is not awaited any more.
struct KillHolder {
  std::string payload;
  std::optional<std::uint32_t> process;  ///< its incarnation; nullopt: any
};
/// Call on_exit() when the process has ended, on_wait_over() if that takes longer.
struct AwaitExit {
  nanoseconds wait{0};
};
/// The process is gone. The last action.
struct HolderGone {};
/// Another wait ended without proof; it goes on.
struct FenceUnproven {
  std::string why;
};

using FenceAction = std::variant<KillHolder, AwaitExit, HolderGone, FenceUnproven>;
using FenceActions = std::vector<FenceAction>;

/// Ends a payload's process so surely that it can never write to the bus again. A process that cannot be
/// killed, or does not go away, may still write: it is not taken for gone before it is, and is killed again
/// after each wait. Pure; one thread.
class HolderFence {
 public:
  explicit HolderFence(nanoseconds wait) : wait_(wait) {}

  /// One at a time. @param process  as in KillHolder
  [[nodiscard]] FenceActions fence(const std::string& payload, std::optional<std::uint32_t> process);
  /// @param is_there  the process still has its instance lock, which ends with it and not before
  /// @param problem   why it is not known to be on its way out; nullopt: it is
  [[nodiscard]] FenceActions on_killed(bool is_there, const std::optional<std::string>& problem);
  [[nodiscard]] FenceActions on_exit();
  [[nodiscard]] FenceActions on_wait_over();
  [[nodiscard]] bool busy() const { return target_.has_value(); }

 private:
  nanoseconds wait_;
  std::optional<KillHolder> target_;
  std::string why_;  ///< it may still be there
};

}  // namespace srfs
