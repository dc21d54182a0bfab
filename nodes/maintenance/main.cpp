// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/maintenance_node.hpp"

int main(int argc, char** argv) {
  return srfs::suite::run_node<srfs::MaintenanceNode>(argc, argv);
}
