// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include <srfs_msgs/action/capture_image.hpp>

#include <mission/structures.hpp>

#include "base/action_queue.hpp"
#include "hw/camera/camera.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/image_acquisition/capture_scheduler.hpp"
#include "nodes/image_acquisition/frame_header.hpp"
#include "nodes/image_acquisition/frame_store.hpp"
#include "suite/image_topics.hpp"
#include "suite/mission_time.hpp"
#include "suite/node.hpp"

namespace srfs {

/// Takes frames at the commanded UTC, stores and publishes them (README.md). The camera is one worker's, the
/// store another's: the work thread decides what comes next and waits for neither.
class ImageAcquisitionNode : public suite::Node {
 public:
  using CameraOpener = std::function<Result<std::unique_ptr<hw::Camera>, hw::HwError>(
      std::string_view uri, const std::filesystem::path& var_dir)>;

  explicit ImageAcquisitionNode(suite::NodeContext& context, CameraOpener open_camera = hw::open_camera);

  /// The last job of a deactivation has ended: the camera is closed, all frames are on the disk.
  [[nodiscard]] bool is_at_rest() const override { return scheduler_.is_at_rest(); }

  void on_mode_changed() override;

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

  void on_goal(const Goal& goal);
  void drive();
  void take_settings();
  [[nodiscard]] CaptureTime time_now() const;
  void run(CaptureScheduler::Actions actions);
  void carry_out(const RefuseGoal& action);
  void carry_out(const ExecuteGoal& action);
  void carry_out(const EndGoal& action);
  void carry_out(const OpenCamera& action);
  void carry_out(const CloseCamera& action);
  void carry_out(const AbandonFrame& action);
  void carry_out(const PrepareCamera& action);
  void carry_out(const BeginExposure& action);
  void carry_out(const TakeFrame& action);
  void carry_out(const StoreFrame& action);
  void carry_out(const ReportProgress& action);
  void carry_out(const ReportCameraReady& action);
  void carry_out(const ReportCameraLost& action);
  void carry_out(const ReportLostFrame& action);
  void carry_out(const WakeAt& action);
  void carry_out(const DriveSoon& action);
  /// Runs @p job on the camera's worker, then @p answer here, whose actions are carried out.
  template <class Job, class Answer>
  void on_camera(Job job, Answer answer);

  // Store's worker
  void open_store();
  void open_store_later();
  void on_store_opened(const Result<void, FileError>& opened);
  void set_store_problem(const std::string& why);
  [[nodiscard]] FrameFacts facts_of(const CapturedFrame& captured) const;
  [[nodiscard]] Result<std::string, FrameStore::Failure> write_frame(const hw::CameraFrame& frame,
                                                                     FrameFacts facts);
  void on_written(const CapturedFrame& captured, const Result<std::string, FrameStore::Failure>& stored);
  void publish_frame(const std::string& file, const CapturedFrame& captured,
                     const std::optional<UtcTime>& begin);

  void find_attitude();
  void on_attitude(const mission::TelemetryPlace& place, const srfs_msgs::msg::PayloadTelemetry& m);
  void publish_housekeeping();
  void release();

  CameraOpener open_camera_;
  suite::MissionTime time_;
  std::optional<FrameFacts::Attitude> attitude_;
  MonotonicTime attitude_at_;

  // Both workers' own; they end before these do.
  std::unique_ptr<hw::Camera> camera_;
  std::unique_ptr<FrameStore> store_;
  std::shared_ptr<ros::Worker> camera_worker_;
  std::shared_ptr<ros::Worker> store_worker_;

  CaptureScheduler scheduler_;
  ActionQueue<CaptureAction> actions_;
  std::map<CaptureGoal, Goal> goals_;  ///< not ended
  CaptureGoal last_goal_ = 0;
  bool keeps_frames_ = false;  ///< memory of a task that ended

  std::string store_problem_;  ///< nothing is taken while it cannot be read
  std::uint32_t store_openings_failed_ = 0;
  StoreFigures store_figures_;

  std::shared_ptr<ros::Publisher<sensor_msgs::msg::Image>> images_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::TimeTick>> ticks_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::PayloadTelemetry>> attitude_telemetry_;
  std::shared_ptr<ros::ActionServer<Capture>> server_;
  ros::Timer wake_;
  ros::Timer soon_;
  ros::Timer store_retry_;
  ros::Timer housekeeping_;
};

}  // namespace srfs
