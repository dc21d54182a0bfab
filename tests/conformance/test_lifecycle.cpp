// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The lifecycle services and ~/transition_event, octet by octet, as used by `ros2 lifecycle`.

#include <chrono>

#include "tests/conformance/node_process.hpp"

namespace srfs::conformance {
namespace {

/// lifecycle_msgs/msg/Transition and State are both {uint8 id, string label}.
struct Named {
  std::uint8_t id;
  const char* label;
};
struct Row {
  Named transition;
  Named start;
  Named goal;
};

constexpr Named unconfigured{1, "unconfigured"};
constexpr Named inactive{2, "inactive"};
constexpr Named active{3, "active"};
constexpr Named finalized{4, "finalized"};
constexpr Named configuring{10, "configuring"};
constexpr Named cleaning_up{11, "cleaningup"};
constexpr Named shutting_down{12, "shuttingdown"};
constexpr Named activating{13, "activating"};
constexpr Named deactivating{14, "deactivating"};
constexpr Named error_processing{15, "errorprocessing"};

Cdr& put(Cdr& cdr, const Named& named) {
  return cdr.u8(named.id).str(named.label);
}

Octets transitions(const std::vector<Row>& rows) {
  Cdr cdr;
  cdr.u32(static_cast<std::uint32_t>(rows.size()));
  for (const Row& row : rows) put(put(put(cdr, row.transition), row.start), row.goal);
  return cdr.payload();
}

const Octets empty_request{0, 1, 0, 0, 0, 0, 0, 0};
const Octets yes{0, 1, 0, 0, 1, 0, 0, 0};
const Octets no{0, 1, 0, 0, 0, 0, 0, 0};

class Lifecycle : public ConformanceTest {
 protected:
  RawClient client(const std::string& service, const std::string& type) {
    return {peer_, "/probe/" + service, "lifecycle_msgs::srv::dds_::" + type};
  }
  Octets change(std::uint8_t id, const std::string& label) {
    return change_.call(Cdr().u8(id).str(label).payload());
  }
  std::string state() { return hex(get_.call(empty_request)); }
  static std::string state_is(const Named& state) {
    Cdr cdr;
    return hex(put(cdr, state).payload());
  }
  /// Returns the node to unconfigured from any state.
  void TearDown() override {
    (void)change(0, "deactivate");
    (void)change(0, "cleanup");
    EXPECT_EQ(state(), state_is(unconfigured));
  }

