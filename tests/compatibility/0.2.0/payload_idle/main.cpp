// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A payload without access to the CAN bus, as the paper's maintenance experiment begins with (section VI.D):
// it is in the plan, and gives every slot back unused. `./run experiment fig16` replaces it in flight by one
// that uses the bus.
#include "ros/node.hpp"
#include "ros/run_node.hpp"

namespace {

using namespace srfs;

class IdlePayloadNode : public ros::LifecycleNode {
 public:
  using LifecycleNode::LifecycleNode;

 protected:
  ros::CallbackReturn on_activate() override {
    statuses_ = create_publisher(ros::topics::bus_status);
    activities_ = create_publisher(ros::topics::activity(name()));
    flags_ = create_subscription(ros::topics::task_flags,
                                 [this](const srfs_msgs::msg::TaskFlags& flags) { give_back(flags); });
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_deactivate() override {
    flags_.reset();
    activities_.reset();
    statuses_.reset();
    return ros::CallbackReturn::success;
  }

 private:
  /// An empty holder asks everybody to end what an earlier switcher granted.
  void give_back(const srfs_msgs::msg::TaskFlags& flags) {
    if (flags.holder != name() && !flags.holder.empty()) return;
    srfs_msgs::msg::BusStatus status;
    status.status = srfs_msgs::msg::BusStatus::RELEASED;
    status.switcher_incarnation = flags.switcher_incarnation;
    status.grant_counter = flags.grant_counter;
    status.payload = name();
    status.payload_incarnation = incarnation();
    status.monotonic_ns = static_cast<std::uint64_t>(now().ns());
    statuses_->publish(status);
    srfs_msgs::msg::PayloadActivity activity;
    activity.payload = name();
    activity.state = srfs_msgs::msg::PayloadActivity::OFF;
    activity.monotonic_ns = status.monotonic_ns;
    activity.cycle = flags.cycle;
    activities_->publish(activity);
  }

  std::shared_ptr<ros::Publisher<srfs_msgs::msg::BusStatus>> statuses_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::PayloadActivity>> activities_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::TaskFlags>> flags_;
};

}  // namespace

int main(int argc, char** argv) {
  return ros::run_node<IdlePayloadNode>(argc, argv);
}
