#pragma once

#include <string>
#include <vector>

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/dds_domain.hpp"

namespace srfs::testing_support {

/// A process of tests/node/ros/action_peer.cpp on this test's DDS domain; killed at the latest with this
/// object.
class PeerProcess {
 public:
  explicit PeerProcess(const std::string& role) {
    const std::string program = std::string(SRFS_BINARY_DIR) + "/tests/action_peer";
    const std::string domain = std::to_string(own_domain());
    pid_ = fork();
    if (pid_ == 0) {
      execl(program.c_str(), program.c_str(), role.c_str(), domain.c_str(), static_cast<char*>(nullptr));
      _exit(127);
    }
  }
  ~PeerProcess() { kill_now(); }
  PeerProcess(const PeerProcess&) = delete;
  PeerProcess& operator=(const PeerProcess&) = delete;

  /// kill -9; returns when the process is gone.
  void kill_now() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = 0;
  }

 private:
  pid_t pid_ = 0;
};

}  // namespace srfs::testing_support