  RawClient change_ = client("change_state", "ChangeState");
  RawClient get_ = client("get_state", "GetState");
};

TEST_F(Lifecycle, TheStateIsAnsweredToARequestOfOneDummyOctet) {
  EXPECT_EQ(hex(get_.call(empty_request)),
            "00010000"
            "01000000"
            "0d000000"
            "756e636f6e6669677572656400000000");
}

TEST_F(Lifecycle, AChangeIsAskedForByIdByLabelOrByBoth) {
  EXPECT_EQ(change(1, "configure"), yes) << "ros2 lifecycle set";
  EXPECT_EQ(state(), state_is(inactive));
  EXPECT_EQ(change(3, ""), yes) << "a node that manages others";
  EXPECT_EQ(state(), state_is(active));
  EXPECT_EQ(change(0, "deactivate"), yes) << "ros2 service call with a label only";
  EXPECT_EQ(state(), state_is(inactive));
}

TEST_F(Lifecycle, TheLabelDecidesOverTheId) {
  EXPECT_EQ(change(5, "configure"), yes);
  EXPECT_EQ(state(), state_is(inactive));
}

TEST_F(Lifecycle, WhatTheStateDoesNotAllowIsRefusedAndChangesNothing) {
  EXPECT_EQ(change(3, "activate"), no);
  EXPECT_EQ(change(10, ""), no) << "an outcome is nobody's request";
  EXPECT_EQ(change(0, "transition_success"), no);
  EXPECT_EQ(change(255, ""), no);
  EXPECT_EQ(state(), state_is(unconfigured));
}

TEST_F(Lifecycle, EveryStateIsListedInRclsOrder) {
  Cdr expected;
  expected.u32(11).u8(0).str("unknown");
  for (const Named& s : {unconfigured, inactive, active, finalized, configuring, cleaning_up, shutting_down,
                         activating, deactivating, error_processing}) {
    put(expected, s);
  }
  RawClient states = client("get_available_states", "GetAvailableStates");
  EXPECT_EQ(hex(states.call(empty_request)), hex(expected.payload()));
}

TEST_F(Lifecycle, TheTransitionsOfAStateAreThoseOfRcl) {
  RawClient available = client("get_available_transitions", "GetAvailableTransitions");
  EXPECT_EQ(hex(available.call(empty_request)),
            hex(transitions({{{1, "configure"}, unconfigured, configuring},
                             {{5, "shutdown"}, unconfigured, shutting_down}})));
  ASSERT_EQ(change(0, "configure"), yes);
  EXPECT_EQ(hex(available.call(empty_request)),
            hex(transitions({{{2, "cleanup"}, inactive, cleaning_up},
                             {{3, "activate"}, inactive, activating},
                             {{6, "shutdown"}, inactive, shutting_down}})));
  ASSERT_EQ(change(0, "activate"), yes);
  EXPECT_EQ(hex(available.call(empty_request)), hex(transitions({{{4, "deactivate"}, active, deactivating},
                                                                 {{7, "shutdown"}, active, shutting_down}})));
}

TEST_F(Lifecycle, TheTransitionGraphIsWhole) {
  // rcl_lifecycle/src/default_state_machine.c
  std::vector<Row> rows;
  const auto outcomes = [&](std::uint8_t first, const Named& from, const Named& success, const Named& failure,
                            const Named& error) {
    rows.push_back({{first, "transition_success"}, from, success});
    rows.push_back({{static_cast<std::uint8_t>(first + 1), "transition_failure"}, from, failure});
    rows.push_back({{static_cast<std::uint8_t>(first + 2), "transition_error"}, from, error});
  };
  rows.push_back({{1, "configure"}, unconfigured, configuring});
  outcomes(10, configuring, inactive, unconfigured, error_processing);
  rows.push_back({{2, "cleanup"}, inactive, cleaning_up});
  outcomes(20, cleaning_up, unconfigured, inactive, error_processing);
  rows.push_back({{3, "activate"}, inactive, activating});
  outcomes(30, activating, active, inactive, error_processing);
  rows.push_back({{4, "deactivate"}, active, deactivating});
  outcomes(40, deactivating, inactive, active, error_processing);
  rows.push_back({{5, "shutdown"}, unconfigured, shutting_down});
  rows.push_back({{6, "shutdown"}, inactive, shutting_down});
  rows.push_back({{7, "shutdown"}, active, shutting_down});
  outcomes(50, shutting_down, finalized, finalized, error_processing);
  outcomes(60, error_processing, unconfigured, finalized, finalized);
  RawClient graph = client("get_transition_graph", "GetAvailableTransitions");
  EXPECT_EQ(hex(graph.call(empty_request)), hex(transitions(rows)));
}

/// Receives ~/transition_event from a chosen moment on.
class TransitionEvents : public Lifecycle {
 protected:
  void SetUp() override {
    ASSERT_TRUE(events_.heard([&] {
      (void)change(0, "configure");
      (void)change(0, "cleanup");
    }));
    since_ = std::chrono::duration_cast<std::chrono::nanoseconds>(
                 std::chrono::system_clock::now().time_since_epoch())
                 .count();
  }
  /// Expects @p row as the next event of this test, with a stamp in nanoseconds of the system clock.
  void expect_event(const Row& row) {
    std::uint64_t timestamp = 0;
    const auto event = events_.next([&](const ReceivedSample& s) {
      timestamp = CdrView(s.payload).u64();
      return timestamp >= static_cast<std::uint64_t>(since_);
    });
    ASSERT_TRUE(event) << row.transition.label;
    Cdr expected;
    expected.u64(timestamp);
    put(put(put(expected, row.transition), row.start), row.goal);
    EXPECT_EQ(hex(event->payload), hex(expected.payload()));
  }

 private:
  RawReader events_{peer_, "rt/probe/transition_event", "lifecycle_msgs::msg::dds_::TransitionEvent_"};
  std::int64_t since_ = 0;
};

TEST_F(TransitionEvents, TellEveryStep) {
  ASSERT_EQ(change(0, "configure"), yes);
  expect_event({{1, "configure"}, unconfigured, configuring});
  expect_event({{10, "transition_success"}, configuring, inactive});
  ASSERT_EQ(change(0, "activate"), yes);
  expect_event({{3, "activate"}, inactive, activating});
  expect_event({{30, "transition_success"}, activating, active});
}

TEST_F(TransitionEvents, TellAFailureThatTheAnswerTellsToo) {
  RawClient set(peer_, "/probe/set_parameters", "rcl_interfaces::srv::dds_::SetParameters");
  const auto fail = [&](bool wanted) {
    Cdr request;
    request.u32(1).str("configure_fails").u8(1).u8(wanted ? 1 : 0);
    request.i64(0).f64(0).str("").u32(0).u32(0).u32(0).u32(0).u32(0);
    EXPECT_FALSE(set.call(request.payload()).empty());
  };
  fail(true);
  EXPECT_EQ(change(1, "configure"), no);
  fail(false);
  EXPECT_EQ(state(), state_is(unconfigured));
  expect_event({{1, "configure"}, unconfigured, configuring});
  expect_event({{11, "transition_failure"}, configuring, unconfigured});
}

}  // namespace
}  // namespace srfs::conformance
