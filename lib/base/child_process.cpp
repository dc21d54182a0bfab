// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/child_process.hpp"

#include <cerrno>
#include <csignal>
#include <cstring>

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace srfs {

Result<ChildProcess, std::string> ChildProcess::start(const std::vector<std::string>& command) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC | O_NONBLOCK) != 0) return Err(fmt::format("pipe: {}", std::strerror(errno)));
  Fd output(ends[0]);
  const Fd input(ends[1]);

  std::vector<char*> arguments;
  arguments.reserve(command.size() + 1);
  for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);

  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&files, input.get(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&files, input.get(), STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigset_t all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  const sched_param ordinary{};
  posix_spawnattr_setschedparam(&attributes, &ordinary);
  posix_spawnattr_setschedpolicy(&attributes, SCHED_OTHER);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF |
                                            POSIX_SPAWN_SETSCHEDULER | POSIX_SPAWN_SETPGROUP);
  pid_t pid = 0;
  const int error =
      posix_spawn(&pid, command.front().c_str(), &files, &attributes, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&attributes);
  if (error != 0) return Err(fmt::format("{}: {}", command.front(), std::strerror(error)));
  auto process = Process::open(pid);  // not buried yet, so the number is its own
  if (!process) {
    kill(pid, SIGKILL);
    waitpid(pid, nullptr, 0);
    return Err(fmt::format("{}: no pidfd: {}", command.front(), std::strerror(errno)));
  }
  return ChildProcess(std::move(*process), std::move(output));
}

ChildProcess::~ChildProcess() {
  if (!output_ || end_) return;  // moved from, or buried
  process_.signal(SIGKILL);
  while (waitpid(process_.pid(), nullptr, 0) < 0 && errno == EINTR) {
  }
}

std::optional<ChildProcess::End> ChildProcess::take_end() {
  if (end_) return end_;
  int status = 0;
  const pid_t pid = waitpid(process_.pid(), &status, WNOHANG);
  if (pid == 0) return std::nullopt;
  End end;
  if (pid < 0) {
    end.signal = SIGKILL;  // reaped elsewhere: how it ended is not known
  } else if (WIFEXITED(status)) {
    end.exit_code = WEXITSTATUS(status);
  } else {
    end.signal = WTERMSIG(status);
  }
  end_ = end;
  return end;
}

std::string to_text(const ChildProcess::End& end) {
  if (end.exit_code) return fmt::format("exit code {}", *end.exit_code);
  const char* name = sigabbrev_np(end.signal);
  return name == nullptr ? fmt::format("signal {}", end.signal)
                         : fmt::format("signal {} (SIG{})", end.signal, name);
}

}  // namespace srfs
