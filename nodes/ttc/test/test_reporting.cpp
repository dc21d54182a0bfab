// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <filesystem>

#include <gtest/gtest.h>

#include <mission/structures.hpp>

#include "nodes/ttc/link/packet_maker.hpp"
#include "nodes/ttc/report/event_reporter.hpp"
#include "nodes/ttc/services/housekeeping_scheduler.hpp"
#include "nodes/ttc/services/mode_manager.hpp"
#include "nodes/ttc/spacecraft_clock.hpp"
#include "nodes/ttc/store/packet_retrieval.hpp"
#include "wire/pus.hpp"

namespace srfs {
namespace {

MonotonicTime at(int ms) {
  return MonotonicTime(milliseconds(ms));
}

class Housekeeping : public testing::Test {
 protected:
  Housekeeping() {
    scheduler_.add_structure(16, 16, 4, 4, {.enabled = true, .interval = milliseconds(1000)});
  }
  bool live(int ms) {
    const auto report = scheduler_.on_sample(16, 16, Octets{1, 2, 3, 4}, at(ms));
    return report && report->live;
  }
  ReportQueue report_queue_;
  HousekeepingScheduler scheduler_{report_queue_};
};

TEST_F(Housekeeping, StoresEverySampleAndSendsOneAnInterval) {
  int sent = 0;
  int stored = 0;
  for (int ms = 0; ms < 30'000; ms += 300) {
    const auto report = scheduler_.on_sample(16, 16, Octets{1, 2, 3, 4}, at(ms));
    ASSERT_TRUE(report);
    ++stored;
    sent += report->live ? 1 : 0;
  }
  EXPECT_EQ(stored, 100);
  EXPECT_EQ(sent, 30);
}

TEST_F(Housekeeping, PutsTheStructureIdBeforeTheParameters) {
  const auto report = scheduler_.on_sample(16, 16, Octets{1, 2, 3, 4}, at(0));
  ASSERT_TRUE(report);
  EXPECT_EQ(report->apid, 16);
  EXPECT_EQ(report->service, 3);
  EXPECT_EQ(report->subtype, 25);
  EXPECT_EQ(report->data, (Octets{0, 16, 1, 2, 3, 4}));
}

TEST_F(Housekeeping, ADisabledStructureIsStoredOnly) {
  ASSERT_TRUE(scheduler_.set_enabled(16, false));
  EXPECT_FALSE(live(0));
  EXPECT_EQ(scheduler_.counters().samples, 1U);
  ASSERT_TRUE(scheduler_.set_enabled(16, true));
  EXPECT_TRUE(live(10));
}

TEST_F(Housekeeping, ANewIntervalHoldsFromTheNextSampleOn) {
  EXPECT_TRUE(live(0));
  ASSERT_TRUE(scheduler_.set_interval(16, milliseconds(100)));
  EXPECT_TRUE(live(10));
  EXPECT_FALSE(live(60));
  EXPECT_TRUE(live(120));
}

TEST_F(Housekeeping, ASilenceIsNotCaughtUpWith) {
  EXPECT_TRUE(live(0));
  EXPECT_TRUE(live(60'000));
  EXPECT_FALSE(live(60'300));
}

TEST_F(Housekeeping, OneShotGivesTheNewestSampleOrSaysThereIsNone) {
  EXPECT_EQ(scheduler_.one_shot(16).error(), HousekeepingError::no_value_yet);
  EXPECT_EQ(scheduler_.one_shot(99).error(), HousekeepingError::unknown_structure);
  (void)live(0);
  EXPECT_EQ(scheduler_.one_shot(16)->data, (Octets{0, 16, 1, 2, 3, 4}));
}

TEST_F(Housekeeping, CountsSamplesThatAreNotInTheDictionary) {
  EXPECT_FALSE(scheduler_.on_sample(16, 99, Octets{1, 2, 3, 4}, at(0)));
  EXPECT_FALSE(scheduler_.on_sample(17, 16, Octets{1, 2, 3, 4}, at(0))) << "structure of another node";
  EXPECT_FALSE(scheduler_.on_sample(16, 16, Octets{1, 2, 3}, at(0)));
  EXPECT_EQ(scheduler_.counters().unknown, 3U);
}

class Events : public testing::Test {
 protected:
  Events() {
    reporter_.add_event(101);
    reporter_.add_event(102);
  }
  ReportQueue report_queue_;
  EventReporter reporter_{report_queue_, {.burst = 3, .refill = milliseconds(1000)}};
};

TEST_F(Events, TheSeverityIsTheSubtype) {
  const auto report = reporter_.on_event(17, 101, 3, Octets{0xAB}, at(0));
  ASSERT_TRUE(report);
  EXPECT_EQ(report->subtype, 3);
  EXPECT_EQ(report->apid, 17);
  EXPECT_EQ(report->data, (Octets{0, 101, 0xAB}));
}

TEST_F(Events, AFloodOfOneEventCostsOnlyItself) {
  for (int i = 0; i < 100; ++i) (void)reporter_.on_event(1, 101, 1, {}, at(i));
  EXPECT_EQ(reporter_.counters().reported, 3U);
  EXPECT_EQ(reporter_.counters().suppressed, 97U);
  EXPECT_TRUE(reporter_.on_event(1, 102, 1, {}, at(100)));
  EXPECT_TRUE(reporter_.on_event(1, 101, 1, {}, at(1000))) << "one more after a second";
  EXPECT_FALSE(reporter_.on_event(1, 101, 1, {}, at(1001)));
}

TEST_F(Events, ADisabledEventIsStoredOnly) {
  ASSERT_TRUE(reporter_.set_enabled(101, false));
  const auto report = reporter_.on_event(1, 101, 1, {}, at(0));
  ASSERT_TRUE(report);
  EXPECT_FALSE(report->live);
  EXPECT_FALSE(reporter_.set_enabled(999, false));
}

TEST_F(Events, UnknownEventsAndSeveritiesAreCounted) {
  EXPECT_FALSE(reporter_.on_event(1, 999, 1, {}, at(0)));
  EXPECT_FALSE(reporter_.on_event(1, 101, 0, {}, at(0)));
  EXPECT_FALSE(reporter_.on_event(1, 101, 5, {}, at(0)));
  EXPECT_EQ(reporter_.counters().unknown, 3U);
}

TEST(ModeKeeping, AFreshDeploymentStartsAsItsParameterSays) {
  EXPECT_EQ(ModeManager(StoredModeState::first_start, "", MissionMode::nominal).mode(), MissionMode::nominal);
}

TEST(ModeKeeping, MissingOrDamagedMeansSafe) {
  EXPECT_EQ(ModeManager(StoredModeState::missing, "", MissionMode::nominal).mode(), MissionMode::safe);
  EXPECT_EQ(ModeManager(StoredModeState::present, "nominal", MissionMode::nominal).mode(), MissionMode::safe);
  EXPECT_EQ(ModeManager(StoredModeState::present, "", MissionMode::nominal).mode(), MissionMode::safe);
}

TEST(ModeKeeping, AStoredChangeComesBack) {
  ModeManager manager(StoredModeState::first_start, "", MissionMode::safe);
  const std::string stored = manager.change(MissionMode::nominal, {.reason = "commanded"});
  EXPECT_EQ(manager.reason(), "commanded");

  EXPECT_EQ(ModeManager(StoredModeState::present, stored, MissionMode::safe).mode(), MissionMode::nominal);
}

TEST(PacketMaking, CountsPerApidAndPerTypeAndKeepsTheTimeStatus) {
  PacketMaker maker;
  const Report event{.apid = 17, .service = 5, .subtype = 1, .destination_id = 0, .data = {0, 1}};
  const Report sample{.apid = 17, .service = 3, .subtype = 25, .destination_id = 0, .data = {0, 17}};
  (void)maker.make(event, TaiTime(seconds(1)), TimeReference::locked);
  (void)maker.make(sample, TaiTime(seconds(2)), TimeReference::locked);

  const auto third = wire::parse_tm_packet(maker.make(event, TaiTime(seconds(3)), TimeReference::holdover));

  ASSERT_TRUE(third);
  EXPECT_EQ(third->sequence_count, 2);
  EXPECT_EQ(third->type_counter, 1);
  EXPECT_EQ(third->time_reference, 2);
  EXPECT_EQ(third->time, TaiTime(seconds(3)));
}

ReceivedTick tick(std::uint32_t utc_s, std::uint64_t due_ms, std::uint8_t sync_state) {
  return {.utc_s = utc_s,
          .utc_ns = 0,
          .monotonic_ns = due_ms * 1'000'000,
          .period_us = 100'000,
          .time_valid = true,
          .sync_state = sync_state};
}

TEST(SpacecraftTime, IsInvalidUntilTheTickSaysOtherwiseAndGoesOnBetweenTicks) {
  SpacecraftClock clock(UtcTime(seconds(1000)), at(0));
  EXPECT_FALSE(clock.valid());
  EXPECT_EQ(clock.utc_at(at(500)), UtcTime(milliseconds(1'000'500)));

  ASSERT_TRUE(clock.on_tick(tick(2000, 600, 2), at(600)));

  EXPECT_EQ(clock.reference_at(at(600)), TimeReference::locked);
  EXPECT_EQ(clock.utc_at(at(700)), UtcTime(milliseconds(2'000'100)));
  ASSERT_TRUE(clock.on_tick(tick(2001, 1600, 3), at(1600)));
  EXPECT_EQ(clock.reference_at(at(1600)), TimeReference::holdover);
}

TEST(SpacecraftTime, GoesOnBeyond2038) {
  SpacecraftClock clock(UtcTime(seconds(1000)), at(0));
  ASSERT_TRUE(clock.on_tick(tick(2'300'000'000, 600, 2), at(600)));
  EXPECT_EQ(clock.utc_at(at(600)), UtcTime(seconds(2'300'000'000)));
}

TEST(SpacecraftTime, IsInHoldoverAfterFivePeriodsWithoutATick) {
  SpacecraftClock clock(UtcTime(seconds(1000)), at(0));
  ASSERT_TRUE(clock.on_tick(tick(2000, 600, 2), at(600)));

  EXPECT_EQ(clock.reference_at(at(1100)), TimeReference::locked);
  EXPECT_EQ(clock.reference_at(at(1101)), TimeReference::holdover);
}

TEST(SpacecraftTime, IgnoresTicksThatCannotBeTrue) {
  SpacecraftClock clock(UtcTime(seconds(1000)), at(0));
  ReceivedTick far_ahead = tick(2000, 0, 2);
  far_ahead.monotonic_ns = UINT64_MAX;
  ReceivedTick long_ago = tick(2000, 0, 2);
  ReceivedTick too_many_ns = tick(2000, 60'000, 2);
  too_many_ns.utc_ns = 1'000'000'000;
  ReceivedTick no_period = tick(2000, 60'000, 2);
  no_period.period_us = 0;

  for (const ReceivedTick& bad : {far_ahead, long_ago, too_many_ns, no_period})
    EXPECT_FALSE(clock.on_tick(bad, at(60'000)));

  EXPECT_EQ(clock.utc_at(at(0)), UtcTime(seconds(1000)));
  EXPECT_FALSE(clock.valid());
}

class Retrieval : public testing::Test {
 protected:
  static TelecommandOrigin origin(std::uint16_t sequence) {
    return {.request = {0x1801, static_cast<std::uint16_t>(0xC000 + sequence)},
            .apid = 1,
            .ack_flags = wire::ack::all,
            .source_id = 0};
  }
  static std::vector<StorePeriod> period(std::uint16_t store = 1) {
    return {StorePeriod{.store = store, .range = {.from = TaiTime(seconds(1)), .to = TaiTime(seconds(2))}}};
  }
  static RetrievedPackets packets(std::size_t count, bool finished) {
    RetrievedPackets out;
    out.packets.assign(count, Octets(10, 1));
    out.finished = finished;
    return out;
  }
  [[nodiscard]] std::vector<int> subtypes() {
    std::vector<int> found;
    for (const Report& report : report_queue_.take()) found.push_back(report.subtype);
    return found;
  }
  static constexpr std::size_t room = PacketRetrieval::room_for_batch;
  ReportQueue report_queue_;
  PacketRetrieval retrieval_{report_queue_};
};

TEST_F(Retrieval, StartsWithTheFirstBatchAndCompletesWhenTheLastPacketIsFramed) {
  ASSERT_TRUE(retrieval_.request(origin(1), period()));
  EXPECT_FALSE(retrieval_.next_batch(room - 1)) << "the playback channel is full";
  auto batch = retrieval_.next_batch(room);
  ASSERT_TRUE(batch);
  EXPECT_FALSE(retrieval_.next_batch(room)) << "one batch at a time";

  EXPECT_EQ(retrieval_.on_batch(batch->request, packets(3, false)).size(), 3U);
  EXPECT_EQ(subtypes(), std::vector<int>{3});
  batch = retrieval_.next_batch(room);
  ASSERT_TRUE(batch);
  EXPECT_EQ(retrieval_.on_batch(batch->request, packets(2, true)).size(), 2U);
  retrieval_.on_playback(false);
  EXPECT_TRUE(subtypes().empty());
  retrieval_.on_playback(true);

  EXPECT_EQ(subtypes(), std::vector<int>{7});
  const auto done = retrieval_.take_done();
  ASSERT_EQ(done.size(), 1U);
  EXPECT_EQ(done[0].packets, 5U);
  EXPECT_EQ(done[0].octets, 50U);
  EXPECT_FALSE(retrieval_.busy());
}

TEST_F(Retrieval, AnEmptyPeriodCompletesAtOnce) {
  ASSERT_TRUE(retrieval_.request(origin(1), period()));
  const auto batch = retrieval_.next_batch(room);
  ASSERT_TRUE(batch);
  (void)retrieval_.on_batch(batch->request, packets(0, true));
  retrieval_.on_playback(true);
  EXPECT_EQ(subtypes(), (std::vector<int>{3, 7}));
}

TEST_F(Retrieval, AnAbortEndsTheRequestsOfThatStoreAndDropsWhatIsStillRead) {
  ASSERT_TRUE(retrieval_.request(origin(1), period(1)));
  ASSERT_TRUE(retrieval_.request(origin(2), period(2)));
  const auto batch = retrieval_.next_batch(room);
  ASSERT_TRUE(batch);

  retrieval_.abort(1, 39);

  EXPECT_EQ(subtypes(), std::vector<int>{8});
  EXPECT_TRUE(retrieval_.on_batch(batch->request, packets(3, false)).empty());
  const auto next = retrieval_.next_batch(room);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->period.store, 2);
}

TEST_F(Retrieval, AnUnreadableStoreFailsTheRequest) {
  ASSERT_TRUE(retrieval_.request(origin(1), period()));
  const auto batch = retrieval_.next_batch(room);
  ASSERT_TRUE(batch);
  retrieval_.fail(batch->request);
  EXPECT_EQ(subtypes(), std::vector<int>{8});
  EXPECT_FALSE(retrieval_.busy());
}

TEST_F(Retrieval, EndsWithAFailureAfterSendingTheRestWhenAPartCouldNotBeRead) {
  ASSERT_TRUE(retrieval_.request(origin(1), period()));
  auto batch = retrieval_.next_batch(room);
  ASSERT_TRUE(batch);
  RetrievedPackets with_a_gap = packets(3, false);
  with_a_gap.damaged = true;
  (void)retrieval_.on_batch(batch->request, with_a_gap);
  batch = retrieval_.next_batch(room);
  ASSERT_TRUE(batch);
  EXPECT_EQ(retrieval_.on_batch(batch->request, packets(2, true)).size(), 2U);

  retrieval_.on_playback(true);

  EXPECT_EQ(subtypes(), (std::vector<int>{3, 8}));
  EXPECT_EQ(retrieval_.incomplete(), 1U);
  EXPECT_EQ(retrieval_.take_done().size(), 1U) << "the ground still learns how many were sent";
}

TEST(EssentialEvent, IsNeitherLimitedNorDisabled) {
  ReportQueue report_queue;
  EventReporter events{report_queue};
  events.add_event(7);
  events.add_essential_event(8);
  for (int i = 0; i < 50; ++i) EXPECT_TRUE(events.on_event(1, 8, 1, Octets{}, at(0)));
  EXPECT_FALSE(events.set_enabled(8, false));
  EXPECT_TRUE(events.set_enabled(8, true));
  EXPECT_TRUE(events.set_enabled(7, false));
}

TEST_F(Retrieval, TakesABoundedNumberOfRequests) {
  for (std::uint16_t i = 0; i < PacketRetrieval::max_requests; ++i)
    EXPECT_TRUE(retrieval_.request(origin(i), period()));
  EXPECT_FALSE(retrieval_.request(origin(9), period()));
}

}  // namespace
}  // namespace srfs
