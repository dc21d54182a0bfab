#include "nodes/can_switcher/holder_fence.hpp"

#include <sys/syscall.h>
#include <unistd.h>

#include <cassert>
#include <cerrno>
#include <csignal>

#include "base/log.hpp"

namespace srfs {
namespace {

Fd open_pidfd(pid_t pid) {
  return Fd(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0)));
}  // close-on-exec by itself

}  // namespace

void HolderFence::fence(const std::string& payload, Done done) {
  assert(!busy());
  done_ = std::move(done);
  const auto pid = hooks_.find(payload);
  if (!pid) {
    finish(true);
    return;
  }
  pidfd_ = open_pidfd(*pid);
  // Asked again: between the two questions the process may have ended and its number gone to a stranger.
  if (!pidfd_ || hooks_.find(payload) != pid) {
    finish(!hooks_.find(payload).has_value());
    return;
  }
  if (::syscall(SYS_pidfd_send_signal, pidfd_.get(), SIGKILL, nullptr, 0) != 0) {
    const int error = errno;
    if (error != ESRCH) log::error("cannot kill {} (pid {}): {}", payload, *pid, errno_text(error));
    finish(error == ESRCH);
    return;
  }
  watch_ = hooks_.watch(pidfd_.get(), [this] { finish(true); });
  timeout_ = hooks_.after(longest_wait_, [this] { finish(false); });
}

void HolderFence::finish(bool gone) {
  watch_.reset();
  timeout_.reset();
  pidfd_.reset();
  const Done done = std::move(done_);
  done_ = nullptr;
  done(gone);
}

}  // namespace srfs
