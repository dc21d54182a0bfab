// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/ttc_node.hpp"
#include "suite/run_node.hpp"

int main(int argc, char** argv) {
  return srfs::suite::run_node<srfs::TtcNode>(argc, argv);
}
