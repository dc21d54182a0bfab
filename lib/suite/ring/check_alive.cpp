// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/check_alive.hpp"

#include <algorithm>

#include "base/saturate.hpp"
#include "suite/node.hpp"

namespace srfs::suite {
namespace {

/// Of nine observers at most; a request that waited longer than its round is of no use.
constexpr ros::Qos check_qos{.depth = 16};

}  // namespace

std::string check_alive_name(std::string_view node) {
  return "/" + std::string(node) + "/check_alive";
}

DueWork due_work(const ros::Executor::Backlog& input, const WorkStatus& own) {
  const bool input_is_older = !own.oldest_due || (input.oldest && *input.oldest < *own.oldest_due);
  return {input.waiting + own.due, input_is_older ? input.handled : own.done,
          input_is_older ? input.oldest : own.oldest_due};
}

CheckAliveService::CheckAliveService(Node& node) : node_(node) {
  service_ = node.create_service<srfs_msgs::srv::CheckAlive>(
      "~/check_alive", [this](const auto& request, auto& response) { answer(request, response); }, check_qos,
      ros::Priority::liveness);
}

void CheckAliveService::answer(const srfs_msgs::srv::CheckAlive_Request& request,
                               srfs_msgs::srv::CheckAlive_Response& response) {
  response.nonce = request.nonce;
  response.incarnation = node_.incarnation();
  response.lifecycle_state = static_cast<std::uint8_t>(node_.state());
  response.desired_state = static_cast<std::uint8_t>(node_.desired_state());
  fill_work(response);
  fill_worker(response);
  if (member_ == nullptr) {
    response.own_last_check_age_ms = UINT32_MAX;
    return;
  }
  response.ring_generation = member_->generation();
  response.own_last_check_age_ms = as_ms(member_->last_check_age());
  member_->on_asked(request.observer, request.ring_generation);
}

/// A node that was stopped, or had no CPU, has old work and is not to be blamed for it.
std::uint32_t CheckAliveService::age_ms(MonotonicTime since) const {
  const nanoseconds held_up = member_ != nullptr ? member_->held_up_since(since) : nanoseconds(0);
  return as_ms(node_.now() - since - held_up);
}

void CheckAliveService::fill_work(srfs_msgs::srv::CheckAlive_Response& response) {
  const DueWork work = due_work(node_.executor().backlog(), node_.work_status());
  response.work_due = work.due;
  response.work_done = work.done;
  response.oldest_due_ms = work.oldest ? age_ms(*work.oldest) : 0;
}

/// A job whose own thread sleeps ages, however the work thread is kept waiting.
nanoseconds CheckAliveService::age_of(const ros::Worker& worker, MonotonicTime since) const {
  const nanoseconds stopped = member_ != nullptr ? member_->stopped_since(since) : nanoseconds(0);
  return std::max(node_.now() - since - worker.waited_since(since) - stopped, nanoseconds(0));
}

void CheckAliveService::fill_worker(srfs_msgs::srv::CheckAlive_Response& response) {
  const ros::Worker* worst = nullptr;
  nanoseconds age_of_worst{0};
  milliseconds deadline_of_worst{0};
  nanoseconds least_left = nanoseconds::max();
  for (ros::Worker* worker : node_.executor().workers()) {
    worker->review_cpu(node_.now());
    const ros::WorkerProgress progress = worker->progress();
    if (!progress.owes_since) continue;
    const nanoseconds age = age_of(*worker, *progress.owes_since);
    if (progress.deadline - age >= least_left) continue;
    least_left = progress.deadline - age;
    worst = worker;
    age_of_worst = age;
    deadline_of_worst = progress.deadline;
  }
  if (worst == nullptr) return;
  response.worker = worst->name();
  response.worker_busy_ms = as_ms(age_of_worst);
  response.worker_deadline_ms = as_ms(deadline_of_worst);
}

}  // namespace srfs::suite
