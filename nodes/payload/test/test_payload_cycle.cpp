// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include <mission/structures.hpp>

#include "nodes/payload/payload_cycle.hpp"

namespace srfs {
namespace {

using Kind = PublishStatus::Kind;
using ::testing::HasSubstr;

constexpr std::uint16_t reset_function = 16;
constexpr std::uint16_t power_function = 17;

Result<PayloadCommand, FailureCode> decode(std::uint16_t function, OctetView arguments) {
  if (function == reset_function) return ResetPeripheral{};
  if (function == power_function) return PowerCyclePeripheral{milliseconds(100)};
  if (function > 3) return Err(mission::failure::unknown_function);
  return PeripheralFunction{static_cast<std::uint8_t>(function), Octets(arguments.begin(), arguments.end())};
}

template <class A>
const A* find(const PayloadActions& actions) {
  for (const PayloadAction& action : actions) {
    if (const A* a = std::get_if<A>(&action)) return a;
  }
  return nullptr;
}
template <class A>
std::size_t count(const PayloadActions& actions) {
  return static_cast<std::size_t>(std::count_if(
      actions.begin(), actions.end(), [](const PayloadAction& a) { return std::holds_alternative<A>(a); }));
}
template <class Body>
bool sends(const PayloadActions& actions) {
  const SendRequest* send = find<SendRequest>(actions);
  return send != nullptr && std::holds_alternative<Body>(send->body);
}

struct Cycle : ::testing::Test {
  PayloadCycle cycle{PayloadSettings{}, decode, TelecommandJournal{"boot"}};
  MonotonicTime now{seconds(20)};
  std::uint32_t counter = 0;
  PayloadFlag flag;

