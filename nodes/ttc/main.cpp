// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/ttc_node.hpp"
#include "ros/run_node.hpp"

int main(int argc, char** argv) {
  return srfs::ros::run_node<srfs::TtcNode>(argc, argv);
}
