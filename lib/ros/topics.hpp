// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <rcl_interfaces/msg/log.hpp>
#include <rcl_interfaces/msg/parameter_event.hpp>
#include <srfs_msgs/msg/bus_status.hpp>
#include <srfs_msgs/msg/event.hpp>
#include <srfs_msgs/msg/image_detections.hpp>
#include <srfs_msgs/msg/liveness_report.hpp>
#include <srfs_msgs/msg/payload_activity.hpp>
#include <srfs_msgs/msg/payload_telemetry.hpp>
#include <srfs_msgs/msg/peripheral_reset.hpp>
#include <srfs_msgs/msg/system_mode.hpp>
#include <srfs_msgs/msg/task_flags.hpp>
#include <srfs_msgs/msg/telecommand.hpp>
#include <srfs_msgs/msg/telecommand_report.hpp>
#include <srfs_msgs/msg/time_tick.hpp>

#include "ros/qos.hpp"

namespace srfs::ros {

/// Which callbacks the work thread runs first when several are due.
enum class Priority : std::uint8_t { liveness = 0, time = 1, normal = 2, bulk = 3 };

/// Name, type and QoS of a topic.
template <class M>
struct Topic {
  using Message = M;
  std::string name;
  Qos qos;
  Priority priority = Priority::normal;
};

/// Every topic of the suite stands here, once.
namespace topics {

namespace m = srfs_msgs::msg;

inline const Topic<m::TimeTick> time_tick{"/timing/tick", {.depth = 4}, Priority::time};
inline const Topic<m::TaskFlags> task_flags{"/can/task_flags", {.depth = 4}, Priority::time};
inline const Topic<m::BusStatus> bus_status{"/can/bus_status", {.depth = 16}, Priority::time};
inline const Topic<m::PeripheralReset> reset_peripheral{
    "/can/reset_peripheral", {.depth = 8}, Priority::time};
inline const Topic<m::Telecommand> telecommand{"/telecommand", {.depth = 32}, Priority::normal};
inline const Topic<m::TelecommandReport> telecommand_report{
    "/telecommand_report", {.depth = 64}, Priority::normal};
inline const Topic<m::Event> event{"/event", {.depth = 32}, Priority::normal};
// Nine observers a period; a reader that misses some sees the next.
inline const Topic<m::LivenessReport> liveness{"/liveness", {.depth = 64}, Priority::bulk};
inline const Topic<m::SystemMode> mode{"/mode", {.depth = 1, .transient_local = true}, Priority::normal};
// A sequence's frames are published together when all are known; the result shows what a reader missed.
inline const Topic<m::ImageDetections> image_detections{"/image/detections", {.depth = 64}, Priority::normal};
// ROS 2 keeps 1000 lines for late readers; 100 are enough to see why a node is as it is and bound the memory
// of a node to 0.15 MB (a line is 1.2 KB at most). Depth is no part of what must agree between writer and
// reader.
inline const Topic<rcl_interfaces::msg::Log> rosout{
    "/rosout", {.depth = 100, .transient_local = true, .lifespan = std::chrono::seconds(10)}, Priority::bulk};
inline const Topic<rcl_interfaces::msg::ParameterEvent> parameter_events{
    "/parameter_events", {.depth = 100}, Priority::bulk};

/// @param node name without slash
inline Topic<m::PayloadActivity> activity(const std::string& node) {
  return {"/" + node + "/activity", {.depth = 16}, Priority::normal};
}
inline Topic<m::PayloadTelemetry> telemetry(const std::string& node) {
  return {"/" + node + "/telemetry", {.depth = 32}, Priority::normal};
}

}  // namespace topics
}  // namespace srfs::ros
