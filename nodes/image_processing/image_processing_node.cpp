// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_processing/image_processing_node.hpp"

#include <algorithm>

#include <malloc.h>

#include "base/log.hpp"
#include "base/saturate.hpp"

namespace srfs {
namespace {

using ros::CallbackReturn;

constexpr nanoseconds housekeeping_period = seconds(10);
constexpr auto longest_step = seconds(60);  // a large frame on a busy machine, or all tracklets of a sequence
constexpr std::size_t longest_reason = 120;
constexpr std::size_t longest_file = 64;
constexpr std::uint64_t mebibyte = 1U << 20;

std::filesystem::path images_of(const suite::VarPaths& var) {
  return var.root / "images";
}

ProcessRequest to_request(const srfs_msgs::action::ProcessImage::Goal& goal, image::ProcessingRun run) {
  return {goal.task, goal.files, goal.method, goal.parameters, goal.budget_octets, goal.full_frames, run};
}

srfs_msgs::msg::ImageStreak to_message(const image::Streak& s) {
  srfs_msgs::msg::ImageStreak m;
  m.x1_px = static_cast<float>(s.x1);
  m.y1_px = static_cast<float>(s.y1);
  m.x2_px = static_cast<float>(s.x2);
  m.y2_px = static_cast<float>(s.y2);
  m.snr = static_cast<float>(s.snr);
  return m;
}

}  // namespace

ImageProcessingNode::ImageProcessingNode(suite::NodeContext& context) : Node(context) {
  declare_parameter("product_quota_mib", std::int64_t{64}, ros::ParameterRange{1, 1'000'000},
                    "Total size of the products on board; the oldest task's are removed first", true);
  declare_parameter("frame_pixels_max", std::int64_t{6'000'000},
                    ros::ParameterRange{256, image::frame_pixels_max},
                    "Larger frames are refused; processing takes 22 octets of memory per pixel", true);
}

bool ImageProcessingNode::is_at_rest() const {
  if (!worker_) return true;
  const ros::WorkerProgress progress = worker_->progress();
  return !progress.busy && progress.waiting == 0;
}

// ---------------------------------------------------------------- lifecycle

CallbackReturn ImageProcessingNode::on_configure() {
  if (!worker_)
    worker_ = create_background_worker("image", 4, std::max<milliseconds>(worker_deadline(), longest_step));
  if (!open_store()) {
    set_failure_reason("a step of an earlier task has not ended yet");
    return CallbackReturn::failure;
  }
  detections_ = create_publisher(suite::topics::image_detections);
  ticks_ = create_subscription(suite::topics::time_tick,
                               [this](const srfs_msgs::msg::TimeTick& tick) { time_.on_tick(tick); });
  ros::ActionHandlers<Process> handlers;
  handlers.goal = [this](const ros::GoalId&, const Process::Goal&) {
    return is_active() ? ros::GoalResponse::accept_and_defer : ros::GoalResponse::reject;
  };
  handlers.cancel = [this](const Goal& goal) { return on_cancel(goal); };
  handlers.accepted = [this](Goal goal) { on_goal(std::move(goal)); };
  server_ = create_action_server<Process>("/image/process", std::move(handlers));
  housekeeping_timer_ = create_timer(
      housekeeping_period, [this] { publish_housekeeping(); }, "housekeeping");
  return CallbackReturn::success;
}

/// @return whether it will be: behind a step that still runs
bool ImageProcessingNode::open_store() {
  store_ = std::make_shared<std::optional<ProductStore>>();
  const auto quota = static_cast<std::uint64_t>(get_parameter<std::int64_t>("product_quota_mib")) * mebibyte;
  return worker_->ask(
      [slot = store_, images = images_of(var()), quota] { return slot->emplace(images, quota).octets(); },
      [this](std::uint64_t octets) { counters_.product_store_mib = as_u32(octets / mebibyte); });
}

CallbackReturn ImageProcessingNode::on_deactivate() {
  abort_all(mission::failure::node_not_active, "the node is no longer active");
  return CallbackReturn::success;
}

/// The worker stays: the running step is not awaited, and later steps come after it.
CallbackReturn ImageProcessingNode::on_cleanup() {
  abort_all(mission::failure::node_not_active, "the node is no longer active");
  housekeeping_timer_.reset();
  server_.reset();
  store_.reset();
  ticks_.reset();
  detections_.reset();
  return CallbackReturn::success;
}

// ---------------------------------------------------------------- goals

void ImageProcessingNode::on_mode_changed() {
  if (!mode_reaction().work) abort_all(mission::failure::wrong_mode, "not in this mode");
  report_mode_obeyed(0);
}

void ImageProcessingNode::on_goal(Goal goal) {
  ++counters_.tasks;
  if (!mode_reaction().work) return abort(goal, mission::failure::wrong_mode, "not in this mode");
  waiting_.push_back(std::move(goal));
  if (!running_) begin_next();
}

/// A goal that waits ends at once, the one that runs behind its frame.
ros::CancelResponse ImageProcessingNode::on_cancel(const Goal& goal) {
  const auto place = std::find(waiting_.begin(), waiting_.end(), goal);
  if (place != waiting_.end()) {
    waiting_.erase(place);
    ++counters_.tasks_failed;
    Process::Result result;
    result.failure_code = mission::failure::aborted;
    result.reason = "cancelled before it began";
    goal->canceled(std::move(result));
  }
  return ros::CancelResponse::accept;
}

void ImageProcessingNode::begin_next() {
  while (!running_ && !waiting_.empty()) {
    const Goal goal = std::move(waiting_.front());
    waiting_.pop_front();
    begin(goal);
  }
}

void ImageProcessingNode::begin(const Goal& goal) {
  auto order = check_request(to_request(goal->goal(), image::run_of_goal(goal->id())));
  if (!order) return abort(goal, order.error().failure_code, order.error().reason);
  const ImageTask::Limits limits{get_parameter<std::int64_t>("frame_pixels_max")};
  running_ = {goal, std::make_shared<ImageTask>(*std::move(order), images_of(var()), limits)};
  goal->execute();
  post_step();
}

void ImageProcessingNode::post_step() {
  const bool taken = worker_->ask(
      [task = running_->task, store = store_] {
        Step step;
        const MonotonicTime begin = monotonic_now();
        step.report = task->step(**store);
        step.took = monotonic_now() - begin;
        step.store_octets = (*store)->octets();
        return step;
      },
      [this, task = running_->task](const Step& step) { on_step(task, step); });
  if (taken) return;
  const Goal goal = running_->goal;
  running_.reset();
  abort(goal, mission::failure::queue_full, "the worker's queue is full");
}

void ImageProcessingNode::on_step(const std::shared_ptr<ImageTask>& task, const Step& step) {
  counters_.product_store_mib = as_u32(step.store_octets / mebibyte);
  if (!running_ || running_->task != task) return;  // aborted meanwhile
  for (const std::string& problem : step.report.problems)
    log::warn("image task {}: {}", task->request().task, problem);
  for (const auto& refused : step.report.refused) {
    ++counters_.frames_refused;
    raise(mission::ImageFrameRefusedEvent{refused.file.substr(0, longest_file),
                                          refused.why.substr(0, longest_reason)});
  }
  if (step.report.frame_processed) {
    ++counters_.frames;
    counters_.frame_ms = as_u32(static_cast<std::uint64_t>(step.took / milliseconds(1)));
  }
  for (const FrameReport& frame : step.report.frames) publish(*task, frame);
  const TaskCounts& counts = task->counts();
  if (step.report.frame_processed || !step.report.refused.empty()) {
    Process::Feedback feedback;
    feedback.frames_done = counts.frames_done;
    feedback.stars = counts.stars;
    feedback.streaks = counts.streaks;
    running_->goal->publish_feedback(feedback);
  }
  if (task->is_done() || running_->goal->is_cancel_requested())
    end_running();
  else
    post_step();
}

void ImageProcessingNode::publish(const ImageTask& task, const FrameReport& frame) {
  srfs_msgs::msg::ImageDetections m;
  m.task = task.request().task;
  m.file = frame.file;
  m.method = task.request().method;
  if (const auto begin = image::utc_of(frame.time_s)) m.utc = ros::to_message(*begin);
  m.stars = as_u32(frame.stars);
  for (const image::Streak& s : frame.streaks) m.streaks.push_back(to_message(s));
  m.background_adu = static_cast<float>(frame.background);
  m.noise_adu = static_cast<float>(frame.noise);
  m.fwhm_px = static_cast<float>(frame.fwhm_px);
  m.solved = frame.attitude.has_value();
  if (frame.attitude) {
    m.ra_deg = frame.attitude->ra_deg;
    m.dec_deg = frame.attitude->dec_deg;
    m.roll_deg = frame.attitude->roll_deg;
  }
  detections_->publish(m);
}

void ImageProcessingNode::end_running() {
  const Running ended = *std::exchange(running_, std::nullopt);
  keeps_frames_ = true;
  const ImageTask& task = *ended.task;
  count(task);
  Process::Result result = result_of(task);
  if (task.failure()) {
    ++counters_.tasks_failed;
    ended.goal->abort(std::move(result));
  } else if (!task.is_done()) {
    ++counters_.tasks_failed;
    result.failure_code = mission::failure::aborted;
    result.reason = "cancelled";
    ended.goal->canceled(std::move(result));
  } else {
    raise_events(task);
    ended.goal->succeed(std::move(result));
  }
  begin_next();
}

void ImageProcessingNode::count(const ImageTask& task) {
  const TaskCounts& counts = task.counts();
  counters_.stars += counts.stars;
  counters_.streaks += counts.streaks;
  counters_.tracklets += counts.tracklets;
  counters_.solutions += counts.solutions;
  counters_.products += as_u32(task.products().size());
  counters_.products_left_out += counts.left_out;
}

void ImageProcessingNode::raise_events(const ImageTask& task) {
  const TaskCounts& counts = task.counts();
  const std::uint32_t number = task.request().task;
  if (counts.streaks > 0 || counts.tracklets > 0)
    raise(mission::ImageDebrisEvent{number, counts.streaks, counts.tracklets, counts.frames_processed});
  if (const auto& a = task.attitude())
    raise(mission::ImageSolvedEvent{number, a->ra_deg, a->dec_deg, a->roll_deg});
  if (counts.left_out > 0) raise(mission::ImageProductsLeftOutEvent{number, counts.left_out});
}

ImageProcessingNode::Process::Result ImageProcessingNode::result_of(const ImageTask& task) const {
  const TaskCounts& counts = task.counts();
  Process::Result result;
  if (const auto& failure = task.failure()) {
    result.failure_code = failure->failure_code;
    result.reason = failure->reason.substr(0, longest_reason);
  }
  result.products = task.products();
  result.octets = task.product_octets();
  result.left_out = counts.left_out;
  result.stars = counts.stars;
  result.streaks = counts.streaks;
  result.tracklets = counts.tracklets;
  if (const auto& attitude = task.attitude()) {
    result.solved = true;
    result.ra_deg = attitude->ra_deg;
    result.dec_deg = attitude->dec_deg;
    result.roll_deg = attitude->roll_deg;
  }
  return result;
}

void ImageProcessingNode::abort(const Goal& goal, std::uint16_t code, const std::string& reason) {
  ++counters_.tasks_failed;
  Process::Result result;
  result.failure_code = code;
  result.reason = reason.substr(0, longest_reason);
  goal->abort(std::move(result));
}

/// What the worker still does belongs to no task any more.
void ImageProcessingNode::abort_all(std::uint16_t code, const std::string& reason) {
  if (running_) waiting_.push_front(std::exchange(running_, std::nullopt)->goal);
  for (const Goal& goal : std::exchange(waiting_, {})) abort(goal, code, reason);
}

// ---------------------------------------------------------------- housekeeping

void ImageProcessingNode::publish_housekeeping() {
  publish_telemetry(
      suite::telemetry_message(name(), counters_, time_.cycle(), time_.utc_at(now()), time_.valid(), now()));
  // What frames took goes back to the system: between tasks that is three quarters of this node's memory.
  if (!running_ && std::exchange(keeps_frames_, false)) malloc_trim(0);
}

}  // namespace srfs
