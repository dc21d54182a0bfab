// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <optional>

#include <mission/structures.hpp>
#include <srfs_msgs/action/process_image.hpp>
#include <srfs_msgs/msg/image_detections.hpp>

#include "nodes/image_processing/image_task.hpp"
#include "suite/mission_time.hpp"
#include "suite/node.hpp"

namespace srfs {

/// Serves /image/process: one goal at a time on a worker, frame by frame, the others wait (README.md).
class ImageProcessingNode : public suite::Node {
 public:
  explicit ImageProcessingNode(suite::NodeContext& context);

  /// The step that ran at a deactivation, or a cleanup, has ended.
  [[nodiscard]] bool is_at_rest() const override;

  void on_mode_changed() override;

 protected:
  ros::CallbackReturn on_configure() override;
  ros::CallbackReturn on_deactivate() override;
  ros::CallbackReturn on_cleanup() override;
  ros::CallbackReturn on_shutdown() override { return on_cleanup(); }
  ros::CallbackReturn on_error() override { return on_cleanup(); }

 private:
  using Process = srfs_msgs::action::ProcessImage;
  using Goal = std::shared_ptr<ros::ServerGoal<Process>>;
  /// The store lives on the worker.
  using StoreSlot = std::shared_ptr<std::optional<ProductStore>>;
  struct Running {
    Goal goal;
    std::shared_ptr<ImageTask> task;
  };
  /// What a step left for the work thread.
  struct Step {
    StepReport report;
    nanoseconds took{0};
    std::uint64_t store_octets = 0;
  };

  [[nodiscard]] bool open_store();
  void on_goal(Goal goal);
  ros::CancelResponse on_cancel(const Goal& goal);
  void begin_next();
  void begin(const Goal& goal);
  void post_step();
  void on_step(const std::shared_ptr<ImageTask>& task, const Step& step);
  void publish(const ImageTask& task, const FrameReport& frame);
  void end_running();
  void count(const ImageTask& task);
  void raise_events(const ImageTask& task);
  [[nodiscard]] Process::Result result_of(const ImageTask& task) const;
  void abort(const Goal& goal, std::uint16_t code, const std::string& reason);
  void abort_all(std::uint16_t code, const std::string& reason);
  void publish_housekeeping();

  std::shared_ptr<ros::Worker> worker_;  ///< from the first configuring on
  StoreSlot store_;
  std::shared_ptr<ros::ActionServer<Process>> server_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::ImageDetections>> detections_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::TimeTick>> ticks_;
  ros::Timer housekeeping_timer_;
  suite::MissionTime time_;
  std::deque<Goal> waiting_;  // as many as the action server lets in
  std::optional<Running> running_;
  bool keeps_frames_ = false;  ///< memory of a task that ended
  mission::ImageProcessingHousekeeping counters_;
};

}  // namespace srfs
