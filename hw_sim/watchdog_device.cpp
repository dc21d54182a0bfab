// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/watchdog_device.hpp"

#include <csignal>
#include <utility>

#include <fcntl.h>
#include <fmt/ranges.h>
#include <spawn.h>
#include <sys/epoll.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/log.hpp"

namespace srfs::sim {
namespace {

/// Starts @p command in a new session with default signals and /dev/null as input. @return errno
int spawn_detached(const std::vector<std::string>& command, pid_t& child) {
  std::vector<char*> arguments;
  arguments.reserve(command.size() + 1);
  for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_t files;
  posix_spawnattr_init(&attributes);
  posix_spawn_file_actions_init(&files);
  sigset_t none;
  sigset_t all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  const int error = posix_spawnp(&child, arguments[0], &files, &attributes, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&attributes);
  return error;
}

}  // namespace

WatchdogDevice::WatchdogDevice(EventLoop& loop, milliseconds timeout,
                               std::vector<std::string> restart_command, milliseconds restart_limit,
                               std::filesystem::path status)
    : loop_(loop),
      starvation_(timeout),
      command_(std::move(restart_command)),
      limit_(restart_limit),
      status_(std::move(status)),
      switched_on_(monotonic_now()),
      bite_timer_(loop.add_timer([this](MonotonicTime) { on_timer(); })),
      limit_timer_(loop.add_timer([this](MonotonicTime) { on_limit(); })) {
  write_status();
}

WatchdogDevice::~WatchdogDevice() {
  if (child_fd_) loop_.unwatch(child_fd_.get());  // a restart under way goes on without us
  loop_.set_timer(bite_timer_, std::nullopt);
  loop_.set_timer(limit_timer_, std::nullopt);
  std::error_code ec;
  if (!status_.empty()) std::filesystem::remove(status_, ec);
}

void WatchdogDevice::write_status() const {
  if (status_.empty()) return;
  const auto bites = starvation_.bite_count() - bites_at_power_on_;
  const auto written = write_file_atomically(
      status_, fmt::format("boot {}.{}\nwatchdog {}\ntimeout_ms {}\n", switched_on_.ns(), bites,
                           bites > 0 ? 1 : 0, starvation_.timeout().count()));
  if (!written) log::error("cannot write the watchdog's status: {}", written.error().message);
}

void WatchdogDevice::set_power(bool on) {
  starvation_.disarm();
  if (on) {
    switched_on_ = monotonic_now();
    bites_at_power_on_ = starvation_.bite_count();
    write_status();
    start_restart();
  }
  set_bite_timer();
}

void WatchdogDevice::on_datagram(OctetView datagram) {
  if (datagram.size() == 1 && datagram[0] == 'V') {
    starvation_.disarm();
    ++counters_.disarmed;
    log::info("watchdog disarmed");
  } else {
    if (!starvation_.deadline()) log::info("watchdog armed, {} ms", starvation_.timeout().count());
    starvation_.feed(loop_.running_now());
  }
  set_bite_timer();
}

void WatchdogDevice::set_bite_timer() {
  loop_.set_timer(bite_timer_, loop_.earliest(starvation_.deadline()));
}

void WatchdogDevice::on_timer() {
  if (starvation_.bites(loop_.running_now())) {
    log::error("watchdog starved for {} ms: restarting the suite", starvation_.timeout().count());
    write_status();  // before anything of the suite starts
    start_restart();
  }
  set_bite_timer();
}

void WatchdogDevice::start_restart() {
  if (child_fd_) {
    log::error("no restart: the previous restart command is still running");
    ++counters_.restarts_failed;
    return;
  }
  const int error = spawn_detached(command_, child_);
  const auto pidfd = error == 0 ? static_cast<int>(syscall(SYS_pidfd_open, child_, 0)) : -1;
  if (error != 0 || pidfd < 0) {
    ++counters_.restarts_failed;
    starvation_.rearm(loop_.running_now());
    log::error("cannot run the restart command '{}': {}", fmt::join(command_, " "),
               errno_text(error != 0 ? error : errno));
    return;
  }
  ++counters_.restarts_started;
  fcntl(pidfd, F_SETFD, FD_CLOEXEC);
  child_fd_ = Fd(pidfd);
  loop_.watch(pidfd, EPOLLIN, [this](std::uint32_t, MonotonicTime) { on_exit(); });
  restart_ends_ = loop_.running_now() + limit_;
  loop_.set_timer(limit_timer_, loop_.earliest(restart_ends_));
}

void WatchdogDevice::on_exit() {
  int status = 0;
  if (waitpid(child_, &status, WNOHANG) != child_) return;
  loop_.unwatch(child_fd_.get());
  child_fd_.reset();
  loop_.set_timer(limit_timer_, std::nullopt);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
    log::info("restart command done");
  } else {
    ++counters_.restarts_failed;
    if (!starvation_.deadline()) starvation_.rearm(loop_.running_now());
    set_bite_timer();
    log::error("restart command failed: {} {}", WIFEXITED(status) ? "exit code" : "signal",
               WIFEXITED(status) ? WEXITSTATUS(status) : WTERMSIG(status));
  }
}

void WatchdogDevice::on_limit() {
  if (!child_fd_) return;
  if (loop_.running_now() < restart_ends_) {
    loop_.set_timer(limit_timer_, loop_.earliest(restart_ends_));
    return;
  }
  ++counters_.restarts_killed;
  log::error("killed the restart command after {} ms", limit_.count());
  kill(-child_, SIGKILL);  // its session's first process group; nodes it started have sessions of their own
}

}  // namespace srfs::sim
