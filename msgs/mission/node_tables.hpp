// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace srfs::mission {

/// A parameter of a node whose change is on trial until it is confirmed.
struct GuardedParameter {
  std::string_view node;
  std::string_view name;
};

/// The housekeeping structure of a node's work thread (work_thread.yaml).
struct WorkThreadStructure {
  std::string_view node;
  std::uint16_t apid = 0;
  std::uint16_t structure_id = 0;
};

/// What the dictionary says of nodes and lib/suite must know. They differ from mission to mission, so each
/// program brings those of its own (run_node): `node_tables` of <mission/structures.hpp>, or
/// `fragment_tables` of the structs of a fragment. The arrays outlive the program's work.
struct NodeTables {
  std::span<const GuardedParameter> guarded_parameters;
  std::span<const WorkThreadStructure> work_threads;
};

}  // namespace srfs::mission
