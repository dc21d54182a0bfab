// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_acquisition/image_acquisition_node.hpp"

#include <time.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include <fmt/format.h>
#include <malloc.h>

#include "image/fits_writer.hpp"

namespace srfs {
namespace {

using ros::CallbackReturn;
namespace failure = mission::failure;

constexpr nanoseconds prelude = milliseconds(500);     // of a task: the camera is prepared
constexpr nanoseconds pause = seconds(2);              // between frames: the camera need not stream then
constexpr nanoseconds lead = milliseconds(20);         // its worker waits out the rest by itself
constexpr nanoseconds take_slice = milliseconds(100);  // then it can be cancelled again
constexpr nanoseconds reopen_interval = milliseconds(500);
constexpr nanoseconds camera_patience = seconds(5);  // of a task while the camera is away
constexpr nanoseconds housekeeping_period = mission::ImageAcquisitionHousekeeping::default_interval;
constexpr nanoseconds attitude_age_max = seconds(10);
constexpr milliseconds longest_job = seconds(10);
constexpr nanoseconds store_retry_interval = seconds(2);
constexpr std::size_t storing_max = 2;  // frames that wait for the disk; the camera then waits, too
constexpr std::size_t camera_queue = 8;
constexpr std::size_t store_queue = storing_max + 2;
constexpr std::size_t reason_max = 120;

void sleep_until(MonotonicTime at) {
  const timespec until{.tv_sec = at.ns() / 1'000'000'000, .tv_nsec = at.ns() % 1'000'000'000};
  while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

CaptureRequest request_of(const srfs_msgs::action::CaptureImage::Goal& goal) {
  CaptureRequest request;
  request.task = goal.task;
  if (goal.start.sec != 0 || goal.start.nanosec != 0) request.start = ros::from_message(goal.start);
  request.exposure = microseconds(goal.exposure_us);
  request.gain_db = static_cast<double>(goal.gain_db);
  request.frames = goal.frames;
  request.interval = milliseconds(goal.interval_ms);
  return request;
}

std::uint32_t as_u32(std::uint64_t v) {
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(v, UINT32_MAX));
}

}  // namespace

ImageAcquisitionNode::ImageAcquisitionNode(ros::NodeContext& context, CameraOpener open_camera)
    : LifecycleNode(context), open_camera_(std::move(open_camera)) {
  declare_parameter("store_quota_mib", std::int64_t{512}, ros::ParameterRange{1, 1'048'576},
                    "Total size of the stored frames", true);
  declare_parameter("frame_patience_ms", std::int64_t{3000}, ros::ParameterRange{10, 60'000},
                    "A frame that is this late after its exposure is lost and taken again");
  declare_parameter("latest_start_ms", std::int64_t{1000}, ros::ParameterRange{0, 3'600'000},
                    "A task that cannot begin this soon after its start time fails");
  declare_parameter("instrument", std::string("SRFS"), "INSTRUME in the frame headers", true);
}

// ---------------------------------------------------------------- lifecycle

CallbackReturn ImageAcquisitionNode::on_configure() {
  if (deployment().devices.contains("camera")) {
    auto camera = open_camera_(device("camera"), var().root);
    if (!camera) {
      set_failure_reason(camera.error().message);
      return CallbackReturn::failure;
    }
    camera_ = std::move(*camera);
  }
  camera_problem_ = camera_ ? "closed" : "the deployment has no camera";
  const auto quota = static_cast<std::uint64_t>(get_parameter<std::int64_t>("store_quota_mib")) << 20;
  store_ = std::make_unique<FrameStore>(var().root / "images", quota);
  const milliseconds deadline = std::max(worker_deadline(), longest_job);
  camera_worker_ = create_worker("camera", camera_queue, deadline);
  store_worker_ = create_background_worker("frame_store", store_queue, deadline);
  open_store();
  images_ = create_publisher(ros::topics::image_raw);
  ticks_ = create_subscription(ros::topics::time_tick, [this](const srfs_msgs::msg::TimeTick& tick) {
    time_.on_tick(tick);
    if (!waiting_.empty()) drive();
  });
  adcs_ = create_subscription(ros::topics::telemetry("payload_adcs"),
                              [this](const srfs_msgs::msg::PayloadTelemetry& m) { on_adcs_telemetry(m); });
  ros::ActionHandlers<Capture> handlers;
  handlers.goal = [](const ros::GoalId&, const Capture::Goal&) {
    return ros::GoalResponse::accept_and_defer;
  };
  handlers.cancel = [this](const Goal&) {
    drive_soon();  // by then the goal knows
    return ros::CancelResponse::accept;
  };
  handlers.accepted = [this](const Goal& goal) { on_goal(goal); };
  server_ = create_action_server<Capture>("/image/capture", std::move(handlers));
  housekeeping_ = create_timer(
      housekeeping_period, [this] { publish_housekeeping(); }, "housekeeping");
  return CallbackReturn::success;
}

CallbackReturn ImageAcquisitionNode::on_activate() {
  camera_was_lost_ = false;
  next_open_ = now();
  drive_soon();
  return CallbackReturn::success;
}

CallbackReturn ImageAcquisitionNode::on_deactivate() {
  drop_tasks("the node was deactivated");
  close_camera();
  return CallbackReturn::success;
}

CallbackReturn ImageAcquisitionNode::on_cleanup() {
  release();
  return CallbackReturn::success;
}

CallbackReturn ImageAcquisitionNode::on_shutdown() {
  drop_tasks("the node was shut down");
  release();
  return CallbackReturn::success;
}

CallbackReturn ImageAcquisitionNode::on_error() {
  drop_tasks("the node failed");
  release();
  return CallbackReturn::success;
}

/// Waits for the jobs that run: at most a slice of an exposure, and the frame that is being written.
void ImageAcquisitionNode::release() {
  wake_.reset();
  soon_.reset();
  housekeeping_.reset();
  server_.reset();
  adcs_.reset();
  ticks_.reset();
  camera_worker_.reset();
  if (store_worker_) store_worker_->drain();
  store_worker_.reset();
  store_retry_.reset();  // the drain may have set it
  images_.reset();
  camera_.reset();
  store_.reset();
  store_problem_.clear();
  camera_jobs_ = 0;
  frames_storing_ = 0;
  camera_state_ = mission::CameraState::closed;
}

// ---------------------------------------------------------------- goals

void ImageAcquisitionNode::on_goal(const Goal& goal) {
  ++counters_.tasks;
  const CaptureRequest request = request_of(goal->goal());
  if (!is_active()) return refuse_goal(goal, {failure::camera_absent, "the node is not active"});
  if (!camera_) return refuse_goal(goal, {failure::camera_absent, camera_problem_});
  if (!store_problem_.empty()) return refuse_goal(goal, {failure::disk_failed, store_problem_});
  if (const auto refused = refuse(request)) return refuse_goal(goal, *refused);
  const auto same = [&](const TaskPointer& task) { return task && task->request.task == request.task; };
  if (same(current_) || std::any_of(waiting_.begin(), waiting_.end(), same))
    return refuse_goal(goal, {failure::task_exists, fmt::format("task {} is in progress", request.task)});
  if (request.start && time_.valid()) {
    if (const auto past = refuse_past(*request.start, time_.utc_at(now()), nanoseconds(0)))
      return refuse_goal(goal, *past);
  }
  waiting_.push_back(std::make_shared<Task>(goal, request, now()));
  drive_soon();  // after the client was answered
}

void ImageAcquisitionNode::refuse_goal(const Goal& goal, const CaptureFailure& why) {
  ++counters_.tasks_failed;
  log::warn("task {} refused: {}", goal->goal().task, why.reason);
  Capture::Result result;
  result.failure_code = why.code;
  result.reason = why.reason.substr(0, reason_max);
  goal->abort(std::move(result));
}

void ImageAcquisitionNode::end_task(const TaskPointer& task) {
  Capture::Result& result = task->result;
  result.start_error_us = task->sequence.largest_start_error_us();
  const bool canceled = task->goal->is_cancel_requested();
  if (task->failure) {
    result.failure_code = task->failure->code;
    result.reason = task->failure->reason.substr(0, reason_max);
    log::warn("task {} ended after {} frames: {}", task->request.task, result.files.size(), result.reason);
  } else if (canceled) {
    result.reason = "canceled";
  }
  counters_.tasks_failed += task->failure || canceled ? 1 : 0;
  keeps_frames_ = true;
  if (canceled) {
    task->goal->canceled(std::move(result));
  } else if (task->failure) {
    task->goal->abort(std::move(result));
  } else {
    task->goal->succeed(std::move(result));
  }
}

/// What was taken before is stored all the same.
void ImageAcquisitionNode::drop_tasks(const std::string& reason) {
  if (current_) waiting_.push_back(std::exchange(current_, nullptr));
  for (const TaskPointer& task : waiting_) {
    if (!task->failure) task->failure = CaptureFailure{failure::camera_absent, reason};
    end_task(task);
  }
  waiting_.clear();
  wake_.reset();
}

/// @return nothing while its time is not known
std::optional<MonotonicTime> ImageAcquisitionNode::due_of(const Task& task) const {
  if (!task.request.start) return task.accepted;
  if (!time_.valid()) return std::nullopt;
  return now() + (*task.request.start - time_.utc_at(now()));
}

/// Ends what was cancelled and what is too late.
void ImageAcquisitionNode::sort_out_waiting() {
  const auto latest = milliseconds(get_parameter<std::int64_t>("latest_start_ms"));
  std::erase_if(waiting_, [&](const TaskPointer& task) {
    if (task->request.start && time_.valid())
      task->failure = refuse_past(*task->request.start, time_.utc_at(now()), latest);
    if (!task->failure && !task->goal->is_cancel_requested()) return false;
    end_task(task);
    return true;
  });
}

void ImageAcquisitionNode::choose_task() {
  std::optional<MonotonicTime> earliest;
  auto chosen = waiting_.end();
  for (auto at = waiting_.begin(); at != waiting_.end(); ++at) {
    const auto due = due_of(**at);
    if (!due || (earliest && *earliest <= *due)) continue;
    earliest = due;
    chosen = at;
  }
  if (!earliest) return;
  if (*earliest - prelude > now()) return wake_at(*earliest - prelude);
  current_ = *chosen;
  waiting_.erase(chosen);
  current_->start = *earliest;
  current_->goal->execute();
}

// ---------------------------------------------------------------- what comes next

void ImageAcquisitionNode::drive_soon() {
  soon_ = create_one_shot(
      now(), [this] { drive(); }, "next step");
}

void ImageAcquisitionNode::wake_at(MonotonicTime at) {
  wake_ = create_one_shot(
      at, [this] { drive(); }, "capture due");
}

void ImageAcquisitionNode::drive() {
  if (!is_active()) return;
  wake_.reset();
  sort_out_waiting();
  if (!current_) choose_task();
  if (current_) drive_current();
  if (camera_jobs_ > 0 || !camera_ || camera_state_ == mission::CameraState::ready ||
      camera_state_ == mission::CameraState::exposing)
    return;
  if (next_open_ > now()) {
    if (!current_ || !wake_) wake_at(next_open_);
  } else {
    open_camera();
  }
}

void ImageAcquisitionNode::drive_current() {
  const TaskPointer task = current_;
  if (camera_jobs_ > 0) return;  // its end drives again
  const bool over = task->failure || task->goal->is_cancel_requested() || task->sequence.all_taken();
  if (over) {
    if (task->uses_camera) return leave_camera();
    if (task->storing > 0) return;
    current_.reset();
    end_task(task);
    drive_soon();
    return;
  }
  if (camera_state_ == mission::CameraState::lost || camera_state_ == mission::CameraState::closed) {
    if (!task->camera_deadline) task->camera_deadline = now() + camera_patience;
    if (*task->camera_deadline > now()) return;
    task->failure = CaptureFailure{failure::camera_absent, camera_problem_};
    drive_soon();
    return;
  }
  task->camera_deadline.reset();
  switch (task->phase) {
    case Phase::unprepared:
      return prepare_in_time();
    case Phase::prepared:
      return expose();
    case Phase::exposing:
      return take();
  }
}

void ImageAcquisitionNode::expose() {
  const TaskPointer task = current_;
  if (task->storing >= storing_max) return;  // the end of a write drives again
  const bool first = task->sequence.next() == 0 && task->sequence.tries() == 0;
  if (first && !task->request.start) task->start = monotonic_now();
  if (first && task->start + milliseconds(get_parameter<std::int64_t>("latest_start_ms")) < now()) {
    task->failure = CaptureFailure{failure::capture_time_past, "the camera was not ready in time"};
    return drive_soon();
  }
  const auto after_start = task->sequence.due();
  task->due = after_start ? task->start + *after_start : monotonic_now();
  if (task->due - lead > now()) return wake_at(task->due - lead);
  const auto begun = std::make_shared<std::pair<MonotonicTime, Result<void, hw::CameraFault>>>();
  on_camera(
      [this, begun, due = task->due] {
        sleep_until(due);
        begun->first = monotonic_now();
        begun->second = camera_->begin();
      },
      [this, task, begun] {
        if (task != current_) return;  // dropped meanwhile
        if (!begun->second) return on_fault(task, begun->second.error());
        camera_state_ = mission::CameraState::exposing;
        task->phase = Phase::exposing;
        task->begun = begun->first;
        task->frame_deadline = begun->first + task->request.exposure +
                               milliseconds(get_parameter<std::int64_t>("frame_patience_ms"));
      });
}

// ---------------------------------------------------------------- camera

void ImageAcquisitionNode::on_camera(std::function<void()> job, std::function<void()> done) {
  ++camera_jobs_;
  const bool taken = camera_worker_->post(std::move(job), [this, f = std::move(done)] {
    --camera_jobs_;
    f();
    drive();
  });
  if (!taken) {
    --camera_jobs_;
    raise_error("the camera worker's queue is full");
  }
}

void ImageAcquisitionNode::open_camera() {
  const auto opened = std::make_shared<Result<std::string, hw::CameraFault>>();
  on_camera([this, opened] { *opened = camera_->open(); },
            [this, opened] {
              next_open_ = now() + reopen_interval;
              if (!is_active()) return;
              if (!*opened) return camera_lost(opened->error().reason);
              if (camera_was_lost_) ++counters_.camera_reopened;
              camera_was_lost_ = false;
              camera_state_ = mission::CameraState::ready;
              camera_name_ = **opened;
              frame_check_.forget();
              log::info("camera: {}", camera_name_);
              raise(mission::ImageCameraReadyEvent{.what = camera_name_});
            });
}

void ImageAcquisitionNode::close_camera() {
  camera_state_ = mission::CameraState::closed;
  camera_problem_ = "closed";
  if (!camera_ || !camera_worker_) return;
  on_camera([this] { camera_->close(); }, [] {});
}

void ImageAcquisitionNode::camera_lost(const std::string& why) {
  camera_problem_ = why;
  camera_state_ = mission::CameraState::lost;
  if (camera_was_lost_) return;  // reported already
  camera_was_lost_ = true;
  log::warn("camera lost: {}", why);
  raise(mission::ImageCameraLostEvent{.why = why});
}

void ImageAcquisitionNode::prepare_in_time() {
  const TaskPointer task = current_;
  const auto after_start = task->sequence.due();
  const bool begun = task->sequence.next() > 0;
  const MonotonicTime due = begun && after_start ? task->start + *after_start : now();
  if (due - prelude <= now()) return prepare();
  if (task->uses_camera && due - pause > now()) return leave_camera();
  wake_at(due - prelude);
}

void ImageAcquisitionNode::prepare() {
  const TaskPointer task = current_;
  const auto prepared = std::make_shared<Result<void, hw::CameraFault>>();
  const hw::CameraSettings settings{task->request.exposure, task->request.gain_db};
  on_camera([this, prepared, settings] { *prepared = camera_->prepare(settings); },
            [this, task, prepared] {
              if (!*prepared) return on_fault(task, prepared->error());
              task->phase = Phase::prepared;
              task->uses_camera = true;
            });
}

void ImageAcquisitionNode::take() {
  const TaskPointer task = current_;
  const auto taken = std::make_shared<Result<std::optional<hw::CameraFrame>, hw::CameraFault>>();
  on_camera([this, taken] { *taken = camera_->take(take_slice); },
            [this, task, taken] {
              if (task != current_) return;  // dropped meanwhile
              if (!*taken) return on_fault(task, taken->error());
              if (**taken) return on_frame(task, std::move(***taken));
              if (now() < task->frame_deadline) return;
              on_unsound(task, "no frame received");
            });
}

/// No frame is waited for any longer.
void ImageAcquisitionNode::leave_camera() {
  current_->phase = Phase::unprepared;
  current_->uses_camera = false;
  if (camera_state_ == mission::CameraState::exposing) camera_state_ = mission::CameraState::ready;
  on_camera([this] { camera_->abandon(); }, [] {});
}

void ImageAcquisitionNode::on_fault(const TaskPointer& task, const hw::CameraFault& fault) {
  if (task != current_) return;
  task->phase = Phase::unprepared;
  switch (fault.kind) {
    case hw::CameraFault::Kind::bad_setting:
      task->failure = CaptureFailure{failure::bad_camera_setting, fault.reason};
      return;
    case hw::CameraFault::Kind::absent:
      camera_lost(fault.reason);
      next_open_ = now();
      break;
    case hw::CameraFault::Kind::unsound:
      break;
  }
  on_unsound(task, fault.reason);
}

void ImageAcquisitionNode::on_unsound(const TaskPointer& task, const std::string& why) {
  ++counters_.frames_lost;
  log::warn("task {}, frame {}, try {}: {}", task->request.task, task->sequence.next() + 1,
            task->sequence.tries() + 1, why);
  task->phase = Phase::unprepared;
  if (camera_state_ == mission::CameraState::exposing) leave_camera();
  if (task->sequence.on_unsound()) return;
  const bool absent = camera_state_ == mission::CameraState::lost;
  task->failure = CaptureFailure{absent ? failure::camera_absent : failure::camera_failed,
                                 fmt::format("frame {}: {}", task->sequence.next() + 1, why)};
}

void ImageAcquisitionNode::on_frame(const TaskPointer& task, hw::CameraFrame frame) {
  if (const auto wrong = frame_check_.judge(frame, task->begun)) return on_unsound(task, *wrong);
  camera_state_ = mission::CameraState::ready;
  task->phase = Phase::unprepared;
  TakenFrame taken;
  taken.facts.task = task->request.task;
  taken.facts.camera = camera_name_;
  taken.facts.instrument = get_parameter<std::string>("instrument");
  if (time_.valid()) taken.facts.begin = time_.utc_at(frame.begin);
  taken.facts.start_error_us = start_error_us(frame.begin, task->due);
  if (attitude_ && frame.begin - attitude_at_ < attitude_age_max) {
    taken.facts.attitude = attitude_;
    taken.facts.attitude->age_s = std::chrono::duration<double>(frame.begin - attitude_at_).count();
  }
  counters_.start_error_us = taken.facts.start_error_us;
  task->sequence.on_sound(taken.facts.start_error_us);
  taken.frame = std::move(frame);
  store(task, std::move(taken));
}

// ---------------------------------------------------------------- store

void ImageAcquisitionNode::open_store() {
  const bool posted =
      store_worker_->ask([this] { return store_->open(); },
                         [this](const Result<void, FileError>& opened) { on_store_opened(opened); });
  if (!posted) open_store_later();
}

void ImageAcquisitionNode::open_store_later() {
  store_retry_ = create_one_shot(
      now() + store_retry_interval, [this] { open_store(); }, "frame store");
}

void ImageAcquisitionNode::on_store_opened(const Result<void, FileError>& opened) {
  store_figures_ = store_->figures();
  if (opened) {
    if (!store_problem_.empty()) log::info("frames can be stored again");
    store_problem_.clear();
    return;
  }
  open_store_later();
  const bool known = !store_problem_.empty();
  store_problem_ = "frames cannot be read: " + opened.error().message;
  if (known) return;
  ++counters_.store_failures;
  log::error("{}; capture suspended, retrying every {} s", store_problem_, store_retry_interval / seconds(1));
  raise(mission::NodeErrorEvent{.what = store_problem_.substr(0, reason_max)});
}

void ImageAcquisitionNode::store(const TaskPointer& task, TakenFrame frame) {
  struct Job {
    TakenFrame taken;
    Result<std::string, FrameStore::Failure> stored = std::string();
    StoreFigures figures;
  };
  const auto job = std::make_shared<Job>();
  job->taken = std::move(frame);
  ++task->storing;
  ++frames_storing_;
  const auto write = [this, job]() -> Result<std::string, FrameStore::Failure> {
    FrameFacts& facts = job->taken.facts;
    if (!store_->is_open()) return Err(FrameStore::Failure{false, "the folder of frames cannot be read"});
    const auto number = store_->next_number(facts.task);
    if (!number) return Err(FrameStore::Failure{true, "no frame number left"});
    facts.number = *number;
    const auto content =
        image::encode_packed_fits(job->taken.frame.pixels, frame_header(job->taken.frame, facts));
    if (!content) return Err(FrameStore::Failure{false, content.error().reason});
    return store_->add(facts.task, *number, *content);
  };
  const bool posted = store_worker_->post(
      [this, job, write] {
        job->stored = write();
        job->figures = store_->figures();
      },
      [this, job, task] {
        --task->storing;
        --frames_storing_;
        store_figures_ = job->figures;
        if (job->stored) {
          on_stored(task, *job->stored, job->taken);
        } else {
          // A task may be accepted before the store is found unreadable; it gets that reason, too.
          on_store_failure(task, store_problem_.empty() ? job->stored.error()
                                                        : FrameStore::Failure{false, store_problem_});
        }
        drive();
      });
  if (posted) return;
  --task->storing;
  --frames_storing_;
  on_store_failure(task, {false, "the store worker's queue is full"});
}

void ImageAcquisitionNode::on_stored(const TaskPointer& task, const std::string& file,
                                     const TakenFrame& taken) {
  ++counters_.frames;
  task->result.files.push_back(file);
  Capture::Feedback feedback;
  feedback.frames_done = static_cast<std::uint16_t>(task->result.files.size());
  feedback.file = file;
  feedback.start_error_us = taken.facts.start_error_us;
  task->goal->publish_feedback(std::move(feedback));
  publish_frame(file, taken);
}

void ImageAcquisitionNode::on_store_failure(const TaskPointer& task, const FrameStore::Failure& why) {
  ++counters_.store_failures;
  log::error("task {}: frame not stored: {}", task->request.task, why.reason);
  if (why.full) raise(mission::ImageStoreFullEvent{.what = why.reason});
  if (!task->failure)
    task->failure = CaptureFailure{why.full ? failure::frame_store_full : failure::disk_failed, why.reason};
}

void ImageAcquisitionNode::publish_frame(const std::string& file, const TakenFrame& taken) {
  if (!images_ || images_->subscription_count() == 0) return;
  const auto& pixels = taken.frame.pixels;
  sensor_msgs::msg::Image image;
  image.header.stamp = ros::to_message(taken.facts.begin.value_or(time_.utc_at(taken.frame.begin)));
  // "frames/0000000017/0001.fits": TASK/NUMBER
  image.header.frame_id =
      (std::filesystem::path(file).parent_path().filename() / std::filesystem::path(file).stem()).string();
  image.width = static_cast<std::uint32_t>(pixels.width());
  image.height = static_cast<std::uint32_t>(pixels.height());
  image.encoding = "mono16";
  image.is_bigendian = 0;
  image.step = image.width * 2;
  image.data.resize(pixels.size() * 2);
  std::memcpy(image.data.data(), pixels.cells().data(), image.data.size());
  images_->publish(image);
}

// ---------------------------------------------------------------- telemetry

void ImageAcquisitionNode::on_adcs_telemetry(const srfs_msgs::msg::PayloadTelemetry& m) {
  if (m.structure_id != mission::PayloadAdcsHousekeeping::structure_id) return;
  const auto decoded = mission::PayloadAdcsHousekeeping::decode(OctetView(m.data));
  if (!decoded) return;
  attitude_ = FrameFacts::Attitude{decoded->measurement.attitude, 0};
  attitude_at_ = MonotonicTime(nanoseconds(static_cast<std::int64_t>(m.monotonic_ns)));
}

void ImageAcquisitionNode::publish_housekeeping() {
  mission::ImageAcquisitionHousekeeping h = counters_;
  h.camera_state = camera_state_;
  h.store_frames = as_u32(store_figures_.frames);
  h.store_mib = as_u32(store_figures_.octets >> 20);
  h.store_removed = as_u32(store_figures_.removed);
  publish_telemetry(
      ros::telemetry_message(name(), h, time_.cycle(), time_.utc_at(now()), time_.valid(), now()));
  if (!current_ && std::exchange(keeps_frames_, false)) malloc_trim(0);  // what frames took
}

}  // namespace srfs
