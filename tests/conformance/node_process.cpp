// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/conformance/node_process.hpp"

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <stdexcept>
#include <thread>
#include <vector>

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "suite/instance.hpp"
#include "tests/signal_child.hpp"

namespace srfs::conformance {

int test_domain() {
  static const suite::DomainLock lock = [] {
    auto allocated = suite::DomainLock::allocate(std::nullopt, 60).value();
    allocated.downgrade();  // the node shares the domain
    return allocated;
  }();
  return lock.domain();
}

NodeProcess::NodeProcess(std::string name, const std::string& dds) : name_(std::move(name)) {
  const std::filesystem::path& folder = folder_.path();
  std::filesystem::create_directories(folder / "state" / name_);
  std::ofstream(folder / "state" / name_ / "desired_state") << "unconfigured\n";
  std::ofstream(folder / "d.yaml") << "deployment: conformance\ndds: " << dds << "\nnodes: [{name: " << name_
                                   << ", executable: conformance_node}]\n";
  std::vector<std::string> arguments{CONFORMANCE_NODE, "--name",          name_,
                                     "--deployment",   folder / "d.yaml", "--var",
                                     folder,           "--domain",        std::to_string(test_domain())};
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  if (posix_spawn(&pid_, CONFORMANCE_NODE, nullptr, nullptr, argv.data(), environ) != 0)
    throw std::runtime_error("cannot start " CONFORMANCE_NODE);
}

NodeProcess::~NodeProcess() {
  testing_support::signal_child(pid_, SIGTERM);
  int status = 0;
  const bool ended = wait_for([&] { return waitpid(pid_, &status, WNOHANG) == pid_; });
  if (!ended) {
    testing_support::signal_child(pid_, SIGKILL);
    waitpid(pid_, &status, 0);
  }
  std::filesystem::remove_all(suite::VarPaths{folder_.path()}.memory());
  EXPECT_TRUE(ended && WIFEXITED(status) && WEXITSTATUS(status) == 0) << name_ << ": status " << status;
}

Octets NodeProcess::user_data() const {
  const std::string text = "enclave=/;srfs=conformance/" + name_ + "/1;";
  Octets octets(text.begin(), text.end());
  octets.push_back(0);
  return octets;
}

std::unique_ptr<NodeProcess> ConformanceTest::node_;
std::unique_ptr<Ros2Peer> ConformanceTest::shared_peer_;

SeenParticipant ConformanceTest::find(const NodeProcess& node) {
  SeenParticipant found;
  EXPECT_TRUE(wait_for([&] {
    for (const SeenParticipant& seen : peer_.participants()) {
      if (seen.user_data != node.user_data()) continue;
      found = seen;
      return true;
    }
    return false;
  })) << "no participant of "
      << node.name();
  return found;
}

}  // namespace srfs::conformance
