// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "ros/endpoint.hpp"
#include "ros/executor.hpp"
#include "ros/node_names.hpp"
#include "ros/participant.hpp"

namespace srfs::ros {

/// Puts a process' node and its endpoints into the ROS graph (`ros_discovery_info`), so that `ros2 node
/// list`, `node info`, `lifecycle` and `param` find it. Publishes the whole state once per turn of the work
/// thread in which an endpoint came or went. Writes only: no node needs the graph of the others. Work thread.
class GraphPublisher {
 public:
  /// @param dialect off: does nothing
  GraphPublisher(Executor& executor, Participant& participant, GraphDialect dialect, const NodeNames& node);
  /// Takes the node out of the graph.
  ~GraphPublisher();
  GraphPublisher(const GraphPublisher&) = delete;
  GraphPublisher& operator=(const GraphPublisher&) = delete;

 private:
  void publish();

  Executor& executor_;
  Participant& participant_;
  const GraphDialect dialect_;
  std::unique_ptr<WriterEndpoint> writer_;
  Timer due_;
};

}  // namespace srfs::ros
