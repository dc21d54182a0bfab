// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <mission/structures.hpp>

#include "base/result.hpp"
#include "base/time.hpp"
#include "hw/camera/camera.hpp"
#include "nodes/image_acquisition/capture_sequence.hpp"
#include "nodes/image_acquisition/frame_check.hpp"

namespace srfs {

/// A goal of this process, by the order of arrival.
using CaptureGoal = std::uint64_t;

/// The time of an input.
struct CaptureTime {
  MonotonicTime now;
  std::optional<UtcTime> utc;  ///< at the same instant; nothing: mission time is not valid
};

/// The result of a task.
struct CaptureEnd {
  std::vector<std::string> files;  ///< stored, below the folder of images
  std::int32_t start_error_us = 0;
  std::optional<CaptureFailure> failure;
  bool canceled = false;
};

/// A sound frame, and what the schedule knows of it.
struct CapturedFrame {
  CaptureGoal goal = 0;
  std::uint32_t task = 0;
  hw::CameraFrame frame;
  std::int32_t start_error_us = 0;
};

// What the scheduler decides; carried out by the adapter in the given order. Each action on the camera is
// answered with the method named, in the order of the actions.

struct RefuseGoal {
  CaptureGoal goal = 0;
  CaptureFailure why;
};
/// Its turn has come.
struct ExecuteGoal {
  CaptureGoal goal = 0;
};
struct EndGoal {
  CaptureGoal goal = 0;
  CaptureEnd end;
};
/// on_opened()
struct OpenCamera {};
/// on_camera_done()
struct CloseCamera {};
/// The frame begun is not wanted. on_camera_done()
struct AbandonFrame {};
/// on_prepared()
struct PrepareCamera {
  hw::CameraSettings settings;
};
/// Waits until then, first. on_begun()
struct BeginExposure {
  MonotonicTime at;
};
/// on_taken(), with nothing after a while, so that a task can be ended meanwhile
struct TakeFrame {};
/// on_stored()
struct StoreFrame {
  std::shared_ptr<CapturedFrame> captured;
};
/// A frame is on the disk.
struct ReportProgress {
  CaptureGoal goal = 0;
  std::uint16_t frames_done = 0;
  std::string file;
  std::int32_t start_error_us = 0;
};
struct ReportCameraReady {
  std::string what;
};
struct ReportCameraLost {
  std::string why;
};
struct ReportLostFrame {
  std::uint32_t task = 0;
  int frame = 1;
  int attempt = 1;
  std::string why;
};
/// Call drive() then; nothing: no earlier than the next input.
struct WakeAt {
  std::optional<MonotonicTime> at;
};
/// Call drive() as soon as what is under way now has ended: the client of a goal is answered first.
struct DriveSoon {};

using CaptureAction = std::variant<RefuseGoal, ExecuteGoal, EndGoal, OpenCamera, CloseCamera, AbandonFrame,
                                   PrepareCamera, BeginExposure, TakeFrame, StoreFrame, ReportProgress,
                                   ReportCameraReady, ReportCameraLost, ReportLostFrame, WakeAt, DriveSoon>;

/// Which task has the camera and what it does next: opens it and opens it again, waits for the start of a
/// task, prepares, exposes, takes, hands over to the disk. One task at a time, the earliest first. Pure. What
/// always holds: the camera does one thing at a time, each goal is refused or ended once, frames of a task
/// come in order, and no more than `storing_max` wait for the disk.
class CaptureScheduler {
 public:
  using Actions = std::vector<CaptureAction>;

  struct Settings {
    nanoseconds latest_start = seconds(1);    ///< a task that cannot begin so soon after its start time fails
    nanoseconds frame_patience = seconds(3);  ///< a frame that is so late after its exposure is lost
  };
  static constexpr nanoseconds prelude = milliseconds(500);  ///< of a task: the camera is prepared
  static constexpr nanoseconds pause = seconds(2);       ///< between frames: the camera need not stream then
  static constexpr nanoseconds lead = milliseconds(20);  ///< BeginExposure waits out the rest by itself
  static constexpr nanoseconds reopen_interval = milliseconds(500);
  static constexpr nanoseconds camera_patience = seconds(5);  ///< of a task while the camera is away
  static constexpr std::size_t storing_max = 2;

  /// Starts anew with the camera closed; the counters go on.
  /// @param camera_problem  why there is no camera; empty: there is one
  void configure(std::string camera_problem);
  void set(const Settings& settings) { settings_ = settings; }
  [[nodiscard]] Actions activate(MonotonicTime now);
  /// Ends all tasks. Frames that were taken are stored all the same.
  [[nodiscard]] Actions deactivate(const std::string& reason);
  /// Frames cannot be stored for this reason, so nothing is taken; empty: they can.
  void set_store_problem(std::string why) { store_problem_ = std::move(why); }
  /// The mode allows no tasks: those that there are end, the running one behind its frame, and none begins.
  /// @param rests  or no more
  [[nodiscard]] Actions rest(bool rests);

