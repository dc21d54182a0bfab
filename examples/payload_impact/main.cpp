// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "impact_profile.hpp"
#include "nodes/payload/payload_node.hpp"
#include "suite/run_node.hpp"

int main(int argc, char** argv) {
  return srfs::suite::run_node<srfs::PayloadNodeOf<srfs::ImpactProfile>>(argc, argv,
                                                                         srfs::mission::fragment_tables);
}
