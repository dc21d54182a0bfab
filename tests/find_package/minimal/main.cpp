// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The smallest lifecycle node: counts while it is active.

#include "suite/node.hpp"
#include "suite/run_node.hpp"

namespace {

using namespace srfs;

class MinimalNode : public suite::Node {
 public:
  explicit MinimalNode(suite::NodeContext& context) : Node(context) {}

 protected:
  ros::CallbackReturn on_activate() override {
    timer_ = create_timer(
        seconds(1), [this] { ++count_; }, "count");
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_deactivate() override {
    timer_.reset();
    return ros::CallbackReturn::success;
  }

 private:
  ros::Timer timer_;
  std::uint64_t count_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  return srfs::suite::run_node<MinimalNode>(argc, argv);
}
