// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/diagnostics_command.hpp"

#include <fmt/format.h>
#include <sys/epoll.h>

#include "base/signals.hpp"
#include "programs/srfs/bus.hpp"
#include "programs/srfs/diagnostics.hpp"
#include "ros/publisher.hpp"
#include "ros/time_message.hpp"

namespace srfs::tool {
namespace {

using diagnostic_msgs::msg::DiagnosticArray;
using srfs_msgs::srv::GetNodeStatus;

const ros::Topic<DiagnosticArray> diagnostics_topic{"/diagnostics", {}};
const ros::Topic<DiagnosticArray> aggregated_topic{"/diagnostics_agg", {}};

/// Asks the nodes and publishes what is known of them.
class Diagnostics {
 public:
  Diagnostics(Bus& bus, const Target& target, milliseconds period)
      : target_(target),
        period_(period),
        publisher_(*bus.participant, diagnostics_topic),
        aggregated_(*bus.participant, aggregated_topic) {
    for (const suite::NodeEntry& node : target.deployment.nodes) {
      nodes_.push_back({.node = node.name});
      clients_.push_back(bus.client<GetNodeStatus>("/" + node.name + "/get_status"));
    }
    ask();
    timer_ = bus.executor.add_timer(
        monotonic_now() + period, period,
        [this] {
          publish();
          ask();
        },
        "diagnostics");
  }

 private:
  void ask() {
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      clients_[i]->call({}, period_, 1,
                        [this, i](const Result<GetNodeStatus::Response, ros::CallError>& answer) {
                          if (!answer) return;
                          nodes_[i].answer = *answer;
                          nodes_[i].answered = monotonic_now();
                        });
    }
  }

  void publish() {
    DiagnosticArray array;
    array.header.stamp = ros::to_message(system_utc_now());
    for (NodeHealth& node : nodes_) {
      node.instance = suite::find_instance(target_.var, node.node);
      node.starts = suite::read_start_record(target_.var, node.node);
      array.status.push_back(diagnose(node, target_.deployment.name, monotonic_now()));
    }
    publisher_.publish(array);
    array.status = aggregate(array.status, target_.deployment.name);
    aggregated_.publish(array);
  }

  const Target& target_;
  milliseconds period_;
  ros::Publisher<DiagnosticArray> publisher_;
  ros::Publisher<DiagnosticArray> aggregated_;
  std::vector<NodeHealth> nodes_;
  std::vector<std::unique_ptr<ros::Client<GetNodeStatus>>> clients_;
  ros::Timer timer_;
};

}  // namespace

int publish_diagnostics(const Target& target, milliseconds period) {
  const auto domain = running_domain(target);
  if (!domain) {
    fmt::print(stderr, "srfs diagnostics: the suite is not running (no {})\n",
               target.var.domain_file().string());
    return 1;
  }
  const Fd signals = termination_signals();
  Bus bus(target, *domain);
  const auto watch = bus.executor.add_fd(signals.get(), EPOLLIN, [&](std::uint32_t) { bus.executor.stop(); });
  Diagnostics diagnostics(bus, target, period);
  fmt::print(stderr, "srfs diagnostics: domain {}, until Ctrl-C\n", *domain);
  bus.executor.spin();
  return 0;
}

}  // namespace srfs::tool
