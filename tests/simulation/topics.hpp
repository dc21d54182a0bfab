// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <srfs_msgs/msg/bus_status.hpp>
#include <srfs_msgs/msg/event.hpp>
#include <srfs_msgs/msg/payload_telemetry.hpp>
#include <srfs_msgs/msg/peripheral_reset.hpp>
#include <srfs_msgs/msg/system_mode.hpp>
#include <srfs_msgs/msg/task_flags.hpp>
#include <srfs_msgs/msg/telecommand.hpp>
#include <srfs_msgs/msg/telecommand_report.hpp>
#include <srfs_msgs/msg/time_tick.hpp>

#include "msgs/mission/encoded_event.hpp"
#include "tests/simulation/process.hpp"

namespace srfs::simulation {

/// The suite's topics (lib/suite/topics.hpp: names and depths), played.
struct Topics {
  Topics(Kernel& kernel, Network& network)
      : time_tick(kernel, network, "tick", 4),
        task_flags(kernel, network, "task flags", 4),
        bus_status(kernel, network, "bus status", 16),
        reset_peripheral(kernel, network, "reset peripheral", 8),
        telecommand(kernel, network, "telecommand", 32),
        telecommand_report(kernel, network, "telecommand report", 64),
        event(kernel, network, "event", 32),
        telemetry(kernel, network, "telemetry", 32),
        mode(kernel, network, "mode", 1) {}

  Topic<srfs_msgs::msg::TimeTick> time_tick;
  Topic<srfs_msgs::msg::TaskFlags> task_flags;
  Topic<srfs_msgs::msg::BusStatus> bus_status;
  Topic<srfs_msgs::msg::PeripheralReset> reset_peripheral;
  Topic<srfs_msgs::msg::Telecommand> telecommand;
  Topic<srfs_msgs::msg::TelecommandReport> telecommand_report;
  Topic<srfs_msgs::msg::Event> event;
  Topic<srfs_msgs::msg::PayloadTelemetry> telemetry;  ///< of all nodes
  Topic<srfs_msgs::msg::SystemMode> mode;
};

/// As Node::raise_event() does.
inline void publish_event(Topics& topics, Host& host, const EncodedEvent& event) {
  srfs_msgs::msg::Event m;
  m.source = host.name();
  m.event_id = event.id;
  m.severity = event.severity;
  m.data = event.data;
  topics.event.publish(host, std::move(m));
}

}  // namespace srfs::simulation
