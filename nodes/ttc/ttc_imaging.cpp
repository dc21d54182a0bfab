// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// ttc and imaging: the goals of the two nodes, products into the outbox.
#include "nodes/ttc/ttc_node.hpp"

#include <mission/structures.hpp>

namespace srfs {
namespace {

using srfs_msgs::action::CaptureImage;
using srfs_msgs::action::ProcessImage;

constexpr const char* acquisition_node = "image_acquisition";
constexpr const char* processing_node = "image_processing";
/// 256 frames an hour apart, and more.
constexpr std::chrono::hours longest_goal{300};
/// A node that the ring restarts is there again within this. The result has no deadline of its own: the
/// scheduler watches the feedback.
constexpr ros::GoalDeadlines goal_deadlines{
    .response = seconds(5), .attempts = 3, .result = longest_goal, .cancel_when_late = true};

constexpr seconds clear_deadline{10};  ///< the search for the server in it

template <class A>
ImageGoalEnd to_end(const ros::GoalOutcome<A>& outcome) {
  using How = ImageGoalEnd::How;
  if (!outcome) {
    const bool rejected = outcome.error() == ros::GoalError::rejected;
    return {.how = rejected ? How::rejected : How::lost, .reason = ros::to_text(outcome.error())};
  }
  const typename A::Result& result = outcome->result;
  ImageGoalEnd end{.failure_code = result.failure_code, .reason = result.reason};
  if (outcome->state == ros::GoalState::canceled) end.how = How::canceled;
  // Aborted without a word: the node went down, or dropped its work.
  if (outcome->state == ros::GoalState::aborted && result.failure_code == 0) end.how = How::lost;
  if constexpr (std::is_same_v<A, CaptureImage>) {
    end.files = result.files;
  } else {
    end.files = result.products;
    end.detections = result.streaks + result.tracklets;
  }
  return end;
}

}  // namespace

ImagingTime TtcNode::imaging_time() const {
  const MonotonicTime at = monotonic_now();
  return {.now = at, .utc = link_->clock.utc_at(at), .utc_valid = link_->clock.valid()};
}

void TtcNode::begin_imaging_tasks() {
  link_->imaging.on_time(imaging_time(), link_->mode.mode() == MissionMode::nominal);
  for (const ImagingScheduler::Failure& failure : link_->imaging.take_failures()) {
    mission::ImageTaskFailedEvent event;
    event.task = failure.task;
    event.why = failure.why;
    raise(event);
  }
}

/// Behind the record of the progress: a restart must find that a capture was asked for.
void TtcNode::carry_out_imaging_orders() {
  if (!link_->journal.is_written()) return;
  for (ImagingOrder& order : link_->imaging.take_orders()) {
    switch (order.action) {
      case ImagingAction::capture:
        send_capture_goal(order);
        break;
      case ImagingAction::process:
        send_process_goal(order);
        break;
      case ImagingAction::cancel_goal:
        cancel_image_goal(order);
        break;
      case ImagingAction::cancel_all:
        cancel_left_goals(order.server);
        break;
      case ImagingAction::list_frames:
      case ImagingAction::queue_products:
      case ImagingAction::stop_sending:
        imaging_jobs_.push_back(std::move(order));
        break;
    }
  }
  run_imaging_job();
}

template <class A>
void TtcNode::send_image_goal(ImageGoals<A>& goals, ImageServer server, std::uint64_t id,
                              const typename A::Goal& goal) {
  ros::GoalCallbacks<A> callbacks;
  callbacks.accepted = [this, id](UtcTime) {
    link_->imaging.on_accepted(id, monotonic_now());
    look_at_imaging_nodes();
    if (is_active()) settle();
  };
  callbacks.feedback = [this, id](const typename A::Feedback& feedback) {
    link_->imaging.on_feedback(id, feedback.frames_done, monotonic_now());
    if (is_active()) settle();
  };
  callbacks.ended = [this, id, server, &goals](const ros::GoalOutcome<A>& outcome) {
    ImageGoalEnd end = to_end<A>(outcome);
    if (const auto known = goals.under_way.find(id); known != goals.under_way.end())
      end.run = image::run_of_goal(known->second->id());
    link_->imaging.on_goal_end(id, server, std::move(end), monotonic_now());
    goals.under_way.erase(id);
    if (is_active()) settle();
  };
  auto sent = goals.client->send_goal(goal, std::move(callbacks), goal_deadlines);
  if (!sent->is_over()) goals.under_way[id] = std::move(sent);
}

void TtcNode::send_capture_goal(const ImagingOrder& order) {
  CaptureImage::Goal goal;
  goal.task = order.task;
  if (order.start) goal.start = ros::to_message(*order.start);
  goal.exposure_us = order.capture.exposure_us;
  goal.gain_db = order.capture.gain_db;
  goal.frames = order.capture.frames;
  goal.interval_ms = order.capture.interval_ms;
  send_image_goal(capture_goals_, ImageServer::acquisition, order.id, goal);
}

void TtcNode::send_process_goal(const ImagingOrder& order) {
  ProcessImage::Goal goal;
  goal.task = order.task;
  goal.files = order.files;
  goal.method = order.method;
  goal.parameters = order.parameters;
  goal.budget_octets = order.budget_octets;
  goal.full_frames = order.full_frames;
  send_image_goal(process_goals_, ImageServer::processing, order.id, goal);
}

void TtcNode::cancel_image_goal(const ImagingOrder& order) {
  const auto cancel = [&](auto& goals) {
    const auto found = goals.under_way.find(order.id);
    if (found == goals.under_way.end()) return;
    const auto goal = found->second;
    goal->cancel();
    // The end of a task that was given up is not awaited.
    if (!link_->imaging.knows(order.id)) goals.under_way.erase(order.id);
  };
  order.server == ImageServer::acquisition ? cancel(capture_goals_) : cancel(process_goals_);
}

/// Only ttc has goals there, and none of them is of this process.
void TtcNode::cancel_left_goals(ImageServer server) {
  const auto done = [this, server](ros::CancelOutcome) {
    link_->imaging.on_cleared(server);
    if (is_active()) settle();
  };
  server == ImageServer::acquisition ? capture_goals_.client->cancel_all_goals(clear_deadline, done)
                                     : process_goals_.client->cancel_all_goals(clear_deadline, done);
}

/// One at a time: the worker has room for it.
void TtcNode::run_imaging_job() {
  if (imaging_job_runs_ || imaging_jobs_.empty()) return;
  auto order = std::make_shared<const ImagingOrder>(std::move(imaging_jobs_.front()));
  imaging_jobs_.pop_front();
  imaging_job_runs_ = files_worker_->ask([files = files_, order] { return files->serve(*order); },
                                         [this, order](const ImagingOutcome& outcome) {
                                           imaging_job_runs_ = false;
                                           on_imaging_job(*order, outcome);
                                         });
  if (!imaging_job_runs_) on_imaging_job(*order, {});
}

void TtcNode::on_imaging_job(const ImagingOrder& order, const ImagingOutcome& outcome) {
  ImagingScheduler& imaging = link_->imaging;
  if (order.action == ImagingAction::list_frames) {
    imaging.on_frames_listed(order.id, outcome.frames);
  } else if (order.action == ImagingAction::queue_products) {
    imaging.on_products_queued(order.id, outcome.products.failure, outcome.products.reason,
                               outcome.products.queued);
  } else {
    imaging.on_sending_stopped(order.id, outcome.products.queued, outcome.products.failure);
  }
  link_->files.on_change();
  if (is_active()) settle();
}

ImagingOutcome TtcNode::Files::serve(const ImagingOrder& order) {
  ImagingOutcome outcome;
  const OutboxImage image{.task = order.task, .frame = order.frame, .run = order.run};
  if (order.action == ImagingAction::list_frames) {
    outcome.frames = images->newest_frames_of(order.task, order.frame);
    return outcome;
  }
  if (const auto opened = open(); !opened) {
    outcome.products.reason = opened.error();
    return outcome;
  }
  if (order.action == ImagingAction::queue_products) {
    outcome.products = images->queue(image, order.files, [this](const std::string& name) {
      return transfer_folders->sending(name).has_value();
    });
    return outcome;
  }
  const std::vector<std::string> names = images->queued(order.task);
  const MonotonicTime at = monotonic_now();
  for (const std::string& name : names) {
    if (const auto sending = transfer_folders->sending(name)) transfer_folders->entity().cancel(*sending, at);
  }
  outcome.products = {.queued = images->remove(names)};
  return outcome;
}

/// A restarted node forgets its goals; the middleware may need its lease to notice.
void TtcNode::look_at_imaging_nodes() {
  if (link_->imaging.tasks() == 0) return;
  struct Seen {
    MonotonicTime at;
    std::uint32_t acquisition = 0;
    std::uint32_t processing = 0;
  };
  state_worker_->ask(
      [paths = var()] {
        const auto incarnation = [&](const char* node) {
          const auto instance = ros::find_instance(paths, node);
          return instance ? instance->incarnation : 0U;
        };
        const MonotonicTime at = monotonic_now();
        return Seen{at, incarnation(acquisition_node), incarnation(processing_node)};
      },
      [this](const Seen& seen) {
        link_->imaging.on_instance(ImageServer::acquisition, seen.acquisition, seen.at);
        link_->imaging.on_instance(ImageServer::processing, seen.processing, seen.at);
        if (is_active()) settle();
      });
}

void TtcNode::connect_imaging() {
  capture_goals_.client = create_action_client<CaptureImage>("/image/capture");
  process_goals_.client = create_action_client<ProcessImage>("/image/process");
}

void TtcNode::disconnect_imaging() {
  capture_goals_ = {};
  process_goals_ = {};
  imaging_jobs_.clear();
}

void TtcNode::send_imaging_housekeeping() {
  const mission::TtcImagingHousekeeping h = link_->imaging.housekeeping();
  if (const auto report = link_->housekeeping.on_sample(h.apid, h.structure_id, h.encoded(), now())) {
    send(report->report, report->live, true, false);
  }
  settle();
}

}  // namespace srfs
