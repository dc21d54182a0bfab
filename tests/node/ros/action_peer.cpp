// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The peer process of the action and service tests: `action_peer ROLE DOMAIN NAME`.
//   server  serves the action NAME. order < 0 is rejected; order 0 runs, with feedback, until it is canceled;
//           order > 0 sends that many feedback messages and succeeds. Results are kept for 2 s.
//   client  sends order 3 to the action NAME; exit code 0 when it succeeds with the sequence 0, 1, 1
//   waiter  sends order 0 to the action NAME and waits
//   mute    serves the service NAME and never answers
//   node    acts as the node "victim" of the suite "t" in VAR = NAME: publishes /test/victim
//   huge    publishes samples of 64 MiB on the topic NAME, whose type is TaskFlags
//   flood   publishes on the topic NAME without a pause

#include <csignal>
#include <cstdlib>
#include <string_view>

#include <sys/prctl.h>

#include <example_interfaces/action/fibonacci.hpp>
#include <srfs_msgs/msg/task_flags.hpp>
#include <srfs_msgs/srv/check_alive.hpp>

#include "ros/action_client.hpp"
#include "ros/action_server.hpp"
#include "ros/publisher.hpp"
#include "suite/departures.hpp"

namespace {

using namespace srfs;
using namespace srfs::ros;
using example_interfaces::action::Fibonacci;
using srfs_msgs::srv::CheckAlive;
using Goal = std::shared_ptr<ServerGoal<Fibonacci>>;

constexpr milliseconds step{20};

/// Adds one number to each goal at every step.
class FibonacciWork {
 public:
  explicit FibonacciWork(Executor& executor)
      : timer_(executor.add_timer(monotonic_now(), step, [this] { advance(); })) {}
  void take(Goal goal) { running_.push_back({std::move(goal), {}}); }

 private:
  struct Running {
    Goal goal;
    std::vector<std::int32_t> sequence;
  };
  void advance() {
    std::erase_if(running_, [](Running& work) {
      auto& [goal, sequence] = work;
      if (goal->is_cancel_requested()) {
        goal->canceled({sequence});
        return true;
      }
      const std::size_t n = sequence.size();
      if (n < 40)
        sequence.push_back(n < 2 ? static_cast<std::int32_t>(n) : sequence[n - 1] + sequence[n - 2]);
      goal->publish_feedback({sequence});
      if (static_cast<std::size_t>(goal->goal().order) != sequence.size()) return false;
      goal->succeed({sequence});
      return true;
    });
  }
  std::vector<Running> running_;
  Timer timer_;
};

int serve_actions(Executor& executor, Participant& participant, const std::string& name) {
  FibonacciWork work(executor);
  ActionHandlers<Fibonacci> handlers;
  handlers.goal = [](const GoalId&, const Fibonacci::Goal& goal) {
    return goal.order < 0 ? GoalResponse::reject : GoalResponse::accept_and_execute;
  };
  handlers.accepted = [&](Goal goal) { work.take(std::move(goal)); };
  ActionServer<Fibonacci> server(executor, participant, name, std::move(handlers),
                                 {.limits = {.result_timeout = seconds(2)}});
  executor.spin();
  return 0;
}

int send_goal(Executor& executor, Participant& participant, const std::string& name, int order) {
  ActionClient<Fibonacci> client(executor, participant, name);
  int exit_code = 1;
  GoalCallbacks<Fibonacci> callbacks;
  callbacks.ended = [&](const GoalOutcome<Fibonacci>& outcome) {
    if (outcome && outcome->state == GoalState::succeeded)
      exit_code = outcome->result.sequence == std::vector<std::int32_t>{0, 1, 1} ? 0 : 3;
    executor.stop();
  };
  const auto goal =
      client.send_goal({order}, std::move(callbacks),
                       {.response = seconds(20), .attempts = 1, .result = std::chrono::hours(1)});
  executor.spin();
  return exit_code;
}

int stay_mute(Executor& executor, Participant& participant, const std::string& name) {
  Service<CheckAlive> service(executor, participant, name, Qos{}, Priority::normal, defer_replies,
                              [](const CheckAlive::Request&, Ticket) {});
  executor.spin();
  return 0;
}

/// Like every node, holds its lock and its participant until it is killed.
int be_a_node(int domain, const std::string& var_folder) {
  const suite::VarPaths var{var_folder};
  auto lock = suite::InstanceLock::take(var, "victim");
  if (!lock) return 3;
  lock->publish(1, "probe");
  Executor executor;
  ParticipantOptions options{domain, {"127.0.0.1"}, &executor, SuiteIdentity{"t", "victim", 1}};
  options.lease = suite::lease_beside_the_ring;
  const auto participant = Participant::create(options);
  if (!participant) return 2;
  const Publisher<srfs_msgs::msg::TaskFlags> publisher(**participant, {"/test/victim", {}});
  executor.spin();
  return 0;
}

/// A sample without a size limit, under the name of another type.
struct Huge {
  static constexpr const char* dds_type_name = srfs_msgs::msg::TaskFlags::dds_type_name;
  std::vector<std::uint8_t> octets;
  template <class Self, class V>
  static void visit(Self& s, V& v) {
    v.sequence(s.octets, 0, 0);
  }
};

template <class M>
int publish_for_ever(Executor& executor, Participant& participant, const std::string& name, const M& message,
                     milliseconds pause) {
  WriterEndpoint writer(participant, topic_dds_name(name), srfs::ros::dds::TypeSupport(new TypeSupport<M>),
                        {.depth = 1});
  while (true) {
    if (writer.matched_count() > 0) writer.write(&message);
    if (writer.matched_count() == 0 || pause > milliseconds(0))
      executor.spin_once(std::max(pause, milliseconds(1)));
  }
}

}  // namespace

int main(int argc, char** argv) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlive the test
  if (argc != 4) return 2;
  const std::string_view role = argv[1];
  if (role == "node") return be_a_node(std::atoi(argv[2]), argv[3]);
  const auto participant = Participant::create({std::atoi(argv[2]), {"127.0.0.1"}});
  if (!participant) return 2;
  Executor executor;
  if (role == "server") return serve_actions(executor, **participant, argv[3]);
  if (role == "client") return send_goal(executor, **participant, argv[3], 3);
  if (role == "waiter") return send_goal(executor, **participant, argv[3], 0);
  if (role == "mute") return stay_mute(executor, **participant, argv[3]);
  if (role == "huge") {
    const Huge message{std::vector<std::uint8_t>(64U << 20, 1)};
    return publish_for_ever(executor, **participant, argv[3], message, milliseconds(100));
  }
  if (role == "flood") {
    return publish_for_ever(executor, **participant, argv[3], srfs_msgs::msg::TaskFlags{}, milliseconds(0));
  }
  return 2;
}
