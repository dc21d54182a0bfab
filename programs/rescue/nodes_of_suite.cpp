// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/rescue/nodes_of_suite.hpp"

#include <set>

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <ctime>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "suite/node_processes.hpp"

namespace srfs::rescue {
namespace {

constexpr milliseconds between_looks{20};
constexpr int most_looks = 150;
constexpr std::size_t most_locks = 256;
/// A process between fork and exec has the command line of its starter.
constexpr int looks_to_be_sure = 2;
constexpr int highest_good_exit_code = 1;

void pause_for(milliseconds time) {
  const timespec wait{.tv_sec = time.count() / 1000, .tv_nsec = time.count() % 1000 * 1'000'000};
  nanosleep(&wait, nullptr);
}

/// The kernel states who holds a lock, whatever the file has in it.
std::set<pid_t> holders(const std::filesystem::path& var) {
  std::set<pid_t> pids;
  std::error_code ec;
  std::size_t looked = 0;
  for (std::filesystem::directory_iterator it(var / "run", ec), end; !ec && it != end && looked < most_locks;
       it.increment(ec)) {
    if (it->path().extension() != ".lock") continue;
    ++looked;
    // Only asked, not locked: also on a disk that is read-only.
    const Fd fd(open(it->path().c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
    struct flock lock {};
    lock.l_type = F_WRLCK;
    lock.l_whence = SEEK_SET;
    if (fd && fcntl(fd.get(), F_GETLK, &lock) == 0 && lock.l_type != F_UNLCK && lock.l_pid > 1)
      pids.insert(lock.l_pid);
  }
  return pids;
}

}  // namespace

bool suite_runs(const std::filesystem::path& var) {
  return !holders(var).empty();
}

bool end_suite(const std::filesystem::path& var) {
  // First, so that no starter makes another one.
  std::error_code ec;
  if (std::filesystem::exists(var / "run", ec)) (void)write_file_atomically(var / "run" / "stopping", "");
  int empty_looks = 0;
  for (int look = 0; look < most_looks && empty_looks < looks_to_be_sure; ++look) {
    if (look > 0) pause_for(between_looks);
    const auto nodes = suite::node_processes(var);
    const auto starters = suite::starter_processes(var);
    const auto owners = holders(var);
    empty_looks = nodes.empty() && starters.empty() && owners.empty() ? empty_looks + 1 : 0;
    for (const Process& starter : starters) (void)starter.signal(SIGKILL);
    for (const auto& node : nodes) (void)node.process.signal(SIGKILL);
    for (const pid_t owner : owners) kill(owner, SIGKILL);
  }
  return empty_looks == looks_to_be_sure;
}

std::string run_program(const std::vector<std::string>& command, nanoseconds limit,
                        const std::function<void()>& meanwhile) {
  std::vector<char*> arguments;
  arguments.reserve(command.size() + 1);
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  pid_t pid = 0;
  if (const int error = posix_spawn(&pid, arguments[0], nullptr, nullptr, arguments.data(), environ);
      error != 0)
    return fmt::format("srfs up cannot be run: {}", errno_text(error));
  const MonotonicTime end = monotonic_now() + limit;
  int status = 0;
  while (waitpid(pid, &status, WNOHANG) == 0) {
    if (monotonic_now() >= end) {
      kill(pid, SIGKILL);
      waitpid(pid, &status, 0);
      return "srfs up did not end in its time";
    }
    meanwhile();
    pause_for(between_looks);
  }
  if (WIFSIGNALED(status)) return fmt::format("srfs up: signal {}", WTERMSIG(status));
  const int code = WEXITSTATUS(status);
  return code <= highest_good_exit_code ? "" : fmt::format("srfs up: exit code {}", code);
}

}  // namespace srfs::rescue
