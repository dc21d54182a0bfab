// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <lifecycle_msgs/srv/get_state.hpp>

#include "base/fd.hpp"
#include "ros/client.hpp"
#include "suite/instance.hpp"
#include "tests/bench/process.hpp"
#include "tests/bench/raw_dds.hpp"
#include "tests/signal_child.hpp"
#include "tests/temporary_folder.hpp"

/// Starts and queries nodes of lib/ros and their raw peers for the measures.
namespace srfs::bench {

using lifecycle_msgs::srv::GetState;

constexpr milliseconds patience_for_an_answer{
    100};  // then the request is repeated, as by the suite's clients
constexpr seconds longest_wait{20};

[[nodiscard]] inline double ms(nanoseconds t) {
  return static_cast<double>(t.count()) / 1e6;
}

/// Processes on one domain with one folder: nodes of lib/ros and raw participants.
class Suite {
 public:
  enum class Ring : bool { off, on };
  /// @param beat_period_ms 0: idle nodes
  Suite(std::filesystem::path bin, int most_nodes, int beat_period_ms, Ring ring = Ring::off);
  /// Also ends processes that a ring has started.
  ~Suite();
  Suite(const Suite&) = delete;
  Suite& operator=(const Suite&) = delete;

  [[nodiscard]] static std::string name(int i) { return fmt::format("bench_{}", i); }
  [[nodiscard]] int domain() const { return domain_.domain(); }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_.path(); }
  [[nodiscard]] Child start_node(int i) const {
    return Child({bin_ / "bench_node", "--name", name(i), "--deployment", deployment(), "--var", folder(),
                  "--domain", std::to_string(domain())},
                 folder() / "bench.log");
  }
  /// @param asked  nodes to query every 100 ms
  [[nodiscard]] Child start_raw(int i, int writers, int readers, const std::vector<int>& asked = {}) const;
  [[nodiscard]] suite::VarPaths var() const { return {folder()}; }

 private:
  [[nodiscard]] std::filesystem::path deployment() const { return folder_.path() / "bench.yaml"; }
  std::filesystem::path bin_;
  int most_nodes_;
  testing_support::TemporaryFolder folder_;
  suite::DomainLock domain_;
};

/// Asks one node for its state, from a separate participant.
class StateClient {
 public:
  StateClient(int domain, const std::string& node)
      : participant_(ros::Participant::create({.domain = domain, .executor = &executor_}).value()),
        client_(executor_, *participant_, "/" + node + "/get_state", {}, ros::Priority::normal) {}

  /// Asks until an answer arrives. @return time of the answer; nullopt after longest_wait
  std::optional<MonotonicTime> ask() {
    const MonotonicTime give_up = monotonic_now() + longest_wait;
    bool answered = false;
    while (!answered && monotonic_now() < give_up) {
      bool ended = false;
      client_.call(GetState::Request{}, patience_for_an_answer, 1,
                   [&](const Result<GetState::Response, ros::CallError>& reply) {
                     ended = true;
                     answered = reply.has_value();
                   });
      executor_.spin_until([&] { return ended; }, give_up);
    }
    if (!answered) return std::nullopt;
    return monotonic_now();
  }
  [[nodiscard]] bool is_ready() const { return client_.is_ready(); }
  bool wait_until_gone() {
    return executor_.spin_until([this] { return !client_.is_ready(); }, monotonic_now() + longest_wait);
  }

 private:
  ros::Executor executor_;
  std::unique_ptr<ros::Participant> participant_;
  ros::Client<GetState> client_;
};

/// The same for a raw node.
class RawStateClient {
 public:
  RawStateClient(int domain, const std::string& node)
      : participant_(raw_participant(domain)), client_(*participant_, "bench_raw/" + node) {}
  std::optional<MonotonicTime> ask() {
    const MonotonicTime give_up = monotonic_now() + longest_wait;
    while (monotonic_now() < give_up) {
      if (client_.is_ready()) {
        if (const auto answered = client_.call(1, patience_for_an_answer)) return answered;
      } else {
        std::this_thread::sleep_for(microseconds(200));
      }
    }
    return std::nullopt;
  }
  void wait_until_gone() {
    const MonotonicTime give_up = monotonic_now() + longest_wait;
    while (client_.is_ready() && monotonic_now() < give_up) std::this_thread::sleep_for(milliseconds(1));
  }

 private:
  std::unique_ptr<ros::Participant> participant_;
  RawClient client_;
};

struct Endpoints {
  int writers = 0;
  int readers = 0;
};
/// The number of a node's endpoints: those it announces to the ROS graph, plus the announcing writer.
[[nodiscard]] Endpoints endpoints_of(int domain, const std::string& node);

/// Starts @p count nodes from number @p first on and waits until all answer.
[[nodiscard]] std::vector<Child> start_nodes(const Suite& suite, int first, int count);

/// CPU time of each process so far.
[[nodiscard]] std::vector<nanoseconds> cpu_times_of(const std::vector<Child>& processes);

/// Smallest, median, largest.
[[nodiscard]] Json spread(std::vector<double> values);

}  // namespace srfs::bench
