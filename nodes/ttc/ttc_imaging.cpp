// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/ttc_imaging.hpp"

#include "suite/instance.hpp"

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

template <class A>
typename A::Goal to_goal(const ImagingOrder& order) {
  typename A::Goal goal;
  goal.task = order.task;
  if constexpr (std::is_same_v<A, CaptureImage>) {
    if (order.start) goal.start = ros::to_message(*order.start);
    goal.exposure_us = order.capture.exposure_us;
    goal.gain_db = order.capture.gain_db;
    goal.frames = order.capture.frames;
    goal.interval_ms = order.capture.interval_ms;
  } else {
    goal.files = order.files;
    goal.method = order.method;
    goal.parameters = order.parameters;
    goal.budget_octets = order.budget_octets;
    goal.full_frames = order.full_frames;
  }
  return goal;
}

}  // namespace

template <class A>
void ImagingGoals::send(Goals<A>& goals, ImageServer server, std::uint64_t id, const typename A::Goal& goal) {
  ros::GoalCallbacks<A> callbacks;
  callbacks.accepted = [this, id](UtcTime) {
    scheduler_.on_accepted(id, monotonic_now());
    look_at_nodes();
    answered_();
  };
  callbacks.feedback = [this, id](const typename A::Feedback& feedback) {
    scheduler_.on_feedback(id, feedback.frames_done, monotonic_now());
    answered_();
  };
  callbacks.ended = [this, id, server, &goals](const ros::GoalOutcome<A>& outcome) {
    ImageGoalEnd end = to_end<A>(outcome);
    if (const auto known = goals.under_way.find(id); known != goals.under_way.end())
      end.run = image::run_of_goal(known->second->id());
    scheduler_.on_goal_end(id, server, std::move(end), monotonic_now());
    goals.under_way.erase(id);
    answered_();
  };
  auto sent = goals.client->send_goal(goal, std::move(callbacks), goal_deadlines);
  if (!sent->is_over()) goals.under_way[id] = std::move(sent);
}

template <class A>
void ImagingGoals::serve(Goals<A>& goals, const ImagingOrder& order) {
  if (order.action == ImagingAction::cancel_all) {
    // Only ttc has goals there, and none of them is of this process.
    goals.client->cancel_all_goals(clear_deadline, [this, server = order.server](ros::CancelOutcome) {
      scheduler_.on_cleared(server);
      answered_();
    });
    return;
  }
  if (order.action == ImagingAction::cancel_goal) {
    const auto found = goals.under_way.find(order.id);
    if (found == goals.under_way.end()) return;
    const auto goal = found->second;
    goal->cancel();
    // The end of a task that was given up is not awaited.
    if (!scheduler_.knows(order.id)) goals.under_way.erase(order.id);
    return;
  }
  send(goals, order.server, order.id, to_goal<A>(order));
}

void ImagingGoals::carry_out(const ServeImaging& action) {
  action.order.server == ImageServer::acquisition ? serve(capture_, action.order)
                                                  : serve(process_, action.order);
}

void ImagingGoals::look_at_nodes() {
  if (scheduler_.tasks() == 0) return;
  struct Seen {
    MonotonicTime at;
    std::uint32_t acquisition = 0;
    std::uint32_t processing = 0;
  };
  small_files_.ask(
      [paths = var_] {
        const auto incarnation = [&](const char* node) {
          const auto instance = suite::find_instance(paths, node);
          return instance ? instance->incarnation : 0U;
        };
        const MonotonicTime at = monotonic_now();
        return Seen{at, incarnation(acquisition_node), incarnation(processing_node)};
      },
      [this](const Seen& seen) {
        scheduler_.on_instance(ImageServer::acquisition, seen.acquisition, seen.at);
        scheduler_.on_instance(ImageServer::processing, seen.processing, seen.at);
        answered_();
      });
}

}  // namespace srfs
