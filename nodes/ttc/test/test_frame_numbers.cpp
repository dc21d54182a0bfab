// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/frame_numbers.hpp"

#include <gtest/gtest.h>

#include <random>

#include "nodes/ttc/link/downlink_scheduler.hpp"
#include "nodes/ttc/link/frame_count_page.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

const UtcTime noon = *from_iso8601("2026-11-27T12:00:00Z");

TEST(FrameNumbers, AreTheClockWhenItIsValidAndSayThatTheyAre) {
  FrameNumbers numbers(0, frame_number_of(noon) + FrameNumbers::reserved_ahead);
  EXPECT_EQ(numbers.take(noon), frame_number_of(noon));
  EXPECT_EQ(numbers.take(noon), frame_number_of(noon) + 2) << "two frames of a millisecond";
  EXPECT_EQ(numbers.take(noon + milliseconds(250)), frame_number_of(noon + milliseconds(250)));
}

TEST(FrameNumbers, WithoutATimeTheyGoOnAndSayNothingAboutIt) {
  FrameNumbers numbers(100, 1000);
  for (const std::uint64_t expected : {100U, 102U, 104U}) EXPECT_EQ(numbers.take(std::nullopt), expected);
}

TEST(FrameNumbers, AheadOfAClockThatWasSetBackTheySayNothingAboutTheTime) {
  FrameNumbers numbers(0, frame_number_of(noon) + FrameNumbers::reserved_ahead);
  const std::uint64_t before = numbers.take(noon);
  const std::uint64_t after = numbers.take(noon - std::chrono::hours(1));
  EXPECT_GT(after, before);
  EXPECT_EQ(after % 2, 0U);
}

TEST(FrameNumbers, FollowAClockThatJumpsWhenTheReserveDoes) {
  FrameNumbers numbers(100, 100 + FrameNumbers::reserved_ahead);
  EXPECT_EQ(numbers.take(noon), 100U) << "the time is not reserved yet";
  const auto wanted = numbers.wanted(noon);
  ASSERT_TRUE(wanted);
  EXPECT_GE(*wanted, frame_number_of(noon) + FrameNumbers::reserved_ahead);
  numbers.on_reserved(*wanted);
  EXPECT_FALSE(numbers.wanted(noon));
  EXPECT_EQ(numbers.take(noon), frame_number_of(noon));
}

TEST(FrameNumbers, WithoutADiskFramesStillHaveNewNumbers) {
  FrameNumbers numbers(100, 103);
  std::uint64_t last = 0;
  for (int i = 0; i < 10; ++i) {
    const std::uint64_t number = numbers.take(noon);
    EXPECT_GT(number, last);
    last = number;
  }
}

TEST(FrameNumbers, AFirstStartWithoutAnythingBeginsAtTheClock) {
  EXPECT_EQ(first_frame_number(std::nullopt, std::nullopt, noon), frame_number_of(noon));
  EXPECT_EQ(first_frame_number(std::nullopt, 5000, noon), 5000U);
  EXPECT_EQ(first_frame_number(4000, 5000, noon), 4000U) << "of a process that was killed";
  const std::uint64_t far = 4000 + 2 * FrameNumbers::reserved_ahead;
  EXPECT_EQ(first_frame_number(4000, far, noon), far) << "srfs_rescue was on the line in between";
}

/// Property: kills, resets of the computer, losses of the memory, srfs_rescue in between, a clock that jumps
/// or is not valid, a disk that fails now and then but not across a reset: no number is used again.
TEST(FrameNumbers, WhateverEndsTheProcessNoNumberIsUsedAgain) {
  std::mt19937 random(11);
  for (int life = 0; life < 300; ++life) {
    std::optional<std::uint64_t> memory;
    std::optional<std::uint64_t> disk;
    UtcTime clock = noon;
    std::uint64_t last = 0;
    bool any = false;
    const auto run = [&](bool in_rescue) {
      FrameNumbers numbers(first_frame_number(in_rescue ? std::nullopt : memory, disk, clock));
      disk = std::max(disk.value_or(0), numbers.wanted(std::nullopt).value());
      numbers.on_reserved(*disk);
      const auto frames = random() % 40;
      for (std::uint_fast32_t i = 0; i < frames; ++i) {
        if (random() % 8 == 0) clock = clock + seconds(static_cast<int>(random() % 400) - 100);
        clock = clock + milliseconds(random() % 50);
        const auto utc = in_rescue || random() % 4 == 0 ? std::nullopt : std::optional(clock);
        if (const auto wanted = numbers.wanted(utc); wanted && random() % 3 != 0) {
          disk = *wanted;
          numbers.on_reserved(*wanted);
        }
        const std::uint64_t number = numbers.take(utc);
        if (any) {
          ASSERT_GT(number, last);
        }
        ASSERT_LT(number, *disk);
        any = true;
        last = number;
        if (!in_rescue) memory = numbers.next();  // before the frame leaves
      }
    };
    for (int process = 0; process < 12; ++process) {
      run(random() % 5 == 0);
      if (random() % 3 == 0) memory.reset();  // the computer was reset
    }
  }
}

