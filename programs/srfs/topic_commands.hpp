// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "programs/srfs/suite.hpp"

namespace srfs::tool {

/// Prints every topic of a domain with type, number of publishers and subscriptions, and QoS, also those of
/// other programs. Listens for @p wait. @param domain nullopt: that of the running suite @return exit code
int show_topics(const Target& target, std::optional<int> domain, milliseconds wait, bool json);

struct TopicEcho {
  std::string topic;                    ///< ROS name
  std::optional<int> domain;            ///< nullopt: that of the running suite
  std::uint64_t count = 0;              ///< messages, then it ends; 0: until SIGINT or SIGTERM
  seconds patience{10};                 ///< for the first message and between two
  std::size_t most = 64;                ///< elements of an array that are shown
  std::vector<std::string> interfaces;  ///< folders with definitions (definition_folders.hpp)
};

/// Prints each message of a topic of any type as a JSON object in one line. Listens only. Samples above 1 MiB
/// are dropped. @return exit code: 0: as many as were wanted, or ended after one at least; 1: nobody
/// publishes it, its type is not known, or a message did not come in time
int echo_topic(const Target& target, const TopicEcho& echo);

}  // namespace srfs::tool
