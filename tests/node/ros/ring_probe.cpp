// A node of a ring that does nothing else (test_liveness_ring.cpp). SIGUSR1: its work thread loops for ever.

#include <csignal>

#include "ros/node.hpp"
#include "ros/run_node.hpp"

namespace {

class RingProbe : public srfs::ros::LifecycleNode {
 public:
  using LifecycleNode::LifecycleNode;
};

[[noreturn]] void loop(int) {
  // On the work thread: the kernel gives a process' signal to its first thread when that does not block it.
  while (true) {
    static volatile int turns = 0;
    turns = turns + 1;
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGUSR1, loop);
  return srfs::ros::run_node<RingProbe>(argc, argv);
}
