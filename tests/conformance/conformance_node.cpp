// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The node under test: only the ROS layer with a parameter of every type, one input and one client.

#include "suite/run_node.hpp"

#include <lifecycle_msgs/srv/get_state.hpp>

#include "suite/node.hpp"

namespace {

using namespace srfs::ros;
namespace suite = srfs::suite;

class ConformanceNode : public suite::Node {
 public:
  explicit ConformanceNode(suite::NodeContext& context) : Node(context) {
    declare_parameter("configure_fails", false, "Configuring returns failure");
    declare_parameter("camera.gain", 1.5, ParameterRange{0.0, 8.0}, "Gain of the camera");
    declare_parameter("camera.lens.focus", std::int64_t{-3}, ParameterRange{-10, 10}, "Focus in steps");
    declare_parameter("camera.name", std::string("cam"), "Name", true);
    declare_parameter("lists.bools", std::vector<bool>{true, false, true}, "Flags");
    declare_parameter("lists.integers", std::vector<std::int64_t>{1, -2}, "Numbers");
    declare_parameter("lists.doubles", std::vector<double>{0.5}, "Fractions");
    declare_parameter("lists.strings", std::vector<std::string>{"a", "", "ccc"}, "Words");
  }

 protected:
  CallbackReturn on_configure() override {
    if (!get_parameter<bool>("configure_fails")) return CallbackReturn::success;
    set_failure_reason("told to fail");
    return CallbackReturn::failure;
  }
  /// Asks the peer for its state and logs the answer.
  CallbackReturn on_activate() override {
    peer_->call({}, std::chrono::seconds(5), 1, [](const auto& answer) {
      if (answer) {
        srfs::log::info("the peer is {} '{}'", answer->current_state.id, answer->current_state.label);
      } else {
        srfs::log::info("the peer did not answer: {}", to_text(answer.error()));
      }
    });
    return CallbackReturn::success;
  }

 private:
  std::shared_ptr<Client<lifecycle_msgs::srv::GetState>> peer_ =
      create_client<lifecycle_msgs::srv::GetState>("/ros2_peer/get_state");
  std::shared_ptr<Subscription<srfs_msgs::msg::TaskFlags>> flags_ =
      create_subscription(suite::topics::task_flags, [](const srfs_msgs::msg::TaskFlags&) {});
};

}  // namespace

int main(int argc, char** argv) {
  return srfs::suite::run_node<ConformanceNode>(argc, argv);
}
