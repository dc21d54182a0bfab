// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include <srfs_msgs/msg/event.hpp>
#include <srfs_msgs/msg/task_flags.hpp>

#include "ros/datagram_filter.hpp"
#include "ros/participant.hpp"
#include "ros/type_support.hpp"
#include "suite/image_topics.hpp"
#include "tests/rtps_message.hpp"

namespace srfs::ros {
namespace {

using Message = testing_support::RtpsMessage;
using Fragment = Message::Fragment;

const GuidPrefix ours{1, 15, 1};
const GuidPrefix stranger{1, 15, 2};

Gid gid(const GuidPrefix& prefix, std::uint8_t entity) {
  Gid g{};
  std::copy(prefix.begin(), prefix.end(), g.begin());
  g[14] = entity;
  g[15] = 3;
  return g;
}

using Verdict = DatagramFilter::Verdict;

class DatagramFilterTest : public testing::Test {
 protected:
  DatagramFilter make(bool drop_foreign = false) const {
    return DatagramFilter([](const GuidPrefix& p) { return p != ours; }, drop_foreign);
  }
  Verdict judge(DatagramFilter& filter, const Message& message) const {
    return filter.judge(message, false, now_);
  }
  /// The first fragment of a sample, with the smallest allowed size.
  static Message first_fragment(const Gid& writer, std::uint32_t sample_octets, std::int64_t sequence = 1) {
    GuidPrefix sender{};
    std::copy_n(writer.begin(), sender.size(), sender.begin());
    return Message(sender).fragment(writer, {.sample_octets = sample_octets, .sequence = sequence});
  }
  /// Sends first fragments of 1 MiB samples with rising sequence numbers until one is dropped.
  /// @return how many passed
  std::int64_t mebibytes_that_pass(DatagramFilter& filter, const Gid& writer) {
    for (std::int64_t n = 0; n < 100; ++n) {
      if (judge(filter, first_fragment(writer, 1U << 20, sequence_ + 1)) != Verdict::pass) return n;
      ++sequence_;
    }
    return 100;
  }
  const Octets small_ = Octets(10);
  const Gid theirs_ = gid(stranger, 1);
  const Gid here_ = gid(ours, 9);
  std::int64_t sequence_ = 0;
  MonotonicTime now_{seconds(100)};
  std::shared_ptr<std::atomic<std::uint64_t>> refused_ = std::make_shared<std::atomic<std::uint64_t>>(0);
};

TEST_F(DatagramFilterTest, ASampleThatClaimsMoreThanItsTopicTakesIsDroppedAtItsFirstFragment) {
  auto filter = make();
  const auto images = std::make_shared<std::atomic<std::uint64_t>>(0);
  const Gid pictures = gid(stranger, 2);
  filter.matched(theirs_, here_, 1000, refused_);
  filter.matched(pictures, gid(ours, 8), 16U << 20, images);
  for (const bool little : {true, false}) {
    const Message empty(stranger, little);
    EXPECT_EQ(judge(filter, Message(empty).timestamp().fragment(theirs_, {1000})), Verdict::pass);
    EXPECT_EQ(judge(filter, Message(empty).timestamp().fragment(theirs_, {1001})), Verdict::malformed);
    EXPECT_EQ(judge(filter, Message(empty).fragment(theirs_, {64U << 20})), Verdict::malformed);
    EXPECT_EQ(judge(filter, Message(empty).fragment(pictures, {1U << 20})), Verdict::pass);
  }
  EXPECT_EQ(judge(filter, Message(stranger).data(theirs_, Octets(500)).data(theirs_, Octets(60'000))),
            Verdict::malformed);
  EXPECT_EQ(*refused_, 5U);
  EXPECT_EQ(*images, 0U);
}

TEST_F(DatagramFilterTest, SeesWhatFastDdsSeesBehindOtherSubmessages) {
  auto filter = make();
  filter.matched(theirs_, here_, 1000, refused_);
  const Message empty(stranger);
  // Neither an INFO_TS without a time nor a PAD ends the message.
  EXPECT_EQ(judge(filter, Message(empty).no_timestamp().fragment(theirs_, {64U << 20})), Verdict::malformed);
  EXPECT_EQ(judge(filter, Message(empty).submessage(0x01, 0, {}).fragment(theirs_, {64U << 20})),
            Verdict::malformed);
  // The next submessage begins at a multiple of four octets.
  EXPECT_EQ(judge(filter, Message(empty).submessage(0x80, 0, Octets(8), 5).fragment(theirs_, {64U << 20})),
            Verdict::malformed);
  // The last submessage may omit its length.
  Octets body = empty.ids(16, theirs_, 1);
  body.resize(body.size() + 2000);
  EXPECT_EQ(judge(filter, Message(empty).submessage(0x15, 0x04, body, 0)), Verdict::malformed);
}

TEST_F(DatagramFilterTest, ASubmessageThatDoesNotHoldWhatItSaysIsDropped) {
  auto filter = make();
  filter.matched(theirs_, here_, 1U << 20, refused_);
  const auto fragment = [&](const Fragment& f) { return Message(stranger).fragment(theirs_, f); };
  EXPECT_EQ(judge(filter, fragment({.sample_octets = 250, .number = 2, .count = 2})), Verdict::pass);
  EXPECT_EQ(judge(filter, fragment({.sample_octets = 250, .number = 3})), Verdict::pass) << "50 octets";
  const std::vector<Message> broken{
      fragment({.sample_octets = 250, .held = 99}),
      fragment({.sample_octets = 250, .number = 3, .held = 49}),
      fragment({.sample_octets = 250, .count = 3, .held = 249}),
      fragment({.sample_octets = 250, .number = 3, .count = 2, .held = 150}),  // it has only three
      fragment({.sample_octets = 250, .number = 0, .held = 100}),
      fragment({.sample_octets = 250, .count = 0, .held = 100}),
      fragment({.sample_octets = 250, .octets = 0, .held = 100}),
      fragment({.sample_octets = 250, .octets = 3}),
      fragment({.sample_octets = 0, .held = 100}),
      fragment({.sample_octets = 250, .flags = 0x04}),    // a key, which Fast DDS ignores
      Message(stranger).submessage(0x16, 0, Octets(28)),  // ends before the size of the sample
      Message(stranger).submessage(0x15, 0x04, Octets(12)),
      Message(stranger).submessage(0x15, 0x04, Message(stranger).ids(12, theirs_, 1)),
      Message(stranger).submessage(0x15, 0x04, Message(stranger).ids(100, theirs_, 1)),
  };
  for (const Message& message : broken)
    EXPECT_EQ(judge(filter, message), Verdict::malformed) << to_hex(message.octets());
  EXPECT_EQ(*refused_, 12U) << "those that name their writer";
}

TEST_F(DatagramFilterTest, InlineQosIsPartOfTheSubmessageAndNotOfTheSample) {
  auto filter = make();
  filter.matched(theirs_, here_, 1000, refused_);
  const Message empty(stranger);
  Octets body = empty.ids(16, theirs_, 1);
  for (const std::uint64_t number : {0x0083, 24}) empty.number(body, number, 2);  // related sample identity
  body.resize(body.size() + 24);
  const Octets without_end = body;
  for (const std::uint64_t number : {1, 0}) empty.number(body, number, 2);
  body.resize(body.size() + 1000);
  EXPECT_EQ(judge(filter, Message(empty).submessage(0x15, 0x06, body)), Verdict::pass);
  body.push_back(0);
  EXPECT_EQ(judge(filter, Message(empty).submessage(0x15, 0x06, body)), Verdict::malformed);
  EXPECT_EQ(judge(filter, Message(empty).submessage(0x15, 0x06, without_end)), Verdict::malformed);
}

TEST_F(DatagramFilterTest, AWriterThatIsNotMatchedYetMaySendWhatTheLargestTopicTakes) {
  auto filter = make();
  filter.matched(gid(ours, 1), here_, 1000, refused_);
  filter.matched(gid(ours, 2), gid(ours, 8), 100'000, refused_);
  EXPECT_EQ(judge(filter, first_fragment(theirs_, 100'000)), Verdict::pass);
  EXPECT_EQ(judge(filter, first_fragment(theirs_, 100'001)), Verdict::malformed);
  EXPECT_EQ(*refused_, 0U) << "of no reader";
}

TEST_F(DatagramFilterTest, AWriterThatFeedsTwoReadersMaySendWhatEitherTakesUntilThatOneGoes) {
  for (const bool ends : {true, false}) {
    auto filter = make();
    filter.matched(theirs_, here_, 1000, refused_);
    filter.matched(theirs_, gid(ours, 8), 5000, refused_);
    EXPECT_EQ(judge(filter, first_fragment(theirs_, 5000)), Verdict::pass);
    if (ends) {
      filter.ended(gid(ours, 8));
    } else {
      filter.unmatched(theirs_, gid(ours, 8));
    }
    EXPECT_EQ(judge(filter, first_fragment(theirs_, 5000)), Verdict::malformed);
  }
}

TEST_F(DatagramFilterTest, StrangersAreDroppedWhereTheDeploymentSaysSoAlsoBehindAnotherName) {
  auto filter = make(true);
  const Gid own = gid(ours, 1);
  EXPECT_EQ(judge(filter, Message(ours).data(own, small_)), Verdict::pass);
  EXPECT_EQ(judge(filter, Message(stranger).data(theirs_, small_)), Verdict::foreign);
  EXPECT_EQ(judge(filter, Message(ours).timestamp().source(stranger).data(theirs_, small_)),
            Verdict::foreign);
  EXPECT_EQ(filter.dropped_foreign(), 2U);
  EXPECT_EQ(filter.last_dropped(), stranger);
}

TEST_F(DatagramFilterTest, WhileTheWorkThreadIsBehindOnlyTheSuiteIsRead) {
  auto filter = make();
  EXPECT_EQ(filter.judge(Message(stranger).data(theirs_, small_), false, now_), Verdict::pass);
  EXPECT_EQ(filter.judge(Message(stranger).data(theirs_, small_), true, now_), Verdict::shed);
  EXPECT_EQ(filter.judge(Message(ours).data(gid(ours, 1), small_), true, now_), Verdict::pass);
}

TEST_F(DatagramFilterTest, LargeSamplesOfStrangersHaveABudgetOfOctetsThatComesBack) {
  auto filter = make();
  filter.matched(theirs_, here_, 1U << 20, refused_);
  const auto passing = [&](const Message& message) {
    std::size_t passed = 0;
    for (; passed < 1000 && judge(filter, message) == Verdict::pass; ++passed) {
    }
    return passed;
  };
  const auto datagram = [](const GuidPrefix& sender) {
    return Message(sender).fragment(gid(sender, 1), {.sample_octets = 1U << 20, .octets = 30'000});
  };
  const std::size_t all_at_once = OctetBudget::at_once / datagram(stranger).octets().size();
  EXPECT_EQ(passing(datagram(stranger)), all_at_once) << "the same fragment again and again";
  EXPECT_EQ(passing(datagram(ours)), 1000U) << "the suite has none";
  now_ += milliseconds(500);
  EXPECT_NEAR(static_cast<double>(passing(datagram(stranger))), static_cast<double>(all_at_once) / 2, 1);
  EXPECT_EQ(judge(filter, Message(stranger).data(theirs_, small_)), Verdict::pass) << "small";
}

TEST_F(DatagramFilterTest, SamplesOfStrangersTakeNoMoreRoomThanThereIsWhateverTheyClaim) {
  auto filter = make();
  filter.matched(theirs_, here_, 1U << 20, refused_);
  filter.matched(gid(stranger, 2), here_, 1U << 20, refused_);
  EXPECT_EQ(mebibytes_that_pass(filter, theirs_), 4);
  for (std::int64_t n = 5; n <= 10'000; ++n) {
    now_ += milliseconds(1);
    ASSERT_EQ(judge(filter, first_fragment(theirs_, 1U << 20, n)), Verdict::shed);
    ASSERT_EQ(judge(filter, first_fragment(gid(stranger, 2), 9000, n)), Verdict::shed)
        << "nobody else either";
  }
  EXPECT_EQ(judge(filter, first_fragment(gid(ours, 1), 1U << 20)), Verdict::pass) << "but the suite";
  EXPECT_EQ(judge(filter, Message(stranger).data(theirs_, small_, 10'001)), Verdict::pass) << "what is small";
  EXPECT_EQ(filter.next_stalled(), std::nullopt) << "it has not lasted for long enough";
}

TEST_F(DatagramFilterTest, ManyLargeSamplesInOneDatagramAreCountedEach) {
  auto filter = make();
  filter.matched(theirs_, here_, 1U << 20, refused_);
  Message five(stranger);
  for (std::int64_t n = 1; n <= 5; ++n) five.fragment(theirs_, {.sample_octets = 1U << 20, .sequence = n});
  EXPECT_EQ(judge(filter, five), Verdict::shed);
  Message hundred(stranger);
  for (std::int64_t n = 1; n <= 100; ++n) hundred.fragment(theirs_, {.sample_octets = 9000, .sequence = n});
  EXPECT_EQ(judge(filter, hundred), Verdict::shed);
  // Fragments of one sample, as small as other writers send them.
  Message many(stranger);
  for (std::uint32_t n = 1; n <= 40; ++n) many.fragment(theirs_, {.sample_octets = 1U << 20, .number = n});
  EXPECT_EQ(judge(filter, many), Verdict::pass);
  EXPECT_EQ(mebibytes_that_pass(filter, theirs_), 4) << "of which it is the first";
}

TEST_F(DatagramFilterTest, ThereIsRoomAgainWhenAllReadersHaveGivenTheSampleToTheNode) {
  auto filter = make();
  const Gid second = gid(ours, 8);
  filter.matched(theirs_, here_, 1U << 20, refused_);
  filter.matched(theirs_, second, 1U << 20, refused_);
  EXPECT_FALSE(filter.holds_any());
  EXPECT_EQ(mebibytes_that_pass(filter, theirs_), 4);
  EXPECT_TRUE(filter.holds_any());
  filter.taken({theirs_, 3}, here_);
  EXPECT_EQ(mebibytes_that_pass(filter, theirs_), 0) << "the other reader holds them";
  filter.taken({theirs_, 2}, second);
  EXPECT_EQ(mebibytes_that_pass(filter, theirs_), 2);
  filter.ended(second);
  EXPECT_EQ(mebibytes_that_pass(filter, theirs_), 1) << "3, which this reader gave already";
  filter.unmatched(theirs_, here_);
  EXPECT_FALSE(filter.holds_any());
}

TEST_F(DatagramFilterTest, FragmentsOfASampleThatHasItsRoomPassInAnyOrderAndAgain) {
  auto filter = make();
  filter.matched(theirs_, here_, 1U << 20, refused_);
  const std::uint32_t octets = 1U << 20;
  std::vector<std::uint32_t> numbers((octets + 64'999) / 65'000);
  std::iota(numbers.begin(), numbers.end(), 1);
  numbers.insert(numbers.end(), numbers.begin(), numbers.end());
  std::mt19937 random(1);  // NOLINT(cert-msc32-c,cert-msc51-cpp): the same each time
  for (std::int64_t sequence = 1; sequence <= 20; ++sequence) {
    std::shuffle(numbers.begin(), numbers.end(), random);
    for (const std::uint32_t number : numbers) {
      now_ += milliseconds(20);
      EXPECT_EQ(judge(filter, Message(stranger).fragment(theirs_, {.sample_octets = octets,
                                                                   .sequence = sequence,
                                                                   .number = number,
                                                                   .octets = 65'000})),
                Verdict::pass);
    }
    filter.taken({theirs_, sequence}, here_);
    EXPECT_FALSE(filter.holds_any());
  }
  // Late repetitions of a taken sample use no room.
  filter.matched(gid(stranger, 2), here_, 1U << 20, refused_);
  EXPECT_EQ(judge(filter, first_fragment(gid(stranger, 2), 1U << 20)), Verdict::pass);
  filter.taken({gid(stranger, 2), 1}, here_);
  for (int i = 0; i < 20; ++i)
    EXPECT_EQ(judge(filter, first_fragment(gid(stranger, 2), 1U << 20)), Verdict::pass);
  EXPECT_FALSE(filter.holds_any());
}

TEST_F(DatagramFilterTest, ASampleThatIsLargerThanTheRoomPassesAlone) {
  auto filter = make();
  filter.matched(theirs_, here_, 16U << 20, refused_);
  EXPECT_EQ(judge(filter, first_fragment(theirs_, 16U << 20, 1)), Verdict::pass);
  EXPECT_EQ(judge(filter, first_fragment(theirs_, 9000, 2)), Verdict::shed);
  EXPECT_EQ(judge(filter, first_fragment(theirs_, 16U << 20, 1)), Verdict::pass)
      << "the next of its fragments";
  filter.taken({theirs_, 1}, here_);
  EXPECT_EQ(judge(filter, first_fragment(theirs_, 9000, 2)), Verdict::pass);
  EXPECT_EQ(judge(filter, first_fragment(theirs_, 16U << 20, 3)), Verdict::shed);
}

TEST_F(DatagramFilterTest, WhoLeavesASampleUnfinishedWhileOthersWaitIsForgotten) {
  auto filter = make();
  const GuidPrefix other{1, 15, 3};
  filter.matched(theirs_, here_, 1U << 20, refused_);
  filter.matched(gid(other, 1), here_, 1U << 20, refused_);
  EXPECT_EQ(mebibytes_that_pass(filter, theirs_), 4);
  now_ += HeldSamples::longest_pause - milliseconds(1);
  EXPECT_EQ(judge(filter, first_fragment(theirs_, 1U << 20, 4)), Verdict::pass) << "this one goes on";
  EXPECT_EQ(judge(filter, first_fragment(gid(other, 1), 1U << 20)), Verdict::shed);
  EXPECT_EQ(filter.next_stalled(), std::nullopt);
  now_ += milliseconds(1);
  EXPECT_EQ(filter.next_stalled(), std::nullopt) << "as long as nobody needs it";
  EXPECT_EQ(judge(filter, first_fragment(gid(other, 1), 1U << 20)), Verdict::shed)
      << "its memory is free when it has been forgotten";
  EXPECT_EQ(filter.next_stalled(), stranger);
  EXPECT_EQ(filter.next_stalled(), std::nullopt) << "once";
  filter.unmatched(theirs_, here_);
  EXPECT_EQ(judge(filter, first_fragment(gid(other, 1), 1U << 20)), Verdict::pass);
}

TEST_F(DatagramFilterTest, WhatNoReaderTakesHoldsItsRoomForAWhileAndTheSuiteIsNeverForgotten) {
  auto filter = make();
  filter.matched(gid(ours, 1), here_, 1U << 20, refused_);
  filter.matched(theirs_, here_, 1U << 20, refused_);
  for (std::int64_t n = 1; n <= 2; ++n) {
    EXPECT_EQ(judge(filter, first_fragment(gid(stranger, 7), 1U << 20, n)), Verdict::pass);
    EXPECT_EQ(judge(filter, Message(stranger).source(ours).fragment(
                                gid(ours, 1), {.sample_octets = 1U << 20, .sequence = n})),
              Verdict::pass);
  }
  EXPECT_EQ(mebibytes_that_pass(filter, theirs_), 0);
  now_ += HeldSamples::longest_pause;
  EXPECT_EQ(mebibytes_that_pass(filter, theirs_), 4);
  EXPECT_EQ(filter.next_stalled(), std::nullopt);
}

TEST_F(DatagramFilterTest, DiscoveryIsReadOfEverybodyButInFragments) {
  auto filter = make(true);
  EXPECT_EQ(filter.judge_discovery(Message(stranger).timestamp().data(theirs_, Octets(60'000))),
            Verdict::pass);
  EXPECT_EQ(filter.judge_discovery(departure_message(stranger)), Verdict::pass);
  EXPECT_EQ(filter.judge_discovery(first_fragment(theirs_, 1000)), Verdict::malformed);
  EXPECT_EQ(filter.judge_discovery(first_fragment(gid(ours, 1), 1000)), Verdict::malformed);
  EXPECT_EQ(filter.judge_discovery(Message(stranger).submessage(0x15, 0x06, Octets(30))), Verdict::malformed);
  EXPECT_EQ(filter.dropped_foreign(), 2U);
}

TEST_F(DatagramFilterTest, EveryCutAndEveryOctetOfAMessageIsSurvived) {
  auto filter = make(true);
  const Gid own = gid(ours, 1);
  filter.matched(own, here_, 10, refused_);
  Message message(ours);
  Octets qos = message.ids(16, own, 1);
  for (const std::uint64_t number : {0x0083, 4, 0, 0, 1, 0, 0, 0}) message.number(qos, number, 2);
  const Octets whole = message.timestamp()
                           .source(ours)
                           .fragment(own, {.sample_octets = 5, .octets = 5})
                           .submessage(0x15, 0x06, qos)
                           .data(own, Octets(5))
                           .octets();
  EXPECT_EQ(filter.judge(whole, true, now_), Verdict::pass);
  for (std::size_t n = 0; n <= whole.size(); ++n) (void)filter.judge(OctetView(whole).first(n), true, now_);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    for (int value = 0; value < 256; ++value) {
      Octets damaged = whole;
      damaged[i] = static_cast<std::uint8_t>(value);
      (void)filter.judge(damaged, false, now_);
      (void)filter.judge_discovery(damaged);
    }
  }
}

TEST(LoadShedder, DropsNothingInABurstAndHalfOfTheTimeInAFlood) {
  LoadShedder shedder;
  MonotonicTime now(seconds(10));
  for (int ms = 0; ms <= 50; ++ms) EXPECT_FALSE(shedder.shed(now + milliseconds(ms), milliseconds(ms)));
  EXPECT_TRUE(shedder.shed(now + milliseconds(51), milliseconds(51)));
  EXPECT_TRUE(shedder.shed(now + milliseconds(60), milliseconds(0)))
      << "the socket was empty, the pause goes on";
  EXPECT_FALSE(shedder.shed(now + milliseconds(101), milliseconds(0)));
}

TEST(LargestSample, FollowsFromTheBoundsOfTheType) {
  srfs_msgs::msg::TaskFlags flags;
  EXPECT_GE(largest_sample<srfs_msgs::msg::TaskFlags>(), encoded_size(flags));
  srfs_msgs::msg::Event event;
  event.source = std::string(64, 'x');
  EXPECT_GE(largest_sample<srfs_msgs::msg::Event>(), encoded_size(event));
  EXPECT_LT(largest_sample<srfs_msgs::msg::Event>(), 8192U);
  EXPECT_EQ(largest_sample<sensor_msgs::msg::Image>(), largest_unbounded_payload);
}

TEST(DepartureMessage, IsTheDisposalOfTheParticipantAsItWouldSendItItself) {
  EXPECT_EQ(to_hex(departure_message({1, 15, 0x78, 0xfd, 0xaa, 0x51, 0x61, 0xf4, 0, 0, 0, 0})),
            "525450530202010f"          // RTPS 2.2
            "010f78fdaa5161f400000000"  // the departed participant
            "15020034"                  // DATA, inline QoS
            "00000010"
            "000100c7"
            "000100c2"
            "000000007fffffff"  // SPDP reader, writer, sequence
            "00700010"
            "010f78fdaa5161f400000000000001c1"  // key hash
            "00710004"
            "00000003"  // disposed, unregistered
            "00010000");
}

}  // namespace
}  // namespace srfs::ros
