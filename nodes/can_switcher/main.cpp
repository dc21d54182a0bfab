// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/can_switcher_node.hpp"

int main(int argc, char** argv) {
  return srfs::suite::run_node<srfs::CanSwitcherNode>(argc, argv);
}
