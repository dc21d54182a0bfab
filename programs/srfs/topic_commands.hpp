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

struct GraphOrder {
  std::string node;           ///< full name or its last part; empty: all
  std::optional<int> domain;  ///< nullopt: that of the running suite
  milliseconds wait{1500};    ///< so long it listens
};

/// Prints the nodes of a domain with their topics (and the QoS of each end), services and actions, also those
/// of other programs, and last the ends of no node. @return exit code: 1: no such node, or no domain
int show_graph(const Target& target, const GraphOrder& order, bool json);

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
