// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>

#include <srfs_msgs/action/capture_image.hpp>
#include <srfs_msgs/action/process_image.hpp>

#include "nodes/ttc/ttc_core.hpp"
#include "ros/action_client.hpp"
#include "ros/worker.hpp"
#include "suite/state_files.hpp"

namespace srfs {

/// The goals of the two imaging nodes, as ImagingScheduler wants them. On the work thread.
class ImagingGoals {
 public:
  template <class A>
  using Client = std::shared_ptr<ros::ActionClient<A>>;
  using Capture = srfs_msgs::action::CaptureImage;
  using Process = srfs_msgs::action::ProcessImage;

  /// @param small_files  reads which process each node is. @param answered  called after each answer.
  /// Scheduler and worker outlive this
  ImagingGoals(Client<Capture> capture, Client<Process> process, ImagingScheduler& scheduler,
               ros::Worker& small_files, suite::VarPaths var, std::function<void()> answered)
      : capture_{std::move(capture), {}},
        process_{std::move(process), {}},
        scheduler_(scheduler),
        small_files_(small_files),
        var_(std::move(var)),
        answered_(std::move(answered)) {}

  void carry_out(const ServeImaging& action);
  /// A restarted node forgets its goals; the middleware may need its lease to notice.
  void look_at_nodes();

 private:
  template <class A>
  struct Goals {
    Client<A> client;
    std::map<std::uint64_t, std::shared_ptr<ros::ClientGoal<A>>> under_way;  ///< by telecommand
  };
  template <class A>
  void send(Goals<A>& goals, ImageServer server, std::uint64_t id, const typename A::Goal& goal);
  template <class A>
  void serve(Goals<A>& goals, const ImagingOrder& order);

  Goals<Capture> capture_;
  Goals<Process> process_;
  ImagingScheduler& scheduler_;
  ros::Worker& small_files_;
  suite::VarPaths var_;
  std::function<void()> answered_;
};

}  // namespace srfs
