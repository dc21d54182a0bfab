// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/dds_domain.hpp"
#include "tests/signal_child.hpp"

namespace srfs::testing_support {

/// A process of tests/node/ros/action_peer.cpp on this test's DDS domain. The destructor kills it if it still
/// runs.
class PeerProcess {
 public:
  PeerProcess(const std::string& role, const std::string& name) {
    const std::string program = std::string(SRFS_BINARY_DIR) + "/tests/action_peer";
    const std::string domain = std::to_string(own_domain());
    pid_ = fork();
    if (pid_ == 0) {
      execl(program.c_str(), program.c_str(), role.c_str(), domain.c_str(), name.c_str(),
            static_cast<char*>(nullptr));
      _exit(127);
    }
  }
  ~PeerProcess() { kill_now(); }
  PeerProcess(const PeerProcess&) = delete;
  PeerProcess& operator=(const PeerProcess&) = delete;

  void signal(int number) const { signal_child(pid_, number); }
  /// Sends SIGKILL and waits until the process has ended.
  void kill_now() {
    if (pid_ <= 0) return;
    signal_child(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = 0;
  }
  /// Waits up to 20 s for the process to end. @return the exit code; -1 if it did not end by itself
  int wait_for_exit() {
    int status = 0;
    for (int i = 0; i < 2000 && waitpid(pid_, &status, WNOHANG) == 0; ++i) usleep(10'000);
    const bool exited = pid_ > 0 && kill(pid_, 0) != 0 && WIFEXITED(status);
    if (exited) pid_ = 0;
    return exited ? WEXITSTATUS(status) : -1;
  }

 private:
  pid_t pid_ = 0;
};

}  // namespace srfs::testing_support
