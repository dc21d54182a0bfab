// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The node that the benchmarks start, stop and measure. It has the parts of every lifecycle node (lifecycle
// and parameter services, log, events, the graph) and, with beat_period_ms, one topic that links it with the
// other benchmark nodes.

#include <algorithm>
#include <map>

#include "suite/node.hpp"
#include "suite/run_node.hpp"
#include "tests/bench/messages.hpp"

namespace srfs::bench {

class BenchNode final : public suite::Node {
 public:
  explicit BenchNode(suite::NodeContext& context) : Node(context) {
    period_ = milliseconds(declare_parameter<std::int64_t>(
        "beat_period_ms", 0, {0, 10000, 1}, "Period of /bench/beat, ms; 0: an idle node", true));
  }

 private:
  ros::CallbackReturn on_activate() override {
    if (period_ == milliseconds(0)) return ros::CallbackReturn::success;
    beats_ = create_publisher(beat_topic);
    others_ = create_subscription(beat_topic, [this](const Beat& beat) {
      if (heard_.size() < 64 || heard_.contains(beat.source.name))
        heard_[beat.source.name] = beat.source.incarnation;
    });
    timer_ = create_timer(
        period_, [this] { beat(); }, "beat");
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_deactivate() override {
    timer_.reset();
    others_.reset();
    beats_.reset();
    return ros::CallbackReturn::success;
  }
  void beat() {
    Beat m{.source = {name(), incarnation()},
           .publishers = static_cast<std::uint32_t>(others_->publisher_count()),
           .subscribers = static_cast<std::uint32_t>(beats_->subscription_count()),
           .heard = {}};
    for (const auto& [source, number] : heard_) m.heard.push_back({source, number});
    beats_->publish(m);
  }

  milliseconds period_{0};
  std::shared_ptr<ros::Publisher<Beat>> beats_;
  std::shared_ptr<ros::Subscription<Beat>> others_;
  std::map<std::string, std::uint32_t> heard_;
  ros::Timer timer_;
};

}  // namespace srfs::bench

int main(int argc, char** argv) {
  return srfs::suite::run_node<srfs::bench::BenchNode>(argc, argv);
}
