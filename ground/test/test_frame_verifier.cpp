// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/frame_verifier.hpp"

#include <fstream>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fake_spacecraft.hpp"
#include "ground/downlink.hpp"
#include "wire/crc16.hpp"

namespace srfs::ground {
namespace {

using ::testing::HasSubstr;

const UtcTime now = *from_iso8601("2026-11-27T12:00:00Z");

std::uint64_t number_of(UtcTime utc) {
  return 2 * static_cast<std::uint64_t>(utc.ns() / 1'000'000) + 1;
}

/// The station's end of a sealed link, as often as it is started.
class SealedDownlink : public ::testing::Test {
 protected:
  [[nodiscard]] Downlink start(const FrameTrustOptions& options = {}) {
    auto trust = open_frame_trust(sealed_link(), var_.path(), state(), options);
    EXPECT_TRUE(trust) << trust.error();
    floor_file_ = std::move(trust->floor_file);
    Downlink downlink(sealed_link(), std::move(trust->verifier), trust->unverified);
    downlink.on_time(now);
    return downlink;
  }
  /// As DirectLink does it.
  std::vector<ReceivedPacket> push(Downlink& downlink, const Octets& line) {
    auto packets = downlink.push(line);
    EXPECT_TRUE(floor_file_->write(downlink.verifier()->floor()));
    return packets;
  }
  [[nodiscard]] std::filesystem::path state() const { return var_.path() / "ground"; }

