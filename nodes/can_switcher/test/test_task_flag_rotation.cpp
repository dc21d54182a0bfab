// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "nodes/can_switcher/task_flag_rotation.hpp"

namespace srfs {
namespace {

constexpr std::uint32_t incarnation = 9;
constexpr MonotonicTime boot{seconds(10)};

std::vector<Slot> plan() {
  return {{"adcs", milliseconds(60), milliseconds(20), milliseconds(40)},
          {"eps", milliseconds(60), milliseconds(20), milliseconds(40)},
          {"thermal", milliseconds(50), milliseconds(10), milliseconds(20)}};
}

template <class Action>
const Action* find(const RotationActions& actions) {
  for (const RotationAction& action : actions) {
    if (const auto* const found = std::get_if<Action>(&action)) return found;
  }
  return nullptr;
}
template <class Action>
bool has(const RotationActions& actions) {
  return find<Action>(actions) != nullptr;
}
/// Nothing is done; at most a line is logged.
bool is_patient(const RotationActions& actions) {
  return actions.empty() || (actions.size() == 1 && has<ReportDoubt>(actions));
}
/// A tick on which the holder keeps the bus.
bool is_blocked(TaskFlagRotation& rotation, MonotonicTime now, MissionCycle cycle) {
  const std::uint32_t before = rotation.counters().blocked_ticks;
  return rotation.on_tick(now, cycle, now).empty() && rotation.counters().blocked_ticks == before + 1;
}
/// A tick on which what was granted before may not be over.
bool is_waiting(TaskFlagRotation& rotation, MonotonicTime now, MissionCycle cycle) {
  const std::uint32_t before = rotation.counters().waiting_ticks;
  return rotation.on_tick(now, cycle, now).empty() && rotation.counters().waiting_ticks == before + 1;
}

struct Rotation : ::testing::Test {
  TaskFlagRotation rotation{plan(), incarnation, boot};
  MonotonicTime now = boot + milliseconds(120);
  MissionCycle cycle = 0;

