#include "nodes/ttc/ttc_node.hpp"
#include "ros/run_node.hpp"

int main(int argc, char** argv) {
  return srfs::ros::run_node<srfs::TtcNode>(argc, argv);
}
