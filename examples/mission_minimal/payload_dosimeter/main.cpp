// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "dosimeter_profile.hpp"
#include "nodes/payload/payload_node.hpp"
#include "suite/run_node.hpp"

int main(int argc, char** argv) {
  return srfs::suite::run_node<srfs::PayloadNodeOf<srfs::DosimeterProfile>>(argc, argv);
}
