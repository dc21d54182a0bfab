#include "nodes/can_switcher/can_switcher_node.hpp"

int main(int argc, char** argv) {
  return srfs::ros::run_node<srfs::CanSwitcherNode>(argc, argv);
}
