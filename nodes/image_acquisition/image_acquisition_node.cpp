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

#include "base/saturate.hpp"
#include "image/file/fits.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs {
namespace {

using ros::CallbackReturn;
namespace failure = mission::failure;

constexpr nanoseconds take_slice = milliseconds(100);  // then it can be cancelled again
constexpr nanoseconds housekeeping_period = mission::ImageAcquisitionHousekeeping::default_interval;
constexpr nanoseconds attitude_age_max = seconds(10);
constexpr milliseconds longest_job = seconds(10);
constexpr nanoseconds store_retry_interval = seconds(2);
constexpr std::size_t camera_queue = 8;
constexpr std::size_t store_queue = CaptureScheduler::storing_max + 2;
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

}  // namespace

ImageAcquisitionNode::ImageAcquisitionNode(suite::NodeContext& context, CameraOpener open_camera)
    : Node(context), open_camera_(std::move(open_camera)) {
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
  scheduler_.configure(camera_ ? "" : "the deployment has no camera");
  const auto quota = static_cast<std::uint64_t>(get_parameter<std::int64_t>("store_quota_mib")) << 20;
  store_ = std::make_unique<FrameStore>(var().root / "images", quota);
  const milliseconds deadline = std::max(worker_deadline(), longest_job);
  camera_worker_ = create_worker("camera", camera_queue, deadline);
  store_worker_ = create_background_worker("frame_store", store_queue, deadline);
  open_store();
  images_ = create_publisher(suite::topics::image_raw);
  ticks_ = create_subscription(suite::topics::time_tick, [this](const srfs_msgs::msg::TimeTick& tick) {
    time_.on_tick(tick);
    if (scheduler_.has_waiting()) drive();
  });
  find_attitude();
  ros::ActionHandlers<Capture> handlers;
  handlers.goal = [](const ros::GoalId&, const Capture::Goal&) {
    return ros::GoalResponse::accept_and_defer;
  };
  handlers.cancel = [this](const Goal& goal) {
    for (const auto& [number, known] : goals_) {
      if (known == goal) scheduler_.on_cancel(number);
    }
    carry_out(DriveSoon{});  // by then the goal knows
    return ros::CancelResponse::accept;
  };
  handlers.accepted = [this](const Goal& goal) { on_goal(goal); };
  server_ = create_action_server<Capture>("/image/capture", std::move(handlers));
  housekeeping_ = create_timer(
      housekeeping_period, [this] { publish_housekeeping(); }, "housekeeping");
  return CallbackReturn::success;
}

CallbackReturn ImageAcquisitionNode::on_activate() {
  run(scheduler_.activate(now()));
  return CallbackReturn::success;
}

CallbackReturn ImageAcquisitionNode::on_deactivate() {
  run(scheduler_.deactivate("the node was deactivated"));
  return CallbackReturn::success;
}

CallbackReturn ImageAcquisitionNode::on_cleanup() {
  release();
  return CallbackReturn::success;
}

CallbackReturn ImageAcquisitionNode::on_shutdown() {
  run(scheduler_.deactivate("the node was shut down"));
  release();
  return CallbackReturn::success;
}

CallbackReturn ImageAcquisitionNode::on_error() {
  run(scheduler_.deactivate("the node failed"));
  release();
  return CallbackReturn::success;
}

/// Waits for the jobs that run: at most a slice of an exposure, and the frame that is being written.
void ImageAcquisitionNode::release() {
  wake_.reset();
  soon_.reset();
  housekeeping_.reset();
  server_.reset();
  attitude_telemetry_.reset();
  ticks_.reset();
  camera_worker_.reset();
  if (store_worker_) store_worker_->drain();
  store_worker_.reset();
  store_retry_.reset();  // the drain may have set it
  images_.reset();
  camera_.reset();
  store_.reset();
  set_store_problem({});
  actions_.clear();
  goals_.clear();
  scheduler_.configure("");
}

// ---------------------------------------------------------------- what the scheduler decides

