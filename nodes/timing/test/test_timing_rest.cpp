// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <deque>
#include <optional>
#include <random>

#include <gtest/gtest.h>

#include "nodes/timing/cycle_reservation.hpp"
#include "nodes/timing/watchdog_feeding.hpp"

namespace srfs {
namespace {

/// The ceiling to be written; nullopt: nothing is.
std::optional<MissionCycle> ceiling_of(const ReservationActions& actions) {
  EXPECT_LE(actions.size(), 1U);
  if (actions.empty()) return std::nullopt;
  return std::get<SaveCycles>(actions.front()).ceiling;
}

TEST(CycleReservation, NeverRepeatsACycleAcrossARestart) {
  CycleReservation before(0);
  const auto ceiling = ceiling_of(before.reserve(0));
  ASSERT_TRUE(ceiling.has_value());
  before.on_written(*ceiling, true);
  MissionCycle published = 0;
  for (; published < 850; ++published) {
    EXPECT_TRUE(before.reserve(published).empty()) << published;
    before.on_published(published);
  }
  EXPECT_EQ(before.unreserved(), 0U);

  const CycleReservation after(*ceiling);
  EXPECT_GT(after.first_cycle(), published);
  EXPECT_LE(after.first_cycle() - published, CycleReservation::step);
}

TEST(CycleReservation, AsksAgainAfterAFailedWriteAndCountsWhatNoCeilingCovers) {
  CycleReservation reservation(0);
  EXPECT_EQ(ceiling_of(reservation.reserve(0)), CycleReservation::step);
  EXPECT_TRUE(reservation.reserve(1).empty());
  EXPECT_TRUE(reservation.renew().empty()) << "one write at a time";
  reservation.on_written(CycleReservation::step, false);
  reservation.on_published(1);
  EXPECT_EQ(reservation.unreserved(), 1U);
  EXPECT_EQ(ceiling_of(reservation.reserve(2)), CycleReservation::step + 2);
}

/// The disk around a reservation: a write may fail, or be the last thing that happens.
TEST(CycleReservationProperties, KilledBeforeOrAfterAnyActionNoCycleIsPublishedTwiceWhileTheDiskWorks) {
  std::mt19937 random(11);
  for (int mission = 0; mission < 200; ++mission) {
    MissionCycle on_disk = 0;
    std::optional<MissionCycle> last_published;
    for (int process = 0; process < 20; ++process) {
      CycleReservation reservation(on_disk);
      MissionCycle next = reservation.first_cycle();
      if (last_published) {
        ASSERT_GT(next, *last_published);
      }
      std::deque<MissionCycle> writes;  // on the worker, in their order
      const auto carry_out = [&](const ReservationActions& actions) {
        for (const ReservationAction& action : actions)
          writes.push_back(std::get<SaveCycles>(action).ceiling);
      };
      const auto finish_write = [&] {
        const bool ok = random() % 4 != 0;
        if (ok) on_disk = writes.front();
        reservation.on_written(writes.front(), ok);
        writes.pop_front();
      };
      carry_out(reservation.reserve(next));
      finish_write();  // before the first tick
      const auto ticks = random() % 3000;
      for (unsigned tick = 0; tick < ticks; ++tick) {
        if (next < on_disk) {  // an unreserved one is counted, not promised
          last_published = next;
        }
        reservation.on_published(next);
        ++next;
        carry_out(reservation.reserve(next));
        if (random() % 200 == 0) carry_out(reservation.renew());
        ASSERT_LE(writes.size(), 1U) << "one write at a time";
        if (!writes.empty() && random() % 20 == 0) finish_write();
      }
      if (!writes.empty() && random() % 2 == 0)
        on_disk = writes.front();  // killed after the write, unanswered
    }
  }
}

TEST(TimingRecord, ReadsWhatItWrites) {
  const TimingRecord record{
      123456, UtcTime(seconds(1795248000)), MonotonicTime(seconds(77)), "b7-1", true, microseconds(3),
      -12.345};
  const auto read = decode_timing_record(encode_timing_record(record));
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->cycle_ceiling, record.cycle_ceiling);
  EXPECT_EQ(read->utc, record.utc);
  EXPECT_TRUE(read->utc_valid);
  EXPECT_EQ(read->at, record.at);
  EXPECT_EQ(read->boot_id, record.boot_id);
  EXPECT_EQ(read->error, record.error);
  EXPECT_EQ(read->drift_ppm, record.drift_ppm);
}

TEST(TimingRecord, ReadsWhatAnEarlierVersionWrote) {
  const auto read = decode_timing_record(
      "srfs-timing 1\ncycle_ceiling 7\nutc_ns 1795248000000000000\nutc_valid 1\nmonotonic_ns 77\nboot_id "
      "b7\ncrc "
      "e400\n");
  ASSERT_TRUE(read.has_value());
  EXPECT_TRUE(read->utc_valid);
  EXPECT_EQ(read->error, nanoseconds(0));
  EXPECT_FALSE(read->drift_ppm.has_value());
}

TEST(TimingRecord, CarriesTheTimeOnAtTheMeasuredRate) {
  const TimingRecord record{
      1, UtcTime(seconds(1795248000)), MonotonicTime(seconds(77)), "b7-1", true, microseconds(3), 40.0};
  const CarriedTime carried = carry_on(record, "b7-1", MonotonicTime(seconds(177)));
  EXPECT_EQ(carried.utc, record.utc + seconds(100) - milliseconds(4));
  EXPECT_EQ(carried.drift_ppm, 40.0);
  EXPECT_EQ(carried.error, microseconds(103));
  EXPECT_FALSE(carry_on(record, "b8", MonotonicTime(seconds(177))).drift_ppm.has_value())
      << "another boot, another temperature";
}

TEST(TimingRecord, CarriesAValidTimeOnWithinOneBoot) {
  const TimingRecord record{1, UtcTime(seconds(1795248000)), MonotonicTime(seconds(77)), "b7-1", true};
  const CarriedTime same = carry_on(record, "b7-1", MonotonicTime(seconds(80)));
  EXPECT_TRUE(same.valid);
  EXPECT_EQ(same.utc, record.utc + seconds(3));
  EXPECT_FALSE(carry_on(record, "b7-1", MonotonicTime(seconds(77 + 601))).valid);

  const CarriedTime rebooted = carry_on(record, "b8-2", MonotonicTime(seconds(80)));
  EXPECT_FALSE(rebooted.valid);
  EXPECT_EQ(rebooted.utc, record.utc);
}

TEST(TimingRecord, NoticesAnyChangedOctet) {
  const std::string good =
      encode_timing_record({123456, UtcTime(seconds(1795248000)), MonotonicTime(seconds(77)), "b7", true});
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 0x04);
    EXPECT_FALSE(decode_timing_record(bad).has_value()) << i;
  }
  EXPECT_FALSE(decode_timing_record("").has_value());
  EXPECT_FALSE(decode_timing_record(good.substr(0, good.size() / 2)).has_value());
}

