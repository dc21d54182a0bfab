// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/datagram_seal.hpp"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "ros/datagram_filter.hpp"
#include "tests/rtps_message.hpp"

namespace srfs::ros {
namespace {

using Verdict = DatagramSeal::Verdict;

constexpr SealKey key{1, 2, 3};
constexpr SealKey other_key{1, 2, 4};
constexpr MonotonicTime now{seconds(1000)};
constexpr GuidPrefix timing{1, 15, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7};
constexpr GuidPrefix stranger{1, 15, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8};

DatagramSeal::ReadKey reads(const SealKey& k) {
  return [k] { return std::optional(k); };
}

/// An RTPS message with one submessage: INFO_SRC of @p speaks_for, or a pad.
Octets message_of(const GuidPrefix& sender, std::optional<GuidPrefix> speaks_for = std::nullopt) {
  OctetWriter out;
  out.bytes(std::array<std::uint8_t, 8>{'R', 'T', 'P', 'S', 2, 2, 1, 15});
  out.bytes(sender);
  if (speaks_for) {
    out.bytes(std::array<std::uint8_t, 4>{0x0c, 0, 0, 20});
    out.u64(0);
    out.bytes(*speaks_for);
  }
  out.bytes(std::array<std::uint8_t, 4>{0x01, 0, 0, 4});
  out.u32(0x11223344);
  return out.take();
}

Octets sealed(DatagramSeal& seal, const Octets& message, MonotonicTime at = now) {
  Octets out;
  seal.seal(message, at, out);
  return out;
}

TEST(DatagramSeal, ShowsWhoIsOfTheSuite) {
  DatagramSeal sender(key, reads(key));
  DatagramSeal receiver(key, reads(key));
  EXPECT_FALSE(receiver.is_member(timing));
  EXPECT_EQ(receiver.judge(sealed(sender, message_of(timing)), now), Verdict::member);
  EXPECT_TRUE(receiver.is_member(timing));
  EXPECT_EQ(receiver.judge(message_of(stranger), now), Verdict::foreign);
  EXPECT_FALSE(receiver.is_member(stranger));
}

TEST(DatagramSeal, IsASubmessageThatOthersSkip) {
  DatagramSeal sender(key, reads(key));
  const Octets message = message_of(timing, stranger);
  const Octets with_seal = sealed(sender, message);
  EXPECT_EQ(with_seal.size(), message.size() + DatagramSeal::octets);
  int found = 0;
  RtpsDatagram(with_seal).for_each([](const AnnouncedSample&) {},
                                   [&](const GuidPrefix& p) { found += p == stranger; });
  EXPECT_EQ(found, 1);
}

TEST(DatagramSeal, LeavesFastDdsRoomForItsOwnCountsAndForNothingElse) {
  DatagramSeal sender(key, reads(key));
  Octets message = message_of(timing);
  const Octets header{0x80, 1, 56, 0};
  message.insert(message.end(), header.begin(), header.end());
  message.resize(message.size() + 56);
  const Octets good = sealed(sender, message);
  for (std::size_t i = 4; i < good.size(); ++i) {
    DatagramSeal receiver(key, reads(key));
    Octets changed = good;
    changed[i] ^= 1;
    const bool is_count = i >= good.size() - 56;
    EXPECT_EQ(receiver.judge(changed, now) == Verdict::member, is_count) << i;
  }
  DatagramSeal receiver(key, reads(key));
  receiver.add_own(timing);
  Octets longer = sealed(sender, message_of(timing));
  longer.insert(longer.end(), good.end() - 60, good.end());
  EXPECT_EQ(receiver.judge(longer, now), Verdict::forged);
}

TEST(DatagramSeal, OfAMemberNothingIsBelievedWithoutIt) {
  DatagramSeal sender(key, reads(key));
  DatagramSeal receiver(key, reads(key));
  ASSERT_EQ(receiver.judge(sealed(sender, message_of(timing)), now), Verdict::member);
  EXPECT_EQ(receiver.judge(message_of(timing), now), Verdict::forged);
  EXPECT_EQ(receiver.judge(message_of(stranger, timing), now), Verdict::forged) << "speaks for timing";
  EXPECT_EQ(receiver.forged().unsealed, 2U);
  EXPECT_EQ(receiver.forged().all(), 2U);
}

constexpr std::array<std::uint8_t, 4> participant_writer{0x00, 0x01, 0x00, 0xc2};
constexpr std::array<std::uint8_t, 4> publications_writer{0x00, 0x00, 0x03, 0xc2};
constexpr std::array<std::uint8_t, 4> liveliness_writer{0x00, 0x02, 0x00, 0xc2};
constexpr std::array<std::uint8_t, 4> reply_writer{0x00, 0x00, 0x01, 0x03};

/// What a stranger says in its own name, with @p content behind the ids of a DATA or DATA_FRAG.
Octets sample_of(const std::array<std::uint8_t, 4>& writer, OctetView content, bool fragment = false) {
  Gid gid{};
  std::copy(stranger.begin(), stranger.end(), gid.begin());
  std::copy(writer.begin(), writer.end(), gid.begin() + 12);
  testing_support::RtpsMessage message(stranger);
  // Addressed to timing, as a unicast message is (INFO_DST).
  message.submessage(0x0e, 0, Octets(timing.begin(), timing.end()));
  Octets body = message.ids(16, gid, 1);
  body.insert(body.end(), content.begin(), content.end());
  return message.submessage(fragment ? 0x16 : 0x15, 0x04, body).octets();
}

/// One parameter of a list: a GUID of @p prefix.
Octets guid_parameter(std::uint16_t id, const GuidPrefix& prefix, std::size_t behind = 0) {
  OctetWriter out;
  out.bytes(Octets(behind));
  out.u16(id);
  out.u16(16);
  out.bytes(prefix);
  out.u32(0x000001c1);
  return out.take();
}

TEST(DatagramSeal, AnotherSuiteInTheDomainIsForeignAndForgesNothing) {
  DatagramSeal sender(key, reads(key));
  DatagramSeal another_suite(other_key, reads(other_key));
  DatagramSeal receiver(key, reads(key));
  ASSERT_EQ(receiver.judge(sealed(sender, message_of(timing)), now), Verdict::member);
  for (int i = 0; i < 100; ++i)
    EXPECT_EQ(receiver.judge(sealed(another_suite, message_of(stranger)), now), Verdict::foreign);
  EXPECT_FALSE(receiver.is_member(stranger));
  EXPECT_EQ(receiver.judge(
                sealed(another_suite, sample_of(participant_writer, guid_parameter(0x0050, stranger))), now),
            Verdict::foreign)
      << "it announces itself";
  EXPECT_EQ(receiver.forged().all(), 0U);

  EXPECT_EQ(receiver.judge(sealed(another_suite, message_of(timing)), now), Verdict::forged);
  EXPECT_EQ(receiver.judge(sealed(another_suite, message_of(stranger, timing)), now), Verdict::forged);
  EXPECT_EQ(receiver.forged().wrong_seal, 2U);
  EXPECT_EQ(receiver.judge(
                sealed(another_suite, sample_of(participant_writer, guid_parameter(0x0070, timing))), now),
            Verdict::forged);
  EXPECT_EQ(receiver.forged().about, 1U);
}

TEST(DatagramSeal, AStrangerSaysNothingAboutAMemberToDiscovery) {
  constexpr std::uint16_t key_hash = 0x0070;
  constexpr std::uint16_t participant_guid = 0x0050;
  constexpr std::uint16_t endpoint_guid = 0x005a;
  DatagramSeal sender(key, reads(key));
  DatagramSeal receiver(key, reads(key));
  GuidPrefix own = timing;
  own[11] = 99;
  receiver.add_own(own);
  ASSERT_EQ(receiver.judge(sealed(sender, message_of(timing)), now), Verdict::member);
  for (const auto& writer : {participant_writer, publications_writer, liveliness_writer}) {
    for (const std::uint16_t id : {key_hash, participant_guid, endpoint_guid}) {
      for (const std::size_t behind : {0U, 1U, 400U}) {
        for (const GuidPrefix& victim : {timing, own}) {
          EXPECT_EQ(receiver.judge(sample_of(writer, guid_parameter(id, victim, behind)), now),
                    Verdict::forged);
          EXPECT_EQ(receiver.judge(sample_of(writer, guid_parameter(id, victim, behind), true), now),
                    Verdict::forged);
        }
        EXPECT_EQ(receiver.judge(sample_of(writer, guid_parameter(id, stranger, behind)), now),
                  Verdict::foreign)
            << "about itself";
      }
    }
  }
  EXPECT_EQ(receiver.judge(sample_of(reply_writer, guid_parameter(0x0083, timing)), now), Verdict::foreign)
      << "a reply names its client";
  // To the end of the message: without a length.
  Octets open_end = sample_of(participant_writer, guid_parameter(key_hash, timing));
  constexpr std::size_t length_at = 20 + 4 + 12 + 2;
  open_end[length_at] = open_end[length_at + 1] = 0;
  EXPECT_EQ(receiver.judge(open_end, now), Verdict::forged);
  // Before a member is known the same words are a stranger's.
  DatagramSeal new_one(key, reads(key));
  EXPECT_EQ(new_one.judge(sample_of(participant_writer, guid_parameter(key_hash, timing)), now),
            Verdict::foreign);
}

TEST(DatagramSeal, WithAnyChangedOctetIsNoMembers) {
  DatagramSeal sender(key, reads(key));
  const Octets good = sealed(sender, message_of(timing));
  for (std::size_t i = 4; i < good.size(); ++i) {
    DatagramSeal receiver(key, reads(key));
    Octets bad = good;
    bad[i] ^= 1;
    EXPECT_NE(receiver.judge(bad, now), Verdict::member) << i;
    EXPECT_FALSE(receiver.is_member(timing)) << i;
  }
  for (std::size_t length = 0; length < good.size(); ++length) {
    DatagramSeal receiver(key, reads(key));
    EXPECT_NE(receiver.judge(OctetView(good).first(length), now), Verdict::member) << length;
  }
}

TEST(DatagramSeal, OfAnotherKeyIsForeignUntilTheKeyIsReadAgainAndThenBothHold) {
  DatagramSeal old_one(key, reads(key));
  DatagramSeal new_one(other_key, reads(other_key));
  SealKey on_disk = key;
  int readings = 0;
  DatagramSeal receiver(key, [&] {
    ++readings;
    return std::optional(on_disk);
  });
  const Octets datagram = sealed(new_one, message_of(timing));
  EXPECT_EQ(receiver.judge(datagram, now), Verdict::foreign);
  EXPECT_EQ(receiver.judge(datagram, now), Verdict::foreign);
  EXPECT_EQ(readings, 1) << "once a second";

  on_disk = other_key;
  EXPECT_EQ(receiver.judge(datagram, now + seconds(1)), Verdict::member);
  EXPECT_EQ(receiver.judge(sealed(old_one, message_of(stranger)), now + seconds(1)), Verdict::member);
  EXPECT_EQ(new_one.judge(sealed(receiver, message_of(timing)), now), Verdict::member);
}

TEST(DatagramSeal, WhatWasRecordedIsWorthlessSoon) {
  DatagramSeal sender(key, reads(key));
  DatagramSeal receiver(key, reads(key));
  const Octets datagram = sealed(sender, message_of(timing));
  EXPECT_EQ(receiver.judge(datagram, now + DatagramSeal::longest_age), Verdict::member);
  EXPECT_EQ(receiver.judge(datagram, now + DatagramSeal::longest_age + nanoseconds(1)), Verdict::forged);
  EXPECT_EQ(receiver.forged().old, 1U);
}

TEST(DatagramSeal, RemembersItsOwnParticipantsAndTheMembersThatWereHeardLast) {
  DatagramSeal sender(key, reads(key));
  DatagramSeal receiver(key, reads(key));
  receiver.add_own(stranger);
  GuidPrefix other = timing;
  for (std::size_t i = 0; i < 2 * DatagramSeal::most_members; ++i) {
    other[11] = static_cast<std::uint8_t>(100 + i);
    ASSERT_EQ(receiver.judge(sealed(sender, message_of(timing)), now), Verdict::member);
    ASSERT_EQ(receiver.judge(sealed(sender, message_of(other)), now), Verdict::member);
  }
  EXPECT_TRUE(receiver.is_member(timing));
  EXPECT_TRUE(receiver.is_member(other));
  EXPECT_TRUE(receiver.is_member(stranger)) << "its own";
  other[11] = 100;
  EXPECT_FALSE(receiver.is_member(other));
}

TEST(DatagramSeal, TakesAnythingThatANetworkSends) {
  DatagramSeal sender(key, reads(key));
  DatagramSeal receiver(key, reads(key));
  const Octets good = sealed(sender, message_of(timing, stranger));
  std::mt19937 random(7);
  for (int i = 0; i < 20'000; ++i) {
    Octets bad = good;
    bad.resize(random() % (good.size() + 1));
    for (unsigned n = random() % 4; n > 0 && !bad.empty(); --n)
      bad[random() % bad.size()] = static_cast<std::uint8_t>(random());
    const bool same = bad == good;
    EXPECT_EQ(receiver.judge(bad, now) == Verdict::member, same);
  }
}

}  // namespace
}  // namespace srfs::ros
