// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <mission/structures.hpp>

#include "suite/commanding/telecommand_journal.hpp"

namespace srfs {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr MonotonicTime now{seconds(5)};

StoredTelecommand command(std::uint64_t id, RepeatClass repeat = RepeatClass::by_id,
                          MonotonicTime expiry = {}) {
  return {id, 1, repeat, expiry, {7, 8}};
}
StageReport accepted(std::uint64_t id) {
  return {.id = id};
}
StageReport started(std::uint64_t id) {
  return {.id = id, .stage = Stage::start};
}
StageReport completed(std::uint64_t id) {
  return {.id = id, .stage = Stage::completion};
}
StageReport failed(std::uint64_t id, FailureCode why, Stage stage = Stage::completion) {
  return {id, stage, false, why};
}

struct Journal : ::testing::Test {
  TelecommandJournal journal{"boot-a"};
  void write() { journal.on_written(journal.revision(), true); }
  void store(const StoredTelecommand& telecommand) {
    journal.add(telecommand);
    write();
    (void)journal.take_reports();
  }
};
using TelecommandJournalTest = Journal;

TEST_F(TelecommandJournalTest, ReportsAcceptanceOnlyAfterTheTelecommandIsStored) {
  EXPECT_EQ(journal.add(command(1)), TelecommandJournal::Arrival::stored);
  EXPECT_THAT(journal.take_reports(), IsEmpty());
  EXPECT_EQ(journal.next(now), nullptr);
  EXPECT_TRUE(journal.storing());
  write();
  EXPECT_THAT(journal.take_reports(), ElementsAre(accepted(1)));
  EXPECT_FALSE(journal.storing());
  ASSERT_NE(journal.next(now), nullptr);
  EXPECT_EQ(journal.next(now)->id, 1U);
}

TEST_F(TelecommandJournalTest, ReportsTheEndOnlyAfterItIsStored) {
  store(command(1));
  journal.begin();
  EXPECT_THAT(journal.take_reports(), ElementsAre(started(1)));
  journal.finish(mission::failure::none);
  EXPECT_THAT(journal.take_reports(), IsEmpty());
  write();
  EXPECT_THAT(journal.take_reports(), ElementsAre(completed(1)));
}

TEST_F(TelecommandJournalTest, KeepsTheOrderOfArrival) {
  for (std::uint64_t id : {5U, 3U, 9U}) store(command(id));
  for (std::uint64_t id : {5U, 3U, 9U}) {
    ASSERT_NE(journal.next(now), nullptr);
    EXPECT_EQ(journal.next(now)->id, id);
    journal.begin();
    journal.finish(mission::failure::none);
  }
  EXPECT_EQ(journal.next(now), nullptr);
}

TEST_F(TelecommandJournalTest, DropsAKnownIdAndRepeatsItsReports) {
  store(command(1));
  EXPECT_EQ(journal.add(command(1)), TelecommandJournal::Arrival::known);
  EXPECT_THAT(journal.take_reports(), ElementsAre(accepted(1)));
  journal.begin();
  journal.finish(mission::failure::peripheral_cannot_now);
  write();
  (void)journal.take_reports();
  EXPECT_EQ(journal.add(command(1)), TelecommandJournal::Arrival::known);
  EXPECT_THAT(journal.take_reports(),
              ElementsAre(accepted(1), failed(1, mission::failure::peripheral_cannot_now)));
  EXPECT_EQ(journal.pending(), 0U);
}

TEST_F(TelecommandJournalTest, RefusesTheSeventeenth) {
  for (std::uint64_t id = 1; id <= TelecommandJournal::capacity; ++id) store(command(id));
  EXPECT_EQ(journal.add(command(99)), TelecommandJournal::Arrival::full);
  EXPECT_THAT(journal.take_reports(),
              ElementsAre(failed(99, mission::failure::queue_full, Stage::acceptance)));
}

TEST_F(TelecommandJournalTest, EndsExpiredTelecommandsWithoutStartingThem) {
  store(command(1, RepeatClass::by_id, now - milliseconds(1)));
  store(command(2, RepeatClass::by_id, now));
  ASSERT_NE(journal.next(now), nullptr);
  EXPECT_EQ(journal.next(now)->id, 2U);
  write();
  EXPECT_THAT(journal.take_reports(), ElementsAre(failed(1, mission::failure::expired, Stage::start)));
}

TEST_F(TelecommandJournalTest, TriesThreeTimesWhatMayBeRepeated) {
  store(command(1));
  for (int i = 0; i < 2; ++i) {
    journal.begin();
    EXPECT_TRUE(journal.attempt_failed(mission::failure::peripheral_silent));
  }
  journal.begin();
  EXPECT_FALSE(journal.attempt_failed(mission::failure::peripheral_silent));
  write();
  EXPECT_THAT(journal.take_reports(),
              ElementsAre(started(1), failed(1, mission::failure::peripheral_silent)));
}

TEST_F(TelecommandJournalTest, LetsAnAtMostOnceCommandBeginOnlyWhenItsStartIsOnDisk) {
  store(command(1, RepeatClass::at_most_once));
  journal.mark_started();
  EXPECT_FALSE(journal.start_is_durable());
  write();
  EXPECT_TRUE(journal.start_is_durable());
  journal.begin();
  EXPECT_FALSE(journal.attempt_failed(mission::failure::peripheral_silent));
  write();
  EXPECT_THAT(journal.take_reports(), ElementsAre(started(1), failed(1, mission::failure::interrupted)));
}

TEST_F(TelecommandJournalTest, ContinuesAfterARestartAndEndsBegunAtMostOnceCommandsAsInterrupted) {
  store(command(1, RepeatClass::at_most_once));
  store(command(2));
  store(command(3, RepeatClass::at_most_once));
  journal.mark_started();

  TelecommandJournal restarted("boot-a");
  ASSERT_TRUE(restarted.restore(journal.encode()).has_value());
  EXPECT_THAT(restarted.take_reports(), IsEmpty());
  restarted.on_written(restarted.revision(), true);
  EXPECT_THAT(restarted.take_reports(), ElementsAre(failed(1, mission::failure::interrupted)));
  ASSERT_NE(restarted.next(now), nullptr);
  EXPECT_EQ(restarted.next(now)->id, 2U);
  EXPECT_EQ(restarted.next(now)->arguments, (Octets{7, 8}));
  EXPECT_EQ(restarted.pending(), 2U);
  EXPECT_EQ(restarted.add(command(1)), TelecommandJournal::Arrival::known);
}

TEST_F(TelecommandJournalTest, ReportsAnEndAgainWhenTheProcessDiedBetweenItsRecordAndItsReport) {
  for (const std::uint64_t id : {1U, 2U}) {
    store(command(id));
    journal.begin();
    journal.finish(mission::failure::none);
  }
  const Octets on_disk = journal.encode();  // and nobody was told
  TelecommandJournal restarted("boot-a");
  ASSERT_TRUE(restarted.restore(on_disk).has_value());
  // The first one's report went out when the second was stored.
  EXPECT_THAT(restarted.take_reports(), ElementsAre(completed(2)));
}

TEST_F(TelecommandJournalTest, EndsOnlyAByIdCommandThatMayHaveBeenSentWhenItsPeripheralForgotTheIds) {
  store(command(1, RepeatClass::by_id));
  journal.on_ids_lost();
  EXPECT_EQ(journal.pending(), 1U) << "not sent yet";
  journal.begin();
  journal.attempt_failed(mission::failure::peripheral_silent);
  journal.on_ids_lost();
  EXPECT_EQ(journal.pending(), 0U);
  write();
  EXPECT_THAT(journal.take_reports(), ElementsAre(started(1), failed(1, mission::failure::interrupted)));

  store(command(2, RepeatClass::idempotent));
  journal.begin();
  journal.attempt_failed(mission::failure::peripheral_silent);
  journal.on_ids_lost();
  EXPECT_EQ(journal.pending(), 1U) << "may be done twice";
}

TEST_F(TelecommandJournalTest, EndsAllRestoredByIdCommandsWhenAnOldFileMayLackThatTheyWereExecuted) {
  store(command(1, RepeatClass::by_id));
  store(command(2, RepeatClass::idempotent));
  store(command(3, RepeatClass::by_id));
  EXPECT_TRUE(journal.is_durable());
  const Octets old_file = journal.encode();
  journal.begin();
  journal.finish(mission::failure::none);
  EXPECT_FALSE(journal.is_durable());

  TelecommandJournal restarted("boot-a");
  ASSERT_TRUE(restarted.restore(old_file).has_value());
  restarted.interrupt_restored();
  ASSERT_NE(restarted.next(now), nullptr);
  EXPECT_EQ(restarted.next(now)->id, 2U);
  EXPECT_EQ(restarted.pending(), 1U);
  restarted.on_written(restarted.revision(), true);
  EXPECT_THAT(restarted.take_reports(), ElementsAre(failed(1, mission::failure::interrupted),
                                                    failed(3, mission::failure::interrupted)));
}

TEST_F(TelecommandJournalTest, EndsAllRestoredByIdCommandsWhenThePeripheralForgetsTheIdsLater) {
  store(command(1, RepeatClass::idempotent));
  store(command(
      2, RepeatClass::by_id));  // a predecessor may have executed both, and died before it recorded that
  TelecommandJournal restarted("boot-a");
  ASSERT_TRUE(restarted.restore(journal.encode()).has_value());
  restarted.on_ids_lost();
  ASSERT_EQ(restarted.pending(), 1U);
  EXPECT_EQ(restarted.next(now)->id, 1U);
  restarted.on_written(restarted.revision(), true);
  EXPECT_THAT(restarted.take_reports(), ElementsAre(failed(2, mission::failure::interrupted)));
}

TEST_F(TelecommandJournalTest, DoesNotExpireWhatBeganInTime) {
  store(command(1, RepeatClass::by_id, now));
  ASSERT_NE(journal.next(now), nullptr);
  journal.begin();
  EXPECT_TRUE(journal.attempt_failed(mission::failure::peripheral_silent));
  ASSERT_NE(journal.next(now + seconds(1)), nullptr) << "its second attempt";
  journal.begin();
  journal.finish(mission::failure::none);
  write();
  EXPECT_THAT(journal.take_reports(), ElementsAre(started(1), completed(1)));
}

TEST_F(TelecommandJournalTest, ExpiresACommandWhoseStartWasRecordedAndThatWasNotSent) {
  store(command(1, RepeatClass::at_most_once, now));
  journal.mark_started();
  EXPECT_EQ(journal.next(now + seconds(1)), nullptr);
  write();
  EXPECT_THAT(journal.take_reports(), ElementsAre(failed(1, mission::failure::expired, Stage::start)));
}

struct JournalAfterACrash : Journal {
  /// What the successor reports of a telecommand that was begun, or was not, before the process died.
  std::vector<StageReport> reports_of(RepeatClass repeat, bool begun, const std::string& boot = "boot-a") {
    store(command(1, repeat, now));
    if (begun) {
      journal.mark_started();
      write();
      journal.begin();
    }
    const Octets on_disk = journal.encode();
    TelecommandJournal restarted(boot);
    EXPECT_TRUE(restarted.restore(on_disk));
    EXPECT_EQ(restarted.next(now + seconds(1)), nullptr) << "past its expiry it does not start";
    restarted.on_written(restarted.revision(), true);
    return restarted.take_reports();
  }
};
using JournalAfterACrashTest = JournalAfterACrash;

TEST_F(JournalAfterACrashTest, SaysThatTheOutcomeOfABegunCommandIsUnknownWhenItExpiredMeanwhile) {
  for (const RepeatClass repeat : {RepeatClass::idempotent, RepeatClass::by_id, RepeatClass::at_most_once}) {
    for (const char* boot : {"boot-a", "boot-b"}) {
      journal = TelecommandJournal("boot-a");
      EXPECT_THAT(reports_of(repeat, true, boot), ElementsAre(failed(1, mission::failure::interrupted)))
          << static_cast<int>(repeat) << boot;
    }
  }
}

TEST_F(JournalAfterACrashTest, ClaimsThatACommandDidNotStartOnlyWhereItsStartWouldHaveBeenRecorded) {
  for (const char* boot : {"boot-a", "boot-b"}) {
    journal = TelecommandJournal("boot-a");
    EXPECT_THAT(reports_of(RepeatClass::at_most_once, false, boot),
                ElementsAre(failed(1, mission::failure::expired, Stage::start)));
    journal = TelecommandJournal("boot-a");
    EXPECT_THAT(reports_of(RepeatClass::by_id, false, boot),
                ElementsAre(failed(1, mission::failure::interrupted)));
  }
}

TEST_F(TelecommandJournalTest, NoticesADamagedFile) {
  store(command(2));
  const Octets good = journal.encode();
  for (std::size_t i = 0; i < good.size(); ++i) {
    Octets bad = good;
    bad[i] ^= 0x10;
    TelecommandJournal other("boot-a");
    EXPECT_FALSE(other.restore(bad).has_value()) << i;
  }
  for (std::size_t n = 0; n < good.size(); ++n) {
    TelecommandJournal other("boot-a");
    EXPECT_FALSE(other.restore(OctetView(good).first(n)).has_value()) << n;
  }
}

TEST_F(TelecommandJournalTest, RefusesWhatCannotBeStoredAndStillReportsEnds) {
  store(command(1));
  journal.begin();
  journal.finish(mission::failure::none);
  journal.add(command(2));
  (void)journal.take_reports();
  journal.on_written(journal.revision(), false);
  EXPECT_THAT(journal.take_reports(),
              ElementsAre(completed(1), failed(2, mission::failure::storage_unavailable, Stage::acceptance)));
  EXPECT_EQ(journal.pending(), 0U);
}

TEST_F(TelecommandJournalTest, RemembersTheLastSixtyFourIdsAndTakesOlderOnesForReplays) {
  for (std::uint64_t id = 1; id <= 70; ++id) {
    store(command(id));
    journal.begin();
    journal.finish(mission::failure::none);
    write();
  }
  (void)journal.take_reports();
  EXPECT_EQ(journal.add(command(7)), TelecommandJournal::Arrival::known);
  EXPECT_EQ(journal.add(command(6)), TelecommandJournal::Arrival::too_old);
  EXPECT_EQ(journal.add(command(1)), TelecommandJournal::Arrival::too_old);
  EXPECT_EQ(journal.pending(), 0U);
  EXPECT_EQ(journal.take_reports().back(), failed(1, mission::failure::interrupted, Stage::acceptance));
  EXPECT_EQ(journal.add(command(71)), TelecommandJournal::Arrival::stored);
}

TEST_F(TelecommandJournalTest, KnowsReplaysAfterARestartTooButNotAfterAnotherBoot) {
  for (std::uint64_t id = 101; id <= 170; ++id) {
    store(command(id));
    journal.begin();
    journal.finish(mission::failure::none);
    write();
  }
  TelecommandJournal restarted("boot-a");
  ASSERT_TRUE(restarted.restore(journal.encode()));
  EXPECT_EQ(restarted.add(command(106)), TelecommandJournal::Arrival::too_old);
  EXPECT_EQ(restarted.add(command(107)), TelecommandJournal::Arrival::known);

  TelecommandJournal rebooted("another boot");
  ASSERT_TRUE(rebooted.restore(journal.encode()));
  EXPECT_EQ(rebooted.add(command(106)), TelecommandJournal::Arrival::stored)
      << "the link's state and the clock may be lost: ttc must be heard all the same";
}

TEST_F(TelecommandJournalTest, IdsOfAnEarlierBootNeverMakeThoseOfThisOneReplays) {
  constexpr std::uint64_t high = 1'000'000;
  for (std::uint64_t id = high; id < high + TelecommandJournal::known_capacity; ++id) {
    store(command(id));
    journal.begin();
    journal.finish(mission::failure::none);
    write();
  }
  journal.add(command(high + 500));  // begins, and the power fails
  write();
  Octets on_disk = journal.encode();
  // ttc counts from low numbers now; this process is restarted between them.
  for (std::uint64_t id = 1; id <= 140; ++id) {
    TelecommandJournal now_on("another boot");
    ASSERT_TRUE(now_on.restore(on_disk));
    ASSERT_EQ(now_on.add(command(id)), TelecommandJournal::Arrival::stored) << id;
    now_on.on_written(now_on.revision(), true);
    now_on.begin();
    now_on.finish(mission::failure::none);
    on_disk = now_on.encode();
  }
  TelecommandJournal last("another boot");
  ASSERT_TRUE(last.restore(on_disk));
  EXPECT_EQ(last.add(command(140)), TelecommandJournal::Arrival::known);
  EXPECT_EQ(last.add(command(20)), TelecommandJournal::Arrival::too_old);
}

TEST_F(TelecommandJournalTest, NoLaterIdIsAReplayWhenManyOfAnEarlierBootMadeRoom) {
  constexpr std::uint64_t high = 1'000'000;
  for (std::uint64_t id = high; id < high + TelecommandJournal::known_capacity; ++id) {
    store(command(id));
    journal.begin();
    journal.finish(mission::failure::none);
    write();
  }
  TelecommandJournal rebooted("another boot");
  ASSERT_TRUE(rebooted.restore(journal.encode()));
  for (std::uint64_t id = 1; id <= 3; ++id) {
    ASSERT_EQ(rebooted.add(command(id)), TelecommandJournal::Arrival::stored) << id;
    rebooted.on_written(rebooted.revision(), true);
    rebooted.begin();
    rebooted.finish(mission::failure::none);
  }
}

TEST_F(TelecommandJournalTest, WhatWasRefusedStaysRefusedWhenItComesAgain) {
  for (std::uint64_t id = 1; id <= TelecommandJournal::capacity; ++id) store(command(id));
  ASSERT_EQ(journal.add(command(99)), TelecommandJournal::Arrival::full);
  journal.refuse(98, mission::failure::node_not_active);
  journal.begin();
  journal.finish(mission::failure::none);
  write();
  (void)journal.take_reports();
  EXPECT_EQ(journal.add(command(99)), TelecommandJournal::Arrival::known);
  EXPECT_TRUE(journal.repeat_reports(98));
  EXPECT_THAT(journal.take_reports(),
              ElementsAre(failed(99, mission::failure::queue_full, Stage::acceptance),
                          failed(98, mission::failure::node_not_active, Stage::acceptance)));
  EXPECT_EQ(journal.pending(), TelecommandJournal::capacity - 1);

  for (std::uint64_t id = 200; id < 200 + TelecommandJournal::refused_capacity; ++id)
    journal.refuse(id, mission::failure::node_not_active);
  EXPECT_FALSE(journal.repeat_reports(99)) << "the oldest made room";
}

}  // namespace
}  // namespace srfs
