// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

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

#include "ros/topics.hpp"

namespace srfs::suite {

/// Every topic of the suite stands here, once. On those with `author` or `all` uplinked nodes may publish,
/// too; on the others a node that is not confined to itself alone (threat_model.md).
namespace topics {

namespace m = srfs_msgs::msg;

inline const ros::Topic<m::TimeTick> time_tick{"/timing/tick", {.depth = 4}, ros::Priority::time};
inline const ros::Topic<m::TaskFlags> task_flags{"/can/task_flags", {.depth = 4}, ros::Priority::time};
inline const ros::Topic<m::BusStatus> bus_status{
    "/can/bus_status", {.depth = 16}, ros::Priority::time, {.author = &m::BusStatus::payload}};
inline const ros::Topic<m::PeripheralReset> reset_peripheral{
    "/can/reset_peripheral", {.depth = 8}, ros::Priority::time};
inline const ros::Topic<m::Telecommand> telecommand{"/telecommand", {.depth = 32}, ros::Priority::normal};
inline const ros::Topic<m::TelecommandReport> telecommand_report{
    "/telecommand_report", {.depth = 64}, ros::Priority::normal, {.author = &m::TelecommandReport::node}};
inline const ros::Topic<m::Event> event{
    "/event", {.depth = 32}, ros::Priority::normal, {.author = &m::Event::source}};
// Nine observers a period; a reader that misses some sees the next.
inline const ros::Topic<m::LivenessReport> liveness{
    "/liveness", {.depth = 64}, ros::Priority::bulk, {.author = &m::LivenessReport::observer}};
inline const ros::Topic<m::SystemMode> mode{
    "/mode", {.depth = 1, .transient_local = true}, ros::Priority::normal};
// A sequence's frames are published together when all are known; the result shows what a reader missed.
inline const ros::Topic<m::ImageDetections> image_detections{
    "/image/detections", {.depth = 64}, ros::Priority::normal, {.all = true}};
/// @param node name without slash
inline ros::Topic<m::PayloadActivity> activity(const std::string& node) {
  return {"/" + node + "/activity", {.depth = 16}, ros::Priority::normal};
}
inline ros::Topic<m::PayloadTelemetry> telemetry(const std::string& node) {
  return {"/" + node + "/telemetry", {.depth = 32}, ros::Priority::normal};
}

}  // namespace topics
}  // namespace srfs::suite
