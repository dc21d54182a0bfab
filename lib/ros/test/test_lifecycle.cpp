// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <set>

#include <gtest/gtest.h>

#include "ros/lifecycle.hpp"

namespace srfs::ros {
namespace {

TEST(LifecycleTable, HasEveryTransitionOfRos2AndNoOther) {
  // rcl_lifecycle/src/default_state_machine.c: 7 requests, 6 transition states x 3 outcomes.
  EXPECT_EQ(lifecycle_table().size(), 25U);
  std::set<int> ids;
  for (const LifecycleRow& row : lifecycle_table()) ids.insert(row.transition_id);
  EXPECT_EQ(ids, (std::set<int>{1,  2,  3,  4,  5,  6,  7,  10, 11, 12, 20, 21, 22,
                                30, 31, 32, 40, 41, 42, 50, 51, 52, 60, 61, 62}));
}

TEST(LifecycleTable, EveryPairOutsideItIsRefused) {
  int accepted = 0;
  for (int state = 0; state < 32; ++state) {
    for (int trigger = 0; trigger < 128; ++trigger) {
      if (find_row(static_cast<State>(state), static_cast<Trigger>(trigger)) != nullptr) ++accepted;
    }
  }
  EXPECT_EQ(accepted, 25);
}

TEST(LifecycleTable, RequestsLeadFromPrimaryToTransitionStatesAndOutcomesBack) {
  for (const LifecycleRow& row : lifecycle_table()) {
    if (static_cast<int>(row.trigger) < 10) {
      EXPECT_TRUE(is_primary(row.from)) << row.label;
      EXPECT_FALSE(is_primary(row.to)) << row.label;
    } else {
      EXPECT_FALSE(is_primary(row.from));
      EXPECT_TRUE(is_primary(row.to) || row.to == State::error_processing);
    }
  }
}

TEST(LifecycleTable, EveryTransitionStateHasAllThreeOutcomes) {
  for (const State state : {State::configuring, State::cleaning_up, State::activating, State::deactivating,
                            State::shutting_down, State::error_processing}) {
    for (const auto outcome : {CallbackReturn::success, CallbackReturn::failure, CallbackReturn::error}) {
      EXPECT_NE(find_row(state, to_trigger(outcome)), nullptr) << label(state);
    }
  }
}

TEST(LifecycleTable, ANodeMayRaiseAnErrorInEveryStateThatCanStillFail) {
  for (int state = 0; state < 32; ++state) {
    const LifecycleRow* row = find_error_row(static_cast<State>(state));
    const bool expected = state == 1 || state == 2 || state == 3;
    ASSERT_EQ(row != nullptr, expected) << state;
    if (row == nullptr) continue;
    EXPECT_EQ(row->to, State::error_processing);
    EXPECT_EQ(find_request(row->from, row->transition_id, ""), nullptr) << "nobody can request it";
    EXPECT_EQ(find_request(row->from, 0, row->label), nullptr);
  }
}

TEST(LifecycleTable, ARequestIsFoundByIdOrByLabel) {
  EXPECT_EQ(find_request(State::inactive, 3, "")->to, State::activating);
  EXPECT_EQ(find_request(State::inactive, 0, "activate")->to, State::activating);
  EXPECT_EQ(find_request(State::active, 0, "shutdown")->transition_id, 7);
  EXPECT_EQ(find_request(State::inactive, 2, "activate")->to, State::activating) << "the label decides";
  EXPECT_EQ(find_request(State::inactive, 3, "deactivate"), nullptr) << "not in this state";
  EXPECT_EQ(find_request(State::active, 3, ""), nullptr);
  EXPECT_EQ(find_request(State::configuring, 3, ""), nullptr) << "one transition at a time";
  EXPECT_EQ(find_request(State::finalized, 0, "configure"), nullptr);
}

TEST(Lifecycle, LabelsAreThoseOfRos2) {
  EXPECT_EQ(label(State::cleaning_up), "cleaningup");
  EXPECT_EQ(label(State::error_processing), "errorprocessing");
  EXPECT_EQ(primary_state("inactive"), State::inactive);
  EXPECT_FALSE(primary_state("activating"));
}

}  // namespace
}  // namespace srfs::ros