  RotationActions tick() { return rotation.on_tick(now, ++cycle, now); }
  bool tick_is_blocked() { return is_blocked(rotation, now, ++cycle); }
  bool tick_waits() { return is_waiting(rotation, now, ++cycle); }
  Grant must_grant() {
    const RotationActions actions = tick();
    EXPECT_TRUE(has<Grant>(actions));
    return has<Grant>(actions) ? *find<Grant>(actions) : Grant{};
  }
  ReportVerdict report(BusReport::Kind kind, const Grant& grant, std::uint32_t process = 5) {
    return rotation.on_bus_status({kind, grant.id, grant.payload, process}, now);
  }
  ReportVerdict take(const Grant& grant) { return report(BusReport::Kind::taken, grant); }
  ReportVerdict release(const Grant& grant) { return report(BusReport::Kind::released, grant); }
};
using TaskFlagRotationTest = Rotation;

TEST_F(TaskFlagRotationTest, GrantsInTheConfiguredOrder) {
  for (const char* expected : {"adcs", "eps", "thermal", "adcs", "eps"}) {
    const Grant grant = must_grant();
    EXPECT_EQ(grant.payload, expected);
    EXPECT_EQ(take(grant), ReportVerdict::applied);
    EXPECT_EQ(release(grant), ReportVerdict::applied);
    now += milliseconds(100);
  }
}

TEST_F(TaskFlagRotationTest, WaitsOutTheLongestLeaseAfterAStart) {
  now = boot + milliseconds(119);
  EXPECT_TRUE(tick_waits());
  now = boot + milliseconds(120);
  EXPECT_EQ(must_grant().payload, "adcs");
}

TEST_F(TaskFlagRotationTest, BlocksUntilThePreviousPayloadReleasesTheBus) {
  const Grant grant = must_grant();
  take(grant);
  now += milliseconds(70);
  EXPECT_TRUE(tick_is_blocked());
  EXPECT_EQ(rotation.holder()->slot, grant.slot);
  release(grant);
  EXPECT_EQ(must_grant().payload, "eps");
  EXPECT_EQ(rotation.counters().blocked_ticks, 1U);
}

TEST_F(TaskFlagRotationTest, TellsTheOverrunnerToResetItsPeripheralAndGoesOnAfterItsRelease) {
  const Grant grant = must_grant();
  take(grant);
  EXPECT_EQ(rotation.next_deadline(), grant.granted + milliseconds(80));
  now = grant.granted + milliseconds(79);
  EXPECT_TRUE(is_patient(rotation.on_deadline(now)));
  now = grant.granted + milliseconds(80);
  const RotationActions actions = rotation.on_deadline(now);
  ASSERT_TRUE(has<OrderReset>(actions));
  EXPECT_EQ(find<OrderReset>(actions)->payload, "adcs");
  EXPECT_TRUE(is_patient(rotation.on_deadline(now)));  // only once

  EXPECT_EQ(report(BusReport::Kind::failed, grant), ReportVerdict::applied);
  EXPECT_EQ(must_grant().payload, "eps");
  EXPECT_EQ(rotation.slot_counters(0).overruns, 1U);
  EXPECT_EQ(rotation.slot_counters(0).failed, 1U);
}

TEST_F(TaskFlagRotationTest, AsksTheHolderFirstWhenItCameLateToTheEndOfTheLeaseItself) {
  const Grant grant = must_grant();
  take(grant);
  now = grant.lease_end + seconds(3);  // the whole computer stood still
  const RotationActions actions = rotation.on_deadline(now);
  const auto* recall = find<Recall>(actions);
  ASSERT_NE(recall, nullptr);
  EXPECT_EQ(recall->payload, grant.payload);
  EXPECT_GT(recall->id, grant.id);
  EXPECT_EQ(release(grant), ReportVerdict::old_grant) << "what it said before is no answer";
  EXPECT_TRUE(has<Recall>(tick())) << "asked again, and nobody else is granted";
  now = *rotation.next_deadline();
  EXPECT_TRUE(has<Fence>(rotation.on_deadline(now))) << "who does not answer is frozen alone";
  EXPECT_EQ(rotation.counters().late_deadlines, 1U);
}

TEST_F(TaskFlagRotationTest, AccusesNobodyWhileItHearsNobodyAndAsksTheHolderWhenItHearsAgain) {
  const Grant grant = must_grant();
  take(grant);
  const MonotonicTime last_heard = grant.granted + milliseconds(40);
  now = grant.granted + milliseconds(80);
  EXPECT_TRUE(has<OrderReset>(rotation.on_deadline(now, last_heard)));
  for (now = grant.lease_end; now < grant.lease_end + seconds(1); now = *rotation.next_deadline())
    ASSERT_TRUE(is_patient(rotation.on_deadline(now, last_heard)));
  EXPECT_TRUE(tick_is_blocked()) << "and nobody else gets the bus";

  now = *rotation.next_deadline();
  const RotationActions actions = rotation.on_deadline(now, now - milliseconds(1));
  ASSERT_TRUE(has<Recall>(actions));
  EXPECT_EQ(find<Recall>(actions)->payload, grant.payload);
  EXPECT_EQ(rotation.counters().deaf_deadlines, 1U);
}

TEST_F(TaskFlagRotationTest, TakesAReleaseThatIsHeardAfterADeafTimeAndStartsTheNextSlotWithCleanHands) {
  const Grant grant = must_grant();
  take(grant);
  now = grant.lease_end;
  EXPECT_TRUE(is_patient(rotation.on_deadline(now, grant.granted)));
  EXPECT_EQ(release(grant), ReportVerdict::applied);
  const Grant next = must_grant();
  take(next);
  now = next.granted + milliseconds(80);
  EXPECT_TRUE(has<OrderReset>(rotation.on_deadline(now, now)));
  now = next.lease_end;
  EXPECT_TRUE(has<Fence>(rotation.on_deadline(now, now))) << "heard, and not released";
}

TEST_F(TaskFlagRotationTest, ThatHearsNobodyForLongFencesAfterAllOnceTheHolderDidNotAnswer) {
  const Grant grant = must_grant();
  take(grant);
  now = grant.lease_end;
  RotationActions actions;
  while (now < grant.lease_end + seconds(5) && !has<Fence>(actions)) {
    actions = rotation.on_deadline(now, grant.granted);
    now = rotation.next_deadline().value_or(now + milliseconds(20));
  }
  EXPECT_TRUE(has<Fence>(actions));
  EXPECT_GE(now, grant.lease_end + TaskFlagRotation::deaf_patience);
}

TEST_F(TaskFlagRotationTest, FencesAtTheEndOfTheLeaseAndGrantsOnlyAfterTheHolderIsGone) {
  const Grant grant = must_grant();
  take(grant);
  now = grant.granted + milliseconds(80);
  EXPECT_TRUE(has<OrderReset>(rotation.on_deadline(now)));
  now = grant.lease_end;
  EXPECT_TRUE(has<Fence>(rotation.on_deadline(now)));

  now += milliseconds(30);
  EXPECT_TRUE(tick_is_blocked());
  EXPECT_EQ(release(grant), ReportVerdict::old_grant);  // too late: the kill has begun
  EXPECT_TRUE(tick_is_blocked());

  rotation.on_fence_unproven();
  now += seconds(10);
  EXPECT_TRUE(tick_is_blocked()) << "a holder that is not proven dead may write";

  rotation.on_fenced(grant.id, now);
  EXPECT_TRUE(tick_waits());
  now += TaskFlagRotation::guard_time;
  EXPECT_EQ(must_grant().payload, "eps");
  EXPECT_EQ(rotation.slot_counters(0).fences, 1U);
}

TEST_F(TaskFlagRotationTest, AsksAHolderWithoutACpuAndWaitsWhileItHasNone) {
  const Grant grant = must_grant();
  take(grant);
  now = grant.granted + milliseconds(80);
  EXPECT_TRUE(has<OrderReset>(rotation.on_deadline(now)));
  now = grant.lease_end;
  // The holder had a CPU for only 30 of 120 ms.
  EXPECT_TRUE(
      has<Recall>(rotation.on_deadline(now, now, HolderCpu{milliseconds(90), milliseconds(5), true})));
  const MonotonicTime asked = now;
  EXPECT_TRUE(has<Recall>(tick())) << "nobody else has the bus meanwhile";
  for (int looks = 0; looks < 10; ++looks) {
    now = *rotation.next_deadline();
    ASSERT_TRUE(
        is_patient(rotation.on_deadline(now, now, HolderCpu{(now - asked) / 2, milliseconds(5), true})));
  }
  EXPECT_EQ(rotation.counters().starved_holders, 1U);
  EXPECT_EQ(release(grant), ReportVerdict::old_grant);
  EXPECT_EQ(release(*rotation.current()), ReportVerdict::applied);
  now += TaskFlagRotation::guard_time;
  EXPECT_EQ(must_grant().payload, "eps");
  EXPECT_EQ(rotation.slot_counters(0).fences, 0U);
}

TEST_F(TaskFlagRotationTest, RepeatsARecallWithEachTickAndLaterSeldom) {
  const Grant grant = must_grant();
  take(grant);
  now = grant.lease_end;
  ASSERT_TRUE(
      has<Recall>(rotation.on_deadline(now, now, HolderCpu{milliseconds(90), milliseconds(5), true})));
  int recalls = 0;
  for (int ticks = 0; ticks < 100; ++ticks) {
    now += milliseconds(100);
    const RotationActions actions = tick();
    recalls += has<Recall>(actions) ? 1 : 0;
    ASSERT_TRUE(has<Recall>(actions) || actions.empty());
  }
  EXPECT_EQ(recalls, 10 + 18);
  EXPECT_EQ(release(*rotation.current()), ReportVerdict::applied);
}

/// Its lease ends while it, or the bus, has no CPU; once it is recalled, both have one. It never answers.
void is_recalled_and_then_fenced(TaskFlagRotation& rotation, const Grant& grant, HolderCpu cpu) {
  (void)rotation.on_deadline(grant.granted + milliseconds(80));
  MonotonicTime now = grant.lease_end;
  RotationActions actions;
  bool recalled = false;
  while (!has<Fence>(actions)) {
    ASSERT_LE(now, grant.lease_end + seconds(20));
    actions = rotation.on_deadline(now, now, cpu);
    if (has<Recall>(actions)) cpu = {nanoseconds(0), milliseconds(2), false};
    recalled = recalled || has<Recall>(actions);
    if (!has<Fence>(actions)) now = *rotation.next_deadline();
  }
  EXPECT_TRUE(recalled);
  EXPECT_LE(now, grant.lease_end + TaskFlagRotation::held_up_recall_time + TaskFlagRotation::starved_look);
}

TEST_F(TaskFlagRotationTest, FencesAHolderThatCouldRunAgainAndDidNotAnswer) {
  const Grant grant = must_grant();
  take(grant);
  is_recalled_and_then_fenced(rotation, grant, HolderCpu{milliseconds(90), milliseconds(5), false});
}

TEST_F(TaskFlagRotationTest, RecallsAHolderWhoseFramesWaitForTheProcessOfASimulatedBus) {
  const Grant grant = must_grant();
  take(grant);
  is_recalled_and_then_fenced(rotation, grant,
                              HolderCpu{nanoseconds(0), milliseconds(2), false, milliseconds(100)});
}

TEST_F(TaskFlagRotationTest, FencesAtOnceAHolderThatSleepsLoopsOrIsStopped) {
  for (const HolderCpu& ill : {HolderCpu{nanoseconds(0), milliseconds(2), false},       // deadlock, SIGSTOP
                               HolderCpu{milliseconds(1), milliseconds(118), true}}) {  // loop
    const Grant grant = must_grant();
    take(grant);
    now = grant.granted + milliseconds(80);
    (void)rotation.on_deadline(now, now, ill);
    now = grant.lease_end;
    EXPECT_TRUE(has<Fence>(rotation.on_deadline(now, now, ill)));
    rotation.on_fenced(grant.id, now);
    now += TaskFlagRotation::guard_time;
  }
}

TEST_F(TaskFlagRotationTest, LooksOnceMoreAtAHolderThatMayJustHaveBegunToWait) {
  const Grant grant = must_grant();
  take(grant);
  now = grant.granted + milliseconds(80);
  (void)rotation.on_deadline(now);
  now = grant.lease_end;
  const HolderCpu runnable{nanoseconds(0), milliseconds(10), true};
  EXPECT_TRUE(is_patient(rotation.on_deadline(now, now, runnable)));
  now = *rotation.next_deadline();
  EXPECT_EQ(now, grant.lease_end + TaskFlagRotation::starved_look);
  EXPECT_TRUE(has<Fence>(rotation.on_deadline(now, now, runnable))) << "it did not wait";
}

TEST_F(TaskFlagRotationTest, FencesAHolderThatStarvesForLongerThanThePatienceWhichARecallDoesNotRenew) {
  const Grant grant = must_grant();
  take(grant);
  now = grant.granted + milliseconds(80);
  (void)rotation.on_deadline(now);
  now = grant.lease_end;
  MonotonicTime counted_from = grant.granted;
  RotationActions actions;
  while (!has<Fence>(actions) && now < grant.lease_end + seconds(20)) {
    actions = rotation.on_deadline(now, now, HolderCpu{now - counted_from, nanoseconds(0), true});
    if (has<Recall>(actions)) counted_from = now;
    if (!has<Fence>(actions)) now = *rotation.next_deadline();
  }
  EXPECT_GE(now, grant.lease_end + TaskFlagRotation::starved_patience);
  EXPECT_LE(now, grant.lease_end + TaskFlagRotation::starved_patience + TaskFlagRotation::starved_look);
  EXPECT_EQ(rotation.counters().starved_holders, 1U);
}

TEST_F(TaskFlagRotationTest, WaitsForAStarvedHolderThatItRecalledEvenIfItLooksLate) {
  const Grant grant = must_grant();
  take(grant);
  now = grant.granted + milliseconds(80);
  (void)rotation.on_deadline(now);
  now = grant.lease_end + TaskFlagRotation::held_up_limit + milliseconds(1);
  RotationActions actions =
      rotation.on_deadline(now, now, HolderCpu{now - grant.granted, nanoseconds(0), true});
  ASSERT_TRUE(has<Recall>(actions)) << "this process was late: it asks first";
  const MonotonicTime recalled = now;
  bool late = false;
  while (is_patient(actions) || has<Recall>(actions)) {
    ASSERT_LE(now, grant.lease_end + seconds(20));
    now = *rotation.next_deadline() + (late ? TaskFlagRotation::held_up_limit * 2 : nanoseconds(0));
    late = !late;
    actions = rotation.on_deadline(now, now, HolderCpu{now - recalled, nanoseconds(0), true});
  }
  EXPECT_TRUE(has<Fence>(actions));
  EXPECT_GE(now, recalled + TaskFlagRotation::starved_patience);
}

TEST_F(TaskFlagRotationTest, FencesAPayloadThatSpokeBeforeButNeverTakesItsFlag) {
  Grant grant = must_grant();
  rotation.on_bus_status({BusReport::Kind::released, {}, "adcs", 5}, now);
  now = grant.lease_end;
  EXPECT_TRUE(has<Fence>(rotation.on_deadline(now)));
}

TEST_F(TaskFlagRotationTest, PassesOverAPayloadThatNeverSpokeWithoutKillingAnybody) {
  const Grant grant = must_grant();
  EXPECT_EQ(rotation.next_deadline(), grant.lease_end);
  now = grant.lease_end;
  EXPECT_TRUE(is_patient(rotation.on_deadline(now)));
  EXPECT_EQ(must_grant().payload, "eps");
  EXPECT_EQ(rotation.slot_counters(0).not_taken, 1U);
}

TEST_F(TaskFlagRotationTest, DoesNotKillAPayloadThatSaidItLeaves) {
  rotation.on_bus_status({BusReport::Kind::released, {}, "adcs", 5}, now);
  rotation.on_bus_status({BusReport::Kind::failed, {}, "adcs", 5}, now);
  const Grant grant = must_grant();
  now = grant.lease_end;
  EXPECT_TRUE(is_patient(rotation.on_deadline(now)));
}

TEST_F(TaskFlagRotationTest, OrdersTheResetAtOnceWhenTakenArrivesAfterTheOverrun) {
  const Grant grant = must_grant();
  now = grant.granted + milliseconds(90);
  take(grant);
  EXPECT_TRUE(has<OrderReset>(rotation.on_deadline(now)));
}

TEST_F(TaskFlagRotationTest, AcceptsAReleaseThatOvertookItsTaken) {
  const Grant grant = must_grant();
  EXPECT_EQ(release(grant), ReportVerdict::applied);
  EXPECT_EQ(take(grant), ReportVerdict::duplicate);
  EXPECT_EQ(must_grant().payload, "eps");
}

TEST_F(TaskFlagRotationTest, IgnoresOldDuplicateAndForeignReports) {
  const Grant first = must_grant();
  take(first);
  EXPECT_EQ(take(first), ReportVerdict::duplicate);
  release(first);
  const Grant second = must_grant();

  EXPECT_EQ(release(first), ReportVerdict::old_grant);
  EXPECT_EQ(rotation.on_bus_status({BusReport::Kind::released, second.id, "adcs", 5}, now),
            ReportVerdict::foreign);
  EXPECT_EQ(rotation.on_bus_status({BusReport::Kind::released, second.id, "intruder", 5}, now),
            ReportVerdict::foreign);
  EXPECT_EQ(rotation.on_bus_status({BusReport::Kind::released, {incarnation, 77}, "eps", 5}, now),
            ReportVerdict::foreign);
  EXPECT_EQ(rotation.on_bus_status({BusReport::Kind::released, {incarnation - 1, 77}, "eps", 5}, now),
            ReportVerdict::old_grant);
  EXPECT_TRUE(tick_is_blocked());
  EXPECT_EQ(rotation.counters().foreign_reports, 3U);
}

TEST_F(TaskFlagRotationTest, IgnoresAReleaseFromAnotherProcessOfTheHolder) {
  const Grant grant = must_grant();
  take(grant);
  EXPECT_EQ(report(BusReport::Kind::released, grant, 6), ReportVerdict::foreign);
  EXPECT_TRUE(tick_is_blocked());
}

TEST_F(TaskFlagRotationTest, GrantsNothingWhileSuspendedAndStillFencesTheHolder) {
  const Grant grant = must_grant();
  take(grant);
  rotation.suspend();
  now = grant.granted + milliseconds(80);
  EXPECT_TRUE(has<OrderReset>(rotation.on_deadline(now)));
  release(grant);
  EXPECT_TRUE(is_patient(tick()));
  rotation.resume(now);
  EXPECT_EQ(must_grant().payload, "eps");
}

TEST_F(TaskFlagRotationTest, GrantsNothingOnATickThatWaitedForItsActivation) {
  rotation.suspend();
  const MonotonicTime received = now;
  now += milliseconds(55);
  rotation.resume(now);

  EXPECT_TRUE(is_patient(rotation.on_tick(now, ++cycle, received)));
  EXPECT_EQ(must_grant().payload, "adcs");
}

TEST_F(TaskFlagRotationTest, GoesThroughTheOrderOfTheParameterBehindWhoHadTheBusLast) {
  release(must_grant());  // adcs
  EXPECT_TRUE(rotation.set_order({"thermal", "adcs", "eps"}));
  for (const char* expected : {"eps", "thermal", "adcs", "eps"}) {
    const Grant grant = must_grant();
    EXPECT_EQ(grant.payload, expected);
    EXPECT_EQ(rotation.slots()[grant.slot].payload, expected) << "the flags keep their positions";
    release(grant);
  }
}

TEST_F(TaskFlagRotationTest, LeavesOutWhoIsNotInTheOrderAndTakesItInAgain) {
  EXPECT_TRUE(rotation.set_order({"thermal"}));
  for (int i = 0; i < 3; ++i) {
    const Grant grant = must_grant();
    EXPECT_EQ(grant.payload, "thermal");
    release(grant);
  }
  EXPECT_TRUE(rotation.set_order({"adcs", "eps", "thermal"}));
  EXPECT_EQ(must_grant().payload, "adcs");
}

TEST_F(TaskFlagRotationTest, RefusesAnOrderThatIsNone) {
  EXPECT_FALSE(rotation.set_order({}));
  EXPECT_FALSE(rotation.set_order({"adcs", "adcs"}));
  EXPECT_FALSE(rotation.set_order({"adcs", "nobody"}));
  for (const char* expected : {"adcs", "eps", "thermal"}) {
    const Grant grant = must_grant();
    EXPECT_EQ(grant.payload, expected) << "nothing was changed";
    release(grant);
  }
}

TEST_F(TaskFlagRotationTest, AChangeOfTheOrderLeavesTheRunningSlotAlone) {
  const Grant grant = must_grant();
  take(grant);
  EXPECT_TRUE(rotation.set_order({"thermal"}));
  EXPECT_TRUE(tick_is_blocked());
  EXPECT_EQ(release(grant), ReportVerdict::applied);
  EXPECT_EQ(must_grant().payload, "thermal");
}

std::vector<Slot> plan_with(const std::string& fourth) {
  auto slots = plan();
  slots.push_back({fourth, milliseconds(60), milliseconds(20), milliseconds(40)});
  return slots;
}

TEST_F(TaskFlagRotationTest, TakesInAPayloadThatJoinsAndNobodyLosesATurn) {
  release(must_grant());  // adcs
  const Grant running = must_grant();
  take(running);  // eps

  EXPECT_TRUE(rotation.set_plan(plan_with("impact"), {"adcs", "eps", "impact", "thermal"}));
  EXPECT_EQ(release(running), ReportVerdict::applied);

  for (const char* expected : {"impact", "thermal", "adcs", "eps", "impact"}) {
    const Grant grant = must_grant();
    EXPECT_EQ(grant.payload, expected);
    EXPECT_EQ(rotation.slots()[grant.slot].payload, expected);
    EXPECT_EQ(take(grant), ReportVerdict::applied);
    EXPECT_EQ(release(grant), ReportVerdict::applied);
  }
}

TEST_F(TaskFlagRotationTest, LeavesOutAPayloadThatLeftAndGoesOnWithItsSuccessor) {
  ASSERT_TRUE(rotation.set_plan(plan_with("impact"), {"adcs", "impact", "eps", "thermal"}));
  release(must_grant());
  release(must_grant());  // impact
  EXPECT_TRUE(rotation.set_plan(plan(), {"adcs", "eps", "thermal"}));
  for (const char* expected : {"eps", "thermal", "adcs", "eps"}) {
    const Grant grant = must_grant();
    EXPECT_EQ(grant.payload, expected);
    release(grant);
  }
  EXPECT_EQ(rotation.on_bus_status({BusReport::Kind::released, {}, "impact", 5}, now),
            ReportVerdict::foreign);
}

TEST_F(TaskFlagRotationTest, FencesAPayloadThatLeftWhileItHadTheBusByItsOldPlan) {
  ASSERT_TRUE(rotation.set_plan(plan_with("impact"), {"impact", "adcs", "eps", "thermal"}));
  const Grant grant = must_grant();
  take(grant);
  EXPECT_EQ(grant.payload, "impact");

  EXPECT_FALSE(rotation.set_plan(plan(), {"adcs", "eps", "thermal"})) << "to be called again";
  EXPECT_TRUE(tick_is_blocked());
  now = grant.granted + milliseconds(80);
  EXPECT_TRUE(has<OrderReset>(rotation.on_deadline(now)));
  now = grant.lease_end;
  EXPECT_TRUE(has<Fence>(rotation.on_deadline(now)));
  EXPECT_TRUE(tick_is_blocked());
  rotation.on_fenced(grant.id, now);
  now += TaskFlagRotation::guard_time;

  EXPECT_TRUE(rotation.set_plan(plan(), {"adcs", "eps", "thermal"}));
  EXPECT_EQ(must_grant().payload, "adcs");
}

TEST_F(TaskFlagRotationTest, GivesThePlaceOfWhoLeftToAnotherOnlyWhenItsSlotIsOver) {
  ASSERT_TRUE(rotation.set_plan(plan_with("impact"), {"impact", "adcs", "eps", "thermal"}));
  const Grant grant = must_grant();
  take(grant);
  const std::vector<std::string> order{"adcs", "other", "eps", "thermal"};

  EXPECT_FALSE(rotation.set_plan(plan_with("other"), order));
  EXPECT_EQ(release(grant), ReportVerdict::applied) << "its report is still its own";
  EXPECT_TRUE(rotation.set_plan(plan_with("other"), order));

  release(must_grant());  // adcs
  EXPECT_EQ(must_grant().payload, "other");
}

TEST_F(TaskFlagRotationTest, LeavesAPlaceOfNobodyFree) {
  auto slots = plan_with("");
  slots.push_back({"impact", milliseconds(60), milliseconds(20), milliseconds(40)});
  TaskFlagRotation with_hole(slots, incarnation, boot);
  EXPECT_EQ(with_hole.turns(), (std::vector<std::string>{"adcs", "eps", "thermal", "impact"}));
  EXPECT_EQ(with_hole.on_bus_status({BusReport::Kind::released, {}, "", 5}, now), ReportVerdict::foreign);
}

TEST_F(TaskFlagRotationTest, TakesBackAGrantWhoseFlagWasNotPublishedAndAccusesNobody) {
  rotation.on_bus_status({BusReport::Kind::released, {}, "adcs", 5}, now);
  const Grant grant = must_grant();
  now += milliseconds(500);  // the switcher stops between the actions and the flag
  rotation.withdraw(grant.id);

  EXPECT_EQ(rotation.next_deadline(), std::nullopt);
  EXPECT_EQ(must_grant().payload, "eps");
  EXPECT_EQ(rotation.counters().withdrawn, 1U);
  EXPECT_EQ(rotation.slot_counters(0).fences, 0U);
}

TEST_F(TaskFlagRotationTest, TakesBackNothingThatWasTaken) {
  const Grant grant = must_grant();
  take(grant);
  rotation.withdraw(grant.id);
  EXPECT_TRUE(tick_is_blocked());
}

TEST_F(TaskFlagRotationTest, TellsItsSuccessorWhoMayWrite) {
  EXPECT_FALSE(rotation.holder());
  const Grant grant = must_grant();
  ASSERT_TRUE(rotation.holder());
  EXPECT_EQ(rotation.holder()->process, 0U) << "it has not spoken yet";
  take(grant);
  EXPECT_EQ(rotation.holder()->slot, 0U);
  EXPECT_EQ(rotation.holder()->process, 5U);
  release(grant);
  EXPECT_FALSE(rotation.holder());
}

/// A switcher whose predecessor was killed while "eps" (process 5) held the bus.
struct Successor : ::testing::Test {
  TaskFlagRotation rotation{plan(), incarnation, boot, InheritedGrant{"eps", 5}};
  MonotonicTime now = boot;
  MissionCycle cycle = 0;

