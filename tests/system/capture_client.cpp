// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Sends one goal to /image/capture of a running suite:
//   capture_client VAR TASK [--frames N] [--exposure-us N] [--interval-ms N] [--gain-db N]
//                  [--start-in-ms N] [--cancel-after FRAMES]
// Prints the result as one JSON object. Exit code 0 for any result, 1 without a result.

#include <cstdlib>
#include <iostream>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <srfs_msgs/action/capture_image.hpp>

#include "base/file.hpp"
#include "ros/action_client.hpp"
#include "ros/publisher.hpp"
#include "suite/instance.hpp"
#include "suite/mission_time.hpp"
#include "suite/topics.hpp"

namespace {

using namespace srfs;
using Capture = srfs_msgs::action::CaptureImage;

constexpr seconds patience{60};

const char* to_text(ros::GoalState state) {
  switch (state) {
    case ros::GoalState::succeeded:
      return "succeeded";
    case ros::GoalState::canceled:
      return "canceled";
    case ros::GoalState::aborted:
      return "aborted";
    default:
      return "under way";
  }
}

void print(const ros::GoalResult<Capture>& end) {
  const Capture::Result& result = end.result;
  std::cout << nlohmann::json{{"state", to_text(end.state)},
                              {"failure_code", result.failure_code},
                              {"reason", result.reason},
                              {"files", result.files},
                              {"start_error_us", result.start_error_us}}
                   .dump()
            << '\n';
}

}  // namespace

int main(int argc, char** argv) {
  std::string var;
  Capture::Goal goal;
  goal.exposure_us = 20'000;
  goal.frames = 1;
  std::int64_t start_in_ms = -1;
  int cancel_after = -1;
  CLI::App app{"One goal to /image/capture"};
  app.add_option("VAR", var)->required();
  app.add_option("TASK", goal.task)->required();
  app.add_option("--frames", goal.frames);
  app.add_option("--exposure-us", goal.exposure_us);
  app.add_option("--interval-ms", goal.interval_ms);
  app.add_option("--gain-db", goal.gain_db);
  app.add_option("--start-in-ms", start_in_ms);
  app.add_option("--cancel-after", cancel_after);
  CLI11_PARSE(app, argc, argv);

  const auto domain = read_file(suite::VarPaths{var}.domain_file(), 64);
  if (!domain) {
    std::cerr << domain.error().message << '\n';
    return 1;
  }
  auto participant = ros::Participant::create({std::atoi(domain->c_str()), {"127.0.0.1"}});
  if (!participant) {
    std::cerr << participant.error() << '\n';
    return 1;
  }
  ros::Executor executor;
  const MonotonicTime until = monotonic_now() + patience;
  suite::MissionTime time;
  const ros::Subscription<srfs_msgs::msg::TimeTick> ticks(
      executor, **participant, suite::topics::time_tick,
      [&](const srfs_msgs::msg::TimeTick& tick, const ros::MessageInfo&) { time.on_tick(tick); });
  if (start_in_ms >= 0) {
    if (!executor.spin_until([&] { return time.valid(); }, until)) return 1;
    goal.start = ros::to_message(time.utc_at(monotonic_now()) + milliseconds(start_in_ms));
  }

  ros::ActionClient<Capture> client(executor, **participant, "/image/capture");
  std::shared_ptr<ros::ClientGoal<Capture>> sent;
  std::optional<ros::GoalOutcome<Capture>> ended;
  bool accepted = false;
  int done = 0;
  bool canceled = false;
  ros::GoalCallbacks<Capture> callbacks;
  callbacks.accepted = [&](UtcTime) { accepted = true; };
  callbacks.feedback = [&](const Capture::Feedback& f) { done = f.frames_done; };
  callbacks.ended = [&](const ros::GoalOutcome<Capture>& outcome) { ended = outcome; };
  sent = client.send_goal(goal, std::move(callbacks), {.response = seconds(20)});
  executor.spin_until(
      [&] {
        if (accepted && !canceled && cancel_after >= 0 && done >= cancel_after) {
          canceled = true;
          sent->cancel();
        }
        return ended.has_value();
      },
      until);
  if (!ended || !*ended) {
    std::cerr << (ended ? "no result: the goal ended without one\n" : "no result in time\n");
    return 1;
  }
  print(**ended);
  return 0;
}
