// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <functional>
#include <optional>
#include <string>

#include "base/fd.hpp"

namespace srfs {

/// What came of a try to kill a process.
struct HolderKill {
  bool is_there = false;                 ///< still
  Fd pidfd;                              ///< readable when it has ended; may be none
  std::optional<std::string> problem{};  ///< why it is not known to be on its way out
};

/// SIGKILL by pidfd. @return 0 or errno
int send_sigkill(int pidfd);

/// Kills the process that @p find finds, never another one: a number that was used again is not hit. Does not
/// block.
/// @param find  asked before and after; nullopt: there is none
[[nodiscard]] HolderKill kill_holder(const std::function<std::optional<pid_t>()>& find,
                                     const std::function<int(int pidfd)>& kill = send_sigkill);

}  // namespace srfs
