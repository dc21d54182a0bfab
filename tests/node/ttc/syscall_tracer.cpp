// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Starts a program and uses ptrace to kill it with SIGKILL at a chosen system call.
// test_ttc_crash_points.cpp controls this program with text lines:
//   in  "trace N"  hold every thread, then count their system-call stops (entry and exit) from the moment a
//                  read returned the start sequence of a CLTU; end the process at the N-th (0: never)
//       "end"      end the process now; also at the end of input
//   out "up PID", "tracing", "begun", "killed AT-STOP CALL entry|exit", "calls N" (after "end"),
//       "refused REASON" (ptrace is not permitted here), "gone" (the process ended by itself)
// However this process ends, its child ends with it (PTRACE_O_EXITKILL, PR_SET_PDEATHSIG).

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>
#include <utility>

#include <dirent.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/signalfd.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

namespace {

constexpr std::size_t read_octets_max = 4096;

void say(const std::string& line) {
  const std::string text = line + "\n";
  if (write(STDOUT_FILENO, text.data(), text.size()) < 0) std::exit(1);
}

class Tracer {
 public:
  explicit Tracer(pid_t child) : child_(child) {}

  /// Seizes every thread. A thread runs on after its first stop has been handled.
  void trace(std::uint64_t kill_at) {
    kill_at_ = kill_at;
    bool found_more = true;
    while (found_more) {  // a thread may start another meanwhile
      found_more = false;
      DIR* tasks = opendir(("/proc/" + std::to_string(child_) + "/task").c_str());
      while (tasks != nullptr) {
        const dirent* entry = readdir(tasks);
        if (entry == nullptr) break;
        const pid_t thread = std::atoi(entry->d_name);
        if (thread <= 0 || threads_.contains(thread)) continue;
        constexpr long options = PTRACE_O_EXITKILL | PTRACE_O_TRACESYSGOOD | PTRACE_O_TRACECLONE;
        if (ptrace(PTRACE_SEIZE, thread, nullptr, options) != 0) {
          // The thread has ended, or a traced thread started it, so that it is traced already.
          if (errno == ESRCH || !threads_.empty()) continue;
          say(std::string("refused ") + std::strerror(errno));
          std::exit(0);
        }
        threads_[thread] = Thread{.awaited = true};
        ++awaited_;
        found_more = true;
        ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr);
      }
      if (tasks != nullptr) closedir(tasks);
    }
  }

  void on_stop(pid_t thread, int status) {
    const int signal = WSTOPSIG(status);
    const int event = status >> 16;
    Thread& t = threads_[thread];
    int deliver = 0;
    if (event == PTRACE_EVENT_STOP) {
      if (std::exchange(t.awaited, false) && --awaited_ == 0) say("tracing");
      if (signal == SIGSTOP || signal == SIGTSTP) {
        ptrace(PTRACE_LISTEN, thread, nullptr, nullptr);
        return;
      }
    } else if (signal == (SIGTRAP | 0x80)) {
      if (on_call(thread)) return;
    } else if (event == 0) {
      deliver = signal;
    }
    ptrace(PTRACE_SYSCALL, thread, nullptr, deliver);
  }

  [[nodiscard]] std::uint64_t stops() const { return stops_; }

 private:
  struct Thread {
    bool awaited = false;  ///< the first stop is still to come
    std::uint64_t call = 0;
    std::uint64_t buffer = 0;
  };

  /// @return whether this stop ended the process
  bool on_call(pid_t thread) {
    __ptrace_syscall_info info{};  // glibc's name for the kernel's
    if (ptrace(PTRACE_GET_SYSCALL_INFO, thread, sizeof info, &info) <= 0) return false;
    Thread& t = threads_[thread];
    const bool entry = info.op == PTRACE_SYSCALL_INFO_ENTRY;
    if (entry) {
      t.call = info.entry.nr;
      t.buffer = info.entry.args[1];
    } else if (!begun_ && t.call == SYS_read && is_telecommand(t.buffer, info.exit.rval)) {
      begun_ = true;
      say("begun");
    }
    if (!begun_ || ++stops_ != kill_at_) return false;
    kill(child_, SIGKILL);
    say("killed " + std::to_string(stops_) + " " + std::to_string(t.call) + (entry ? " entry" : " exit"));
    return true;
  }

  /// Whether the octets that were read contain the start sequence of a CLTU.
  [[nodiscard]] bool is_telecommand(std::uint64_t address, std::int64_t octets) const {
    if (octets < 2 || octets > static_cast<std::int64_t>(read_octets_max)) return false;
    std::array<std::uint8_t, read_octets_max> data{};
    const iovec to{data.data(), static_cast<std::size_t>(octets)};
    const iovec from{reinterpret_cast<void*>(address),  // NOLINT(performance-no-int-to-ptr)
                     static_cast<std::size_t>(octets)};
    if (process_vm_readv(child_, &to, 1, &from, 1, 0) != octets) return false;
    for (std::size_t i = 0; i + 1 < static_cast<std::size_t>(octets); ++i) {
      if (data[i] == 0xEB && data[i + 1] == 0x90) return true;
    }
    return false;
  }

  pid_t child_;
  std::map<pid_t, Thread> threads_;
  int awaited_ = 0;
  std::uint64_t kill_at_ = 0;
  std::uint64_t stops_ = 0;
  bool begun_ = false;
};

pid_t start(char** program) {
  const pid_t child = fork();
  if (child != 0) return child;
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  execv(program[0], program);
  _exit(127);
}

/// @return false: the process has ended
bool reap(Tracer& tracer, pid_t child) {
  int status = 0;
  for (pid_t who = 0; (who = waitpid(-1, &status, __WALL | WNOHANG)) > 0;) {
    if (WIFSTOPPED(status)) {
      tracer.on_stop(who, status);
    } else if (who == child) {
      return false;
    }
  }
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  sigset_t children;
  sigemptyset(&children);
  sigaddset(&children, SIGCHLD);
  sigprocmask(SIG_BLOCK, &children, nullptr);
  const int signals = signalfd(-1, &children, SFD_CLOEXEC | SFD_NONBLOCK);
  const pid_t child = start(argv + 1);
  if (child < 0 || signals < 0) return 2;
  say("up " + std::to_string(child));

  Tracer tracer(child);
  bool ending = false;
  std::array<char, 256> line{};
  while (true) {
    std::array<pollfd, 2> fds{{{signals, POLLIN, 0}, {ending ? -1 : STDIN_FILENO, POLLIN, 0}}};
    if (poll(fds.data(), fds.size(), -1) < 0 && errno != EINTR) return 2;
    signalfd_siginfo told{};
    while (read(signals, &told, sizeof told) > 0) {
    }
    if (!reap(tracer, child)) break;
    if (fds[1].revents == 0) continue;
    const ssize_t octets = read(STDIN_FILENO, line.data(), line.size() - 1);
    const std::string order(line.data(), static_cast<std::size_t>(octets > 0 ? octets : 0));
    if (order.starts_with("trace ")) {
      tracer.trace(std::strtoull(order.c_str() + 6, nullptr, 10));
    } else {
      ending = true;
      kill(child, SIGKILL);
      say("calls " + std::to_string(tracer.stops()));
    }
  }
  say("gone");
  return 0;
}
