// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The fate of a node whose callbacks fail, throw or take too long.

#include <set>
#include <stdexcept>

#include <mission/structures.hpp>
#include <rcl_interfaces/srv/get_parameters.hpp>
#include <srfs_msgs/srv/get_node_status.hpp>

#include "tests/node/suite/node_fixture.hpp"

namespace srfs::suite {
namespace {

using srfs_msgs::srv::GetNodeStatus;
using testing::ElementsAre;
using testing::HasSubstr;
using Outcome = ros::LastTransition::Outcome;

class NodeErrors : public ScriptedNodeTest {
 protected:
  void SetUp() override {
    ScriptedNodeTest::SetUp();
    events_ = std::make_unique<ros::Subscription<srfs_msgs::msg::Event>>(
        executor_, *there_, topics::event,
        [this](const srfs_msgs::msg::Event& e, const ros::MessageInfo&) { heard_.push_back(e); });
    ASSERT_TRUE(is_heard(*events_));
  }
  void TearDown() override {
    events_.reset();
    ScriptedNodeTest::TearDown();
  }
  template <class Event>
  std::optional<Event> heard() {
    std::optional<Event> found;
    wait([&] {
      for (const auto& e : heard_) {
        if (e.event_id == Event::event_id) found = Event::decode(OctetView(e.data));
      }
      return found.has_value();
    });
    return found;
  }
  /// Runs @p what in a timer callback.
  void in_a_callback(std::function<void()> what) {
    bool ran = false;
    const auto timer = node_->create_one_shot(
        monotonic_now(),
        [&] {
          ran = true;
          what();
        },
        "faulty");
    ASSERT_TRUE(wait([&] { return ran; }));
  }
  std::unique_ptr<ros::Subscription<srfs_msgs::msg::Event>> events_;
  std::vector<srfs_msgs::msg::Event> heard_;
};

TEST_F(NodeErrors, AThrowingCallbackOfAnActiveNodeEndsInUnconfiguredAndTheProcessGoesOn) {
  ASSERT_TRUE(node_->go_to(ros::State::active));
  node_->calls.clear();
  in_a_callback([] { throw std::runtime_error("index 7 of 3"); });
  EXPECT_EQ(node_->state(), ros::State::unconfigured);
  EXPECT_THAT(node_->calls, ElementsAre("error"));
  EXPECT_EQ(node_->failed_callbacks(), 1U);
  EXPECT_EQ(node_->last_transition().reason, "timer faulty: index 7 of 3");

  const auto failed = heard<mission::NodeCallbackFailedEvent>();
  ASSERT_TRUE(failed);
  EXPECT_EQ(failed->callback, "faulty");
  EXPECT_EQ(failed->what, "index 7 of 3");
  EXPECT_TRUE(heard<mission::NodeErrorEvent>());
  EXPECT_TRUE(node_->go_to(ros::State::active)) << "it can be used again";
}

TEST_F(NodeErrors, WhatIsThrownNeedNotBeAnException) {
  ASSERT_TRUE(node_->go_to(ros::State::inactive));
  in_a_callback([] { throw 17; });
  EXPECT_EQ(node_->state(), ros::State::unconfigured);
}

TEST_F(NodeErrors, AThrowingSubscriptionIsCaughtAndTheNextMessageArrives) {
  ASSERT_TRUE(node_->go_to(ros::State::active));
  std::vector<std::uint64_t> got;
  const ros::Topic<srfs_msgs::msg::TimeTick> topic{"/test/tick", {}};
  const auto subscription = node_->create_subscription(topic, [&](const srfs_msgs::msg::TimeTick& t) {
    got.push_back(t.cycle);
    if (t.cycle == 1) throw std::runtime_error("bad cycle");
  });
  ros::Publisher<srfs_msgs::msg::TimeTick> publisher(*there_, topic);
  ASSERT_TRUE(
      wait([&] { return publisher.subscription_count() == 1 && subscription->publisher_count() == 1; }));
  for (const std::uint64_t cycle : {1, 2}) {
    srfs_msgs::msg::TimeTick tick;
    tick.cycle = cycle;
    publisher.publish(tick);
    ASSERT_TRUE(wait([&] { return !got.empty() && got.back() == cycle; }));
  }
  EXPECT_THAT(got, ElementsAre(1, 2));
  EXPECT_EQ(node_->failed_callbacks(), 1U);
  EXPECT_EQ(node_->state(), ros::State::unconfigured);
}

TEST_F(NodeErrors, AThrowingWorkerJobIsAnErrorOfTheNode) {
  ASSERT_TRUE(node_->go_to(ros::State::active));
  const auto worker = node_->create_worker("test", 2);
  bool done = false;
  EXPECT_TRUE(worker->post([] { throw std::runtime_error("no space"); }, [&] { done = true; }));
  ASSERT_TRUE(wait([&] { return node_->state() == ros::State::unconfigured; }));
  EXPECT_FALSE(done);
  EXPECT_EQ(worker->progress().failed, 1U);
  EXPECT_THAT(node_->last_transition().reason, HasSubstr("worker test: no space"));
}

TEST_F(NodeErrors, RaiseErrorTakesEffectWhenTheCallbackHasReturned) {
  for (const ros::State from : {ros::State::unconfigured, ros::State::inactive, ros::State::active}) {
    ASSERT_TRUE(node_->go_to(from));
    node_->calls.clear();
    in_a_callback([&] {
      node_->raise_error("the receiver is gone");
      node_->raise_error("a consequence");
      EXPECT_EQ(node_->state(), from);
    });
    ASSERT_TRUE(wait([&] { return !node_->calls.empty(); }));
    EXPECT_THAT(node_->calls, ElementsAre("error"));
    EXPECT_EQ(node_->state(), ros::State::unconfigured);
    EXPECT_EQ(node_->last_transition().reason, "the receiver is gone");
    EXPECT_EQ(node_->last_transition().label, "raise_error");
  }
}

TEST_F(NodeErrors, AFailingOnErrorEndsInFinalizedWithBothReasons) {
  ASSERT_TRUE(node_->go_to(ros::State::active));
  node_->error = []() -> ros::CallbackReturn { throw std::runtime_error("cannot close"); };
  in_a_callback([] { throw std::runtime_error("first"); });
  EXPECT_EQ(node_->state(), ros::State::finalized);
  EXPECT_EQ(node_->last_transition().reason, "timer faulty: first; then cannot close");
  in_a_callback([] { throw std::runtime_error("again"); });
  EXPECT_EQ(node_->state(), ros::State::finalized);
  EXPECT_EQ(node_->failed_callbacks(), 2U) << "still counted";
}

TEST_F(NodeErrors, AFailedTransitionHasItsReasonInStatusAndEvent) {
  node_->configure = [this] {
    node_->set_failure_reason("no such device");
    return ros::CallbackReturn::failure;
  };
  EXPECT_FALSE(change("configure"));
  const auto status = call<GetNodeStatus>("/probe/get_status", {});
  EXPECT_EQ(status.state_label, "unconfigured");
  EXPECT_EQ(status.last_transition, "configure");
  EXPECT_EQ(status.last_outcome, GetNodeStatus::Response::FAILED);
  EXPECT_EQ(status.last_reason, "no such device");
  EXPECT_EQ(status.failed_transitions, 1U);
  const auto event = heard<mission::NodeTransitionFailedEvent>();
  ASSERT_TRUE(event);
  EXPECT_EQ(event->reason, "no such device");
  EXPECT_EQ(event->state, "unconfigured");
}

TEST_F(NodeErrors, ARefusedTransitionChangesNothingAndHasItsReasonInStatusAndEvent) {
  EXPECT_FALSE(change("activate"));
  const auto status = call<GetNodeStatus>("/probe/get_status", {});
  EXPECT_EQ(status.state_label, "unconfigured");
  EXPECT_EQ(status.last_outcome, GetNodeStatus::Response::REFUSED);
  EXPECT_EQ(status.last_reason, "not possible in state unconfigured");
  EXPECT_EQ(status.failed_transitions, 0U);
  const auto event = heard<mission::NodeTransitionRefusedEvent>();
  ASSERT_TRUE(event);
  EXPECT_EQ(event->transition, "activate");
}

TEST_F(NodeErrors, ATransitionPastItsDeadlineIsReportedAsLateNotAsFailed) {
  ASSERT_EQ(node_->parameters().set_atomically({{"transition_deadline_ms", std::int64_t{1}}})[0], "");
  node_->configure = [] {
    const MonotonicTime end = monotonic_now() + milliseconds(5);
    while (monotonic_now() < end) {
    }
    return ros::CallbackReturn::success;
  };
  EXPECT_TRUE(change("configure"));
  const auto status = call<GetNodeStatus>("/probe/get_status", {});
  EXPECT_EQ(status.last_outcome, GetNodeStatus::Response::SUCCEEDED);
  EXPECT_TRUE(status.last_was_late);
  EXPECT_EQ(status.last_reason, "");
  const auto event = heard<mission::NodeTransitionLateEvent>();
  ASSERT_TRUE(event);
  EXPECT_EQ(event->state, "configuring");
  EXPECT_GE(event->took_ms, 5U);
  EXPECT_EQ(event->deadline_ms, 1U);
}

// Every request in every state, with every outcome of its callback and of on_error. The tests compare them
// with an independent copy of the rules of the ROS 2 design.
class TransitionOutcomes : public ScriptedNodeTest {
 protected:
  enum class Does : std::uint8_t { succeed, fail, err, except };
  static constexpr std::array all_outcomes{Does::succeed, Does::fail, Does::err, Does::except};

