// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/socket.h>

#include "update/sandbox.hpp"

namespace srfs::update {

/// One layer's set-up: what was tried and the errno, 0 when it succeeded. The name is a literal: it means the
/// same in the parent process.
struct Step {
  const char* name = "";
  int error = 0;
  [[nodiscard]] bool ok() const { return error == 0; }
};

// For a process that confines itself, each once, in this order.

/// Full rights in a user namespace of its own, so that a process that is not root has the others too.
[[nodiscard]] Step map_user(uid_t user, gid_t group);
/// A new root: /usr and what is readable, read-only, a few devices, the work folder. In a mount namespace.
[[nodiscard]] Step enter_view(const Confinement& confinement, const WorkFolder& work, bool own_processes);
[[nodiscard]] Step bring_up_loopback();
[[nodiscard]] Step take_lowest_priority();
/// @param own_user  the user has no other processes: they can be counted
[[nodiscard]] Step limit_resources(const Limits& limits, bool own_user);
[[nodiscard]] Step forbid_new_privileges();
/// The same rights as in the view, on the files as they are.
[[nodiscard]] Step restrict_files(const Confinement& confinement, const WorkFolder& work);
/// @param user, group  to become; nullopt: only capabilities are given up
[[nodiscard]] Step drop_privileges(std::optional<std::pair<uid_t, gid_t>> user);
struct AllowedSockets {
  bool internet = false;
  bool local = false;  ///< AF_UNIX; where no process of the suite can be reached by it

  [[nodiscard]] bool allow(std::uint64_t family) const {
    const bool is_internet = family == AF_INET || family == AF_INET6 || family == AF_NETLINK;
    return (internet && is_internet) || (local && family == AF_UNIX);
  }
};
[[nodiscard]] Step filter_system_calls(AllowedSockets sockets);

}  // namespace srfs::update
