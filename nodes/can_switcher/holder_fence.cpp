// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/holder_fence.hpp"

#include <sys/syscall.h>
#include <unistd.h>

#include <cassert>
#include <cerrno>
#include <csignal>
#include <utility>

#include <fmt/format.h>

#include "base/fd.hpp"

namespace srfs {
namespace {

Fd open_pidfd(pid_t pid) {
  return Fd(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0)));
}  // close-on-exec by itself

}  // namespace

bool is_holder(std::uint32_t incarnation, const std::optional<std::uint32_t>& holder) {
  if (!holder) return true;  // any process
  // A holder has made its number known long ago: a process without one is a successor, too.
  return incarnation != 0 && incarnation <= *holder;
}

int HolderFence::send_sigkill(int pidfd) {
  return ::syscall(SYS_pidfd_send_signal, pidfd, SIGKILL, nullptr, 0) == 0 ? 0 : errno;
}

void HolderFence::fence(const std::string& payload, Outcome outcome) {
  assert(!busy() && outcome.gone);
  payload_ = payload;
  outcome_ = std::move(outcome);
  attempt();
}

void HolderFence::attempt() {
  watch_.reset();
  pidfd_.reset();
  const auto problem = kill_holder();
  // The instance lock ends with the process, not before: without it there is no such process.
  if (!hooks_.find(payload_)) {
    finish();
    return;
  }
  if (pidfd_) watch_ = hooks_.watch(pidfd_.get(), [this] { finish(); });
  timeout_ = hooks_.after(wait_, [this, why = problem.value_or("killed, but still there")] {
    if (outcome_.unproven) outcome_.unproven(why);
    attempt();
  });
}

std::optional<std::string> HolderFence::kill_holder() {
  const auto pid = hooks_.find(payload_);
  if (!pid) return std::nullopt;
  pidfd_ = open_pidfd(*pid);
  if (!pidfd_) return fmt::format("pidfd of {}: {}", *pid, errno_text(errno));
  // Asked again: between the two questions the process may have ended and its number may have been reused.
  if (hooks_.find(payload_) != pid) {
    pidfd_.reset();
    return "another process holds its lock";
  }
  const int error = hooks_.kill(pidfd_.get());
  if (error == 0) return std::nullopt;
  return fmt::format("cannot kill pid {}: {}", *pid, errno_text(error));
}

void HolderFence::finish() {
  watch_.reset();
  timeout_.reset();
  pidfd_.reset();
  const Outcome outcome = std::exchange(outcome_, {});
  outcome.gone();
}

}  // namespace srfs