/// What is missing; empty: the watchdog is fed.
std::string missing(WatchdogFeeding& feeding, MonotonicTime now) {
  static std::string last;
  const FeedingActions actions = feeding.on_due(now);
  if (std::holds_alternative<FeedWatchdog>(actions.at(0))) {
    EXPECT_EQ(actions.size(), 1U);
    return {};
  }
  EXPECT_TRUE(std::holds_alternative<WithholdWatchdog>(actions[0]));
  if (actions.size() == 2) last = std::get<ReportWithheld>(actions[1]).what;
  return last;
}

TEST(WatchdogFeeding, FeedsOnlyWhileTheTickRunsOnTime) {
  WatchdogFeeding feeding(milliseconds(100), milliseconds(50));
  MonotonicTime now{seconds(1)};
  EXPECT_EQ(missing(feeding, now), "no tick yet");
  feeding.on_tick(milliseconds(1), nanoseconds(0), now);
  EXPECT_EQ(missing(feeding, now + milliseconds(200)), "");
  EXPECT_EQ(missing(feeding, now + milliseconds(300)), "tick stopped");

  for (int i = 0; i < 6; ++i) feeding.on_tick(milliseconds(60), nanoseconds(0), now);
  EXPECT_EQ(missing(feeding, now), "tick late");
  feeding.on_tick(milliseconds(2), nanoseconds(0), now);
  EXPECT_EQ(missing(feeding, now), "");
}

TEST(WatchdogFeeding, CountsNoTickAsLateThatOnlyWaitedForACpuForLessThanASecond) {
  WatchdogFeeding feeding(milliseconds(100), milliseconds(50));
  const MonotonicTime now{seconds(1)};
  for (int i = 0; i < 60; ++i) feeding.on_tick(milliseconds(400), milliseconds(380), now);
  EXPECT_EQ(missing(feeding, now), "");
  for (int i = 0; i < 6; ++i) feeding.on_tick(milliseconds(400), milliseconds(300), now);
  EXPECT_EQ(missing(feeding, now), "tick late") << "100 ms are its own";
  for (int i = 0; i < 6; ++i) feeding.on_tick(milliseconds(1200), milliseconds(1200), now);
  EXPECT_EQ(missing(feeding, now), "tick late") << "no excuse without end";
}

TEST(WatchdogFeeding, IsWithheldWhenFurtherEvidenceIsMissing) {
  WatchdogFeeding feeding(milliseconds(100), milliseconds(50));
  bool answered = true;
  feeding.add_evidence({"can_switcher answered", [&](MonotonicTime) { return answered; }});
  feeding.on_tick(milliseconds(1), nanoseconds(0), MonotonicTime(seconds(1)));
  EXPECT_EQ(missing(feeding, MonotonicTime(seconds(1))), "");
  answered = false;
  EXPECT_EQ(missing(feeding, MonotonicTime(seconds(1))), "can_switcher answered");
}

TEST(WatchdogFeeding, ReportsOnceWhatIsMissingAndAgainAfterItWasFed) {
  WatchdogFeeding feeding(milliseconds(100), milliseconds(50));
  MonotonicTime now{seconds(1)};
  EXPECT_EQ(feeding.on_due(now).size(), 2U);
  EXPECT_EQ(feeding.on_due(now).size(), 1U) << "withheld, and known";
  feeding.on_tick(milliseconds(1), nanoseconds(0), now);
  EXPECT_TRUE(std::holds_alternative<FeedWatchdog>(feeding.on_due(now)[0]));
  now += seconds(9);
  EXPECT_EQ(std::get<ReportWithheld>(feeding.on_due(now).at(1)).what, "tick stopped");
  feeding.change_tick(milliseconds(200), milliseconds(50));
  EXPECT_EQ(std::get<ReportWithheld>(feeding.on_due(now).at(1)).what, "no tick yet") << "something else";
}

}  // namespace
}  // namespace srfs