  VarFolder var_;
  FakeSpacecraft spacecraft_{sealed_link()};
  std::optional<FrameFloorFile> floor_file_;
};

TEST_F(SealedDownlink, TakesWhatTheSpacecraftSent) {
  Downlink downlink = start();
  const auto packets = push(downlink, spacecraft_.send(1, 17, 2, {}));
  ASSERT_EQ(packets.size(), 1U);
  EXPECT_EQ(packets[0].authenticity, Authenticity::verified);
  EXPECT_EQ(downlink.counters().frames, 1U);
  EXPECT_TRUE(downlink.clcw());
  EXPECT_EQ(downlink.counters().forged_frames, 0U);
}

TEST_F(SealedDownlink, BelievesNothingOfAStrangerNotEvenItsControlWord) {
  suite::LinkSettings same = sealed_link();
  same.tm_security.reset();  // a stranger has no key; the frame has another layout
  FakeSpacecraft open(same);
  Downlink downlink = start();
  EXPECT_TRUE(push(downlink, open.send(1, 17, 2, {})).empty());
  EXPECT_TRUE(push(downlink, open.idle()).empty());
  EXPECT_TRUE(push(downlink, open.send_pdu(Octets(30, 4))).empty());
  EXPECT_FALSE(downlink.clcw());
  EXPECT_TRUE(downlink.take_control_words().empty());
  EXPECT_TRUE(downlink.take_file_pdus().empty());
  EXPECT_EQ(downlink.counters().frames, 0U);
  EXPECT_EQ(downlink.counters().forged_frames, 3U);
}

TEST_F(SealedDownlink, AForgedFrameBetweenTwoOthersMakesNoneLookLost) {
  Downlink downlink = start();
  static_cast<void>(push(downlink, spacecraft_.idle()));
  suite::LinkSettings same = sealed_link();
  same.tm_security.reset();
  FakeSpacecraft open(same);
  for (int i = 0; i < 5; ++i) static_cast<void>(push(downlink, open.idle()));
  const auto packets = push(downlink, spacecraft_.send(1, 17, 2, {}));
  EXPECT_EQ(packets.size(), 1U);
  EXPECT_EQ(downlink.counters().lost_frames, 0U);
}

TEST_F(SealedDownlink, TakesNoFrameTwiceNotEvenAfterARestart) {
  Octets recording;
  Octets newest;
  {
    Downlink downlink = start();
    for (int i = 0; i < 5; ++i) {
      newest = spacecraft_.send(1, 17, 2, {});
      EXPECT_EQ(push(downlink, newest).size(), 1U);
      recording.insert(recording.end(), newest.begin(), newest.end());
    }
    EXPECT_TRUE(push(downlink, recording).empty());
    EXPECT_EQ(downlink.counters().replayed_frames, 5U);
  }
  Downlink downlink = start();  // nothing was synced: as after a kill
  EXPECT_TRUE(push(downlink, recording).empty());
  EXPECT_TRUE(push(downlink, newest).empty());
  EXPECT_EQ(downlink.counters().replayed_frames, 6U);
  EXPECT_FALSE(downlink.clcw());
  EXPECT_EQ(push(downlink, spacecraft_.send(1, 17, 2, {})).size(), 1U);
}

TEST_F(SealedDownlink, ARestoredFolderTakesNoOldRecordingWhenNumbersAreTimes) {
  spacecraft_.frame_number = number_of(now - std::chrono::hours(5));
  {
    Downlink downlink = start();
    downlink.on_time(now - std::chrono::hours(5));
    EXPECT_EQ(push(downlink, spacecraft_.send(1, 17, 2, {})).size(), 1U);
  }
  const auto copy = var_.path() / "copy";
  std::filesystem::copy(state(), copy, std::filesystem::copy_options::recursive);
  Octets recording;
  {
    Downlink downlink = start();
    spacecraft_.frame_number = number_of(now - std::chrono::hours(3));
    downlink.on_time(now - std::chrono::hours(3));
    recording = spacecraft_.send(1, 17, 2, {});
    EXPECT_EQ(push(downlink, recording).size(), 1U);
  }
  std::filesystem::remove_all(state());
  std::filesystem::copy(copy, state(), std::filesystem::copy_options::recursive);

  Downlink downlink = start();
  EXPECT_TRUE(push(downlink, recording).empty());
  EXPECT_EQ(downlink.counters().old_frames, 1U);
  spacecraft_.frame_number = number_of(now - seconds(2));
  EXPECT_EQ(push(downlink, spacecraft_.send(1, 17, 2, {})).size(), 1U) << "contact goes on by itself";
  std::filesystem::remove_all(state());
  Downlink without = start();
  EXPECT_TRUE(push(without, recording).empty()) << "nor one that was deleted";
}

TEST_F(SealedDownlink, OfASpacecraftThatLostItsNumbersTheOperatorSaysFromWhenFramesCount) {
  spacecraft_.frame_number = number_of(now);
  {
    Downlink downlink = start();
    EXPECT_EQ(push(downlink, spacecraft_.send(1, 17, 2, {})).size(), 1U);
  }
  spacecraft_.frame_number = 4;  // all state lost, no valid time
  Downlink refusing = start();
  EXPECT_TRUE(push(refusing, spacecraft_.send(1, 17, 2, {})).empty());
  EXPECT_EQ(refusing.counters().replayed_frames, 1U);
  Downlink downlink = start({.from = UtcTime(nanoseconds(0))});
  EXPECT_EQ(push(downlink, spacecraft_.send(1, 17, 2, {})).size(), 1U);
}

TEST_F(SealedDownlink, MarksWhatItCannotVerifyWhenItIsToldTo) {
  Downlink downlink = start({.unverified = UnverifiedFrames::marked});
  Octets frame = spacecraft_.send(1, 17, 2, {});
  const Octets again = frame;
  EXPECT_EQ(push(downlink, frame).at(0).authenticity, Authenticity::verified);
  static_cast<void>(downlink.take_control_words());
  const auto marked = push(downlink, again);
  ASSERT_EQ(marked.size(), 1U);
  EXPECT_EQ(marked[0].authenticity, Authenticity::unverified);
  EXPECT_TRUE(downlink.take_control_words().empty());
  const Octets pdu = spacecraft_.send_pdu(Octets(30, 4));
  EXPECT_TRUE(push(downlink, pdu).empty());
  EXPECT_EQ(downlink.take_file_pdus().size(), 1U);
  EXPECT_TRUE(push(downlink, pdu).empty());
  EXPECT_TRUE(downlink.take_file_pdus().empty()) << "that was not verified";
  EXPECT_EQ(downlink.counters().packets, 2U);
}

TEST_F(SealedDownlink, WithoutTheKeyItDoesNotStartUnlessItMayShowWhatItCannotVerify) {
  std::filesystem::remove(var_.path() / "keys/tm_downlink.key");
  const auto refused = open_frame_trust(sealed_link(), var_.path(), state(), {});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error(), HasSubstr("--unverified mark"));
  auto trust =
      open_frame_trust(sealed_link(), var_.path(), state(), {.unverified = UnverifiedFrames::marked});
  ASSERT_TRUE(trust);
  EXPECT_THAT(trust->warning, HasSubstr("tm_downlink.key"));
  Downlink downlink(sealed_link(), std::move(trust->verifier), trust->unverified);
  EXPECT_EQ(downlink.push(spacecraft_.send(1, 17, 2, {})).at(0).authenticity, Authenticity::unverified);
  EXPECT_FALSE(downlink.clcw());
}

TEST_F(SealedDownlink, OfALinkWithoutAuthenticationNothingIsJudged) {
  FakeSpacecraft open(secured_link());
  Downlink downlink(secured_link());
  EXPECT_EQ(downlink.push(open.send(1, 17, 2, {})).at(0).authenticity, Authenticity::not_judged);
  EXPECT_FALSE(downlink.counters().authenticated);
}

TEST_F(SealedDownlink, ADamagedFloorIsSaidAndTheClockStillJudges) {
  {
    Downlink downlink = start();
    static_cast<void>(push(downlink, spacecraft_.idle()));
  }
  std::ofstream(state() / "frame_floor", std::ios::binary) << "damaged";
  auto trust = open_frame_trust(sealed_link(), var_.path(), state(), {});
  ASSERT_TRUE(trust);
  EXPECT_THAT(trust->warning, HasSubstr("was damaged"));
  Downlink downlink(sealed_link(), std::move(trust->verifier));
  downlink.on_time(now);
  spacecraft_.frame_number = number_of(now - seconds(700));
  EXPECT_TRUE(downlink.push(spacecraft_.send(1, 17, 2, {})).empty());
}

/// Property: of a line on which a stranger writes what it heard, in any order, altered or as it was, between
/// the frames of the spacecraft, every packet of the spacecraft comes once, in order, and no other.
TEST_F(SealedDownlink, WhateverAStrangerWritesThePacketsAreTheSpacecraftsEachOnce) {
  std::mt19937 random(5);
  for (int round = 0; round < 30; ++round) {
    std::filesystem::remove_all(state());
    Downlink downlink = start();
    FakeSpacecraft spacecraft(sealed_link());
    std::vector<Octets> heard;
    std::vector<std::uint8_t> sent;
    std::vector<std::uint8_t> received;
    const auto take = [&](const std::vector<ReceivedPacket>& packets) {
      for (const auto& packet : packets) received.push_back(packet.packet.source.at(0));
    };
    std::uint64_t strange = 0;
    for (std::uint8_t i = 0; i < 60; ++i) {
      if (random() % 2 == 0 && !heard.empty()) {
        Octets old = heard[random() % heard.size()];
        if (random() % 2 == 0) old[4 + random() % (old.size() - 4)] ^= 0x10;  // Reed-Solomon corrects it
        take(push(downlink, old));
        ++strange;
      }
      heard.push_back(spacecraft.send(1, 3, 25, Octets(1 + random() % 40, i)));
      sent.push_back(i);
      take(push(downlink, heard.back()));
    }
    EXPECT_EQ(received, sent);
    const DownlinkCounters counters = downlink.counters();
    EXPECT_EQ(counters.frames, sent.size());
    EXPECT_EQ(counters.replayed_frames + counters.forged_frames, strange);
  }
}

TEST(RefusedFrameNews, AreToldAtOnceAndThenOnceAMinute) {
  RefusedFrameNews news;
  const MonotonicTime begin{};
  EXPECT_EQ(news.take({}, begin), "");
  EXPECT_THAT(news.take({.forged = 1}, begin), HasSubstr("1 not authentic"));
  EXPECT_EQ(news.take({.forged = 500}, begin + seconds(59)), "");
  const std::string later = news.take({.forged = 500, .replayed = 3}, begin + seconds(60));
  EXPECT_THAT(later, HasSubstr("499 not authentic"));
  EXPECT_THAT(later, HasSubstr("3 authentic, with numbers that were used"));
  EXPECT_EQ(news.take({.forged = 500, .replayed = 3}, begin + seconds(200)), "");
}

}  // namespace
}  // namespace srfs::ground
