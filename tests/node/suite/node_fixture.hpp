// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <lifecycle_msgs/srv/change_state.hpp>
#include <lifecycle_msgs/srv/get_state.hpp>

#include "base/file.hpp"
#include "suite/node.hpp"
#include "tests/dds_domain.hpp"
#include "tests/var_folder.hpp"

namespace srfs::suite {

/// A node whose callbacks the test defines.
class ScriptedNode : public Node {
 public:
  using Script = std::function<ros::CallbackReturn()>;

  explicit ScriptedNode(NodeContext& context) : Node(context) {
    declare_parameter("period_ms", std::int64_t{100}, ros::ParameterRange{10, 1000}, "Period");
    declare_parameter("window", std::int64_t{4}, ros::ParameterRange{1, 64}, "Window", true);
    declare_parameter("guarded_ms", std::int64_t{100}, ros::ParameterRange{10, 1000},
                      "On trial when changed");
  }

  Script configure, activate, deactivate, cleanup, shutdown, error;
  std::vector<std::string> calls;

  // Makes the node's other functions accessible to tests.
  using Node::create_one_shot;
  using Node::create_subscription;
  using Node::create_timer;
  using Node::create_worker;
  using Node::get_parameter;

 protected:
  ros::CallbackReturn on_configure() override { return play("configure", configure); }
  ros::CallbackReturn on_activate() override { return play("activate", activate); }
  ros::CallbackReturn on_deactivate() override { return play("deactivate", deactivate); }
  ros::CallbackReturn on_cleanup() override { return play("cleanup", cleanup); }
  ros::CallbackReturn on_shutdown() override { return play("shutdown", shutdown); }
  ros::CallbackReturn on_error() override { return play("error", error); }

 private:
  ros::CallbackReturn play(const char* name, const Script& script) {
    calls.emplace_back(name);
    return script ? script() : ros::CallbackReturn::success;
  }
};

/// A scripted node "probe" in one participant and a client's participant beside it; one work thread serves
/// both, so callbacks never overlap.
class ScriptedNodeTest : public testing::Test {
 protected:
  /// One pair for all tests of the program: Fast DDS never reuses participant numbers in a process, and
  /// discovery reaches only the first 32 numbers.
  static ros::Participant* shared_participant(std::size_t side) {
    static const auto make = [] {
      return ros::Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value().release();
    };
    static const std::array<ros::Participant*, 2> both{make(), make()};
    return both.at(side);
  }
  void SetUp() override {
    ASSERT_TRUE(write_file_atomically(
        folder_ / "d.yaml",
        "deployment: t\nnodes: [{name: probe, executable: x, parameters: {period_ms: 50}}]\n"));
    deployment_ = std::make_unique<Deployment>(Deployment::load(folder_ / "d.yaml"));
    start_node();
  }
  void TearDown() override { node_.reset(); }
  /// Creates a new node, as after a restart of its process.
  void start_node() {
    node_.reset();
    context_ = std::make_unique<NodeContext>(
        NodeContext{"probe", *deployment_, VarPaths{folder_}, ++incarnation_, executor_, *here_});
    context_->tables = {guarded_parameters, {}};
    node_ = std::make_unique<ScriptedNode>(*context_);
    node_->finish_declarations();
  }
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(20));
  }
  template <class S>
  typename S::Response call(const std::string& name, const typename S::Request& request) {
    ros::Client<S> client(executor_, *there_, name, ros::Qos{}, ros::Priority::normal);
    std::optional<typename S::Response> answer;
    // The first request may go to the server of the node that was just destroyed.
    client.call(request, seconds(5), 3, [&](const Result<typename S::Response, ros::CallError>& r) {
      if (r) answer = *r;
    });
    EXPECT_TRUE(wait([&] { return answer.has_value(); })) << name;
    return answer.value_or(typename S::Response{});
  }
  /// Waits until everything that the node publishes arrives. A match at the reader does not imply one at the
  /// writer. But discovery announces endpoints in order, so a node that answers a later client knows the
  /// reader.
  template <class S>
  bool is_heard(const S& subscription) {
    if (!wait([&] { return subscription.publisher_count() == 1; })) return false;
    call<lifecycle_msgs::srv::GetState>("/probe/get_state", {});
    return !HasFailure();
  }
  bool change(const std::string& label) {
    lifecycle_msgs::srv::ChangeState_Request request;
    request.transition.label = label;
    return call<lifecycle_msgs::srv::ChangeState>("/probe/change_state", request).success;
  }

  static constexpr std::array guarded_parameters{mission::GuardedParameter{"probe", "guarded_ms"},
                                                 mission::GuardedParameter{"another", "period_ms"}};
  ros::Executor executor_;
  ros::Participant* here_ = shared_participant(0);
  ros::Participant* there_ = shared_participant(1);
  const testing_support::VarFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  std::unique_ptr<Deployment> deployment_;
  std::uint32_t incarnation_ = 0;
  std::unique_ptr<NodeContext> context_;
  std::unique_ptr<ScriptedNode> node_;
};

}  // namespace srfs::suite