  void SetUp() override { rotation.set_recall_time(milliseconds(500)); }
  RotationActions tick(milliseconds later = milliseconds(100)) {
    now += later;
    return rotation.on_tick(now, ++cycle, now);
  }
  bool tick_is_blocked() {
    now += milliseconds(100);
    return is_blocked(rotation, now, ++cycle);
  }
  bool tick_waits(milliseconds later = milliseconds(100)) {
    now += later;
    return is_waiting(rotation, now, ++cycle);
  }
  GrantId must_recall() {
    const RotationActions actions = tick();
    EXPECT_TRUE(has<Recall>(actions));
    return has<Recall>(actions) ? find<Recall>(actions)->id : GrantId{};
  }
  ReportVerdict answer(GrantId id, const char* payload = "eps", std::uint32_t process = 5) {
    return rotation.on_bus_status({BusReport::Kind::released, id, payload, process}, now);
  }
};

TEST_F(Successor, GrantsNobodyUntilTheHolderItInheritedHasAnswered) {
  const GrantId id = must_recall();
  for (int i = 0; i < 3; ++i) EXPECT_EQ(must_recall(), id);
  EXPECT_EQ(answer(id, "adcs"), ReportVerdict::greeting) << "everybody answers; that of the holder counts";
  EXPECT_EQ(answer({incarnation - 1, 77}), ReportVerdict::old_grant);
  EXPECT_EQ(must_recall(), id);

  EXPECT_EQ(answer(id), ReportVerdict::applied);
  EXPECT_TRUE(tick_waits(milliseconds(4))) << "its last frames may be on their way";
  const RotationActions actions = tick();
  ASSERT_TRUE(has<Grant>(actions));
  EXPECT_GT(find<Grant>(actions)->id, id);
}

TEST_F(Successor, WaitsOutTheLongestLeaseAllTheSame) {
  const RotationActions first = tick(milliseconds(1));
  ASSERT_TRUE(has<Recall>(first));
  answer(find<Recall>(first)->id);
  EXPECT_TRUE(tick_waits());
  EXPECT_TRUE(has<Grant>(tick()));
}

TEST_F(Successor, FencesTheHolderThatDoesNotAnswerInTime) {
  EXPECT_EQ(rotation.next_deadline(), std::nullopt) << "nobody is late before he was asked";
  const GrantId id = must_recall();
  const MonotonicTime asked = now;
  ASSERT_EQ(rotation.next_deadline(), asked + milliseconds(500));
  must_recall();
  now = asked + milliseconds(500);
  const RotationActions actions = rotation.on_deadline(now);
  ASSERT_TRUE(has<Fence>(actions));
  EXPECT_EQ(find<Fence>(actions)->payload, "eps");
  EXPECT_EQ(find<Fence>(actions)->process, 5U);
  EXPECT_TRUE(tick_is_blocked());
  rotation.on_fenced(id, now);
  EXPECT_TRUE(has<Grant>(tick()));
}

TEST_F(Successor, LearnsFromALaterProcessThatTheHolderIsGoneAndFencesAtOnceWhatItMayHaveLeft) {
  const GrantId id = must_recall();
  EXPECT_EQ(answer(id, "eps", 4), ReportVerdict::foreign) << "an earlier one says nothing";
  EXPECT_LT(now, *rotation.next_deadline());
  EXPECT_EQ(answer(id, "eps", 6), ReportVerdict::greeting);
  EXPECT_TRUE(has<Fence>(rotation.on_deadline(now)));
  EXPECT_TRUE(tick_is_blocked()) << "its frames may wait for the bus";
}

TEST_F(Successor, AwaitsTheEmptyQueueOfAHolderWhoseProcessIsGoneAndAsksNobody) {
  TaskFlagRotation heir{plan(), incarnation, boot, InheritedGrant{"eps", std::nullopt}};
  EXPECT_TRUE(heir.awaits_fence());
  EXPECT_FALSE(heir.next_deadline());
  now += seconds(1);
  EXPECT_TRUE(is_blocked(heir, now, 1));
  ASSERT_TRUE(heir.holder()) << "a switcher after this one has to wait for it, too";
  heir.on_fenced(heir.current()->id, now);
  EXPECT_FALSE(heir.holder());
  now += milliseconds(100);
  EXPECT_TRUE(has<Grant>(heir.on_tick(now, 2, now)));
}

TEST_F(TaskFlagRotationTest, AwaitsTheEmptyQueueOfASuiteItKnowsNothingOfAndThenBeginsWithTheFirst) {
  rotation.await_empty_queue(now);
  EXPECT_TRUE(rotation.awaits_fence());
  EXPECT_FALSE(rotation.next_deadline());
  EXPECT_FALSE(rotation.holder()) << "nobody to remember for a successor: that one waits anyway";
  now += seconds(1);
  EXPECT_TRUE(tick_is_blocked()) << "frames may wait for the bus";
  EXPECT_TRUE(rotation.set_order({"thermal", "adcs", "eps"}));
  rotation.on_fenced(rotation.current()->id, now);
  EXPECT_TRUE(tick_waits()) << "guard time";
  now += TaskFlagRotation::guard_time;
  EXPECT_EQ(must_grant().payload, "thermal");
}

TEST_F(TaskFlagRotationTest, AsksForAGrantThatItDidNotWatchUnderANewIdAndAccusesNobody) {
  const Grant grant = must_grant();
  take(grant);
  EXPECT_TRUE(rotation.awaits_release());
  rotation.suspend();
  now = grant.lease_end + seconds(5);  // no process received reports
  rotation.inherit({grant.payload, 5}, now);
  EXPECT_FALSE(rotation.awaits_release());
  EXPECT_EQ(rotation.next_deadline(), std::nullopt);
  EXPECT_EQ(rotation.slot_counters(0).fences, 0U);

  rotation.resume(now);
  const RotationActions actions = tick();
  ASSERT_TRUE(has<Recall>(actions));
  const GrantId id = find<Recall>(actions)->id;
  EXPECT_GT(id, grant.id);
  EXPECT_EQ(release(grant), ReportVerdict::old_grant);
  EXPECT_EQ(rotation.on_bus_status({BusReport::Kind::released, id, grant.payload, 5}, now),
            ReportVerdict::applied);
  now += milliseconds(100);
  EXPECT_EQ(must_grant().payload, "eps");
}

TEST_F(Successor, AccusesNobodyWhileItIsNotActive) {
  must_recall();
  rotation.suspend();
  EXPECT_EQ(rotation.next_deadline(), std::nullopt);
  EXPECT_TRUE(is_patient(rotation.on_deadline(now + seconds(60))));
  EXPECT_TRUE(is_patient(tick()));
  rotation.resume(now);
  must_recall();
  EXPECT_EQ(rotation.next_deadline(), now + milliseconds(500));
}

struct EarlyHandover : Rotation {
  EarlyHandover() { rotation.set_early_handover(true); }
  RotationActions give_back(const Grant& grant) {
    EXPECT_EQ(rotation.on_bus_status({.kind = BusReport::Kind::released,
                                      .grant = grant.id,
                                      .payload = grant.payload,
                                      .payload_incarnation = 5,
                                      .unused = true},
                                     now),
              ReportVerdict::applied);
    return rotation.on_early_release(now);
  }
  Grant must_be_given_on(const Grant& grant) {
    const RotationActions actions = give_back(grant);
    EXPECT_TRUE(has<Grant>(actions));
    return has<Grant>(actions) ? *find<Grant>(actions) : Grant{};
  }
};

TEST_F(EarlyHandover, GivesAnUnusedSlotOnAtOnceWithANewGrantOfTheSameCycle) {
  const Grant first = must_grant();
  now += milliseconds(1);
  const Grant second = must_be_given_on(first);
  EXPECT_EQ(second.payload, "eps");
  EXPECT_EQ(second.cycle, first.cycle);
  EXPECT_GT(second.id, first.id);
  EXPECT_EQ(second.lease_end, now + milliseconds(120));
  EXPECT_EQ(rotation.counters().early_grants, 1U);
  EXPECT_EQ(rotation.slot_counters(0).unused, 1U);
}

TEST_F(EarlyHandover, GivesEveryPayloadOneSlotATickAtMost) {
  const Grant third = must_be_given_on(must_be_given_on(must_grant()));
  EXPECT_EQ(third.payload, "thermal");
  EXPECT_TRUE(is_patient(give_back(third))) << "nobody has anything to say: wait for the tick";
  EXPECT_EQ(must_grant().payload, "adcs");
}

TEST_F(EarlyHandover, DoesNotHurryAfterASlotThatWasUsedOrFailed) {
  Grant grant = must_grant();
  take(grant);
  release(grant);
  EXPECT_TRUE(is_patient(rotation.on_early_release(now)));
  grant = must_grant();
  report(BusReport::Kind::failed, grant);
  EXPECT_TRUE(is_patient(rotation.on_early_release(now)));
  grant = must_grant();
  take(grant);
  EXPECT_TRUE(is_patient(give_back(grant))) << "it took the bus: the count of its frames is late";
}

TEST_F(EarlyHandover, IsOffUnlessAskedForAndWhileSuspended) {
  rotation.set_early_handover(false);
  EXPECT_TRUE(is_patient(give_back(must_grant())));
  rotation.set_early_handover(true);
  const Grant grant = must_grant();
  rotation.suspend();
  EXPECT_TRUE(is_patient(give_back(grant)));
}

TEST_F(EarlyHandover, ARepeatedReportGivesNothingOnTwice) {
  const Grant first = must_grant();
  const Grant second = must_be_given_on(first);
  EXPECT_EQ(report(BusReport::Kind::released, first), ReportVerdict::old_grant);
  EXPECT_TRUE(is_patient(rotation.on_early_release(now)));
  EXPECT_EQ(rotation.current()->id, second.id);
}

}  // namespace
}  // namespace srfs
