// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_acquisition/capture_scheduler.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace srfs {

namespace failure = mission::failure;
using mission::CameraState;
using Actions = CaptureScheduler::Actions;

namespace {

constexpr const char* ended_by_mode = "not in this mode";

}  // namespace

void CaptureScheduler::configure(std::string camera_problem) {
  const auto counters = counters_;
  const Settings settings = settings_;
  const bool rests = rests_;
  *this = CaptureScheduler();
  counters_ = counters;
  settings_ = settings;
  rests_ = rests;
  counters_.camera_state = CameraState::closed;
  has_camera_ = camera_problem.empty();
  camera_problem_ = has_camera_ ? "closed" : std::move(camera_problem);
}

Actions CaptureScheduler::activate(MonotonicTime now) {
  active_ = true;
  camera_was_lost_ = false;
  next_open_ = now;
  return {DriveSoon{}};
}

Actions CaptureScheduler::deactivate(const std::string& reason) {
  const bool was_active = std::exchange(active_, false);
  if (current_) waiting_.push_back(*std::exchange(current_, std::nullopt));
  for (Task& task : waiting_) {
    if (!task.end.failure) task.end.failure = CaptureFailure{failure::camera_absent, reason};
    end_task(task);
  }
  waiting_.clear();
  wake_.reset();
  actions_.emplace_back(WakeAt{});
  if (was_active && has_camera_) {
    counters_.camera_state = CameraState::closed;
    camera_problem_ = "closed";
    closes_behind_open_ = is_opening_;
    ask_camera(CloseCamera{});
  }
  return take_actions();
}

// ---------------------------------------------------------------- goals

std::optional<CaptureFailure> CaptureScheduler::why_refused(const CaptureRequest& request,
                                                            const CaptureTime& time) const {
  if (!active_) return CaptureFailure{failure::camera_absent, "the node is not active"};
  if (rests_) return CaptureFailure{failure::wrong_mode, ended_by_mode};
  if (!has_camera_) return CaptureFailure{failure::camera_absent, camera_problem_};
  if (!store_problem_.empty()) return CaptureFailure{failure::disk_failed, store_problem_};
  if (auto refused = refuse(request)) return refused;
  const auto same = [&](const Task& task) { return task.request.task == request.task; };
  if ((current_ && same(*current_)) || std::any_of(waiting_.begin(), waiting_.end(), same))
    return CaptureFailure{failure::task_exists, fmt::format("task {} is in progress", request.task)};
  if (request.start && time.utc) return refuse_past(*request.start, *time.utc, nanoseconds(0));
  return std::nullopt;
}

Actions CaptureScheduler::on_goal(CaptureGoal goal, const CaptureRequest& request, const CaptureTime& time) {
  ++counters_.tasks;
  if (auto why = why_refused(request, time)) {
    ++counters_.tasks_failed;
    return {RefuseGoal{goal, std::move(*why)}};
  }
  waiting_.emplace_back(goal, request, time.now);
  return {DriveSoon{}};
}

Actions CaptureScheduler::rest(bool rests) {
  rests_ = rests;
  if (!rests_) return {};
  if (current_ && !current_->end.failure) current_->end.failure = {failure::wrong_mode, ended_by_mode};
  for (Task& task : waiting_) {
    task.end.failure = {failure::wrong_mode, ended_by_mode};
    end_task(task);
  }
  waiting_.clear();
  Actions actions = take_actions();
  if (current_) actions.emplace_back(DriveSoon{});
  return actions;
}

void CaptureScheduler::on_cancel(CaptureGoal goal) {
  if (Task* task = find(goal)) task->is_canceled = true;
}

CaptureScheduler::Task* CaptureScheduler::find(CaptureGoal goal) {
  if (current_ && current_->goal == goal) return &*current_;
  const auto found =
      std::find_if(waiting_.begin(), waiting_.end(), [&](const Task& task) { return task.goal == goal; });
  return found == waiting_.end() ? nullptr : &*found;
}

void CaptureScheduler::end_task(Task& task) {
  task.end.start_error_us = task.sequence.largest_start_error_us();
  task.end.canceled = task.is_canceled;
  counters_.tasks_failed += task.end.failure || task.end.canceled ? 1 : 0;
  actions_.emplace_back(EndGoal{task.goal, std::move(task.end)});
}

/// @return nothing while its time is not known
std::optional<MonotonicTime> CaptureScheduler::due_of(const Task& task, const CaptureTime& time) {
  if (!task.request.start) return task.accepted;
  if (!time.utc) return std::nullopt;
  return time.now + (*task.request.start - *time.utc);
}

/// Ends what was cancelled and what is too late.
void CaptureScheduler::sort_out_waiting(const CaptureTime& time) {
  for (auto task = waiting_.begin(); task != waiting_.end();) {
    if (task->request.start && time.utc)
      task->end.failure = refuse_past(*task->request.start, *time.utc, settings_.latest_start);
    if (!task->end.failure && !task->is_canceled) {
      ++task;
    } else {
      end_task(*task);
      task = waiting_.erase(task);
    }
  }
}