CaptureTime ImageAcquisitionNode::time_now() const {
  const MonotonicTime t = monotonic_now();
  return {t, time_.valid() ? std::optional(time_.utc_at(t)) : std::nullopt};
}

void ImageAcquisitionNode::drive() {
  take_settings();
  run(scheduler_.drive(time_now()));
}

void ImageAcquisitionNode::take_settings() {
  scheduler_.set({milliseconds(get_parameter<std::int64_t>("latest_start_ms")),
                  milliseconds(get_parameter<std::int64_t>("frame_patience_ms"))});
}

void ImageAcquisitionNode::run(CaptureScheduler::Actions actions) {
  actions_.run(std::move(actions), [this](const CaptureAction& action) {
    std::visit([this](const auto& a) { carry_out(a); }, action);
  });
}

void ImageAcquisitionNode::carry_out(const DriveSoon& /*action*/) {
  soon_ = create_one_shot(
      now(), [this] { drive(); }, "next step");
}

void ImageAcquisitionNode::carry_out(const WakeAt& action) {
  wake_.reset();
  if (action.at)
    wake_ = create_one_shot(
        *action.at, [this] { drive(); }, "capture due");
}

// ---------------------------------------------------------------- mode

void ImageAcquisitionNode::on_mode_changed() {
  run(scheduler_.rest(!mode_reaction().work));
  report_mode_obeyed(0);
}

// ---------------------------------------------------------------- goals

void ImageAcquisitionNode::on_goal(const Goal& goal) {
  goals_[++last_goal_] = goal;
  run(scheduler_.on_goal(last_goal_, request_of(goal->goal()), time_now()));
}

void ImageAcquisitionNode::carry_out(const RefuseGoal& action) {
  const auto goal = goals_.extract(action.goal).mapped();
  log::warn("task {} refused: {}", goal->goal().task, action.why.reason);
  Capture::Result result;
  result.failure_code = action.why.code;
  result.reason = action.why.reason.substr(0, reason_max);
  goal->abort(std::move(result));
}

void ImageAcquisitionNode::carry_out(const ExecuteGoal& action) {
  goals_.at(action.goal)->execute();
}

void ImageAcquisitionNode::carry_out(const EndGoal& action) {
  const auto goal = goals_.extract(action.goal).mapped();
  const CaptureEnd& end = action.end;
  Capture::Result result;
  result.files = end.files;
  result.start_error_us = end.start_error_us;
  if (end.failure) {
    result.failure_code = end.failure->code;
    result.reason = end.failure->reason.substr(0, reason_max);
    log::warn("task {} ended after {} frames: {}", goal->goal().task, end.files.size(), result.reason);
  } else if (end.canceled) {
    result.reason = "canceled";
  }
  keeps_frames_ = true;
  if (end.canceled) {
    goal->canceled(std::move(result));
  } else if (end.failure) {
    goal->abort(std::move(result));
  } else {
    goal->succeed(std::move(result));
  }
}

void ImageAcquisitionNode::carry_out(const ReportProgress& action) {
  Capture::Feedback feedback;
  feedback.frames_done = action.frames_done;
  feedback.file = action.file;
  feedback.start_error_us = action.start_error_us;
  goals_.at(action.goal)->publish_feedback(std::move(feedback));
}

void ImageAcquisitionNode::carry_out(const ReportLostFrame& action) {
  log::warn("task {}, frame {}, try {}: {}", action.task, action.frame, action.attempt, action.why);
}

// ---------------------------------------------------------------- camera

/// Its queue holds all that is ever asked of it.
template <class Job, class Answer>
void ImageAcquisitionNode::on_camera(Job job, Answer answer) {
  const bool taken = camera_worker_->ask(std::move(job), [this, f = std::move(answer)](auto result) {
    take_settings();
    run(f(std::move(result)));
  });
  if (!taken) raise_error("the camera worker's queue is full");
}

void ImageAcquisitionNode::carry_out(const OpenCamera& /*action*/) {
  on_camera([this] { return camera_->open(); },
            [this](const auto& opened) { return scheduler_.on_opened(opened, time_now()); });
}

