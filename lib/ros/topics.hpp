// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <rcl_interfaces/msg/log.hpp>
#include <rcl_interfaces/msg/parameter_event.hpp>

#include "ros/qos.hpp"

namespace srfs::ros {

/// Which callbacks the work thread runs first when several are due.
enum class Priority : std::uint8_t { liveness = 0, time = 1, normal = 2, bulk = 3 };

/// What limited members (datagram_seal.hpp) may publish on a topic that is not below their own name.
template <class M>
struct OfLimited {
  bool all = false;                  ///< whatever they like
  std::string M::*author = nullptr;  ///< what bears their own name here; with neither: nothing
};

/// Name, type and QoS of a topic.
template <class M>
struct Topic {
  using Message = M;
  std::string name;
  Qos qos;
  Priority priority = Priority::normal;
  OfLimited<M> of_limited = {};
};

/// Those of every node of ROS 2.
namespace topics {

// ROS 2 keeps 1000 lines for late readers; 100 are enough to see why a node is as it is and bound the memory
// of a node to 0.15 MB (a line is 1.2 KB at most). Depth is no part of what must agree between writer and
// reader.
inline const Topic<rcl_interfaces::msg::Log> rosout{
    "/rosout",
    {.depth = 100, .transient_local = true, .lifespan = std::chrono::seconds(10)},
    Priority::bulk,
    {.author = &rcl_interfaces::msg::Log::name}};
inline const Topic<rcl_interfaces::msg::ParameterEvent> parameter_events{
    "/parameter_events", {.depth = 100}, Priority::bulk, {.all = true}};

}  // namespace topics
}  // namespace srfs::ros