  static ros::CallbackReturn play(Does does) {
    switch (does) {
      case Does::succeed:
        return ros::CallbackReturn::success;
      case Does::fail:
        return ros::CallbackReturn::failure;
      case Does::err:
        return ros::CallbackReturn::error;
      case Does::except:
        break;
    }
    throw std::runtime_error("scripted");
  }
  /// The state after @p request in state @p from; nullopt if the request is refused.
  static std::optional<ros::State> expected(ros::State from, const std::string& request, Does does,
                                            Does on_error) {
    const std::map<std::pair<ros::State, std::string>, std::pair<ros::State, ros::State>> table{
        // from, request -> success, failure
        {{ros::State::unconfigured, "configure"}, {ros::State::inactive, ros::State::unconfigured}},
        {{ros::State::inactive, "cleanup"}, {ros::State::unconfigured, ros::State::inactive}},
        {{ros::State::inactive, "activate"}, {ros::State::active, ros::State::inactive}},
        {{ros::State::active, "deactivate"}, {ros::State::inactive, ros::State::active}},
        {{ros::State::unconfigured, "shutdown"}, {ros::State::finalized, ros::State::finalized}},
        {{ros::State::inactive, "shutdown"}, {ros::State::finalized, ros::State::finalized}},
        {{ros::State::active, "shutdown"}, {ros::State::finalized, ros::State::finalized}},
    };
    const auto row = table.find({from, request});
    if (row == table.end()) return std::nullopt;
    if (does == Does::succeed) return row->second.first;
    // An exception while configuring, as for a missing device or key, is a failure and not an error.
    if (does == Does::fail || (does == Does::except && request == "configure")) return row->second.second;
    return on_error == Does::succeed ? ros::State::unconfigured : ros::State::finalized;
  }
};

TEST_F(TransitionOutcomes, AreThoseOfTheDesignInEveryCase) {
  int accepted = 0;
  int refused = 0;
  for (const ros::State from :
       {ros::State::unconfigured, ros::State::inactive, ros::State::active, ros::State::finalized}) {
    for (const std::string request :
         {"configure", "cleanup", "activate", "deactivate", "shutdown", "nonsense"}) {
      for (const Does does : all_outcomes) {
        for (const Does on_error : all_outcomes) {
          if (node_->state() == ros::State::finalized) start_node();
          node_->configure = node_->activate = node_->deactivate = node_->cleanup = node_->shutdown =
              node_->error = {};
          ASSERT_TRUE(node_->go_to(from));
          node_->configure = node_->activate = node_->deactivate = node_->cleanup =
              node_->shutdown = [does] { return play(does); };
          node_->error = [on_error] { return play(on_error); };

          const auto result = node_->request_transition(0, request);

          const auto wanted = expected(from, request, does, on_error);
          ASSERT_EQ(result.has_value(), wanted.has_value()) << label(from) << " " << request;
          ASSERT_EQ(node_->state(), wanted.value_or(from)) << label(from) << " " << request;
          const ros::LastTransition& last = node_->last_transition();
          if (!wanted) {
            ++refused;
            EXPECT_EQ(last.outcome, Outcome::refused);
          } else {
            ++accepted;
            EXPECT_EQ(result->succeeded, does == Does::succeed);
            EXPECT_EQ(last.outcome == Outcome::succeeded, does == Does::succeed);
            EXPECT_EQ(last.label, request);
          }
          EXPECT_EQ(last.reason.empty(), last.outcome == Outcome::succeeded);
        }
      }
    }
  }
  EXPECT_EQ(accepted, 7 * 16);
  EXPECT_EQ(refused, 17 * 16);
}

}  // namespace
}  // namespace srfs::suite