void ImageAcquisitionNode::carry_out(const CloseCamera& /*action*/) {
  on_camera([this] { return camera_->close(), true; },
            [this](bool) { return scheduler_.on_camera_done(time_now()); });
}

void ImageAcquisitionNode::carry_out(const AbandonFrame& /*action*/) {
  on_camera([this] { return camera_->abandon(), true; },
            [this](bool) { return scheduler_.on_camera_done(time_now()); });
}

void ImageAcquisitionNode::carry_out(const PrepareCamera& action) {
  on_camera([this, settings = action.settings] { return camera_->prepare(settings); },
            [this](const auto& prepared) { return scheduler_.on_prepared(prepared, time_now()); });
}

void ImageAcquisitionNode::carry_out(const BeginExposure& action) {
  on_camera(
      [this, at = action.at] {
        sleep_until(at);
        const MonotonicTime begun = monotonic_now();
        return std::pair(begun, camera_->begin());
      },
      [this](const auto& begun) { return scheduler_.on_begun(begun.first, begun.second, time_now()); });
}

void ImageAcquisitionNode::carry_out(const TakeFrame& /*action*/) {
  on_camera([this] { return camera_->take(take_slice); },
            [this](auto taken) { return scheduler_.on_taken(std::move(taken), time_now()); });
}

void ImageAcquisitionNode::carry_out(const ReportCameraReady& action) {
  log::info("camera: {}", action.what);
  raise(mission::ImageCameraReadyEvent{.what = action.what});
}

