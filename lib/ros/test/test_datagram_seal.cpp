// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/datagram_seal.hpp"

#include <algorithm>
#include <random>
#include <utility>
#include <vector>

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

DatagramSeal::ReadKeys reads(const SealKeys& k) {
  return [k] { return std::optional(k); };
}

/// A process that hears at one port.
class Process : public DatagramSeal {
 public:
  explicit Process(const SealKeys& keys) : DatagramSeal(keys, reads(keys)) {}
  explicit Process(const SealKey& suite) : Process(SealKeys{suite}) {}
  Process(const SealKey& suite, ReadKeys read) : DatagramSeal({suite}, std::move(read)) {}
  [[nodiscard]] Verdict judge(OctetView datagram, MonotonicTime at) {
    return DatagramSeal::judge(datagram, at, heard_);
  }

 private:
  HeardTimes heard_{now - seconds(100)};
};

SealKeys limited(const std::string& name) {
  return {limited_seal_key(key, name), name, seal_key_among_limited(key)};
}

const GuidPrefix of_eps = limited_prefix("payload_eps", {9, 9, 9, 9, 9, 9});
const GuidPrefix of_eps_later = limited_prefix("payload_eps", {5, 5, 5, 5, 5, 5});
const GuidPrefix of_adcs = limited_prefix("payload_adcs", {6, 6, 6, 6, 6, 6});

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
  Process sender(key);
  Process receiver(key);
  EXPECT_FALSE(receiver.is_member(timing));
  EXPECT_EQ(receiver.judge(sealed(sender, message_of(timing)), now), Verdict::member);
  EXPECT_TRUE(receiver.is_member(timing));
  EXPECT_EQ(receiver.judge(message_of(stranger), now), Verdict::foreign);
  EXPECT_FALSE(receiver.is_member(stranger));
}

TEST(DatagramSeal, IsASubmessageThatOthersSkip) {
  Process sender(key);
  const Octets message = message_of(timing, stranger);
  const Octets with_seal = sealed(sender, message);
  EXPECT_EQ(with_seal.size(), message.size() + 32);
  int found = 0;
  RtpsDatagram(with_seal).for_each([](const AnnouncedSample&) {},
                                   [&](const GuidPrefix& p) { found += p == stranger; });
  EXPECT_EQ(found, 1);
}

TEST(DatagramSeal, LeavesFastDdsRoomForItsOwnCountsAndForNothingElse) {
  Process sender(key);
  Octets message = message_of(timing);
  const Octets header{0x80, 1, 56, 0};
  message.insert(message.end(), header.begin(), header.end());
  message.resize(message.size() + 56);
  const Octets good = sealed(sender, message);
  for (std::size_t i = 4; i < good.size(); ++i) {
    Process receiver(key);
    Octets changed = good;
    changed[i] ^= 1;
    const bool is_count = i >= good.size() - 56;
    EXPECT_EQ(receiver.judge(changed, now) == Verdict::member, is_count) << i;
  }
  Process receiver(key);
  receiver.add_own(timing);
  Octets longer = sealed(sender, message_of(timing));
  longer.insert(longer.end(), good.end() - 60, good.end());
  EXPECT_EQ(receiver.judge(longer, now), Verdict::forged);
}

