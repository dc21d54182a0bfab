// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <srfs_msgs/action/capture_image.hpp>

#include <mission/structures.hpp>

#include "hw/camera/camera.hpp"
#include "nodes/image_acquisition/capture_sequence.hpp"
#include "nodes/image_acquisition/frame_check.hpp"
#include "nodes/image_acquisition/frame_header.hpp"
#include "nodes/image_acquisition/frame_store.hpp"
#include "ros/image_topics.hpp"
#include "ros/mission_time.hpp"
#include "ros/node.hpp"

namespace srfs {

/// Takes frames at the commanded UTC, stores and publishes them (README.md). The camera is one worker's, the
/// store another's: the work thread decides what comes next and waits for neither.
class ImageAcquisitionNode : public ros::LifecycleNode {
 public:
  using CameraOpener = std::function<Result<std::unique_ptr<hw::Camera>, hw::HwError>(
      std::string_view uri, const std::filesystem::path& var_dir)>;

  explicit ImageAcquisitionNode(ros::NodeContext& context, CameraOpener open_camera = hw::open_camera);

  /// The last job of a deactivation has ended: the camera is closed, all frames are on the disk.
  [[nodiscard]] bool is_at_rest() const override { return camera_jobs_ == 0 && frames_storing_ == 0; }

 protected:
  ros::CallbackReturn on_configure() override;
  ros::CallbackReturn on_activate() override;
  ros::CallbackReturn on_deactivate() override;
  ros::CallbackReturn on_cleanup() override;
  ros::CallbackReturn on_shutdown() override;
  ros::CallbackReturn on_error() override;

 private:
  using Capture = srfs_msgs::action::CaptureImage;
  using Goal = std::shared_ptr<ros::ServerGoal<Capture>>;

  /// How far the next frame is.
  enum class Phase : std::uint8_t { unprepared, prepared, exposing };

  /// A goal from its acceptance to its end.
  struct Task {
    Task(Goal its_goal, const CaptureRequest& its_request, MonotonicTime at)
        : goal(std::move(its_goal)),
          request(its_request),
          sequence(its_request.frames, its_request.interval),
          accepted(at) {}
    Goal goal;
    CaptureRequest request;
    CaptureSequence sequence;
    MonotonicTime accepted;
    MonotonicTime start;  ///< when its first exposure is due; known from when its turn comes
    Phase phase = Phase::unprepared;
    bool uses_camera = false;  ///< it was prepared for this task, and may stream
    MonotonicTime due;         ///< of the exposure under way
    MonotonicTime begun;       ///< asked for
    MonotonicTime frame_deadline;
    std::optional<MonotonicTime> camera_deadline;  ///< while the camera is away
    std::size_t storing = 0;
    std::optional<CaptureFailure> failure;
    Capture::Result result;
  };
  using TaskPointer = std::shared_ptr<Task>;
  struct TakenFrame {
    hw::CameraFrame frame;
    FrameFacts facts;
  };

  // Goals
  void on_goal(const Goal& goal);
  void refuse_goal(const Goal& goal, const CaptureFailure& failure);
  void end_task(const TaskPointer& task);
  void drop_tasks(const std::string& reason);
  [[nodiscard]] std::optional<MonotonicTime> due_of(const Task& waiting) const;
  void sort_out_waiting();
  void choose_task();

  // What comes next
  void drive();
  void drive_soon();
  void drive_current();
  void wake_at(MonotonicTime at);
  void expose();

  // Camera's worker
  /// Runs @p job there, then @p done and drive() here, unless the node was cleaned up. The queue holds all
  /// that is ever asked of it.
  void on_camera(std::function<void()> job, std::function<void()> done);
  void open_camera();
  void close_camera();
  void prepare_in_time();
  void prepare();
  void take();
  void leave_camera();
  void on_fault(const TaskPointer& task, const hw::CameraFault& fault);
  void on_unsound(const TaskPointer& task, const std::string& why);
  void on_frame(const TaskPointer& task, hw::CameraFrame frame);
  void camera_lost(const std::string& why);

  // Store's worker
  void open_store();
  void open_store_later();
  void on_store_opened(const Result<void, FileError>& opened);
  void store(const TaskPointer& task, TakenFrame taken);
  void on_stored(const TaskPointer& task, const std::string& file, const TakenFrame& taken);
  void on_store_failure(const TaskPointer& task, const FrameStore::Failure& failure);
  void publish_frame(const std::string& file, const TakenFrame& taken);

  void on_adcs_telemetry(const srfs_msgs::msg::PayloadTelemetry& m);
  void publish_housekeeping();
  void release();

  CameraOpener open_camera_;
  ros::MissionTime time_;
  std::optional<FrameFacts::Attitude> attitude_;
  MonotonicTime attitude_at_;

  // Both workers' own; they end before these do.
  std::unique_ptr<hw::Camera> camera_;
  std::unique_ptr<FrameStore> store_;
  std::shared_ptr<ros::Worker> camera_worker_;
  std::shared_ptr<ros::Worker> store_worker_;

  mission::CameraState camera_state_ = mission::CameraState::closed;
  bool camera_was_lost_ = false;
  std::string camera_name_;
  std::string camera_problem_;
  std::size_t camera_jobs_ = 0;
  std::size_t frames_storing_ = 0;
  FrameCheck frame_check_;
  MonotonicTime next_open_;

  std::vector<TaskPointer> waiting_;
  TaskPointer current_;
  bool keeps_frames_ = false;  ///< memory of a task that ended

  std::string store_problem_;  ///< nothing is taken while it cannot be read
  StoreFigures store_figures_;
  mission::ImageAcquisitionHousekeeping counters_;

  std::shared_ptr<ros::Publisher<sensor_msgs::msg::Image>> images_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::TimeTick>> ticks_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::PayloadTelemetry>> adcs_;
  std::shared_ptr<ros::ActionServer<Capture>> server_;
  ros::Timer wake_;
  ros::Timer soon_;
  ros::Timer store_retry_;
  ros::Timer housekeeping_;
};

}  // namespace srfs