void CaptureScheduler::choose_task(const CaptureTime& time) {
  std::optional<MonotonicTime> earliest;
  auto chosen = waiting_.end();
  for (auto at = waiting_.begin(); at != waiting_.end(); ++at) {
    const auto due = due_of(*at, time);
    if (!due || (earliest && *earliest <= *due)) continue;
    earliest = due;
    chosen = at;
  }
  if (!earliest) return;
  if (*earliest - prelude > time.now) {
    wake_ = *earliest - prelude;
    return;
  }
  current_ = std::move(*chosen);
  waiting_.erase(chosen);
  current_->start = *earliest;
  actions_.emplace_back(ExecuteGoal{current_->goal});
}

// ---------------------------------------------------------------- what comes next

Actions CaptureScheduler::drive(const CaptureTime& time) {
  if (!active_) return take_actions();
  wake_.reset();
  sort_out_waiting(time);
  if (!current_) choose_task(time);
  while (current_ && finish_current()) choose_task(time);
  if (current_) drive_current(time);
  review_camera(time.now);
  actions_.emplace_back(WakeAt{wake_});
  return take_actions();
}

/// Opens a camera that is not open, not too often.
void CaptureScheduler::review_camera(MonotonicTime now) {
  const bool is_open =
      counters_.camera_state == CameraState::ready || counters_.camera_state == CameraState::exposing;
  if (camera_jobs_ > 0 || !has_camera_ || is_open) return;
  if (next_open_ > now) {
    wake_ = std::min(wake_.value_or(next_open_), next_open_);
  } else {
    is_opening_ = true;
    ask_camera(OpenCamera{});
  }
}

bool CaptureScheduler::finish_current() {
  Task& task = *current_;
  const bool over = task.end.failure || task.is_canceled || task.sequence.all_taken();
  if (!over || camera_jobs_ > 0 || task.uses_camera || task.storing > 0) return false;
  end_task(task);
  current_.reset();
  return true;
}

void CaptureScheduler::drive_current(const CaptureTime& time) {
  Task& task = *current_;
  if (camera_jobs_ > 0) return;  // its end drives again
  if (task.end.failure || task.is_canceled || task.sequence.all_taken()) {
    if (task.uses_camera) leave_camera();
    return;
  }
  if (counters_.camera_state == CameraState::lost || counters_.camera_state == CameraState::closed) {
    await_camera(time.now);
    return;
  }
  task.camera_deadline.reset();
  switch (task.phase) {
    case Phase::unprepared:
      return prepare_in_time(time.now);
    case Phase::prepared:
      return expose(time.now);
    case Phase::exposing:
      return ask_camera(TakeFrame{});
  }
}

void CaptureScheduler::await_camera(MonotonicTime now) {
  Task& task = *current_;
  if (!task.camera_deadline) task.camera_deadline = now + camera_patience;
  if (*task.camera_deadline > now) return;
  task.end.failure = CaptureFailure{failure::camera_absent, camera_problem_};
  actions_.emplace_back(DriveSoon{});
}

void CaptureScheduler::prepare_in_time(MonotonicTime now) {
  Task& task = *current_;
  const auto after_start = task.sequence.due();
  const bool begun = task.sequence.next() > 0;
  const MonotonicTime due = begun && after_start ? task.start + *after_start : now;
  if (due - prelude <= now) return ask_camera(PrepareCamera{{task.request.exposure, task.request.gain_db}});
  if (task.uses_camera && due - pause > now) return leave_camera();
  wake_ = due - prelude;
}

void CaptureScheduler::expose(MonotonicTime now) {
  Task& task = *current_;
  if (task.storing >= storing_max) return;  // the end of a write drives again
  const bool first = task.sequence.next() == 0 && task.sequence.tries() == 0;
  if (first && !task.request.start) task.start = now;
  if (first && task.start + settings_.latest_start < now) {
    task.end.failure = CaptureFailure{failure::capture_time_past, "the camera was not ready in time"};
    actions_.emplace_back(DriveSoon{});
    return;
  }
  const auto after_start = task.sequence.due();
  task.due = after_start ? task.start + *after_start : now;
  if (task.due - lead > now) {
    wake_ = task.due - lead;
  } else {
    ask_camera(BeginExposure{task.due});
  }
}

// ---------------------------------------------------------------- camera

template <class Action>
void CaptureScheduler::ask_camera(Action action) {
  ++camera_jobs_;
  asker_ = current_ ? std::optional(current_->goal) : std::nullopt;
  actions_.emplace_back(std::move(action));
}

CaptureScheduler::Task* CaptureScheduler::answered() {
  --camera_jobs_;
  return current_ && asker_ == current_->goal ? &*current_ : nullptr;
}

