// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A node with interfaces of its own: a message and a service.

#include <beside_msgs/msg/sample.hpp>
#include <found_msgs/srv/find.hpp>
#include <messages/msg/own.hpp>

#include "suite/node.hpp"
#include "suite/run_node.hpp"

namespace {

using namespace srfs;

class MessagesNode : public suite::Node {
 public:
  explicit MessagesNode(suite::NodeContext& context) : Node(context) {}

 protected:
  ros::CallbackReturn on_activate() override {
    own_ = create_publisher(ros::Topic<messages::msg::Own>{"~/own", {}});
    samples_ = create_publisher(ros::Topic<beside_msgs::msg::Sample>{"~/sample", {}});
    find_ = create_service<found_msgs::srv::Find>(
        "~/find", [](const found_msgs::srv::Find::Request& request,
                     found_msgs::srv::Find::Response& response) { response.found.count = request.least; });
    return ros::CallbackReturn::success;
  }

 private:
  std::shared_ptr<ros::Publisher<messages::msg::Own>> own_;
  std::shared_ptr<ros::Publisher<beside_msgs::msg::Sample>> samples_;
  std::shared_ptr<ros::Service<found_msgs::srv::Find>> find_;
};

}  // namespace

int main(int argc, char** argv) {
  return srfs::suite::run_node<MessagesNode>(argc, argv);
}