TEST(DatagramSeal, OfAMemberNothingIsBelievedWithoutIt) {
  Process sender(key);
  Process receiver(key);
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
Octets sample_of(const std::array<std::uint8_t, 4>& writer, OctetView content, bool fragment = false,
                 const GuidPrefix& sender = stranger) {
  Gid gid{};
  std::copy(sender.begin(), sender.end(), gid.begin());
  std::copy(writer.begin(), writer.end(), gid.begin() + 12);
  testing_support::RtpsMessage message(sender);
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
  Process sender(key);
  Process another_suite(other_key);
  Process receiver(key);
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
  Process sender(key);
  Process receiver(key);
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
  Process new_one(key);
  EXPECT_EQ(new_one.judge(sample_of(participant_writer, guid_parameter(key_hash, timing)), now),
            Verdict::foreign);
}

TEST(DatagramSeal, WithAnyChangedOctetIsNoMembers) {
  Process sender(key);
  const Octets good = sealed(sender, message_of(timing));
  for (std::size_t i = 4; i < good.size(); ++i) {
    Process receiver(key);
    Octets bad = good;
    bad[i] ^= 1;
    EXPECT_NE(receiver.judge(bad, now), Verdict::member) << i;
    EXPECT_FALSE(receiver.is_member(timing)) << i;
  }
  for (std::size_t length = 0; length < good.size(); ++length) {
    Process receiver(key);
    EXPECT_NE(receiver.judge(OctetView(good).first(length), now), Verdict::member) << length;
  }
}

TEST(DatagramSeal, OfAnotherKeyIsForeignUntilTheKeyIsReadAgainAndThenBothHold) {
  Process old_one(key);
  Process new_one(other_key);
  SealKey on_disk = key;
  int readings = 0;
  Process receiver(key, [&] {
    ++readings;
    return std::optional(SealKeys{on_disk});
  });
  const Octets datagram = sealed(new_one, message_of(timing));
  EXPECT_EQ(receiver.judge(datagram, now), Verdict::foreign);
  EXPECT_EQ(receiver.judge(datagram, now), Verdict::foreign) << "it was never taken";
  EXPECT_EQ(readings, 1) << "once a second";

  on_disk = other_key;
  EXPECT_EQ(receiver.judge(datagram, now + seconds(1)), Verdict::member);
  EXPECT_EQ(receiver.judge(sealed(old_one, message_of(stranger)), now + seconds(1)), Verdict::member);
  EXPECT_EQ(new_one.judge(sealed(receiver, message_of(timing)), now), Verdict::member);
}

TEST(DatagramSeal, WhatWasRecordedIsWorthlessAtOnce) {
  Process sender(key);
  Process receiver(key);
  const Octets datagram = sealed(sender, message_of(timing));
  ASSERT_EQ(receiver.judge(datagram, now), Verdict::member);
  EXPECT_EQ(receiver.judge(datagram, now), Verdict::forged);
  EXPECT_EQ(receiver.forged().repeated, 1U);

  // After the sender has left nobody knows its sequence numbers any longer, and many others have come.
  for (std::uint8_t i = 0; i < 200; ++i) {
    GuidPrefix other = timing;
    other[11] = static_cast<std::uint8_t>(i + 20);
    ASSERT_EQ(receiver.judge(sealed(sender, message_of(other)), now), Verdict::member);
  }
  EXPECT_FALSE(receiver.is_member(timing));
  EXPECT_EQ(receiver.judge(datagram, now), Verdict::stale);
  EXPECT_FALSE(receiver.is_member(timing));
  EXPECT_EQ(receiver.forged().all(), 1U);
}

TEST(DatagramSeal, WhatWasRecordedBeforeAReceiversStartIsWorthlessToIt) {
  Process sender(key);
  const Octets datagram = sealed(sender, message_of(timing), now);
  DatagramSeal restarted({key}, reads({key}));
  HeardTimes port(now + nanoseconds(1));
  EXPECT_EQ(restarted.judge(datagram, now + seconds(1), port), Verdict::stale);
  EXPECT_FALSE(restarted.is_member(timing)) << "nor is it a stranger's, which would be passed on";
  EXPECT_EQ(restarted.judge(sealed(sender, message_of(timing), now + seconds(1)), now + seconds(1), port),
            Verdict::member);
}

TEST(DatagramSeal, TheBacklogOfAProcessThatStoodStillIsNotForged) {
  Process sender(key);
  Process receiver(key);
  ASSERT_EQ(receiver.judge(sealed(sender, message_of(timing)), now), Verdict::member);
  std::vector<Octets> backlog;
  for (int s = 1; s <= 100; ++s) backlog.push_back(sealed(sender, message_of(timing), now + seconds(s)));
  const MonotonicTime resumed = now + seconds(100);
  int taken = 0;
  for (const Octets& datagram : backlog) taken += receiver.judge(datagram, resumed) == Verdict::member;
  EXPECT_EQ(taken, 61) << "those of the last minute";
  EXPECT_EQ(receiver.stale(), 39U);
  EXPECT_EQ(receiver.forged().all(), 0U);
}

TEST(DatagramSeal, OfTwoDatagramsAtOneTimeBothAreTaken) {
  Process sender(key);
  Process receiver(key);
  const Octets first = sealed(sender, message_of(timing));
  const Octets second = sealed(sender, message_of(timing));
  EXPECT_EQ(receiver.judge(second, now), Verdict::member);
  EXPECT_EQ(receiver.judge(first, now), Verdict::member) << "of another thread, overtaken";
}

TEST(DatagramSeal, TakesEachDatagramAtMostOnceInWhateverOrderWithWhateverIsRepeated) {
  std::mt19937 random(20261127);
  int all_taken = 0;
  for (int round = 0; round < 50; ++round) {
    Process sender(key);
    Process receiver(key);
    std::vector<std::pair<Octets, int>> sent;
    MonotonicTime at = now;
    for (int i = 0; i < 600; ++i) {
      GuidPrefix who = timing;
      who[11] = static_cast<std::uint8_t>(random() % 90);  // more than are remembered
      at += nanoseconds(random() % 3);
      sent.emplace_back(sealed(sender, message_of(who), at), 0);
      // One of the last ones, or any recorded one.
      const std::size_t back =
          random() % 4 == 0 ? random() % sent.size() : random() % std::min<std::size_t>(sent.size(), 8);
      auto& [datagram, taken] = sent[sent.size() - 1 - back];
      const bool is_taken = receiver.judge(datagram, at + seconds(random() % 70)) == Verdict::member;
      taken += is_taken;
      all_taken += is_taken;
      ASSERT_LE(taken, 1);
    }
  }
  EXPECT_GT(all_taken, 1000);
}

TEST(DatagramSeal, OfALimitedMemberIsKnownByItsNameAndItKnowsTheOthers) {
  Process timing_node(key);
  Process payload(limited("payload_eps"));
  // What was sealed before its sender had heard the payload shows it nothing.
  const Octets early = sealed(timing_node, message_of(timing));
  EXPECT_EQ(payload.judge(early, now), Verdict::foreign);

  EXPECT_EQ(timing_node.judge(sealed(payload, message_of(of_eps)), now), Verdict::member);
  EXPECT_EQ(timing_node.limit_of(of_eps), "payload_eps");
  EXPECT_EQ(payload.judge(sealed(timing_node, message_of(timing)), now), Verdict::member);
  EXPECT_EQ(payload.limit_of(timing), "");
  EXPECT_TRUE(payload.is_limited());
  const Octets overtaken = early;
  EXPECT_EQ(payload.judge(overtaken, now), Verdict::stale);
  EXPECT_EQ(payload.forged().all(), 0U);
  EXPECT_EQ(payload.judge(message_of(timing), now), Verdict::forged);
}

TEST(DatagramSeal, LimitedMembersKnowEachOther) {
  Process eps(limited("payload_eps"));
  Process adcs(limited("payload_adcs"));
  EXPECT_EQ(adcs.judge(sealed(eps, message_of(of_eps)), now), Verdict::member);
  EXPECT_EQ(adcs.limit_of(of_eps), "payload_eps");
}

TEST(DatagramSeal, ALimitedMembersPrefixShowsItsName) {
  constexpr std::array<std::uint8_t, 8> vendor_and_random{1, 15, 9, 9, 9, 9, 9, 9};
  EXPECT_TRUE(std::equal(vendor_and_random.begin(), vendor_and_random.end(), of_eps.begin()));
  EXPECT_TRUE(std::equal(of_eps.begin() + 8, of_eps.end(), of_eps_later.begin() + 8));
  EXPECT_FALSE(std::equal(of_eps.begin() + 8, of_eps.end(), of_adcs.begin() + 8));
  EXPECT_NE(of_eps.back(), 0) << "as in those that Fast DDS makes";
}

/// A receiver that starts anew knows nobody: who speaks first under a prefix must not get it.
TEST(DatagramSeal, ALimitedMemberTakesNobodysPrefixWhereNobodyIsKnown) {
  Process timing_node(key);
  Process payload(limited("payload_eps"));
  Process other(limited("payload_adcs"));
  Process restarted(key);
  EXPECT_EQ(restarted.judge(sealed(payload, message_of(timing)), now), Verdict::forged);
  EXPECT_EQ(restarted.judge(sealed(payload, message_of(of_adcs)), now), Verdict::forged);
  EXPECT_EQ(restarted.forged().beyond, 2U);
  EXPECT_FALSE(restarted.is_member(timing));
  EXPECT_EQ(restarted.judge(sealed(timing_node, message_of(timing), now + milliseconds(1)), now),
            Verdict::member);
  EXPECT_EQ(restarted.limit_of(timing), "");
  EXPECT_EQ(restarted.judge(sealed(other, message_of(of_adcs), now + milliseconds(1)), now), Verdict::member);
  EXPECT_EQ(restarted.limit_of(of_adcs), "payload_adcs");
}

TEST(DatagramSeal, ALimitedMemberSilencesNobodyWhateverPrefixesAndTimesItMakesUp) {
  for (const nanoseconds ahead : {nanoseconds(seconds(59)), nanoseconds(seconds(1)), nanoseconds(0)}) {
    Process timing_node(key);
    Process switcher(key);
    Process payload(limited("payload_eps"));
    ASSERT_EQ(switcher.judge(sealed(timing_node, message_of(timing)), now), Verdict::member);
    int taken = 0;
    for (std::uint8_t i = 0; i < 200; ++i) {
      const GuidPrefix made_up = limited_prefix("payload_eps", {i, 1, 2, 3, 4, 5});
      taken += switcher.judge(sealed(payload, message_of(made_up), now + ahead), now) == Verdict::member;
    }
    EXPECT_LE(taken, 1) << "one participant at a time";
    const MonotonicTime later = now + milliseconds(1);
    EXPECT_EQ(switcher.judge(sealed(timing_node, message_of(timing), later), later), Verdict::member);
    EXPECT_EQ(switcher.limit_of(timing), "");
    Process starting(key);  // another one that was never heard
    EXPECT_EQ(switcher.judge(sealed(starting, message_of(stranger), later), later), Verdict::member);
  }
}

/// Whatever a program does that has a limited member's keys.
TEST(DatagramSeal, ALimitedMemberPassesForNoOther) {
  Process timing_node(key);
  Process switcher(key);
  Process payload(limited("payload_eps"));
  Process other(limited("payload_adcs"));
  const GuidPrefix of_payload = of_eps;
  const GuidPrefix of_other = of_adcs;
  ASSERT_EQ(switcher.judge(sealed(timing_node, message_of(timing)), now), Verdict::member);
  ASSERT_EQ(switcher.judge(sealed(payload, message_of(of_payload)), now), Verdict::member);
  ASSERT_EQ(switcher.judge(sealed(other, message_of(of_other)), now), Verdict::member);
  ASSERT_EQ(switcher.forged().all(), 0U);

  // With its own keys as those of the suite, and under another name.
  for (const SealKeys& keys :
       {SealKeys{limited("payload_eps").key}, SealKeys{limited("payload_eps").among_limited},
        SealKeys{limited("payload_eps").key, "timing", limited("payload_eps").among_limited},
        SealKeys{limited("payload_eps").key, "payload_adcs", limited("payload_eps").among_limited}}) {
    Process liar(keys);
    const MonotonicTime at = now + milliseconds(1);  // what has the time of another datagram is a repetition
    EXPECT_EQ(switcher.judge(sealed(liar, message_of(timing), at), at), Verdict::forged);
    EXPECT_EQ(switcher.judge(sealed(liar, message_of(of_other), at), at), Verdict::forged);
  }
  EXPECT_EQ(switcher.forged().wrong_seal, 8U);
  // With its own seal, as another participant, for another one, and about another one.
  EXPECT_EQ(switcher.judge(sealed(payload, message_of(timing)), now), Verdict::forged);
  EXPECT_EQ(switcher.judge(sealed(payload, message_of(of_other)), now), Verdict::forged);
  EXPECT_EQ(switcher.judge(sealed(payload, message_of(of_payload, timing)), now), Verdict::forged);
  const Octets about_timing =
      sample_of(participant_writer, guid_parameter(0x0070, timing), false, of_payload);
  EXPECT_EQ(switcher.judge(sealed(payload, about_timing), now), Verdict::forged);
  EXPECT_EQ(switcher.forged().beyond, 4U);
  EXPECT_EQ(switcher.limit_of(timing), "");
  EXPECT_EQ(switcher.limit_of(of_other), "payload_adcs");

  // What others sealed for it, changed or as from another one.
  const Octets to_all = sealed(switcher, message_of(stranger));
  EXPECT_EQ(timing_node.judge(to_all, now), Verdict::member);
  for (std::size_t i = 4; i < to_all.size(); ++i) {
    Octets changed = to_all;
    changed[i] ^= 1;
    DatagramSeal listener({key}, reads({key}));
    HeardTimes port(now - seconds(1));
    const bool is_a_tag_of_others = i >= 20 + 16 + 16 && i < 20 + 16 + 3 * 16;
    EXPECT_EQ(listener.judge(changed, now, port) == Verdict::member, is_a_tag_of_others) << i;
  }
}

TEST(DatagramSeal, ALimitedMemberHasOneParticipantTheNewest) {
  Process timing_node(key);
  Process payload(limited("payload_eps"));
  const Octets late = sealed(payload, message_of(of_eps));
  ASSERT_EQ(timing_node.judge(sealed(payload, message_of(of_eps)), now), Verdict::member);
  EXPECT_EQ(timing_node.judge(sealed(payload, message_of(of_eps_later), now + milliseconds(1)), now),
            Verdict::stale)
      << "not by turns";
  const MonotonicTime restarted = now + seconds(2);
  EXPECT_EQ(timing_node.judge(sealed(payload, message_of(of_eps_later), restarted), restarted),
            Verdict::member);
  EXPECT_EQ(timing_node.limit_of(of_eps_later), "payload_eps");
  EXPECT_EQ(timing_node.limit_of(of_eps), std::nullopt);
  EXPECT_EQ(timing_node.judge(late, restarted), Verdict::stale);
}

TEST(DatagramSeal, AMemberThatIsAnnouncedAsGoneByAnotherStaysWhatItWas) {
  Process timing_node(key);
  Process switcher(key);
  Process payload(limited("payload_eps"));
  ASSERT_EQ(switcher.judge(sealed(payload, message_of(of_eps)), now), Verdict::member);
  const MonotonicTime later = now + milliseconds(1);
  EXPECT_EQ(switcher.judge(sealed(timing_node, message_of(of_eps), later), later), Verdict::member);
  EXPECT_EQ(switcher.limit_of(of_eps), "payload_eps");
  Process restarted(key);
  EXPECT_EQ(restarted.judge(sealed(timing_node, message_of(of_eps), later), later), Verdict::member);
  EXPECT_EQ(restarted.limit_of(of_eps), std::nullopt) << "not one that all believe";
  EXPECT_EQ(restarted.judge(sealed(payload, message_of(of_eps), later), later), Verdict::member);
  EXPECT_EQ(restarted.limit_of(of_eps), "payload_eps");
}

TEST(DatagramSeal, AKeyIsNotThrownAwayBecauseItCannotBeReadNow) {
  int readings = 0;
  Process receiver(key, [&]() -> std::optional<SealKeys> {
    ++readings;
    return std::nullopt;
  });
  Process sender(key);
  Process another_suite(other_key);
  for (int s = 0; s < 5; ++s) {
    const MonotonicTime at = now + seconds(2 * s);
    EXPECT_EQ(receiver.judge(sealed(another_suite, message_of(stranger), at), at), Verdict::foreign);
    EXPECT_EQ(receiver.judge(sealed(sender, message_of(timing), at), at), Verdict::member);
  }
  EXPECT_EQ(readings, 5);
}

TEST(DatagramSeal, AfterTheSuitesKeyWasMadeAnewALimitedMemberIsKnownByEither) {
  SealKeys on_disk{key};
  Process timing_node(key, [&] { return std::optional(on_disk); });
  Process payload(limited("payload_eps"));
  ASSERT_EQ(timing_node.judge(sealed(payload, message_of(of_eps)), now), Verdict::member);
  on_disk = SealKeys{other_key};
  Process restarted(
      SealKeys{limited_seal_key(other_key, "payload_eps"), "payload_eps", seal_key_among_limited(other_key)});
  const MonotonicTime later = now + seconds(5);
  const GuidPrefix again = of_eps_later;
  EXPECT_EQ(timing_node.judge(sealed(restarted, message_of(again), later), later), Verdict::member);
  EXPECT_EQ(timing_node.limit_of(again), "payload_eps");
  EXPECT_EQ(restarted.judge(sealed(timing_node, message_of(timing), later), later), Verdict::member);
}

TEST(DatagramSeal, WhatIsLongAndOfNobodyKnownCostsNoHash) {
  Process sender(key);
  Process receiver(key);
  Octets large = message_of(timing);
  large.resize(20'000);
  EXPECT_EQ(receiver.judge(sealed(sender, large), now), Verdict::foreign);
  ASSERT_EQ(receiver.judge(sealed(sender, message_of(timing)), now), Verdict::member);
  EXPECT_EQ(receiver.judge(sealed(sender, large), now), Verdict::member);
}

TEST(DatagramSeal, RemembersItsOwnParticipantsAndTheMembersThatWereHeardLast) {
  Process sender(key);
  Process receiver(key);
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
  Process sender(key);
  Process receiver(key);
  const Octets good = sealed(sender, message_of(timing, stranger));
  std::mt19937 random(7);
  bool came = false;
  for (int i = 0; i < 20'000; ++i) {
    Octets bad = good;
    bad.resize(random() % (good.size() + 1));
    for (unsigned n = random() % 4; n > 0 && !bad.empty(); --n)
      bad[random() % bad.size()] = static_cast<std::uint8_t>(random());
    const bool same = bad == good;
    EXPECT_EQ(receiver.judge(bad, now) == Verdict::member, same && !std::exchange(came, came || same));
  }
}

}  // namespace
}  // namespace srfs::ros
