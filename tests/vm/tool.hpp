// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/fd.hpp"
#include "tests/vm/virtual_can.hpp"

namespace srfs::vm {

/// A can-utils program whose standard input and output the test controls. The destructor ends the program.
class Tool {
 public:
  explicit Tool(std::vector<std::string> words) {
    std::array<int, 2> in{};
    std::array<int, 2> out{};
    EXPECT_EQ(::pipe2(in.data(), O_CLOEXEC), 0);
    EXPECT_EQ(::pipe2(out.data(), O_CLOEXEC), 0);
    const Fd theirs_in(in[0]);
    const Fd theirs_out(out[1]);
    to_ = Fd(in[1]);
    from_ = Fd(out[0]);
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t files{};
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, in[0], STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&files, out[1], STDOUT_FILENO);
    EXPECT_EQ(::posix_spawnp(&pid_, arguments[0], &files, nullptr, arguments.data(), environ), 0) << words[0];
    posix_spawn_file_actions_destroy(&files);
  }
  ~Tool() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Tool(const Tool&) = delete;
  Tool& operator=(const Tool&) = delete;

  void type(const std::string& text) {
    EXPECT_EQ(::write(to_.get(), text.data(), text.size()), static_cast<ssize_t>(text.size()));
    to_ = Fd();
  }
  /// Reads the output until @p enough accepts it, the program ends, or the patience is over.
  std::string output(const std::function<bool(const std::string&)>& enough) {
    const MonotonicTime end = monotonic_now() + patience;
    while (!enough(said_) && monotonic_now() < end) {
      pollfd p{.fd = from_.get(), .events = POLLIN, .revents = 0};
      if (::poll(&p, 1, 100) != 1) continue;
      std::array<char, 4096> part{};
      const ssize_t size = ::read(from_.get(), part.data(), part.size());
      if (size <= 0) break;
      said_.append(part.data(), static_cast<std::size_t>(size));
    }
    return said_;
  }
  std::string all_output() {
    return output([](const std::string&) { return false; });
  }

 private:
  pid_t pid_ = -1;
  Fd to_;
  Fd from_;
  std::string said_;
};

/// Waits until a socket listens to the extended identifier @p id on an interface.
inline bool await_listener(const std::string& interface, std::uint32_t id) {
  const std::string identifier = fmt::format("{:08x}", CAN_EFF_FLAG | id);
  const MonotonicTime end = monotonic_now() + patience;
  while (monotonic_now() < end) {
    std::ifstream list("/proc/net/can/rcvlist_eff");
    for (std::string line; std::getline(list, line);) {
      if (line.find(interface) != std::string::npos && line.find(identifier) != std::string::npos)
        return true;
    }
    ::usleep(10'000);
  }
  return false;
}

}  // namespace srfs::vm
