// The other process of the action and service tests, there to be killed: `action_peer server|client|mute
// DOMAIN`.
//   server  serves /test/fibonacci; a goal runs, with feedback, until it is canceled
//   client  sends one goal to /test/fibonacci and waits for its result
//   mute    serves /test/check_alive and never answers

#include <cstdlib>
#include <string_view>

#include <sys/prctl.h>
#include <csignal>

#include <example_interfaces/action/fibonacci.hpp>
#include <srfs_msgs/srv/check_alive.hpp>

#include "ros/action_client.hpp"
#include "ros/action_server.hpp"

namespace {

using namespace srfs;
using namespace srfs::ros;
using example_interfaces::action::Fibonacci;
using srfs_msgs::srv::CheckAlive;

void serve_actions(Executor& executor, Participant& participant) {
  std::shared_ptr<ServerGoal<Fibonacci>> current;
  ActionServer<Fibonacci> server(executor, participant, "/test/fibonacci",
                                 {.accepted = [&](auto goal) { current = std::move(goal); }});
  const auto work = executor.add_timer(monotonic_now(), milliseconds(20), [&] {
    if (!current) return;
    if (current->is_cancel_requested()) {
      current->canceled();
      current.reset();
    } else {
      current->publish_feedback({{0, 1}});
    }
  });
  executor.spin();
}

void send_goal(Executor& executor, Participant& participant) {
  ActionClient<Fibonacci> client(executor, participant, "/test/fibonacci");
  const auto goal = client.send_goal({}, {}, {.response = seconds(20)});
  executor.spin();
}

void stay_mute(Executor& executor, Participant& participant) {
  Service<CheckAlive> service(executor, participant, "/test/check_alive", Qos{}, Priority::normal,
                              defer_replies, [](const CheckAlive::Request&, Ticket) {});
  executor.spin();
}

}  // namespace

int main(int argc, char** argv) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlive the test
  if (argc != 3) return 2;
  const std::string_view role = argv[1];
  const auto participant = Participant::create({std::atoi(argv[2]), {"127.0.0.1"}});
  if (!participant) return 1;
  Executor executor;
  if (role == "server") serve_actions(executor, **participant);
  if (role == "client") send_goal(executor, **participant);
  if (role == "mute") stay_mute(executor, **participant);
  return 2;
}
