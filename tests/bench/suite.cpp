// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/suite.hpp"

#include <algorithm>
#include <stdexcept>

#include "ros/publisher.hpp"

namespace srfs::bench {
namespace {

/// A DDS domain that the nodes started here share with the driver.
suite::DomainLock shared_domain() {
  auto lock = suite::DomainLock::allocate(std::nullopt, 60);
  if (!lock) throw std::runtime_error(lock.error());
  lock->downgrade();
  return std::move(*lock);
}

}  // namespace

Suite::Suite(std::filesystem::path bin, int most_nodes, int beat_period_ms, Ring ring)
    : bin_(std::move(bin)), most_nodes_(most_nodes), domain_(shared_domain()) {
  std::ofstream out(deployment());
  // The bench itself belongs to no suite, and publishes to the nodes.
  out << "deployment: bench\ndds: {orders: open}\n"
      << (ring == Ring::on ? "ring: {period_ms: 100}\n" : "") << "nodes:\n";
  for (int i = 0; i < most_nodes; ++i)
    out << fmt::format("  - {{name: {}, executable: bench_node, parameters: {{beat_period_ms: {}}}}}\n",
                       name(i), beat_period_ms);
}

Suite::~Suite() {
  for (int i = 0; i < most_nodes_; ++i) {
    if (const auto instance = suite::open_instance(var(), name(i)))
      testing_support::signal_child(instance->pid(), SIGKILL);
  }
  std::error_code ec;
  std::filesystem::remove_all(var().memory(), ec);
}

Child Suite::start_raw(int i, int writers, int readers, const std::vector<int>& asked) const {
  std::vector<std::string> command{bin_ / "bench_ros", "raw-node",
                                   "--domain",         std::to_string(domain()),
                                   "--name",           name(i),
                                   "--writers",        std::to_string(writers),
                                   "--readers",        std::to_string(readers)};
  for (const int other : asked) {
    command.emplace_back("--ask");
    command.push_back(name(other));
  }
  return Child(command, folder() / "bench.log");
}

Endpoints endpoints_of(int domain, const std::string& node) {
  ros::Executor executor;
  const auto participant = ros::Participant::create({.domain = domain, .executor = &executor}).value();
  Endpoints found;
  const auto graph = ros::TypedReader<ros::HumbleGraphMessage>::create(
      executor, *participant, "ros_discovery_info", {.depth = 64, .transient_local = true},
      ros::Priority::normal, [&](const ros::HumbleGraphMessage& m, const ros::MessageInfo&) {
        for (const auto& entry : m.node_entities_info_seq) {
          if (entry.node_name == node)
            found = {static_cast<int>(entry.writer_gid_seq.size()) + 1,
                     static_cast<int>(entry.reader_gid_seq.size())};
        }
      });
  StateClient client(domain, node);
  if (!client.ask()) throw std::runtime_error(node + " does not answer");
  executor.spin_until([&] { return found.readers > 0; }, monotonic_now() + longest_wait);
  graph->close();
  if (found.readers == 0) throw std::runtime_error(node + " is not in the ROS graph");
  return found;
}

std::vector<Child> start_nodes(const Suite& suite, int first, int count) {
  std::vector<Child> nodes;
  for (int i = first; i < first + count; ++i) nodes.push_back(suite.start_node(i));
  for (int i = first; i < first + count; ++i) {
    if (!StateClient(suite.domain(), Suite::name(i)).ask())
      throw std::runtime_error(Suite::name(i) + " did not come up");
  }
  return nodes;
}

Json spread(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return {{"min", values.front()}, {"median", values[values.size() / 2]}, {"max", values.back()}};
}

std::vector<nanoseconds> cpu_times_of(const std::vector<Child>& processes) {
  std::vector<nanoseconds> times;
  for (const Child& p : processes) times.push_back(cpu_time_of(p.pid()));
  return times;
}

}  // namespace srfs::bench