  void SetUp() override {
    cycle.activate(now);
    cycle.on_power_switched(true, true, now);
  }
  PayloadActions grant() {
    flag = PayloadFlag{{1, ++counter}, counter, now, now + milliseconds(60), now + milliseconds(120), true};
    return cycle.on_flag(flag, now);
  }
  PayloadActions pass(nanoseconds d) {
    now += d;
    return cycle.on_deadline(now);
  }
  PayloadActions wake(wire::PeripheralStatus status = wire::PeripheralStatus::ready) {
    now += milliseconds(4);
    return cycle.on_answer({0, wire::WakeUpResponse{status, 1000, {1, 2, 3}}}, now);
  }
  PayloadActions quiet() { return cycle.on_bus_quiet(now); }
  PayloadActions arrive(std::uint64_t id, std::uint16_t function = 1, RepeatClass repeat = RepeatClass::by_id,
                        MonotonicTime expiry = {}) {
    return cycle.on_telecommand({id, function, repeat, expiry, {9}}, now);
  }
  PayloadActions written() { return cycle.on_journal_written(cycle.journal().revision(), true, now); }
  PayloadActions command_answer(std::uint32_t id,
                                wire::PeripheralResult result = wire::PeripheralResult::done) {
    now += milliseconds(2);
    return cycle.on_answer({0, wire::CommandResponse{id, result}}, now);
  }
  void store(std::uint64_t id, std::uint16_t function = 1, RepeatClass repeat = RepeatClass::by_id,
             MonotonicTime expiry = {}) {
    arrive(id, function, repeat, expiry);
    written();
  }
};
using PayloadCycleTest = Cycle;

TEST_F(PayloadCycleTest, TakesTheFlagWakesThePeripheralReleasesAndProcesses) {
  PayloadActions actions = grant();
  ASSERT_NE(find<PublishStatus>(actions), nullptr);
  EXPECT_EQ(find<PublishStatus>(actions)->kind, Kind::taken);
  ASSERT_NE(find<OpenBus>(actions), nullptr);
  EXPECT_EQ(find<OpenBus>(actions)->lease_end, flag.lease_end);
  EXPECT_TRUE(sends<wire::WakeUpRequest>(actions));
  EXPECT_EQ(*find<Activity>(actions), Activity::occupying_can);

  actions = wake();
  EXPECT_EQ(find<PublishStatus>(actions), nullptr);  // its last frame is still in flight
  EXPECT_NE(find<AwaitQuiet>(actions), nullptr);

  actions = quiet();
  ASSERT_NE(find<PublishStatus>(actions), nullptr);
  EXPECT_EQ(find<PublishStatus>(actions)->kind, Kind::released);
  EXPECT_EQ(find<PublishStatus>(actions)->used, milliseconds(4));
  EXPECT_NE(find<CloseBus>(actions), nullptr);
  ASSERT_NE(find<ProcessMeasurement>(actions), nullptr);
  EXPECT_EQ(find<ProcessMeasurement>(actions)->block, (Octets{1, 2, 3}));
  EXPECT_EQ(*find<Activity>(actions), Activity::data_processing);

  EXPECT_EQ(*find<Activity>(cycle.on_processed(now)), Activity::off);
  EXPECT_EQ(cycle.statistics().slots_used, 1U);
}

TEST_F(PayloadCycleTest, PublishesTakenBeforeAnythingElse) {
  const PayloadActions actions = grant();
  EXPECT_TRUE(std::holds_alternative<PublishStatus>(actions.front()));
}

TEST_F(PayloadCycleTest, ClosesTheHandleBeforeItPublishesTheRelease) {
  grant();
  wake();
  const PayloadActions actions = quiet();
  const auto close = std::find_if(actions.begin(), actions.end(),
                                  [](const PayloadAction& a) { return std::holds_alternative<CloseBus>(a); });
  const auto status = std::find_if(actions.begin(), actions.end(), [](const PayloadAction& a) {
    return std::holds_alternative<PublishStatus>(a);
  });
  EXPECT_LT(close, status);
}

TEST_F(PayloadCycleTest, ReleasesAsFailedWhenThePeripheralNeverAnswers) {
  grant();
  EXPECT_EQ(cycle.next_deadline(), now + milliseconds(25));
  const PayloadActions actions = pass(milliseconds(25));
  EXPECT_NE(find<AbortRequest>(actions), nullptr);
  const PayloadActions released = quiet();
  ASSERT_NE(find<PublishStatus>(released), nullptr);
  EXPECT_EQ(find<PublishStatus>(released)->kind, Kind::failed);
  EXPECT_THAT(find<PublishStatus>(released)->detail, HasSubstr("no answer"));
  EXPECT_EQ(cycle.statistics().peripheral_timeouts, 1U);
}

TEST_F(PayloadCycleTest, HasMoreTimeOnceForAnAnswerOfWhichFramesWaitedWhenItWasLateItself) {
  grant();
  now += milliseconds(30);
  cycle.on_frames_waited(now);
  EXPECT_TRUE(cycle.on_deadline(now).empty());
  EXPECT_EQ(cycle.next_deadline(), now + milliseconds(25));
  EXPECT_NE(find<AwaitQuiet>(wake()), nullptr);
  EXPECT_EQ(find<PublishStatus>(quiet())->kind, Kind::released);
  EXPECT_EQ(cycle.statistics().peripheral_timeouts, 0U);

  now += milliseconds(70);
  grant();
  now += milliseconds(28);
  cycle.on_frames_waited(now);
  now += milliseconds(28);
  cycle.on_frames_waited(now);
  EXPECT_NE(find<AbortRequest>(cycle.on_deadline(now)), nullptr) << "once for each request";
  EXPECT_THAT(find<PublishStatus>(quiet())->detail, HasSubstr("this node was late"));
  EXPECT_EQ(cycle.statistics().peripheral_timeouts, 0U);
}

TEST_F(PayloadCycleTest, HasMoreTimeForTheAnswerToATelecommandTooButNoneBehindTheSlot) {
  store(1);
  grant();
  now += milliseconds(28);
  cycle.on_frames_waited(now);
  EXPECT_TRUE(sends<wire::CommandRequest>(wake()));
  now += milliseconds(27);
  cycle.on_frames_waited(now);
  EXPECT_TRUE(cycle.on_deadline(now).empty());
  EXPECT_EQ(cycle.next_deadline(), flag.allotted_end);
}

TEST_F(PayloadCycleTest, ARequestThatDidNotLeaveIsNoSilenceOfThePeripheral) {
  grant();
  now += milliseconds(25);
  EXPECT_NE(find<AbortRequest>(cycle.on_deadline(now, false)), nullptr);
  EXPECT_EQ(find<PublishStatus>(quiet())->detail, "own frames did not get the bus");
  EXPECT_EQ(cycle.statistics().peripheral_timeouts, 0U);
}

TEST_F(PayloadCycleTest, FramesThatWaitedGiveNoTimeBeforeTheDeadlineOrBehindTheSlot) {
  grant();
  const auto deadline = cycle.next_deadline();
  now += milliseconds(24);
  cycle.on_frames_waited(now);
  EXPECT_EQ(cycle.next_deadline(), deadline);
  now += milliseconds(2);
  cycle.on_frames_waited(now);
  EXPECT_EQ(cycle.next_deadline(), deadline) << "it is not late: the peripheral sends what is no answer";
  now += milliseconds(35);
  cycle.on_frames_waited(now);
  EXPECT_NE(find<AbortRequest>(cycle.on_deadline(now)), nullptr);

  quiet();
  cycle.on_frames_waited(now);
  EXPECT_EQ(cycle.next_deadline(), std::nullopt);
}

TEST_F(PayloadCycleTest, ReleasesAsFailedOnGarbageAndSaysWhy) {
  grant();
  const PayloadActions actions = cycle.on_request_failed(RequestFailure::garbage, "bad CRC", now);
  ASSERT_NE(find<PayloadEvent>(actions), nullptr);
  EXPECT_EQ(find<PayloadEvent>(actions)->kind, PayloadEvent::Kind::peripheral_garbage);
  EXPECT_EQ(find<PublishStatus>(quiet())->detail, "bad CRC");
  EXPECT_EQ(cycle.counters().garbage_answers, 1U);
}

TEST_F(PayloadCycleTest, CountsALateAnswer) {
  grant();
  pass(milliseconds(25));
  quiet();
  EXPECT_TRUE(wake().empty());
  EXPECT_EQ(cycle.counters().unexpected_answers, 1U);
}

TEST_F(PayloadCycleTest, ReportsSilenceAfterThreeSlotsAndTheReturn) {
  for (int i = 0; i < 3; ++i) {
    grant();
    const PayloadActions actions = pass(milliseconds(25));
    EXPECT_EQ(find<PayloadEvent>(actions) != nullptr, i == 2);
    quiet();
    now += milliseconds(100);
  }
  grant();
  const PayloadActions actions = wake();
  ASSERT_NE(find<PayloadEvent>(actions), nullptr);
  EXPECT_EQ(find<PayloadEvent>(actions)->kind, PayloadEvent::Kind::peripheral_back);
}

TEST_F(PayloadCycleTest, PowerCyclesAPeripheralThatStaysSilent) {
  PayloadActions last;
  for (int i = 0; i < 20; ++i) {
    grant();
    pass(milliseconds(25));
    last = quiet();
    now += milliseconds(100);
  }
  ASSERT_NE(find<SwitchPower>(last), nullptr);
  EXPECT_FALSE(find<SwitchPower>(last)->on);
  cycle.on_power_switched(false, true, now);
  EXPECT_EQ(find<PublishStatus>(grant())->detail, "the peripheral is switched off");
  const PayloadActions on = pass(milliseconds(200));
  ASSERT_NE(find<SwitchPower>(on), nullptr);
  EXPECT_TRUE(find<SwitchPower>(on)->on);
  EXPECT_EQ(find<PayloadEvent>(cycle.on_power_switched(true, true, now))->kind,
            PayloadEvent::Kind::peripheral_power_cycled);
  EXPECT_TRUE(sends<wire::WakeUpRequest>(grant()));
}

TEST_F(PayloadCycleTest, IgnoresARepeatedFlagAndRepeatsItsStatus) {
  grant();
  wake();
  quiet();
  const PayloadActions actions = cycle.on_flag(flag, now);
  EXPECT_EQ(find<SendRequest>(actions), nullptr);
  ASSERT_NE(find<PublishStatus>(actions), nullptr);
  EXPECT_EQ(find<PublishStatus>(actions)->kind, Kind::released);
  EXPECT_EQ(cycle.counters().repeated_flags, 1U);
}

TEST_F(PayloadCycleTest, HandsBackAFlagThatWaitedForItsStartAndCountsNoFailure) {
  flag = PayloadFlag{{1, 1}, 1, now - milliseconds(55), now + milliseconds(5), now + milliseconds(65), true};
  const PayloadActions actions = cycle.on_flag(flag, now);
  ASSERT_NE(find<PublishStatus>(actions), nullptr);
  EXPECT_EQ(find<PublishStatus>(actions)->kind, Kind::released);
  EXPECT_EQ(find<PublishStatus>(actions)->detail, "starting");
  EXPECT_EQ(cycle.statistics().slots_failed, 0U);
  EXPECT_EQ(cycle.statistics().slots_handed_back, 1U);
}

TEST(PayloadCycleStart, HandsBackAFlagThatComesWhileThePeripheralIsSwitchedOn) {
  PayloadCycle cycle{PayloadSettings{}, decode, TelecommandJournal{"boot"}};
  const MonotonicTime now{seconds(20)};
  cycle.activate(now);
  const PayloadFlag flag{{1, 1}, 1, now, now + milliseconds(60), now + milliseconds(120), true};
  EXPECT_EQ(find<PublishStatus>(cycle.on_flag(flag, now))->kind, Kind::released);
  EXPECT_EQ(cycle.statistics().slots_failed, 0U);
}

TEST_F(PayloadCycleTest, IsNotStartingForEver) {
  now += PayloadSettings{}.start_time;
  flag = PayloadFlag{{1, 1}, 1, now - milliseconds(55), now + milliseconds(5), now + milliseconds(65), true};
  EXPECT_EQ(find<PublishStatus>(cycle.on_flag(flag, now))->kind, Kind::failed);
}

TEST_F(PayloadCycleTest, NeverTakesAFlagWhoseLeaseIsOverOrWhoseTimeIsShort) {
  grant();
  wake();
  quiet();  // no longer starting
  flag = PayloadFlag{{1, 2}, 2, now, now + milliseconds(60), now + milliseconds(120), true};
  now += milliseconds(120);
  EXPECT_TRUE(cycle.on_flag(flag, now).empty());
  flag = PayloadFlag{{1, 3}, 3, now, now + milliseconds(60), now + milliseconds(120), true};
  now += milliseconds(55);
  const PayloadActions actions = cycle.on_flag(flag, now);
  EXPECT_EQ(find<PublishStatus>(actions)->kind, Kind::failed);
  EXPECT_EQ(find<OpenBus>(actions), nullptr);
  EXPECT_EQ(cycle.counters().stale_flags, 2U);
}

TEST_F(PayloadCycleTest, TakesNoFlagWhileNoSwitcherHearsIt) {
  flag = PayloadFlag{{1, 1}, 1, now, now + milliseconds(60), now + milliseconds(120), false};
  EXPECT_TRUE(cycle.on_flag(flag, now).empty());
  EXPECT_FALSE(cycle.holds_bus());
}

TEST_F(PayloadCycleTest, GivesTheBusOnAtOnceWhileInactive) {
  cycle.deactivate(now);
  const PayloadActions actions = grant();
  EXPECT_EQ(find<PublishStatus>(actions)->kind, Kind::released);
  EXPECT_EQ(find<OpenBus>(actions), nullptr);
}

TEST_F(PayloadCycleTest, GivesASlotBackWhenNoMeasurementIsDueAndNoTelecommandWaits) {
  PayloadSettings settings;
  settings.measurement_period = milliseconds(1000);
  cycle.change_settings(settings);
  EXPECT_TRUE(sends<wire::WakeUpRequest>(grant())) << "the first measurement is always due";
  wake();
  quiet();
  cycle.on_processed(now);

  now = flag.granted + milliseconds(300);
  const PayloadActions actions = grant();
  ASSERT_NE(find<PublishStatus>(actions), nullptr);
  EXPECT_EQ(find<PublishStatus>(actions)->kind, Kind::released);
  EXPECT_EQ(find<PublishStatus>(actions)->detail, "nothing to say");
  EXPECT_EQ(find<OpenBus>(actions), nullptr) << "not a frame";
  EXPECT_EQ(cycle.statistics().slots_handed_back, 1U);

  now += milliseconds(300);
  store(7);
  EXPECT_TRUE(sends<wire::WakeUpRequest>(grant())) << "a telecommand is something to say";
  wake();
  command_answer(7);
  quiet();
  cycle.on_processed(now);
  now = flag.granted + milliseconds(1000);
  EXPECT_TRUE(sends<wire::WakeUpRequest>(grant())) << "the next measurement is due";
}

TEST_F(PayloadCycleTest, UsesEverySlotWhileItsPeripheralIsSilent) {
  PayloadSettings settings;
  settings.measurement_period = milliseconds(1000);
  cycle.change_settings(settings);
  grant();
  wake();
  quiet();
  now = flag.granted + milliseconds(1000);
  grant();
  pass(milliseconds(25));
  quiet();
  now = flag.granted + milliseconds(100);
  EXPECT_TRUE(sends<wire::WakeUpRequest>(grant()));
}

TEST_F(PayloadCycleTest, ReleasesCleanlyWhenDeactivatedInMidSlot) {
  grant();
  const PayloadActions actions = cycle.deactivate(now);
  EXPECT_NE(find<AbortRequest>(actions), nullptr);
  EXPECT_EQ(find<PublishStatus>(actions), nullptr);
  EXPECT_EQ(find<PublishStatus>(quiet())->kind, Kind::failed);
}

TEST_F(PayloadCycleTest, TakesBackOwnFramesThatDidNotGetTheBusInTheAllottedTimeAndReleases) {
  grant();
  cycle.on_request_failed(RequestFailure::not_sent, "no echo", now += milliseconds(25));
  EXPECT_EQ(find<WithdrawFrames>(pass(milliseconds(34))), nullptr);
  const PayloadActions actions = pass(milliseconds(1));
  EXPECT_NE(find<WithdrawFrames>(actions), nullptr);
  EXPECT_EQ(find<PublishStatus>(actions), nullptr) << "not before they are gone";
  EXPECT_EQ(find<PublishStatus>(quiet())->detail, "no echo");
  EXPECT_EQ(cycle.counters().withdrawals, 1U);
  EXPECT_EQ(cycle.counters().stuck_frames, 0U);
}

TEST_F(PayloadCycleTest, GivesLastFramesOfALateSlotAMomentBeforeItTakesThemBack) {
  grant();
  now = flag.allotted_end - milliseconds(1);
  wake();
  ASSERT_TRUE(cycle.next_deadline());
  EXPECT_GE(*cycle.next_deadline() - now, PayloadSettings{}.drain_time);
  EXPECT_LT(*cycle.next_deadline(), flag.lease_end);
}

TEST_F(PayloadCycleTest, NeverReleasesWhileOwnFramesAreStuck) {
  grant();
  pass(milliseconds(25));
  pass(milliseconds(60));
  PayloadActions actions = pass(milliseconds(35));
  EXPECT_EQ(find<PublishStatus>(actions), nullptr);
  EXPECT_TRUE(cycle.holds_bus());
  EXPECT_EQ(cycle.counters().stuck_frames, 1U);
  EXPECT_EQ(find<PublishStatus>(quiet())->kind, Kind::failed);
}

TEST_F(PayloadCycleTest, StopsWhenAnotherPayloadIsGranted) {
  grant();
  const PayloadActions actions = cycle.on_foreign_flag({1, counter + 1}, now);
  EXPECT_NE(find<CloseBus>(actions), nullptr);
  EXPECT_FALSE(cycle.holds_bus());
  EXPECT_EQ(cycle.counters().lost_grants, 1U);
}

TEST_F(PayloadCycleTest, TakesItsFramesBackWhenAnotherPayloadIsGranted) {
  grant();
  const PayloadActions actions = cycle.on_foreign_flag({1, counter + 1}, now);
  EXPECT_NE(find<WithdrawFrames>(actions), nullptr) << "they must not leave in the other's slot";
}

struct Recalled : Cycle {
  static bool answers(const PayloadActions& actions) {
    return std::any_of(actions.begin(), actions.end(), [](const PayloadAction& a) {
      const auto* status = std::get_if<PublishStatus>(&a);
      return status != nullptr && status->kind == Kind::released && status->grant == GrantId{2, 1};
    });
  }
  PayloadActions recall() { return cycle.on_recall({2, 1}, now); }
};
using PayloadCycleRecall = Recalled;

TEST_F(PayloadCycleRecall, EndsTheSlotAndIsAnsweredEachTimeOnceNoOwnFrameWaits) {
  grant();
  PayloadActions actions = recall();
  EXPECT_NE(find<CloseBus>(actions), nullptr);
  EXPECT_NE(find<AwaitQuiet>(actions), nullptr);
  EXPECT_EQ(find<PublishStatus>(actions), nullptr) << "its request is on its way";
  actions = quiet();
  EXPECT_EQ(count<PublishStatus>(actions), 2U) << "the end of its slot, and the answer";
  EXPECT_TRUE(answers(actions));
  EXPECT_FALSE(cycle.holds_bus());
  EXPECT_FALSE(answers(quiet())) << "once for each question";
  EXPECT_NE(find<AwaitQuiet>(recall()), nullptr) << "the first answer may be lost";
  EXPECT_TRUE(answers(quiet()));

  EXPECT_TRUE(grant().empty()) << "what the earlier switcher granted is void";
  cycle.on_foreign_flag({2, 2}, now);
  EXPECT_TRUE(recall().empty()) << "an old question";
}

TEST_F(PayloadCycleRecall, TakesBackFramesThatAreStuckAndIsNotAnsweredBefore) {
  grant();
  EXPECT_EQ(find<WithdrawFrames>(recall()), nullptr) << "on a bus that works they are gone in a moment";
  const PayloadActions actions = pass(PayloadSettings{}.drain_time);
  EXPECT_NE(find<WithdrawFrames>(actions), nullptr);
  EXPECT_FALSE(answers(actions));
  EXPECT_FALSE(answers(recall())) << "asked again";
  EXPECT_FALSE(answers(pass(flag.lease_end - now))) << "only the fence can tell that they are gone";
  EXPECT_TRUE(answers(quiet())) << "a late echo can, too";
}

TEST_F(PayloadCycleRecall, HurriesASlotThatWaitsForItsLastEchoes) {
  grant();
  wake();
  recall();
  EXPECT_NE(find<WithdrawFrames>(pass(PayloadSettings{}.drain_time)), nullptr);
}

TEST_F(PayloadCycleRecall, IsAnsweredWhileInactive) {
  cycle.deactivate(now);
  recall();
  EXPECT_TRUE(answers(quiet()));
}

TEST_F(PayloadCycleRecall, IsForgottenWithANewerGrant) {
  grant();
  recall();
  cycle.on_foreign_flag({2, 2}, now);
  EXPECT_FALSE(answers(quiet()));
}

TEST_F(PayloadCycleTest, DoesNotRepeatAByIdCommandThatItsPeripheralForgotWithItsPower) {
  store(7);
  grant();
  wake();  // sends the command, which stays unanswered
  pass(milliseconds(10));
  cycle.on_peripheral_reset(flag.grant, "overrun", now);
  const PayloadActions actions = pass(milliseconds(10));  // the reset stays unanswered too: the power is cut
  ASSERT_NE(find<SwitchPower>(actions), nullptr);

  const PayloadActions reported = written();
  ASSERT_NE(find<StageReport>(reported), nullptr);
  EXPECT_EQ(find<StageReport>(reported)->failure, mission::failure::interrupted);
  EXPECT_EQ(cycle.journal().pending(), 0U);
}

TEST(PayloadCycleStart, DoesNotRepeatAByIdCommandWhenThePowerWasOffAtTheStart) {
  TelecommandJournal before("boot");
  before.add({7, 1, RepeatClass::by_id, {}, {}});
  before.add({8, 1, RepeatClass::by_id, {}, {}});
  before.on_written(before.revision(), true);
  for (const bool was_on : {true, false}) {
    TelecommandJournal journal("boot");
    ASSERT_TRUE(journal.restore(before.encode()));
    PayloadCycle cycle(PayloadSettings{}, decode, std::move(journal));
    cycle.activate(MonotonicTime(seconds(20)));
    cycle.on_power_switched(true, true, MonotonicTime(seconds(20)), was_on);
    EXPECT_EQ(cycle.journal().pending(), was_on ? 2U : 0U)
        << "both may have been executed: the process died before it recorded that";
  }
}

TEST(PayloadCycleStart, LearnsThatThePowerWasOffAlsoFromASwitchThatObeysOnlyLater) {
  TelecommandJournal before("boot");
  before.add({7, 1, RepeatClass::by_id, {}, {}});
  before.on_written(before.revision(), true);
  TelecommandJournal journal("boot");
  ASSERT_TRUE(journal.restore(before.encode()));
  PayloadCycle cycle(PayloadSettings{}, decode, std::move(journal));
  MonotonicTime now(seconds(20));
  cycle.activate(now);
  cycle.on_power_switched(true, false, now);  // another process owns the line, so its level is unknown
  ASSERT_TRUE(cycle.next_deadline());
  now = *cycle.next_deadline();
  ASSERT_NE(find<SwitchPower>(cycle.on_deadline(now)), nullptr);
  cycle.on_power_switched(true, true, now, false);
  EXPECT_EQ(cycle.journal().pending(), 0U) << "the peripheral has forgotten the ids it knew";
}

TEST_F(PayloadCycleTest, ResetsItsPeripheralWhenOrderedAndReleases) {
  grant();
  now += milliseconds(20);
  const PayloadActions actions = cycle.on_peripheral_reset(flag.grant, "overrun", now);
  EXPECT_TRUE(sends<wire::ResetRequest>(actions));
  now += milliseconds(2);
  const PayloadActions answered = cycle.on_answer({0, wire::ResetResponse{}}, now);
  EXPECT_EQ(find<PayloadEvent>(answered)->kind, PayloadEvent::Kind::peripheral_reset);
  EXPECT_EQ(find<SwitchPower>(answered), nullptr);
  const PayloadActions released = quiet();
  EXPECT_EQ(find<PublishStatus>(released)->kind, Kind::failed);
  EXPECT_EQ(find<PublishStatus>(released)->detail, "overrun");
}

TEST_F(PayloadCycleTest, SwitchesThePeripheralOffBeforeTheReleaseWhenItDoesNotAnswerTheReset) {
  grant();
  cycle.on_peripheral_reset(flag.grant, "overrun", now);
  const PayloadActions actions = pass(milliseconds(10));
  ASSERT_NE(find<SwitchPower>(actions), nullptr);
  EXPECT_FALSE(find<SwitchPower>(actions)->on);
  EXPECT_TRUE(quiet().empty());
  const PayloadActions off = cycle.on_power_switched(false, true, now);
  EXPECT_NE(find<AwaitQuiet>(off), nullptr);
  EXPECT_EQ(find<PublishStatus>(quiet())->kind, Kind::failed);
}

TEST_F(PayloadCycleTest, ReleasesBeforeTheLeaseEndsEvenWhenThePowerSwitchHangs) {
  grant();
  cycle.on_peripheral_reset(flag.grant, "overrun", now);
  pass(milliseconds(10));
  ASSERT_TRUE(cycle.next_deadline().has_value());
  EXPECT_LT(*cycle.next_deadline(), flag.lease_end);
  now = *cycle.next_deadline();
  EXPECT_NE(find<AwaitQuiet>(cycle.on_deadline(now)), nullptr);
  EXPECT_NE(find<PublishStatus>(quiet()), nullptr);
}

TEST_F(PayloadCycleTest, AnswersAResetOrderForAReleasedGrantWithItsStatus) {
  grant();
  wake();
  quiet();
  const PayloadActions actions = cycle.on_peripheral_reset(flag.grant, "overrun", now);
  EXPECT_EQ(find<SendRequest>(actions), nullptr);
  EXPECT_EQ(find<PublishStatus>(actions)->kind, Kind::released);
  EXPECT_TRUE(cycle.on_peripheral_reset({1, 99}, "overrun", now).empty());
}

TEST_F(PayloadCycleTest, ExecutesStoredTelecommandsInOrderInItsNextSlot) {
  EXPECT_EQ(*find<Activity>(arrive(0x1'0000'0007)), Activity::other_async_command);
  EXPECT_EQ(*find<Activity>(written()), Activity::off);
  store(8, 2);

  grant();
  PayloadActions actions = wake();
  ASSERT_TRUE(sends<wire::CommandRequest>(actions));
  auto request = std::get<wire::CommandRequest>(find<SendRequest>(actions)->body);
  EXPECT_EQ(request.telecommand_id, 7U);  // the low 32 bits
  EXPECT_EQ(request.arguments, Octets{9});
  EXPECT_EQ(find<StageReport>(actions)->stage, Stage::start);

  actions = command_answer(7);
  ASSERT_TRUE(sends<wire::CommandRequest>(actions));
  EXPECT_EQ(std::get<wire::CommandRequest>(find<SendRequest>(actions)->body).function, 2);
  actions = command_answer(8, wire::PeripheralResult::bad_argument);
  EXPECT_NE(find<AwaitQuiet>(actions), nullptr);
  EXPECT_EQ(find<PublishStatus>(quiet())->kind, Kind::released);

  actions = written();
  ASSERT_EQ(count<StageReport>(actions), 2U);
  EXPECT_TRUE(find<StageReport>(actions)->success);
  EXPECT_EQ(find<PayloadEvent>(actions)->code, mission::failure::peripheral_bad_argument);
  EXPECT_EQ(cycle.statistics().telecommands_executed, 1U);
}

TEST_F(PayloadCycleTest, KeepsATelecommandForTheNextSlotWhenTimeRunsShort) {
  store(1);
  grant();
  now += milliseconds(46);
  EXPECT_FALSE(sends<wire::CommandRequest>(wake()));
  quiet();
  now += milliseconds(100);
  grant();
  EXPECT_TRUE(sends<wire::CommandRequest>(wake()));
}

TEST_F(PayloadCycleTest, RepeatsAnUnansweredTelecommandInTheNextSlot) {
  store(1);
  for (int i = 0; i < 3; ++i) {
    grant();
    EXPECT_TRUE(sends<wire::CommandRequest>(wake())) << i;
    pass(milliseconds(25));
    EXPECT_EQ(find<PublishStatus>(quiet())->kind, Kind::failed);
    now += milliseconds(100);
  }
  const PayloadActions actions = written();
  ASSERT_NE(find<StageReport>(actions), nullptr);
  EXPECT_EQ(find<StageReport>(actions)->failure, mission::failure::peripheral_silent);
  grant();
  EXPECT_FALSE(sends<wire::CommandRequest>(wake()));
}

TEST_F(PayloadCycleTest, StoresTheStartOfAnAtMostOnceCommandWhileItWakesThePeripheral) {
  store(1, 1, RepeatClass::at_most_once);
  PayloadActions actions = grant();
  EXPECT_NE(find<WriteTelecommands>(actions), nullptr);
  EXPECT_TRUE(sends<wire::WakeUpRequest>(actions));
  actions = wake();
  EXPECT_EQ(find<SendRequest>(actions), nullptr);  // not on disk yet
  EXPECT_TRUE(sends<wire::CommandRequest>(written()));
  pass(milliseconds(25));
  quiet();
  actions = written();
  EXPECT_EQ(find<StageReport>(actions)->failure, mission::failure::interrupted);
  grant();
  EXPECT_FALSE(sends<wire::CommandRequest>(wake()));  // never twice
}

TEST_F(PayloadCycleTest, NeverRepeatsAnAtMostOnceCommandThatADeactivationCutOff) {
  store(1, 1, RepeatClass::at_most_once);
  grant();
  written();
  EXPECT_TRUE(sends<wire::CommandRequest>(wake()));
  cycle.deactivate(now);
  quiet();
  EXPECT_EQ(find<StageReport>(written())->failure, mission::failure::interrupted);
  cycle.activate(now);
  cycle.on_power_switched(true, true, now);
  grant();
  EXPECT_FALSE(sends<wire::CommandRequest>(wake()));
}

TEST_F(PayloadCycleTest, ResetsAPeripheralByTelecommandEvenWhenItCannotBeWoken) {
  store(1, reset_function, RepeatClass::at_most_once);
  EXPECT_EQ(find<SendRequest>(grant()), nullptr);
  EXPECT_TRUE(sends<wire::ResetRequest>(written()));
  now += milliseconds(2);
  cycle.on_answer({0, wire::ResetResponse{}}, now);
  EXPECT_EQ(find<PublishStatus>(quiet())->kind, Kind::released);
  EXPECT_TRUE(find<StageReport>(written())->success);
}

TEST_F(PayloadCycleTest, PowerCyclesByTelecommandAndCompletesWhenThePowerIsBack) {
  store(1, power_function, RepeatClass::at_most_once);
  grant();
  written();
  PayloadActions actions = quiet();
  EXPECT_EQ(find<PublishStatus>(actions)->kind, Kind::released);
  ASSERT_NE(find<SwitchPower>(actions), nullptr);
  EXPECT_EQ(*find<Activity>(actions), Activity::other_async_command);
  cycle.on_power_switched(false, true, now);
  EXPECT_NE(find<SwitchPower>(pass(milliseconds(100))), nullptr);
  cycle.on_power_switched(true, true, now);
  EXPECT_TRUE(find<StageReport>(written())->success);
}

TEST_F(PayloadCycleTest, ReportsAPowerSwitchThatDoesNotObey) {
  store(1, power_function, RepeatClass::at_most_once);
  grant();
  written();
  quiet();
  const PayloadActions disobeyed = cycle.on_power_switched(false, false, now);
  ASSERT_NE(find<SwitchPower>(disobeyed), nullptr) << "it may have been switched off after all";
  EXPECT_TRUE(find<SwitchPower>(disobeyed)->on);
  EXPECT_EQ(find<StageReport>(written())->failure, mission::failure::power_switch_failed);
  EXPECT_TRUE(sends<wire::WakeUpRequest>(grant()));
}

/// The consequences when the peripheral floods the bus outside its slot.
struct Flood : Cycle {
  void SetUp() override {
    Cycle::SetUp();
    grant();
    wake();
    quiet();
  }
  PayloadActions flood() {
    for (int i = 0; i < 1000; ++i) {
      now += microseconds(300);
      if (PayloadActions actions = cycle.on_unsolicited_frame(now); !actions.empty()) return actions;
    }
    return {};
  }
  void switched_off_and_on() {
    cycle.on_power_switched(false, true, now);
    EXPECT_TRUE(find<SwitchPower>(pass(milliseconds(200)))->on);
    cycle.on_power_switched(true, true, now);
  }
  /// @return the actions after the last flood
  PayloadActions flood_until_kept_off() {
    for (int i = 0; i < 3; ++i) {
      EXPECT_NE(find<SwitchPower>(flood()), nullptr);
      switched_off_and_on();
    }
    flood();
    return cycle.on_power_switched(false, true, now);
  }
};
using PayloadCycleFlood = Flood;

TEST_F(PayloadCycleFlood, CutsThePowerAndRestoresItByTheNormalPowerCycle) {
  const PayloadActions cut = flood();
  ASSERT_NE(find<SwitchPower>(cut), nullptr);
  EXPECT_FALSE(find<SwitchPower>(cut)->on);
  EXPECT_EQ(find<PayloadEvent>(cut)->kind, PayloadEvent::Kind::peripheral_babbles);
  EXPECT_TRUE(flood().empty()) << "it is being switched off already";
  EXPECT_EQ(find<PublishStatus>(grant())->detail, "the peripheral is switched off");
  switched_off_and_on();
  EXPECT_TRUE(sends<wire::WakeUpRequest>(grant()));
  EXPECT_EQ(cycle.counters().babble_cuts, 1U);
}

TEST_F(PayloadCycleFlood, InTheEndKeepsItOffRemembersAndGivesItsSlotsBack) {
  const PayloadActions off = flood_until_kept_off();
  ASSERT_NE(find<RememberKeptOff>(off), nullptr);
  EXPECT_TRUE(find<RememberKeptOff>(off)->kept_off);
  EXPECT_EQ(find<RememberKeptOff>(off)->until, now + std::chrono::minutes(10));
  EXPECT_EQ(find<PayloadEvent>(off)->kind, PayloadEvent::Kind::peripheral_kept_off);
  EXPECT_EQ(cycle.next_deadline(), now + std::chrono::minutes(10)) << "nothing switches it on before";
  const PayloadActions slot = grant();
  EXPECT_EQ(find<OpenBus>(slot), nullptr);
  EXPECT_EQ(find<PublishStatus>(slot)->kind, Kind::released);
}

TEST_F(PayloadCycleFlood, IsTriedAgainAndKeptOffTwiceAsLongAfterATrialInVain) {
  flood_until_kept_off();
  for (const nanoseconds off :
       {std::chrono::minutes(10), std::chrono::minutes(20), std::chrono::minutes(40),
        std::chrono::minutes(80), std::chrono::minutes(160), std::chrono::minutes(320),
        std::chrono::minutes(360), std::chrono::minutes(360)}) {
    ASSERT_EQ(cycle.next_deadline(), now + off);
    const PayloadActions trial = pass(off);
    EXPECT_FALSE(find<RememberKeptOff>(trial)->kept_off);
    EXPECT_TRUE(find<SwitchPower>(trial)->on);
    cycle.on_power_switched(true, true, now);
    EXPECT_FALSE(find<SwitchPower>(flood())->on);
    EXPECT_TRUE(find<RememberKeptOff>(cycle.on_power_switched(false, true, now))->kept_off);
  }
}

TEST_F(PayloadCycleFlood, ServesItsSlotsAgainWhenATrialShowsThatItIsCured) {
  flood_until_kept_off();
  pass(std::chrono::minutes(10));
  cycle.on_power_switched(true, true, now);
  EXPECT_FALSE(cycle.peripheral_kept_off());
  EXPECT_TRUE(sends<wire::WakeUpRequest>(grant()));
}

TEST_F(PayloadCycleFlood, WhileKeptOffFailsTelecommandsToItAndObeysThePowerCycleBehindThem) {
  flood_until_kept_off();
  store(1);
  store(2, power_function, RepeatClass::at_most_once);
  EXPECT_EQ(find<PublishStatus>(grant())->kind, Kind::taken);
  EXPECT_EQ(find<StageReport>(written())->failure, mission::failure::peripheral_off);
  const PayloadActions released = quiet();
  ASSERT_NE(find<SwitchPower>(released), nullptr);
  EXPECT_FALSE(cycle.peripheral_kept_off());
  EXPECT_FALSE(find<RememberKeptOff>(released)->kept_off);
  cycle.on_power_switched(false, true, now);
  EXPECT_TRUE(find<SwitchPower>(pass(milliseconds(100)))->on);
  cycle.on_power_switched(true, true, now);
  EXPECT_TRUE(sends<wire::WakeUpRequest>(grant()));
}

TEST_F(PayloadCycleFlood, RemembersWithoutTheDiskThatTheIdsAreLostWhileTheDiskLacksWhatWasExecuted) {
  cycle.on_telecommand({1, 1, RepeatClass::by_id, MonotonicTime(), {}}, now);
  cycle.on_journal_written(cycle.journal().revision(), true, now);
  cycle.on_telecommand({2, 1, RepeatClass::by_id, MonotonicTime(), {}}, now);
  cycle.on_journal_written(cycle.journal().revision(), false, now);
  const PayloadActions off = flood();
  ASSERT_NE(find<RememberIdsLost>(off), nullptr);
  EXPECT_TRUE(find<RememberIdsLost>(off)->lost);

  cycle.on_power_switched(false, true, now);
  const PayloadActions stored = cycle.on_journal_written(cycle.journal().revision(), true, now);
  ASSERT_NE(find<RememberIdsLost>(stored), nullptr);
  EXPECT_FALSE(find<RememberIdsLost>(stored)->lost);
}

TEST_F(PayloadCycleFlood, StaysOffAcrossARestartOfTheNode) {
  PayloadCycle next{PayloadSettings{}, decode, TelecommandJournal{"boot"}};
  next.restore_kept_off(now + std::chrono::minutes(7));
  const PayloadActions start = next.activate(now);
  ASSERT_NE(find<SwitchPower>(start), nullptr);
  EXPECT_FALSE(find<SwitchPower>(start)->on);
  const PayloadActions off = next.on_power_switched(false, true, now);
  EXPECT_EQ(find<PayloadEvent>(off), nullptr) << "said before the restart";
  EXPECT_EQ(next.next_deadline(), now + std::chrono::minutes(7));
  EXPECT_TRUE(next.peripheral_kept_off());
}

TEST_F(PayloadCycleFlood, IsTriedAgainAlsoWhenARestartCouldNotSwitchItOffOrTheTimeIsOver) {
  for (const nanoseconds left : {nanoseconds(std::chrono::minutes(7)), nanoseconds(-seconds(1))}) {
    PayloadCycle next{PayloadSettings{}, decode, TelecommandJournal{"boot"}};
    next.restore_kept_off(now + left);
    next.activate(now);
    next.on_power_switched(false, false, now);
    ASSERT_EQ(next.next_deadline(), now + left);
    const PayloadActions trial = next.on_deadline(now + std::max(left, nanoseconds(0)));
    EXPECT_FALSE(find<RememberKeptOff>(trial)->kept_off);
    EXPECT_TRUE(find<SwitchPower>(trial)->on);
    EXPECT_FALSE(next.peripheral_kept_off());
  }
}

TEST_F(PayloadCycleFlood, IsCutOffInTheSlotToOnceNothingIsAskedOfIt) {
  grant();
  EXPECT_TRUE(cycle.expects_frames());
  cycle.on_request_failed(RequestFailure::garbage, "CRC", now);
  EXPECT_FALSE(cycle.expects_frames());
  EXPECT_NE(find<SwitchPower>(flood()), nullptr);
  EXPECT_EQ(find<PublishStatus>(quiet())->kind, Kind::failed);
  switched_off_and_on();
  EXPECT_TRUE(sends<wire::WakeUpRequest>(grant()));
}

TEST_F(PayloadCycleFlood, IsCutOffAgainWhenThePowerSwitchDidNotObey) {
  for (int i = 0; i < 3; ++i) {
    ASSERT_NE(find<SwitchPower>(flood()), nullptr) << i;
    cycle.on_power_switched(false, false, now);
    EXPECT_FALSE(cycle.peripheral_kept_off());
  }
}

TEST_F(PayloadCycleTest, RefusesUnknownFunctionsAndExpiredTelecommandsAtArrival) {
  EXPECT_EQ(find<StageReport>(arrive(1, 40))->failure, mission::failure::unknown_function);
  EXPECT_EQ(find<StageReport>(arrive(2, 1, RepeatClass::by_id, now - milliseconds(1)))->failure,
            mission::failure::expired);
  cycle.deactivate(now);
  EXPECT_EQ(find<StageReport>(arrive(3))->failure, mission::failure::node_not_active);
  EXPECT_EQ(cycle.journal().pending(), 0U);
}

TEST_F(PayloadCycleTest, FailsASlotWhoseRequestCouldNotBeSent) {
  grant();
  cycle.on_request_failed(RequestFailure::not_sent, "CAN device is gone", now);
  EXPECT_EQ(find<PublishStatus>(quiet())->detail, "CAN device is gone");
  EXPECT_EQ(cycle.statistics().peripheral_timeouts, 0U);
}

TEST_F(PayloadCycleTest, WaitsForAPeripheralThatBoots) {
  grant();
  wake(wire::PeripheralStatus::booting);
  const PayloadActions actions = quiet();
  EXPECT_EQ(find<PublishStatus>(actions)->detail, "the peripheral is booting");
  EXPECT_EQ(find<ProcessMeasurement>(actions), nullptr);
}

// ---------------------------------------------------------------- orders of the mode

const wire::CommandRequest* sent_command(const PayloadActions& actions) {
  const SendRequest* send = find<SendRequest>(actions);
  return send == nullptr ? nullptr : std::get_if<wire::CommandRequest>(&send->body);
}

TEST_F(PayloadCycleTest, OrdersOfTheModeGoOutBehindTheTelecommandsInOneSlot) {
  store(7);
  cycle.set_orders({}, {{2, {5}, "two"}, {3, {6}, "three"}}, seconds(10), now);
  grant();
  const wire::CommandRequest* telecommand = sent_command(wake());
  ASSERT_NE(telecommand, nullptr);
  PayloadActions actions = command_answer(7);
  const wire::CommandRequest* first = sent_command(actions);
  ASSERT_NE(first, nullptr);
  EXPECT_EQ(first->function, 2);
  EXPECT_EQ(first->arguments, Octets{5});
  EXPECT_GE(first->telecommand_id, 0x8000'0000U);
  actions = command_answer(first->telecommand_id);
  const wire::CommandRequest* second = sent_command(actions);
  ASSERT_NE(second, nullptr);
  EXPECT_EQ(second->function, 3);
  actions = command_answer(second->telecommand_id);
  ASSERT_NE(find<OrdersObeyed>(actions), nullptr);
  EXPECT_EQ(find<OrdersObeyed>(actions)->done, 2);
  EXPECT_NE(find<AwaitQuiet>(actions), nullptr);
  quiet();
  grant();
  EXPECT_EQ(sent_command(wake()), nullptr);  // not before the repeat time
}

TEST_F(PayloadCycleTest, AnOrderWithoutAnAnswerComesAgainInTheNextSlotUnderAnotherId) {
  cycle.set_orders({}, {{2, {}, "two"}}, seconds(10), now);
  grant();
  const std::uint32_t id = sent_command(wake())->telecommand_id;
  pass(milliseconds(25));
  EXPECT_EQ(find<PublishStatus>(quiet())->kind, Kind::failed);
  grant();
  const PayloadActions actions = wake();
  ASSERT_NE(sent_command(actions), nullptr);
  EXPECT_NE(sent_command(actions)->telecommand_id, id);
}

TEST_F(PayloadCycleTest, AnOrderThatIsNeverAnsweredIsReportedAfterThreeTriesAndTheNextGoesOut) {
  cycle.set_orders({}, {{2, {}, "two"}, {3, {}, "three"}}, seconds(10), now);
  for (int tries = 1; tries <= StandingOrders::longest_silence; ++tries) {
    grant();
    ASSERT_EQ(sent_command(wake())->function, 2);
    const PayloadActions actions = pass(milliseconds(25));
    EXPECT_EQ(find<OrderRefused>(actions) != nullptr, tries == StandingOrders::longest_silence);
    quiet();
  }
  grant();
  const PayloadActions actions = wake();
  ASSERT_NE(sent_command(actions), nullptr);
  EXPECT_EQ(sent_command(actions)->function, 3);
}

TEST_F(PayloadCycleTest, AnOrderThatCountsOnceIsDoneWhenThePeripheralHasCarriedItOut) {
  cycle.set_orders({{2, {}, "two"}}, {}, seconds(10), now);
  grant();
  PayloadActions actions =
      command_answer(sent_command(wake())->telecommand_id, wire::PeripheralResult::cannot_now);
  EXPECT_NE(find<OrderRefused>(actions), nullptr);
  EXPECT_EQ(find<OrdersObeyed>(actions), nullptr);
  quiet();
  now += seconds(10);
  grant();
  actions = command_answer(sent_command(wake())->telecommand_id);
  ASSERT_NE(find<OrdersObeyed>(actions), nullptr);
  EXPECT_EQ(find<OrdersObeyed>(actions)->done, 1);
}

TEST_F(PayloadCycleTest, AnOrderThatThePeripheralRefusesIsReportedAndTheNextGoesOut) {
  cycle.set_orders({}, {{2, {}, "two"}, {3, {}, "three"}}, seconds(10), now);
  grant();
  const std::uint32_t id = sent_command(wake())->telecommand_id;
  const PayloadActions actions = command_answer(id, wire::PeripheralResult::bad_argument);
  ASSERT_NE(find<OrderRefused>(actions), nullptr);
  EXPECT_EQ(find<OrderRefused>(actions)->order, "two");
  EXPECT_EQ(find<OrderRefused>(actions)->why, mission::failure::peripheral_bad_argument);
  EXPECT_EQ(sent_command(actions)->function, 3);
}

TEST_F(PayloadCycleTest, AnAnswerToAnOrderOfTheModeBeforeCountsForNoneOfThisOne) {
  cycle.set_orders({}, {{2, {}, "two"}}, seconds(10), now);
  grant();
  const std::uint32_t id = sent_command(wake())->telecommand_id;
  cycle.set_orders({}, {{3, {}, "three"}}, seconds(10), now);
  const PayloadActions actions = command_answer(id);
  EXPECT_EQ(find<OrdersObeyed>(actions), nullptr);
  ASSERT_NE(sent_command(actions), nullptr);
  EXPECT_EQ(sent_command(actions)->function, 3);
}

}  // namespace
}  // namespace srfs
