// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/holder_kill.hpp"

#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>

#include <fmt/format.h>

namespace srfs {
namespace {

/// @return why the process is not known to be on its way out, nothing when it is
std::optional<std::string> try_to_kill(const std::function<std::optional<pid_t>()>& find,
                                       const std::function<int(int pidfd)>& kill, Fd& pidfd) {
  const auto pid = find();
  if (!pid) return std::nullopt;
  pidfd = Fd(static_cast<int>(::syscall(SYS_pidfd_open, *pid, 0)));  // close-on-exec by itself
  if (!pidfd) return fmt::format("pidfd of {}: {}", *pid, errno_text(errno));
  // Asked again: between the two questions the process may have ended and its number may have been reused.
  if (find() != pid) {
    pidfd.reset();
    return "another process holds its lock";
  }
  const int error = kill(pidfd.get());
  if (error == 0) return std::nullopt;
  return fmt::format("cannot kill pid {}: {}", *pid, errno_text(error));
}

}  // namespace

int send_sigkill(int pidfd) {
  return ::syscall(SYS_pidfd_send_signal, pidfd, SIGKILL, nullptr, 0) == 0 ? 0 : errno;
}

HolderKill kill_holder(const std::function<std::optional<pid_t>()>& find,
                       const std::function<int(int pidfd)>& kill) {
  HolderKill result;
  result.problem = try_to_kill(find, kill, result.pidfd);
  // The instance lock ends with the process, not before: without it there is no such process.
  result.is_there = find().has_value();
  return result;
}

}  // namespace srfs
