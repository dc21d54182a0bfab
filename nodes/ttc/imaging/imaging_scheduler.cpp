// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/imaging/imaging_scheduler.hpp"

#include <algorithm>
#include <array>

namespace srfs {
namespace {

constexpr std::array quarter_steps{25, 50, 75};
constexpr std::size_t why_octets = 120;  ///< of the event
constexpr std::string_view findings_file = "/findings.json";

}  // namespace

bool ImagingScheduler::provides(const mission::Command& command) const {
  return command.name == mission::ImageCapture::name || command.name == mission::ImageProcess::name ||
         command.name == mission::ImageCancel::name || command.name == mission::ImageSendFrame::name;
}

std::optional<Refusal> ImagingScheduler::why_refused(const Telecommand& telecommand) const {
  const std::string& name = telecommand.command->name;
  const bool flies = (lane_.acquisition || name != mission::ImageCapture::name) &&
                     (lane_.processing || name != mission::ImageProcess::name);
  if (flies) return std::nullopt;
  return Refusal{.code = mission::failure::unknown_node};
}

std::optional<ImagingScheduler::Task> ImagingScheduler::read(const Telecommand& telecommand,
                                                             MonotonicTime now) {
  const mission::Command& command = *telecommand.command;
  const OctetView arguments(telecommand.arguments);
  Task task;
  task.origin = telecommand.origin;
  task.expiry = now + command.timeout;
  if (command.name == mission::ImageCapture::name) {
    const auto capture = mission::ImageCapture::decode(arguments);
    if (!capture) return std::nullopt;
    task.settings = *capture;
    // 1970, as leap seconds are counted today.
    const UtcTime start = to_utc(capture->start);
    if (start.since_epoch() >= seconds(1)) task.start = start;
  } else if (command.name == mission::ImageProcess::name) {
    const auto process = mission::ImageProcess::decode(arguments);
    if (!process) return std::nullopt;
    task.kind = Kind::process;
    task.settings.task = process->task;
    task.settings.budget_octets = process->budget_octets;
    task.settings.method = process->method;
    task.settings.parameters = process->parameters;
  } else {
    const auto send = mission::ImageSendFrame::decode(arguments);
    if (!send) return std::nullopt;
    task.kind = Kind::send_frame;
    task.settings.task = send->task;
    task.settings.budget_octets = UINT32_MAX;  // all of it was asked for
    task.frame = send->frame;
  }
  return task;
}

std::uint16_t ImagingScheduler::refusal_of(const Task& task) const {
  const bool exists = std::any_of(tasks_.begin(), tasks_.end(), [&](const Task& other) {
    const bool both_frames = task.kind == Kind::send_frame || other.kind == Kind::send_frame;
    return other.settings.task == task.settings.task &&
           (!both_frames || (task.kind == other.kind && task.frame == other.frame));
  });
  if (exists) return mission::failure::task_exists;
  if (tasks_.size() == max_tasks) return mission::failure::too_many_tasks;
  return mission::failure::none;
}

void ImagingScheduler::execute(const Telecommand& telecommand, MonotonicTime now) {
  if (telecommand.command->name == mission::ImageCancel::name) return cancel(telecommand, now);
  const TelecommandOrigin& origin = telecommand.origin;
  auto task = read(telecommand, now);
  const std::uint16_t refusal = task ? refusal_of(*task) : mission::failure::bad_arguments_length;
  if (refusal != mission::failure::none) {
    report_queue_.failure(origin, Stage::start, refusal);
    return;
  }
  ++counters_.taken;
  report_queue_.success(origin, Stage::start);
  tasks_.push_back(std::move(*task));
  if (tasks_.back().kind != Kind::capture) list_frames(tasks_.back(), now);
}

bool ImagingScheduler::restore(const Telecommand& telecommand, const TelecommandProgress& progress,
                               MonotonicTime now) {
  if (progress.other_boot) return false;
  const TelecommandOrigin& origin = telecommand.origin;
  const std::uint8_t last_step = progress.last_step;
  if (telecommand.command->name == mission::ImageCancel::name) {
    cancel(telecommand, now);
    return true;
  }
  auto task = read(telecommand, now);
  const bool may_have_captured =
      task && task->kind == Kind::capture && last_step >= step_capture && last_step < step_captured;
  if (may_have_captured) clear(ImageServer::acquisition, now);
  if (task && last_step >= step_process) clear(ImageServer::processing, now);
  if (!task || may_have_captured || refusal_of(*task) != mission::failure::none) {
    report_queue_.failure(origin, Stage::completion, mission::failure::interrupted);
    if (task) note_failure(task->settings.task, "interrupted by a restart");
    return true;
  }
  ++counters_.taken;
  if (!progress.started) report_queue_.success(origin, Stage::start);
  tasks_.push_back(std::move(*task));
  Task& added = tasks_.back();
  if (added.kind == Kind::capture && last_step < step_captured) return true;
  if (added.kind == Kind::capture && added.settings.method.empty()) {
    complete(origin.id);
  } else {
    list_frames(added, now);
  }
  return true;
}

/// A goal of the earlier process, whose end is not awaited any more, would hold up the next ones.
void ImagingScheduler::clear(ImageServer server, MonotonicTime now) {
  auto& until = clearing_[static_cast<std::size_t>(server)];
  if (until) return;
  until = now + clear_patience;
  orders_.push_back({.action = ImagingAction::cancel_all, .server = server});
}

// ---- cancelling

void ImagingScheduler::cancel(const Telecommand& telecommand, MonotonicTime now) {
  const TelecommandOrigin& origin = telecommand.origin;
  const auto wanted = mission::ImageCancel::decode(telecommand.arguments);
  const std::uint32_t number = wanted ? wanted->task : 0;
  if (cancels_.size() == max_cancels) {
    report_queue_.failure(origin, Stage::start, mission::failure::busy);
    return;
  }
  report_queue_.success(origin, Stage::start);
  std::vector<std::uint64_t> meant;
  for (const Task& task : tasks_) {
    if (task.settings.task == number) meant.push_back(task.origin.id);
  }
  for (const std::uint64_t id : meant) cancel(*find(id));
  cancels_.push_back({.origin = origin,
                      .found = telecommand.repeated || !meant.empty(),
                      .expiry = now + telecommand.command->timeout});
  orders_.push_back({.action = ImagingAction::stop_sending, .id = origin.id, .task = number});
}

void ImagingScheduler::cancel(Task& task) {
  const std::uint64_t id = task.origin.id;
  const bool at_hand = std::any_of(orders_.begin(), orders_.end(), [id](const ImagingOrder& order) {
    return order.id == id && order.action != ImagingAction::cancel_goal;
  });
  if (waits(task) || at_hand) return fail(id, mission::failure::aborted);
  task.cancelled = true;
  if (const auto server = server_of(task))
    orders_.push_back({.action = ImagingAction::cancel_goal, .id = id, .server = *server});
}

void ImagingScheduler::on_sending_stopped(std::uint64_t id, std::size_t files, std::uint16_t failure) {
  const auto found = std::find_if(cancels_.begin(), cancels_.end(),
                                  [id](const Cancel& cancel) { return cancel.origin.id == id; });
  if (found == cancels_.end()) return;
  if (failure != mission::failure::none) {
    report_queue_.failure(found->origin, Stage::completion, failure);
  } else if (!found->found && files == 0) {
    report_queue_.failure(found->origin, Stage::completion, mission::failure::unknown_task);
  } else {
    report_queue_.success(found->origin, Stage::completion);
  }
  cancels_.erase(found);
}

// ---- what is due

bool ImagingScheduler::waits(const Task& task) {
  return task.state == State::waits_for_camera || task.state == State::waits_for_processing;
}

std::optional<ImageServer> ImagingScheduler::server_of(const Task& task) {
  if (task.state == State::capturing) return ImageServer::acquisition;
  if (task.state == State::processing) return ImageServer::processing;
  return std::nullopt;
}

bool ImagingScheduler::busy(ImageServer server) const {
  return clearing_[static_cast<std::size_t>(server)] ||
         std::any_of(tasks_.begin(), tasks_.end(),
                     [server](const Task& task) { return server_of(task) == server; });
}

/// The one whose start is first; without a start it is the time of its telecommand.
const ImagingScheduler::Task* ImagingScheduler::next_capture() const {
  const Task* next = nullptr;
  for (const Task& task : tasks_) {
    if (task.state != State::waits_for_camera) continue;
    if (next == nullptr || task.start.value_or(UtcTime()) < next->start.value_or(UtcTime())) next = &task;
  }
  return next;
}

void ImagingScheduler::on_time(const ImagingTime& time, bool may_capture) {
  end_overdue(time, may_capture);
  for (auto& until : clearing_) {
    if (until && time.now >= *until) until.reset();
  }
  const Task* capture = busy(ImageServer::acquisition) ? nullptr : next_capture();
  if (capture != nullptr && time.now >= capture->not_before) {
    const bool is_due = !capture->start || (time.utc_valid && *capture->start - lead <= time.utc);
    if (is_due) begin_capture(*find(capture->origin.id), time);
  }
  if (busy(ImageServer::processing)) return;
  const auto waiting = std::find_if(tasks_.begin(), tasks_.end(), [&](const Task& task) {
    return task.state == State::waits_for_processing && time.now >= task.not_before;
  });
  if (waiting != tasks_.end()) begin_processing(*waiting, time.now);
}

void ImagingScheduler::end_overdue(const ImagingTime& time, bool may_capture) {
  std::vector<std::pair<std::uint64_t, std::uint16_t>> ended;
  std::vector<std::uint64_t> silent;
  for (const Task& task : tasks_) {
    const bool asked = task.rejections > 0;  // then its node judges
    if (waits(task) && time.now >= task.expiry) {
      ended.emplace_back(task.origin.id, mission::failure::expired);
    } else if (task.state == State::waits_for_camera && time.utc_valid && task.start &&
               *task.start < time.utc && !asked) {
      ended.emplace_back(task.origin.id, mission::failure::capture_time_past);
    } else if (task.state == State::waits_for_camera && !may_capture &&
               (!task.start || (time.utc_valid && *task.start - lead <= time.utc))) {
      ended.emplace_back(task.origin.id, mission::failure::wrong_mode);
    } else if (!waits(task) && time.now >= task.silent_at) {
      silent.push_back(task.origin.id);
    }
  }
  for (const auto& [id, code] : ended) fail(id, code);
  for (const std::uint64_t id : silent) lose(*find(id), time.now);
  for (std::size_t i = 0; i < cancels_.size();) {
    if (time.now < cancels_[i].expiry) {
      ++i;
      continue;
    }
    report_queue_.failure(cancels_[i].origin, Stage::completion, mission::failure::completion_unknown);
    cancels_.erase(cancels_.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

std::optional<MonotonicTime> ImagingScheduler::next_due(const ImagingTime& time) const {
  std::optional<MonotonicTime> due;
  const auto sooner = [&](MonotonicTime t) {
    if (!due || t < *due) due = t;
  };
  for (const Cancel& cancel : cancels_) sooner(cancel.expiry);
  for (const auto& until : clearing_) {
    if (until) sooner(*until);
  }
  for (const Task& task : tasks_) {
    sooner(waits(task) ? task.expiry : task.silent_at);
    if (task.state == State::waits_for_processing && !busy(ImageServer::processing)) sooner(task.not_before);
    // UTC may step: checked at each tick too.
    if (task.state == State::waits_for_camera && task.start && time.utc_valid) {
      if (*task.start - lead > time.utc) sooner(time.now + (*task.start - lead - time.utc));
      if (*task.start >= time.utc) sooner(time.now + (*task.start - time.utc) + nanoseconds(1));
    }
  }
  const Task* capture = busy(ImageServer::acquisition) ? nullptr : next_capture();
  if (capture != nullptr && !capture->start) sooner(capture->not_before);
  if (capture != nullptr && capture->start && capture->not_before > time.now) sooner(capture->not_before);
  return due;
}

// ---- goals

void ImagingScheduler::begin_capture(Task& task, const ImagingTime& time) {
  if (task.rejections == 0) progress(task, step_capture);
  task.state = State::capturing;
  task.accepted_at.reset();
  task.incarnation.reset();
  const nanoseconds wait = task.start ? std::max(nanoseconds(0), *task.start - time.utc) : nanoseconds(0);
  task.silent_at = time.now + wait + longest_frame(task) + answer_patience;
  orders_.push_back({.action = ImagingAction::capture,
                     .id = task.origin.id,
                     .task = task.settings.task,
                     .start = task.start,
                     .capture = task.settings});
}

void ImagingScheduler::begin_processing(Task& task, MonotonicTime now) {
  if (task.rejections == 0) progress(task, step_process);
  task.state = State::processing;
  task.accepted_at.reset();
  task.incarnation.reset();
  task.silent_at = now + answer_patience;
  orders_.push_back({.action = ImagingAction::process,
                     .id = task.origin.id,
                     .task = task.settings.task,
                     .frame = task.frame,
                     .files = task.files,
                     .method = task.settings.method,
                     .parameters = task.settings.parameters,
                     .budget_octets = task.settings.budget_octets,
                     .full_frames = task.kind == Kind::send_frame,
                     .server = ImageServer::processing});
}

void ImagingScheduler::list_frames(Task& task, MonotonicTime now) {
  task.state = State::listing;
  task.silent_at = now + answer_patience;
  orders_.push_back({.action = ImagingAction::list_frames,
                     .id = task.origin.id,
                     .task = task.settings.task,
                     .frame = task.frame});
}

void ImagingScheduler::on_accepted(std::uint64_t id, MonotonicTime now) {
  Task* task = find(id);
  if (task == nullptr || !server_of(*task) || task->accepted_at) return;
  task->accepted_at = now;
  // That of a capture counts from its start.
  if (task->state == State::processing) task->silent_at = now + process_patience;
}

void ImagingScheduler::on_feedback(std::uint64_t id, std::uint16_t frames_done, MonotonicTime now) {
  Task* task = find(id);
  if (task == nullptr || !server_of(*task)) return;
  const mission::ImageCapture& settings = task->settings;
  const bool captures = task->state == State::capturing;
  task->silent_at =
      now + (captures ? milliseconds(settings.interval_ms) + longest_frame(*task) + capture_patience
                      : nanoseconds(process_patience));
  const std::size_t frames = captures ? settings.frames : task->files.size();
  if (frames == 0) return;
  while (task->quarters < quarter_steps.size() &&
         std::size_t{frames_done} * 4 >= frames * (std::size_t{task->quarters} + 1) && frames_done < frames) {
    const auto percent = static_cast<std::uint8_t>(quarter_steps.at(task->quarters++));
    progress(*task, captures ? percent : static_cast<std::uint8_t>(step_captured + percent));
  }
}

void ImagingScheduler::on_goal_end(std::uint64_t id, ImageServer server, ImageGoalEnd end,
                                   MonotonicTime now) {
  Task* task = find(id);
  if (task == nullptr || server_of(*task) != server) return;
  using How = ImageGoalEnd::How;
  if (task->cancelled || end.how == How::canceled) return fail(id, mission::failure::aborted, end.reason);
  if (end.how == How::lost) return lose(*task, now);
  if (end.how == How::rejected) {
    if (++task->rejections > max_rejections) return fail(id, mission::failure::busy);
    task->state = server == ImageServer::acquisition ? State::waits_for_camera : State::waits_for_processing;
    task->not_before = now + reject_pause;
    return;
  }
  if (end.failure_code != mission::failure::none) return fail(id, end.failure_code, end.reason);
  task->rejections = 0;
  task->quarters = 0;
  if (server == ImageServer::acquisition) {
    on_captured(*task, std::move(end), now);
  } else {
    on_processed(*task, std::move(end), now);
  }
}

nanoseconds ImagingScheduler::longest_frame(const Task& task) {
  return tries_of_a_frame * (microseconds(task.settings.exposure_us) + nanoseconds(frame_patience));
}

void ImagingScheduler::on_captured(Task& task, ImageGoalEnd end, MonotonicTime now) {
  counters_.frames += static_cast<std::uint32_t>(end.files.size());
  progress(task, step_captured);
  if (task.settings.method.empty()) return complete(task.origin.id);
  if (end.files.empty()) return fail(task.origin.id, mission::failure::no_usable_frame, "no frame received");
  task.files = std::move(end.files);
  task.expiry = std::max(task.expiry, now + longest_wait);
  task.state = State::waits_for_processing;
}

void ImagingScheduler::on_processed(Task& task, ImageGoalEnd end, MonotonicTime now) {
  counters_.detections += end.detections;
  progress(task, step_processed);
  if (end.files.empty()) return complete(task.origin.id);
  const bool tells = std::any_of(end.files.begin(), end.files.end(),
                                 [](const std::string& file) { return file.ends_with(findings_file); });
  task.files = std::move(end.files);
  task.state = State::queueing;
  task.silent_at = now + answer_patience;
  orders_.push_back({.action = ImagingAction::queue_products,
                     .id = task.origin.id,
                     .task = task.settings.task,
                     .frame = task.frame,
                     .files = task.files,
                     .run = tells ? end.run : 0});
}

void ImagingScheduler::on_instance(ImageServer server, std::uint32_t incarnation, MonotonicTime looked) {
  std::vector<std::uint64_t> lost;
  for (Task& task : tasks_) {
    // What was seen before the goal was taken does not show which process took it.
    if (server_of(task) != server || !task.accepted_at || looked < *task.accepted_at) continue;
    if (!task.incarnation && incarnation != 0) task.incarnation = incarnation;
    if (task.incarnation && *task.incarnation != incarnation) lost.push_back(task.origin.id);
  }
  for (const std::uint64_t id : lost) lose(*find(id), looked);
}

// ---- files

void ImagingScheduler::on_frames_listed(std::uint64_t id, std::optional<std::vector<std::string>> frames) {
  Task* task = find(id, State::listing);
  if (task == nullptr) return;
  if (task->cancelled) return fail(id, mission::failure::aborted);
  if (!frames || frames->empty()) return fail(id, mission::failure::unknown_task);
  task->files = std::move(*frames);
  task->state = State::waits_for_processing;
}

void ImagingScheduler::on_products_queued(std::uint64_t id, std::uint16_t failure, const std::string& reason,
                                          std::size_t queued) {
  counters_.products_queued += static_cast<std::uint32_t>(queued);
  const Task* task = find(id, State::queueing);
  if (task == nullptr) return;
  if (task->cancelled) return fail(id, mission::failure::aborted);
  if (failure != mission::failure::none) return fail(id, failure, reason);
  complete(id);
}

// ---- ends

/// Its node restarted, is silent, or the disk is.
void ImagingScheduler::lose(Task& task, MonotonicTime now) {
  const auto server = server_of(task);
  const std::uint64_t id = task.origin.id;
  const std::uint16_t code = task.cancelled ? mission::failure::aborted
                             : server       ? mission::failure::imaging_lost
                                            : mission::failure::disk_failed;
  fail(id, code);
  if (!server) return;
  // In case the goal is alive after all, or was taken without our hearing of it. Only ttc has goals there.
  orders_.push_back({.action = ImagingAction::cancel_goal, .id = id, .server = *server});
  clear(*server, now);
}

void ImagingScheduler::progress(const Task& task, std::uint8_t step) {
  report_queue_.success(task.origin, Stage::progress, step);
}

void ImagingScheduler::complete(std::uint64_t id) {
  ++counters_.completed;
  report_queue_.success(find(id)->origin, Stage::completion);
  remove(id);
}

void ImagingScheduler::fail(std::uint64_t id, std::uint16_t code, const std::string& reason) {
  const Task& task = *find(id);
  ++counters_.failed;
  report_queue_.failure(task.origin, Stage::completion, code);
  std::string why(mission::failure_text(code));
  if (!reason.empty()) why += ": " + reason;
  note_failure(task.settings.task, why);
  remove(id);
}

void ImagingScheduler::note_failure(std::uint32_t task, const std::string& why) {
  if (failures_.size() == max_failures) failures_.erase(failures_.begin());
  failures_.push_back({.task = task, .why = why.substr(0, why_octets)});
}

void ImagingScheduler::remove(std::uint64_t id) {
  // A goal that was not sent is not sent any more; one that was may still have to be cancelled.
  std::erase_if(orders_, [id](const ImagingOrder& order) {
    return order.id == id && order.action != ImagingAction::cancel_goal;
  });
  std::erase_if(tasks_, [id](const Task& task) { return task.origin.id == id; });
}

ImagingScheduler::Task* ImagingScheduler::find(std::uint64_t id) {
  const auto found =
      std::find_if(tasks_.begin(), tasks_.end(), [id](const Task& task) { return task.origin.id == id; });
  return found == tasks_.end() ? nullptr : &*found;
}

ImagingScheduler::Task* ImagingScheduler::find(std::uint64_t id, State state) {
  Task* task = find(id);
  return task != nullptr && task->state == state ? task : nullptr;
}

bool ImagingScheduler::knows(std::uint64_t id) const {
  return std::any_of(tasks_.begin(), tasks_.end(), [id](const Task& task) { return task.origin.id == id; });
}

mission::TtcImagingHousekeeping ImagingScheduler::housekeeping() const {
  mission::TtcImagingHousekeeping h;
  h.tasks = static_cast<std::uint8_t>(tasks_.size());
  h.taken = counters_.taken;
  h.completed = counters_.completed;
  h.failed = counters_.failed;
  h.frames = counters_.frames;
  h.detections = counters_.detections;
  h.products_queued = counters_.products_queued;
  h.products_sent = counters_.products_sent;
  return h;
}

}  // namespace srfs
