// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "programs/srfs/suite.hpp"

namespace srfs::tool {

struct McapRecording {
  std::string file;
  std::vector<std::string>
      topics;                     ///< ROS names; empty: all, but hidden ones ("_" begins a part of the name)
  std::optional<int> domain;      ///< nullopt: that of the running suite
  seconds duration{0};            ///< 0: until SIGTERM or SIGINT
  std::uint64_t most_mib = 1024;  ///< of the file; the recording ends there
  std::uint64_t largest_mib = 1;  ///< of a sample; larger ones are dropped and counted
  std::vector<std::string> interfaces;  ///< folders with definitions (definition_folders.hpp)
};

/// Records topics of any type into a new MCAP file, topics and publishers of other programs too. Listens
/// only. The file is readable at any time up to its last whole chunk, which is a second old at most.
/// @return exit code: 0: recorded; 1: nothing could be recorded, or the disk refused a chunk
int record_mcap(const Target& target, const McapRecording& recording);

struct McapPlay {
  std::string file;
  int domain = 0;
  double rate = 1;
  std::vector<std::string> topics;  ///< empty: all
  milliseconds wait{1000};          ///< for subscriptions to match, before the first message
};

/// Publishes what an MCAP file holds at the intervals of its recording, as a participant of no suite. Never
/// into the domain of the running suite. @return exit code
int play_mcap(const Target& target, const McapPlay& play);

}  // namespace srfs::tool
