// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A node of a ring that only gives its worker a job from time to time (test_liveness_ring.cpp).
// SIGUSR1: the work thread loops for ever; SIGUSR2, sent to one thread: that thread never returns;
// SIGHUP: the process allocates 950 MiB.

#include <csignal>

#include <sys/mman.h>
#include <unistd.h>

#include "ros/worker.hpp"
#include "suite/node.hpp"
#include "suite/run_node.hpp"

namespace {

class RingProbe : public srfs::suite::Node {
 public:
  using Node::Node;

 private:
  std::shared_ptr<srfs::ros::Worker> worker_ = create_worker("probe", 2);
  srfs::ros::Timer timer_ =
      create_timer(std::chrono::milliseconds(100), [this] { (void)worker_->post([] {}); });
};

[[noreturn]] void loop(int) {
  // Runs on the work thread: the kernel delivers a process' signal to the first thread unless it is blocked.
  while (true) {
    static volatile int turns = 0;
    turns = turns + 1;
  }
}

void hang(int) {
  while (true) pause();
}

void grow(int) {
  (void)mmap(nullptr, 950U << 20U, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGUSR1, loop);
  std::signal(SIGUSR2, hang);
  std::signal(SIGHUP, grow);
  return srfs::suite::run_node<RingProbe>(argc, argv);
}