Actions CaptureScheduler::on_opened(const Result<std::string, hw::CameraFault>& opened,
                                    const CaptureTime& time) {
  (void)answered();
  is_opening_ = false;
  next_open_ = time.now + reopen_interval;
  const bool is_closed_again = std::exchange(closes_behind_open_, false);
  if (!active_) return take_actions();
  if (is_closed_again) return drive(time);
  if (!opened) {
    camera_lost(opened.error().reason);
    return drive(time);
  }
  if (std::exchange(camera_was_lost_, false)) ++counters_.camera_reopened;
  counters_.camera_state = CameraState::ready;
  camera_name_ = *opened;
  frame_check_.forget();
  actions_.emplace_back(ReportCameraReady{camera_name_});
  return drive(time);
}

void CaptureScheduler::camera_lost(const std::string& why) {
  camera_problem_ = why;
  counters_.camera_state = CameraState::lost;
  if (std::exchange(camera_was_lost_, true)) return;  // reported already
  actions_.emplace_back(ReportCameraLost{why});
}

Actions CaptureScheduler::on_prepared(const Result<void, hw::CameraFault>& prepared,
                                      const CaptureTime& time) {
  if (Task* task = answered()) {
    if (prepared) {
      task->phase = Phase::prepared;
      task->uses_camera = true;
    } else {
      on_fault(prepared.error(), time.now);
    }
  }
  return drive(time);
}

Actions CaptureScheduler::on_begun(MonotonicTime begun, const Result<void, hw::CameraFault>& result,
                                   const CaptureTime& time) {
  if (Task* task = answered()) {
    if (result) {
      counters_.camera_state = CameraState::exposing;
      task->phase = Phase::exposing;
      task->begun = begun;
      task->frame_deadline = begun + task->request.exposure + settings_.frame_patience;
    } else {
      on_fault(result.error(), time.now);
    }
  }
  return drive(time);
}

Actions CaptureScheduler::on_taken(Result<std::optional<hw::CameraFrame>, hw::CameraFault> taken,
                                   const CaptureTime& time) {
  if (Task* task = answered()) {
    if (!taken) {
      on_fault(taken.error(), time.now);
    } else if (*taken) {
      on_frame(std::move(**taken));
    } else if (time.now >= task->frame_deadline) {
      on_unsound("no frame received");
    }
  }
  return drive(time);
}

Actions CaptureScheduler::on_camera_done(const CaptureTime& time) {
  (void)answered();
  return drive(time);
}

/// No frame is waited for any longer.
void CaptureScheduler::leave_camera() {
  current_->phase = Phase::unprepared;
  current_->uses_camera = false;
  if (counters_.camera_state == CameraState::exposing) counters_.camera_state = CameraState::ready;
  ask_camera(AbandonFrame{});
}

void CaptureScheduler::on_fault(const hw::CameraFault& fault, MonotonicTime now) {
  current_->phase = Phase::unprepared;
  switch (fault.kind) {
    case hw::CameraFault::Kind::bad_setting:
      current_->end.failure = CaptureFailure{failure::bad_camera_setting, fault.reason};
      return;
    case hw::CameraFault::Kind::absent:
      camera_lost(fault.reason);
      next_open_ = now;
      break;
    case hw::CameraFault::Kind::unsound:
      break;
  }
  on_unsound(fault.reason);
}

void CaptureScheduler::on_unsound(const std::string& why) {
  Task& task = *current_;
  ++counters_.frames_lost;
  actions_.emplace_back(
      ReportLostFrame{task.request.task, task.sequence.next() + 1, task.sequence.tries() + 1, why});
  task.phase = Phase::unprepared;
  if (counters_.camera_state == CameraState::exposing) leave_camera();
  if (task.sequence.on_unsound()) return;
  const bool absent = counters_.camera_state == CameraState::lost;
  task.end.failure = CaptureFailure{absent ? failure::camera_absent : failure::camera_failed,
                                    fmt::format("frame {}: {}", task.sequence.next() + 1, why)};
}

void CaptureScheduler::on_frame(hw::CameraFrame frame) {
  Task& task = *current_;
  if (const auto wrong = frame_check_.judge(frame, task.begun)) return on_unsound(*wrong);
  counters_.camera_state = CameraState::ready;
  task.phase = Phase::unprepared;
  const std::int32_t error_us = start_error_us(frame.begin, task.due);
  counters_.start_error_us = error_us;
  task.sequence.on_sound(error_us);
  ++task.storing;
  ++frames_storing_;
  actions_.emplace_back(StoreFrame{std::make_shared<CapturedFrame>(
      CapturedFrame{task.goal, task.request.task, std::move(frame), error_us})});
}

// ---------------------------------------------------------------- store

Actions CaptureScheduler::on_stored(const CapturedFrame& captured,
                                    const Result<std::string, CaptureFailure>& stored,
                                    const CaptureTime& time) {
  --frames_storing_;
  ++(stored ? counters_.frames : counters_.store_failures);
  if (Task* task = find(captured.goal)) {
    --task->storing;
    if (stored) {
      task->end.files.push_back(*stored);
      actions_.emplace_back(ReportProgress{task->goal, static_cast<std::uint16_t>(task->end.files.size()),
                                           *stored, captured.start_error_us});
    } else if (!task->end.failure) {
      task->end.failure = stored.error();
    }
  }
  return drive(time);
}

}  // namespace srfs
