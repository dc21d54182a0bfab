// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/downlink_scheduler.hpp"

#include <gtest/gtest.h>

#include "wire/pus.hpp"

namespace srfs {
namespace {

constexpr std::uint16_t spacecraft = 0xAB;

class Downlink : public testing::Test {
 protected:
  static DownlinkConfig config() {
    DownlinkConfig c;
    c.spacecraft_id = spacecraft;
    c.live_queue_octets = 4000;
    c.playback_queue_octets = 4000;
    return c;
  }
  static Octets packet(std::size_t source_octets, std::uint16_t sequence = 0) {
    wire::TmPacket p;
    p.apid = 1;
    p.sequence_count = sequence;
    p.service = 3;
    p.subtype = 25;
    p.source = Octets(source_octets, 0x11);
    return wire::make_tm_packet(p);
  }
  static MonotonicTime at_us(std::int64_t us) { return MonotonicTime(microseconds(us)); }
  /// The frame of the next CADU, as decoded by the ground.
  std::optional<wire::TmFrame> next(MonotonicTime now) {
    const auto cadu = scheduler_.next(now, [] { return 0x01000005U; });
    if (!cadu) return std::nullopt;
    for (const auto& found : ground_.push(*cadu)) {
      auto frame = frames_.decode(found.frame);
      if (frame) return *frame;
    }
    ADD_FAILURE() << "not a CADU the ground can read";
    return std::nullopt;
  }
  DownlinkScheduler scheduler_{config()};
  wire::CaduSynchroniser ground_{config().cadu};
  wire::TmFrameDecoder frames_{spacecraft, 223};
  wire::TmPacketReassembly live_;
};

TEST_F(Downlink, AFrameThatIsNotFullWaits50MsForCompany) {
  scheduler_.push(DownlinkChannel::live, packet(20), false, at_us(0));
  EXPECT_FALSE(next(at_us(49'999)));
  EXPECT_EQ(scheduler_.next_due(at_us(10)), at_us(50'000));

  const auto frame = next(at_us(50'000));

  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->ocf, 0x01000005U);
  EXPECT_EQ(live_.push(*frame), std::vector<Octets>{packet(20)});
}

TEST_F(Downlink, BesideWholeFramesOfAnotherChannelAFrameThatIsNotFullWaits32Cadus) {
  scheduler_.push(DownlinkChannel::live, packet(20), false, at_us(0));
  std::int64_t live_at_us = 0;
  for (std::int64_t us = 0; us < 200'000 && live_at_us == 0; us += 100) {
    while (scheduler_.room_octets(DownlinkChannel::playback) > 1000)
      scheduler_.push(DownlinkChannel::playback, packet(500), false, at_us(us));
    const auto frame = next(at_us(us));
    if (frame && frame->vc == 0) live_at_us = us;
  }
  constexpr std::int64_t cadu_us = 2811;  // 259 octets at 921600 baud
  EXPECT_GE(live_at_us, 31 * cadu_us);
  EXPECT_LE(live_at_us, 33 * cadu_us);
}

TEST_F(Downlink, AnUrgentPacketLeavesAtOnceWithWhatStandsBeforeIt) {
  scheduler_.push(DownlinkChannel::live, packet(20, 1), false, at_us(0));
  scheduler_.push(DownlinkChannel::live, packet(20, 2), true, at_us(5));

  const auto frame = next(at_us(5));

  ASSERT_TRUE(frame);
  EXPECT_EQ(live_.push(*frame).size(), 2U);
}

TEST_F(Downlink, WaitsForTheLineBeforeTheNextCadu) {
  for (std::uint16_t i = 0; i < 20; ++i)
    scheduler_.push(DownlinkChannel::live, packet(180, i), true, at_us(0));
  // The backlog may be one CADU (259 octets, 2.81 ms). So two leave at once, then one every 2.81 ms.
  EXPECT_TRUE(next(at_us(0)));
  EXPECT_TRUE(next(at_us(0)));
  EXPECT_FALSE(next(at_us(0)));
  const auto due = scheduler_.next_due(at_us(0));
  ASSERT_TRUE(due);
  EXPECT_NEAR(static_cast<double>(due->ns()), 259 * 10e9 / 921600, 1000);
  EXPECT_TRUE(next(*due));
  EXPECT_FALSE(next(*due));
}

TEST_F(Downlink, UsesTheLineFullyWhileThereIsSomethingToSend) {
  std::uint16_t sequence = 0;
  MonotonicTime now;
  std::size_t cadus = 0;
  while (now < at_us(1'000'000)) {
    while (scheduler_.room_octets(DownlinkChannel::playback) > 300) {
      scheduler_.push(DownlinkChannel::playback, packet(200, sequence++ & 0x3FFF), false, now);
    }
    while (next(now)) ++cadus;
    now = *scheduler_.next_due(now);
  }
  EXPECT_GE(static_cast<double>(cadus), 921600 / 10.0 / 259 * 0.99);
}

TEST_F(Downlink, LiveGoesFirstAndPlaybackKeepsItsMinimumShare) {
  for (std::uint16_t i = 0; i < 18; ++i) {
    scheduler_.push(DownlinkChannel::live, packet(188, i), true, at_us(0));
    scheduler_.push(DownlinkChannel::playback, packet(188, i), true, at_us(0));
  }
  std::string order;
  MonotonicTime now;
  while (order.size() < 16) {
    if (const auto frame = next(now)) {
      order += frame->vc == 0 ? 'L' : 'p';
    } else {
      now = *scheduler_.next_due(now);
    }
  }
  EXPECT_EQ(order, "LLLLLLLpLLLLLLLp");
}

TEST_F(Downlink, AFullQueueRefusesTheNewestPacketAndCounts) {
  std::size_t taken = 0;
  for (std::uint16_t i = 0; i < 50; ++i) {
    taken += scheduler_.push(DownlinkChannel::live, packet(177, i), false, at_us(0)) ? 1U : 0U;
  }
  EXPECT_EQ(taken, 20U);
  EXPECT_EQ(scheduler_.counters().dropped[0], 30U);
  EXPECT_EQ(scheduler_.counters().dropped[1], 0U);
}

class ContinuousDownlink : public Downlink {
 protected:
  ContinuousDownlink() {
    DownlinkConfig continuous = config();
    continuous.continuous = true;
    scheduler_ = DownlinkScheduler(continuous);
  }
};

TEST_F(ContinuousDownlink, IsNeverSilentAndFillsWhatIsLeftWithIdleFrames) {
  std::size_t cadus = 0;
  std::size_t idle = 0;
  std::size_t packets = 0;
  std::uint16_t sequence = 0;
  MonotonicTime now;
  while (now < at_us(1'000'000)) {
    if (cadus % 10 == 0) scheduler_.push(DownlinkChannel::live, packet(20, sequence++), false, now);
    while (const auto frame = next(now)) {
      ++cadus;
      idle += frame->vc == wire::tm_idle_vc ? 1U : 0U;
      if (frame->vc == 0) packets += live_.push(*frame).size();
    }
    now = *scheduler_.next_due(now);
  }
  EXPECT_GE(static_cast<double>(cadus), 921600 / 10.0 / 259 * 0.99);
  EXPECT_EQ(idle, scheduler_.counters().idle_frames);
  EXPECT_GT(idle, cadus / 2);
  EXPECT_GE(packets + 1, sequence);
}

TEST_F(ContinuousDownlink, APacketGoesRatherThanAnIdleFrame) {
  scheduler_.push(DownlinkChannel::files, packet(20), false, at_us(0));
  const auto frame = next(at_us(0));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->vc, 2);
  EXPECT_EQ(next(at_us(0))->vc, wire::tm_idle_vc);
}

TEST_F(Downlink, AnIdleFrameCarriesTheControlWordWhenThereIsNothingToSay) {
  EXPECT_FALSE(next(at_us(0)));
  scheduler_.want_control_word(at_us(0));
  EXPECT_FALSE(next(at_us(49'000)));

  const auto frame = next(at_us(50'000));

  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->vc, wire::tm_idle_vc);
  EXPECT_EQ(frame->ocf, 0x01000005U);
  EXPECT_FALSE(next(at_us(200'000)));
  EXPECT_EQ(scheduler_.counters().idle_frames, 1U);
}

}  // namespace
}  // namespace srfs
