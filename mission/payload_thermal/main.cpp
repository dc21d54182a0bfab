// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/payload_node.hpp"
#include "suite/run_node.hpp"
#include "thermal_profile.hpp"

int main(int argc, char** argv) {
  return srfs::suite::run_node<srfs::PayloadNodeOf<srfs::ThermalProfile>>(argc, argv);
}
