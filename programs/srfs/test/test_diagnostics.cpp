// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <lifecycle_msgs/msg/state.hpp>

#include "programs/srfs/diagnostics.hpp"

namespace srfs::tool {
namespace {

using diagnostic_msgs::msg::DiagnosticStatus;
using Answer = srfs_msgs::srv::GetNodeStatus_Response;

const MonotonicTime now(seconds(100));

NodeHealth healthy() {
  NodeHealth health{.node = "timing",
                    .instance = suite::RunningInstance{.pid = 7, .incarnation = 3, .version = "0.2.0"},
                    .starts = {.starts = 3, .restarts = 2, .last_cause = "silent"},
                    .answer = Answer{},
                    .answered = now};
  health.answer->state = lifecycle_msgs::msg::State::PRIMARY_STATE_ACTIVE;
  health.answer->state_label = "active";
  return health;
}

/// "LEVEL message" with LEVEL 0 OK, 1 WARN, 2 ERROR, 3 STALE.
std::string judged(const NodeHealth& health) {
  const DiagnosticStatus status = diagnose(health, "sim", now);
  return std::to_string(status.level) + " " + status.message;
}

TEST(Diagnostics, ANodeThatWorksIsWell) {
  EXPECT_EQ(judged(healthy()), "0 active");
  const DiagnosticStatus status = diagnose(healthy(), "sim", now);
  EXPECT_EQ(status.name, "sim: timing");
  EXPECT_EQ(status.hardware_id, "sim");
  std::string values;
  for (const auto& value : status.values) values += value.key + "=" + value.value + ";";
  EXPECT_EQ(values,
            "restarts=2;last restart=silent;pid=7;incarnation=3;version=0.2.0;state=active;up for s=0;failed "
            "transitions=0;failed callbacks=0;");
}

TEST(Diagnostics, WhatIsWrongWithANodeIsItsLevelAndMessage) {
  NodeHealth health = healthy();
  health.instance.reset();
  EXPECT_EQ(judged(health), "2 not running");
  health = healthy();
  health.answered = now - longest_silence - milliseconds(1);
  EXPECT_EQ(judged(health), "3 not answering");
  health.answer.reset();
  EXPECT_EQ(judged(health), "3 not answering");
  health = healthy();
  health.answer->state = lifecycle_msgs::msg::State::PRIMARY_STATE_INACTIVE;
  health.answer->state_label = "inactive";
  EXPECT_EQ(judged(health), "1 inactive");
  health.answer->last_reason = "no device";
  EXPECT_EQ(judged(health), "1 inactive: no device");
  health = healthy();
  health.answer->last_outcome = Answer::FAILED;
  health.answer->last_transition = "cleanup";
  health.answer->last_reason = "busy";
  EXPECT_EQ(judged(health), "1 cleanup failed: busy");
  health = healthy();
  health.answer->failed_callbacks = 2;
  EXPECT_EQ(judged(health), "1 2 callbacks ended with an exception");
}

TEST(Diagnostics, TheSuiteIsAsWellAsItsWorstNode) {
  NodeHealth dead = healthy();
  dead.node = "ttc";
  dead.instance.reset();
  const auto tree = aggregate({diagnose(healthy(), "sim", now), diagnose(dead, "sim", now)}, "sim");
  ASSERT_EQ(tree.size(), 3U);
  EXPECT_EQ(tree[0].name, "/sim");
  EXPECT_EQ(tree[0].level, DiagnosticStatus::ERROR);
  EXPECT_EQ(tree[0].message, "1 of 2 nodes are well");
  EXPECT_EQ(tree[1].name, "/sim/timing");
  EXPECT_EQ(tree[2].name, "/sim/ttc");
  EXPECT_EQ(tree[2].message, "not running");
}

}  // namespace
}  // namespace srfs::tool
