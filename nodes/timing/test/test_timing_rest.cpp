// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "nodes/timing/cycle_reservation.hpp"
#include "nodes/timing/watchdog_feeding.hpp"

namespace srfs {
namespace {

TEST(CycleReservation, NeverRepeatsACycleAcrossARestart) {
  CycleReservation before(0);
  const auto ceiling = before.wanted(0);
  ASSERT_TRUE(ceiling.has_value());
  before.on_written(*ceiling, true);
  MissionCycle published = 0;
  for (; published < 850; ++published) {
    EXPECT_FALSE(before.wanted(published).has_value()) << published;
    before.on_published(published);
  }
  EXPECT_EQ(before.unreserved(), 0U);

  const CycleReservation after(*ceiling);
  EXPECT_GT(after.first_cycle(), published);
  EXPECT_LE(after.first_cycle() - published, CycleReservation::step);
}

TEST(CycleReservation, AsksAgainAfterAFailedWriteAndCountsWhatNoCeilingCovers) {
  CycleReservation reservation(0);
  EXPECT_EQ(reservation.wanted(0), CycleReservation::step);
  EXPECT_FALSE(reservation.wanted(1).has_value());
  reservation.on_written(CycleReservation::step, false);
  reservation.on_published(1);
  EXPECT_EQ(reservation.unreserved(), 1U);
  EXPECT_EQ(reservation.wanted(2), CycleReservation::step + 2);
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

TEST(WatchdogFeeding, FeedsOnlyWhileTheTickRunsOnTime) {
  WatchdogFeeding feeding(milliseconds(100), milliseconds(50));
  MonotonicTime now{seconds(1)};
  EXPECT_EQ(feeding.missing(now), "no tick yet");
  feeding.on_tick(milliseconds(1), nanoseconds(0), now);
  EXPECT_FALSE(feeding.missing(now + milliseconds(200)).has_value());
  EXPECT_EQ(feeding.missing(now + milliseconds(300)), "tick stopped");

  for (int i = 0; i < 6; ++i) feeding.on_tick(milliseconds(60), nanoseconds(0), now);
  EXPECT_EQ(feeding.missing(now), "tick late");
  feeding.on_tick(milliseconds(2), nanoseconds(0), now);
  EXPECT_FALSE(feeding.missing(now).has_value());
}

TEST(WatchdogFeeding, CountsNoTickAsLateThatOnlyWaitedForACpuForLessThanASecond) {
  WatchdogFeeding feeding(milliseconds(100), milliseconds(50));
  const MonotonicTime now{seconds(1)};
  for (int i = 0; i < 60; ++i) feeding.on_tick(milliseconds(400), milliseconds(380), now);
  EXPECT_FALSE(feeding.missing(now).has_value());
  for (int i = 0; i < 6; ++i) feeding.on_tick(milliseconds(400), milliseconds(300), now);
  EXPECT_EQ(feeding.missing(now), "tick late") << "100 ms are its own";
  for (int i = 0; i < 6; ++i) feeding.on_tick(milliseconds(1200), milliseconds(1200), now);
  EXPECT_EQ(feeding.missing(now), "tick late") << "no excuse without end";
}

TEST(WatchdogFeeding, IsWithheldWhenFurtherEvidenceIsMissing) {
  WatchdogFeeding feeding(milliseconds(100), milliseconds(50));
  bool answered = true;
  feeding.add_evidence({"can_switcher answered", [&](MonotonicTime) { return answered; }});
  feeding.on_tick(milliseconds(1), nanoseconds(0), MonotonicTime(seconds(1)));
  EXPECT_FALSE(feeding.missing(MonotonicTime(seconds(1))).has_value());
  answered = false;
  EXPECT_EQ(feeding.missing(MonotonicTime(seconds(1))), "can_switcher answered");
}

}  // namespace
}  // namespace srfs