TEST(FrameNumberFile, KeepsTheReserveWhenOneCopyIsDamaged) {
  const testing_support::TemporaryFolder folder;
  const auto path = folder.path() / "frame_numbers";
  EXPECT_FALSE(frame_number_file(path).load().existed());
  auto file = frame_number_file(path);
  ASSERT_EQ(file.store(1000).copies, 2U);
  ASSERT_EQ(file.store(2000).copies, 2U);
  ASSERT_TRUE(write_file_atomically(path.string() + ".0", "20"));
  EXPECT_EQ(frame_number_file(path).load().state, 2000U);
  ASSERT_TRUE(write_file_atomically(path.string() + ".1", ""));
  EXPECT_FALSE(frame_number_file(path).load().state);
  EXPECT_TRUE(frame_number_file(path).load().existed());
}

TEST(FrameCountPage, KeepsTheNumberBesideTheCounters) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.path() / "memory" / "counts";
  {
    auto page = FrameCountPage::open(file, std::nullopt);
    ASSERT_TRUE(page);
    EXPECT_FALSE(page->read_number());
    page->write_number(frame_number_of(noon));
    EXPECT_FALSE(page->read()) << "the counters are a word of their own";
  }
  EXPECT_EQ(FrameCountPage::open(file, std::nullopt)->read_number(), frame_number_of(noon));
}

TEST(DownlinkScheduler, SealsEveryFrameIdleOnesTooWithHigherNumbers) {
  const std::array<std::uint8_t, wire::sdls_key_octets> key{9};
  DownlinkConfig config;
  config.spacecraft_id = 0xAB;
  config.cadu = {.frame_octets = 223, .reed_solomon = false, .interleave = 1, .randomize = false};
  config.continuous = true;
  config.numbers = FrameNumbers(frame_number_of(noon), frame_number_of(noon) + FrameNumbers::reserved_ahead);
  DownlinkScheduler scheduler(
      config, wire::TmSeal{.spi = 16, .authenticator = wire::TmAuthenticator::create(wire::SdlsKey(key))});
  EXPECT_EQ(scheduler.field_octets(), 223 - wire::tm_frame_overhead_octets - wire::tm_sdls_overhead_octets);
  auto authenticator = wire::TmAuthenticator::create(wire::SdlsKey(key));
  wire::TmPacketReassembly live;
  const Octets packet = wire::encode_space_packet({.apid = 5}, Octets(700, 3));
  MonotonicTime now;
  ASSERT_TRUE(scheduler.push(DownlinkChannel::live, packet, true, now));
  std::vector<Octets> packets;
  std::uint64_t last = 0;
  unsigned idle = 0;
  for (int i = 0; i < 8; ++i) {
    now += milliseconds(10);
    const auto cadu = scheduler.next(
        now, [] { return 0x01040006U; }, noon + (now - MonotonicTime{}));
    ASSERT_TRUE(cadu);
    const OctetView octets = OctetView(*cadu).subspan(4);
    auto frame = wire::decode_tm_frame(octets, 0xAB, 223);
    ASSERT_TRUE(frame);
    const auto number = wire::tm_sdls_open(octets, *frame, 16, *authenticator);
    ASSERT_TRUE(number) << wire::to_string(number.error());
    EXPECT_GT(*number, last);
    last = *number;
    EXPECT_EQ(frame->ocf, 0x01040006U);
    if (frame->vc == wire::tm_idle_vc) ++idle;
    if (frame->vc == 0) {
      for (Octets& whole : live.push(*frame)) packets.push_back(std::move(whole));
    }
  }
  EXPECT_EQ(packets, std::vector<Octets>{packet});
  EXPECT_EQ(idle, 4U);
}

}  // namespace
}  // namespace srfs