void ImageAcquisitionNode::carry_out(const ReportCameraLost& action) {
  log::warn("camera lost: {}", action.why);
  raise(mission::ImageCameraLostEvent{.why = action.why});
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

void ImageAcquisitionNode::set_store_problem(const std::string& why) {
  store_problem_ = why;
  scheduler_.set_store_problem(why);
}

void ImageAcquisitionNode::on_store_opened(const Result<void, FileError>& opened) {
  store_figures_ = store_->figures();
  if (opened) {
    if (!store_problem_.empty()) log::info("frames can be stored again");
    set_store_problem({});
    return;
  }
  open_store_later();
  const bool known = !store_problem_.empty();
  set_store_problem("frames cannot be read: " + opened.error().message);
  if (known) return;
  ++store_openings_failed_;
  log::error("{}; capture suspended, retrying every {} s", store_problem_, store_retry_interval / seconds(1));
  raise(mission::NodeErrorEvent{.what = store_problem_.substr(0, reason_max)});
}

FrameFacts ImageAcquisitionNode::facts_of(const CapturedFrame& captured) const {
  FrameFacts facts;
  facts.task = captured.task;
  facts.camera = scheduler_.camera_name();
  facts.instrument = get_parameter<std::string>("instrument");
  if (time_.valid()) facts.begin = time_.utc_at(captured.frame.begin);
  facts.start_error_us = captured.start_error_us;
  if (attitude_ && captured.frame.begin - attitude_at_ < attitude_age_max) {
    facts.attitude = attitude_;
    facts.attitude->age_s = std::chrono::duration<double>(captured.frame.begin - attitude_at_).count();
  }
  return facts;
}

/// On the store's worker.
Result<std::string, FrameStore::Failure> ImageAcquisitionNode::write_frame(const hw::CameraFrame& frame,
                                                                           FrameFacts facts) {
  if (!store_->is_open()) return Err(FrameStore::Failure{false, "the folder of frames cannot be read"});
  const auto number = store_->next_number(facts.task);
  if (!number) return Err(FrameStore::Failure{true, "no frame number left"});
  facts.number = *number;
  const auto content = image::encode_packed_fits(frame.pixels, frame_header(frame, facts));
  if (!content) return Err(FrameStore::Failure{false, content.error().reason});
  return store_->add(facts.task, *number, *content);
}

void ImageAcquisitionNode::carry_out(const StoreFrame& action) {
  const FrameFacts facts = facts_of(*action.captured);
  using Stored = Result<std::string, FrameStore::Failure>;
  const bool posted = store_worker_->ask(
      [this, captured = action.captured, facts] {
        Stored stored = write_frame(captured->frame, facts);
        return std::pair(std::move(stored), store_->figures());
      },
      [this, captured = action.captured, begin = facts.begin](const std::pair<Stored, StoreFigures>& done) {
        store_figures_ = done.second;
        if (done.first) publish_frame(*done.first, *captured, begin);
        // A task may be accepted before the store is found unreadable; it gets that reason, too.
        on_written(*captured, done.first || store_problem_.empty()
                                  ? done.first
                                  : Stored(Err(FrameStore::Failure{false, store_problem_})));
      });
  if (!posted)
    on_written(*action.captured, Err(FrameStore::Failure{false, "the store worker's queue is full"}));
}

void ImageAcquisitionNode::on_written(const CapturedFrame& captured,
                                      const Result<std::string, FrameStore::Failure>& stored) {
  if (stored) {
    run(scheduler_.on_stored(captured, *stored, time_now()));
    return;
  }
  const FrameStore::Failure& why = stored.error();
  log::error("task {}: frame not stored: {}", captured.task, why.reason);
  if (why.full) raise(mission::ImageStoreFullEvent{.what = why.reason});
  const CaptureFailure failed{why.full ? failure::frame_store_full : failure::disk_failed, why.reason};
  run(scheduler_.on_stored(captured, Err(failed), time_now()));
}

void ImageAcquisitionNode::publish_frame(const std::string& file, const CapturedFrame& captured,
                                         const std::optional<UtcTime>& begin) {
  if (!images_ || images_->subscription_count() == 0) return;
  const auto& pixels = captured.frame.pixels;
  sensor_msgs::msg::Image image;
  image.header.stamp = ros::to_message(begin.value_or(time_.utc_at(captured.frame.begin)));
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

/// The dictionary says who measures it; it is read aside, frames can be taken without.
void ImageAcquisitionNode::find_attitude() {
  (void)store_worker_->ask(
      []() -> std::optional<mission::TelemetryPlace> {
        try {
          return mission::Dictionary::load(mission::Dictionary::default_folder()).attitude();
        } catch (const ConfigError& e) {
          log::error("frames have no attitude in their headers: {}", e.what());
          return std::nullopt;
        }
      },
      [this](const std::optional<mission::TelemetryPlace>& place) {
        malloc_trim(0);                  // what reading YAML took
        if (!place || !server_) return;  // released meanwhile
        attitude_telemetry_ = create_subscription(
            suite::topics::telemetry(place->node),
            [this, place = *place](const srfs_msgs::msg::PayloadTelemetry& m) { on_attitude(place, m); });
      });
}

void ImageAcquisitionNode::on_attitude(const mission::TelemetryPlace& place,
                                       const srfs_msgs::msg::PayloadTelemetry& m) {
  if (m.structure_id != place.structure_id) return;
  OctetReader in(m.data);
  (void)in.bytes(place.offset);
  std::array<float, 4> quaternion{};
  for (float& element : quaternion) element = in.f32();
  if (!in.ok()) return;
  attitude_ = FrameFacts::Attitude{quaternion, 0};
  attitude_at_ = MonotonicTime(nanoseconds(static_cast<std::int64_t>(m.monotonic_ns)));
}

void ImageAcquisitionNode::publish_housekeeping() {
  mission::ImageAcquisitionHousekeeping h = scheduler_.counters();
  h.store_failures += store_openings_failed_;
  h.store_frames = as_u32(store_figures_.frames);
  h.store_mib = as_u32(store_figures_.octets >> 20);
  h.store_removed = as_u32(store_figures_.removed);
  publish_telemetry(
      suite::telemetry_message(name(), h, time_.cycle(), time_.utc_at(now()), time_.valid(), now()));
  if (scheduler_.is_idle() && std::exchange(keeps_frames_, false)) malloc_trim(0);  // what frames took
}

}  // namespace srfs