  [[nodiscard]] Actions on_goal(CaptureGoal goal, const CaptureRequest& request, const CaptureTime& time);
  void on_cancel(CaptureGoal goal);
  /// What is due now; harmless at any time.
  [[nodiscard]] Actions drive(const CaptureTime& time);

  [[nodiscard]] Actions on_opened(const Result<std::string, hw::CameraFault>& opened,
                                  const CaptureTime& time);
  [[nodiscard]] Actions on_prepared(const Result<void, hw::CameraFault>& prepared, const CaptureTime& time);
  /// @param begun  when the exposure was asked for
  [[nodiscard]] Actions on_begun(MonotonicTime begun, const Result<void, hw::CameraFault>& result,
                                 const CaptureTime& time);
  [[nodiscard]] Actions on_taken(Result<std::optional<hw::CameraFrame>, hw::CameraFault> taken,
                                 const CaptureTime& time);
  [[nodiscard]] Actions on_camera_done(const CaptureTime& time);
  /// @param stored  its file
  [[nodiscard]] Actions on_stored(const CapturedFrame& captured,
                                  const Result<std::string, CaptureFailure>& stored, const CaptureTime& time);

  /// The camera has nothing to do, and all frames are on the disk.
  [[nodiscard]] bool is_at_rest() const { return camera_jobs_ == 0 && frames_storing_ == 0; }
  /// No task has the camera.
  [[nodiscard]] bool is_idle() const { return !current_; }
  [[nodiscard]] bool has_waiting() const { return !waiting_.empty(); }
  /// As reported by the camera that was opened last.
  [[nodiscard]] const std::string& camera_name() const { return camera_name_; }
  /// The scheduler's part of the housekeeping.
  [[nodiscard]] const mission::ImageAcquisitionHousekeeping& counters() const { return counters_; }

 private:
  /// How far the next frame is.
  enum class Phase : std::uint8_t { unprepared, prepared, exposing };
  struct Task {
    Task(CaptureGoal its_goal, const CaptureRequest& its_request, MonotonicTime at)
        : goal(its_goal),
          request(its_request),
          sequence(its_request.frames, its_request.interval),
          accepted(at) {}
    CaptureGoal goal;
    CaptureRequest request;
    CaptureSequence sequence;
    MonotonicTime accepted;
    MonotonicTime start;  ///< when its first exposure is due; known from when its turn comes
    Phase phase = Phase::unprepared;
    bool uses_camera = false;  ///< it was prepared for this task, and may stream
    bool is_canceled = false;
    MonotonicTime due;    ///< of the exposure under way
    MonotonicTime begun;  ///< asked for
    MonotonicTime frame_deadline;
    std::optional<MonotonicTime> camera_deadline;  ///< while the camera is away
    std::size_t storing = 0;
    CaptureEnd end;
  };

  [[nodiscard]] std::optional<CaptureFailure> why_refused(const CaptureRequest& request,
                                                          const CaptureTime& time) const;
  [[nodiscard]] static std::optional<MonotonicTime> due_of(const Task& waiting, const CaptureTime& time);
  [[nodiscard]] Task* find(CaptureGoal goal);
  void end_task(Task& task);
  void sort_out_waiting(const CaptureTime& time);
  void choose_task(const CaptureTime& time);
  void drive_current(const CaptureTime& time);
  /// @return whether the task has ended
  bool finish_current();
  void await_camera(MonotonicTime now);
  void prepare_in_time(MonotonicTime now);
  void expose(MonotonicTime now);
  void review_camera(MonotonicTime now);
  template <class Action>
  void ask_camera(Action action);
  /// An answer of the camera. @return its task while that still has the camera
  [[nodiscard]] Task* answered();
  void leave_camera();
  void camera_lost(const std::string& why);
  void on_fault(const hw::CameraFault& fault, MonotonicTime now);
  void on_unsound(const std::string& why);
  void on_frame(hw::CameraFrame frame);
  [[nodiscard]] Actions take_actions() { return std::exchange(actions_, {}); }

  bool has_camera_ = true;
  Settings settings_;
  bool active_ = false;
  bool rests_ = false;
  std::string camera_problem_;
  std::string camera_name_;
  bool is_opening_ = false;
  bool closes_behind_open_ = false;  ///< it was deactivated meanwhile: what is opened is closed again
  bool camera_was_lost_ = false;
  std::size_t camera_jobs_ = 0;
  std::optional<CaptureGoal> asker_;  ///< the task that had the camera when it was asked last
  std::size_t frames_storing_ = 0;
  FrameCheck frame_check_;
  MonotonicTime next_open_;
  std::vector<Task> waiting_;
  std::optional<Task> current_;
  std::string store_problem_;
  std::optional<MonotonicTime> wake_;
  mission::ImageAcquisitionHousekeeping counters_;
  Actions actions_;
};

}  // namespace srfs
