// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/isotp.hpp"

#include <algorithm>
#include <deque>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace srfs::wire {
namespace {

constexpr IsoTpAddress to_adcs{.target = 0x11, .source = 0x01};
constexpr IsoTpAddress to_computer{.target = 0x01, .source = 0x11};

constexpr MonotonicTime at(microseconds t) {
  return MonotonicTime(t);
}
constexpr MonotonicTime start = at(seconds(5));

Octets counting(std::size_t size, unsigned first = 0) {
  Octets message(size);
  for (std::size_t i = 0; i < size; ++i) message[i] = static_cast<std::uint8_t>(first + i * 7 + (i >> 8));
  return message;
}

CanDataFrame frame_to_adcs(const char* hex) {
  const Octets octets = *from_hex(hex);
  CanDataFrame frame{.id = normal_fixed_id(to_adcs), .size = static_cast<std::uint8_t>(octets.size())};
  std::copy(octets.begin(), octets.end(), frame.data.begin());
  return frame;
}

std::string hex(const std::optional<CanDataFrame>& frame) {
  return frame ? to_hex(frame->view()) : "none";
}

/// Two channels on one wire. Every frame takes 250 us; its sender gets the confirmation at its end.
class Line {
 public:
  using Fate =
      std::function<int(const CanDataFrame&)>;  // number of copies that arrive; 0: lost, 2: duplicated

  explicit Line(IsoTpSettings settings = {}) : Line(settings, settings) {}
  Line(IsoTpSettings at_computer, IsoTpSettings at_adcs)
      : computer(to_adcs, at_computer), adcs(to_computer, at_adcs) {}

  /// Runs until nothing is due before @p until.
  void run(MonotonicTime until) {
    while (true) {
      put_on_wire(computer, adcs);
      put_on_wire(adcs, computer);
      auto next = next_event();
      if (!next || *next > until) return;
      now = std::max(now, *next);
      if (on_wire_ && on_wire_->end <= now) land();
      (void)step(computer);
      (void)step(adcs);
    }
  }

  IsoTpChannel computer;
  IsoTpChannel adcs;
  MonotonicTime now = start;
  Fate fate = [](const CanDataFrame&) { return 1; };
  std::function<void(const CanDataFrame&, MonotonicTime)> tap = [](const CanDataFrame&, MonotonicTime) {};
  bool swap_next = false;

 private:
  struct Transfer {
    CanDataFrame frame;
    IsoTpChannel* from;
    IsoTpChannel* to;
    MonotonicTime end;
  };
  void put_on_wire(IsoTpChannel& from, IsoTpChannel& to) {
    while (const auto frame = from.poll(now)) waiting_.push_back({*frame, &from, &to, {}});
    if (!on_wire_ && !waiting_.empty()) {
      on_wire_ = waiting_.front();
      waiting_.pop_front();
      on_wire_->end = now + microseconds(250);
    }
  }
  bool step(IsoTpChannel& channel) {
    if (const auto frame = channel.poll(now)) {
      waiting_.push_back({*frame, &channel, &channel == &computer ? &adcs : &computer, {}});
      return true;
    }
    return false;
  }
  void land() {
    const Transfer t = *std::exchange(on_wire_, std::nullopt);
    tap(t.frame, now);
    for (int copies = fate(t.frame); copies > 0; --copies) arrive(*t.to, t.frame);
    t.from->on_transmit_confirm(t.frame, now);
  }
  void arrive(IsoTpChannel& to, const CanDataFrame& frame) {
    if (std::exchange(swap_next, false)) {
      held_ = {frame, &to};
      return;
    }
    to.on_frame(frame, now);
    if (held_ && held_->second == &to) {
      to.on_frame(held_->first, now);
      held_.reset();
    }
  }
  std::optional<MonotonicTime> next_event() const {
    std::optional<MonotonicTime> next;
    const auto consider = [&next](std::optional<MonotonicTime> t) {
      if (t && (!next || *t < *next)) next = t;
    };
    if (on_wire_) consider(on_wire_->end);
    consider(computer.next_deadline());
    consider(adcs.next_deadline());
    return next;
  }
  std::deque<Transfer> waiting_;
  std::optional<Transfer> on_wire_;
  std::optional<std::pair<CanDataFrame, IsoTpChannel*>> held_;
};

IsoTpSettings without_confirmation() {
  IsoTpSettings settings;
  settings.await_confirmation = false;
  return settings;
}

TEST(NormalFixedAddress, PutsTargetBeforeSource) {
  EXPECT_EQ(normal_fixed_id(to_adcs), 0x18DA1101U);
  EXPECT_EQ(parse_normal_fixed_id(0x18DA0111U), to_computer);
}

TEST(NormalFixedAddress, IsNotAnyIdentifier) {
  EXPECT_FALSE(parse_normal_fixed_id(0x18DB0111U));  // functional addressing
  EXPECT_FALSE(parse_normal_fixed_id(0x123U));
}

TEST(SeparationTime, HasMillisecondAndHundredMicrosecondCodes) {
  EXPECT_EQ(separation_time(0x00), microseconds(0));
  EXPECT_EQ(separation_time(0x14), milliseconds(20));
  EXPECT_EQ(separation_time(0x7F), milliseconds(127));
  EXPECT_EQ(separation_time(0xF1), microseconds(100));
  EXPECT_EQ(separation_time(0xF9), microseconds(900));
}

TEST(SeparationTime, IsTheLongestForReservedCodes) {
  for (const std::uint8_t code : std::array<std::uint8_t, 4>{0x80, 0xF0, 0xFA, 0xFF})
    EXPECT_EQ(separation_time(code), milliseconds(127));
}

TEST(SeparationTime, EncodesToTheNextLongerCode) {
  EXPECT_EQ(separation_code(microseconds(0)), 0x00);
  EXPECT_EQ(separation_code(microseconds(1)), 0xF1);
  EXPECT_EQ(separation_code(microseconds(900)), 0xF9);
  EXPECT_EQ(separation_code(microseconds(901)), 0x01);
  EXPECT_EQ(separation_code(milliseconds(5)), 0x05);
  EXPECT_EQ(separation_code(seconds(1)), 0x7F);
  for (int us = 0; us <= 127'000; us += 37) {
    EXPECT_GE(separation_time(separation_code(microseconds(us))), microseconds(us));
  }
}

TEST(IsoTpSender, PutsAShortMessageIntoOneFramePaddedWithCC) {
  IsoTpChannel channel(to_adcs, {});
  ASSERT_TRUE(channel.send(*from_hex("0105d2ab"), start));

  const auto frame = channel.poll(start);
  EXPECT_EQ(hex(frame), "040105d2abcccccc");
  EXPECT_EQ(frame->id, 0x18DA1101U);
  EXPECT_FALSE(channel.take_send_result());

  channel.on_transmit_confirm(*frame, start + milliseconds(1));
  EXPECT_TRUE(channel.take_send_result().value().has_value());
  EXPECT_FALSE(channel.next_deadline());
}

TEST(IsoTpSender, CutsALongMessageIntoFirstAndConsecutiveFrames) {
  IsoTpChannel channel(to_adcs, without_confirmation());
  ASSERT_TRUE(channel.send(counting(20), start));
  EXPECT_EQ(hex(channel.poll(start)), "101400070e151c23");
  EXPECT_EQ(hex(channel.poll(start)), "none");

  channel.on_frame({.id = 0x18DA0111, .size = 8, .data = {0x30, 0, 0}}, start);
  EXPECT_EQ(hex(channel.poll(start)), "212a31383f464d54");
  EXPECT_EQ(hex(channel.poll(start)), "225b626970777e85");
  EXPECT_EQ(hex(channel.poll(start)), "none");
  EXPECT_TRUE(channel.take_send_result().value().has_value());
}

TEST(IsoTpSender, RefusesWhatItCannotSend) {
  IsoTpChannel channel(to_adcs, {});
  EXPECT_EQ(channel.send({}, start).error(), IsoTpError::empty_message);
  EXPECT_EQ(channel.send(counting(4096), start).error(), IsoTpError::message_too_long);
  ASSERT_TRUE(channel.send(counting(1), start));
  EXPECT_EQ(channel.send(counting(1), start).error(), IsoTpError::busy);
}

TEST(IsoTpSender, GivesUpWithoutATransmitConfirmation) {
  IsoTpChannel channel(to_adcs, {});
  ASSERT_TRUE(channel.send(counting(3), start));
  const auto frame = channel.poll(start);
  EXPECT_EQ(channel.next_deadline(), start + milliseconds(25));

  EXPECT_FALSE(channel.poll(start + milliseconds(25)));
  EXPECT_EQ(channel.take_send_result().value().error(), IsoTpError::timeout_as);

  channel.on_transmit_confirm(*frame, start + milliseconds(26));
  EXPECT_EQ(channel.counters().stray_confirmations, 1U);
}

TEST(IsoTpSender, GivesUpWithoutFlowControl) {
  IsoTpChannel channel(to_adcs, {});
  ASSERT_TRUE(channel.send(counting(30), start));
  channel.on_transmit_confirm(*channel.poll(start), start + milliseconds(2));
  EXPECT_EQ(channel.next_deadline(), start + milliseconds(42));

  EXPECT_FALSE(channel.poll(start + milliseconds(42)));
  EXPECT_EQ(channel.take_send_result().value().error(), IsoTpError::timeout_bs);
  EXPECT_EQ(channel.counters().timeouts_bs, 1U);
}

TEST(IsoTpSender, WaitsAsLongAsThePeerSaysSoUpToTheLimit) {
  IsoTpSettings settings = without_confirmation();
  settings.max_wait_frames = 2;
  IsoTpChannel channel(to_adcs, settings);
  ASSERT_TRUE(channel.send(counting(30), start));
  (void)channel.poll(start);
  const CanDataFrame wait{.id = 0x18DA0111, .size = 3, .data = {0x31, 0, 0}};

  channel.on_frame(wait, start + milliseconds(30));
  channel.on_frame(wait, start + milliseconds(60));
  EXPECT_FALSE(channel.poll(start + milliseconds(99)));
  EXPECT_FALSE(channel.take_send_result());

  channel.on_frame(wait, start + milliseconds(99));
  EXPECT_EQ(channel.take_send_result().value().error(), IsoTpError::wait_limit);
}

TEST(IsoTpSender, StopsAtOverflowAndAtAnUnknownFlowStatus) {
  for (const auto& [status, error] : {std::pair<std::uint8_t, IsoTpError>{0x32, IsoTpError::peer_overflow},
                                      {0x33, IsoTpError::invalid_flow_status}}) {
    IsoTpChannel channel(to_adcs, without_confirmation());
    ASSERT_TRUE(channel.send(counting(30), start));
    (void)channel.poll(start);
    channel.on_frame({.id = 0x18DA0111, .size = 8, .data = {status, 0, 0}}, start);
    EXPECT_EQ(channel.take_send_result().value().error(), error);
  }
}

TEST(IsoTpSender, GivesARefusedFrameAgainAMillisecondLater) {
  IsoTpChannel channel(to_adcs, {});
  ASSERT_TRUE(channel.send(counting(3), start));
  const auto frame = channel.poll(start);
  channel.on_transmit_refused(start);
  EXPECT_FALSE(channel.poll(start));
  EXPECT_EQ(channel.next_deadline(), start + milliseconds(1));
  EXPECT_EQ(channel.poll(start + milliseconds(1)), frame);
  channel.on_transmit_confirm(*frame, start + milliseconds(2));
  EXPECT_TRUE(channel.take_send_result().value().has_value());
}

constexpr CanDataFrame go_on{.id = 0x18DA0111, .size = 8, .data = {0x30, 0, 0}};

/// A sender whose first frame has received @p answer.
IsoTpChannel sender_of(OctetView message, IsoTpSettings settings, const CanDataFrame& answer = go_on) {
  IsoTpChannel channel(to_adcs, settings);
  EXPECT_TRUE(channel.send(message, start));
  channel.on_transmit_confirm(channel.poll(start).value(), start);
  channel.on_frame(answer, start);
  return channel;
}

std::vector<CanDataFrame> all_due(IsoTpChannel& channel, MonotonicTime now) {
  std::vector<CanDataFrame> frames;
  while (const auto frame = channel.poll(now)) frames.push_back(*frame);
  return frames;
}

TEST(IsoTpSender, KeepsAsManyFramesAheadOfTheirConfirmationAsItIsSet) {
  IsoTpChannel channel = sender_of(counting(100), {.frames_ahead = 3});
  const auto frames = all_due(channel, start);
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_EQ(frames[2].data[0], 0x23);

  channel.on_transmit_confirm(frames[0], start + microseconds(250));
  EXPECT_EQ(channel.next_deadline(), start) << "the next frame is due since the flow control";
  const auto next = all_due(channel, start + microseconds(250));
  ASSERT_EQ(next.size(), 1U);
  EXPECT_EQ(next[0].data[0], 0x24);
}

TEST(IsoTpSender, EndsWithTheConfirmationOfEveryFrame) {
  IsoTpChannel channel = sender_of(counting(20), {});
  const auto frames = all_due(channel, start);
  ASSERT_EQ(frames.size(), 2U);
  channel.on_transmit_confirm(frames[1], start);  // an echo may be lost or late
  EXPECT_TRUE(channel.sending());
  channel.on_transmit_confirm(frames[0], start);
  EXPECT_TRUE(channel.take_send_result().value().has_value());
  EXPECT_EQ(channel.counters().stray_confirmations, 0U);
}

TEST(IsoTpSender, GivesEachFrameAheadItsOwnTimeToBeConfirmed) {
  IsoTpChannel channel = sender_of(counting(100), {.frames_ahead = 2});
  const auto frames = all_due(channel, start);
  channel.on_transmit_confirm(frames[0], start + milliseconds(10));
  ASSERT_EQ(all_due(channel, start + milliseconds(10)).size(), 1U);
  EXPECT_EQ(channel.next_deadline(), start + milliseconds(35)) << "the second frame could not leave before";

  EXPECT_FALSE(channel.poll(start + milliseconds(35)));
  EXPECT_EQ(channel.take_send_result().value().error(), IsoTpError::timeout_as);
  EXPECT_EQ(channel.counters().timeouts_as, 1U);
  EXPECT_FALSE(channel.next_deadline()) << "the third frame is forgotten with the message";
}

TEST(IsoTpSender, GivesUpWhenTheOldestFrameAheadIsNotConfirmedWhateverComesBehind) {
  IsoTpChannel channel = sender_of(counting(100), {.frames_ahead = 3});
  const auto frames = all_due(channel, start);
  channel.on_transmit_confirm(frames[1], start + milliseconds(10));
  ASSERT_EQ(all_due(channel, start + milliseconds(20)).size(), 1U);
  EXPECT_FALSE(channel.poll(start + milliseconds(25)));
  EXPECT_EQ(channel.take_send_result().value().error(), IsoTpError::timeout_as);
}

TEST(IsoTpSender, GetsNoFurtherAheadThanTheBlock) {
  CanDataFrame two_frames = go_on;
  two_frames.data[1] = 2;
  IsoTpChannel channel = sender_of(counting(100), {}, two_frames);
  const auto block = all_due(channel, start);
  ASSERT_EQ(block.size(), 2U);
  channel.on_transmit_confirm(block[0], start);
  EXPECT_FALSE(channel.poll(start));
  channel.on_transmit_confirm(block[1], start + milliseconds(1));
  EXPECT_FALSE(channel.poll(start + milliseconds(1)));
  EXPECT_EQ(channel.next_deadline(), start + milliseconds(41)) << "N_Bs";

  channel.on_frame(two_frames, start + milliseconds(2));
  EXPECT_EQ(all_due(channel, start + milliseconds(2)).size(), 2U);
}

TEST(IsoTpSender, TakesTheFlowControlThatOvertookTheEchoesOfABlock) {
  CanDataFrame three_frames = go_on;
  three_frames.data[1] = 3;
  IsoTpChannel channel = sender_of(counting(100), {}, three_frames);
  ASSERT_EQ(all_due(channel, start).size(), 3U);
  channel.on_frame(three_frames, start + milliseconds(1));
  const auto next = all_due(channel, start + milliseconds(1));
  ASSERT_EQ(next.size(), 3U);
  EXPECT_EQ(next[0].data[0], 0x24);
  EXPECT_EQ(channel.counters().ignored_pdus, 0U);
}

TEST(IsoTpSender, IsNotAheadWhereThePeerAsksForASeparationTime) {
  CanDataFrame apart = go_on;
  apart.data[2] = 5;
  IsoTpChannel channel = sender_of(counting(100), {}, apart);
  const auto frame = channel.poll(start);
  ASSERT_TRUE(frame);
  EXPECT_FALSE(channel.poll(start + milliseconds(20)));
  channel.on_transmit_confirm(*frame, start + milliseconds(20));
  EXPECT_FALSE(channel.poll(start + milliseconds(24)));
  EXPECT_TRUE(channel.poll(start + milliseconds(25)));
}

TEST(IsoTpSender, GivesTheRefusedFrameAgainBeforeAnyOther) {
  IsoTpChannel channel = sender_of(counting(100), {.frames_ahead = 4});
  const auto first = channel.poll(start);
  const auto refused = channel.poll(start);
  channel.on_transmit_refused(start);
  EXPECT_FALSE(channel.poll(start));
  EXPECT_EQ(channel.next_deadline(), start + milliseconds(1));
  channel.on_transmit_confirm(*refused, start);
  EXPECT_EQ(channel.counters().stray_confirmations, 1U) << "it was never with the driver";

  channel.on_transmit_confirm(*first, start + microseconds(250));
  EXPECT_EQ(channel.poll(start + microseconds(250)), refused) << "an echo means room";
  EXPECT_EQ(channel.poll(start + microseconds(250))->data[0], 0x23);
}

TEST(IsoTpSender, ForgetsARefusedFrameWithItsMessage) {
  IsoTpChannel channel(to_adcs, {});
  ASSERT_TRUE(channel.send(counting(3), start));
  (void)channel.poll(start);
  channel.on_transmit_refused(start + microseconds(24'500));
  EXPECT_FALSE(channel.poll(start + milliseconds(25)));
  EXPECT_EQ(channel.take_send_result().value().error(), IsoTpError::timeout_as);

  ASSERT_TRUE(channel.send(counting(2), start + milliseconds(25)));
  EXPECT_EQ(hex(channel.poll(start + milliseconds(25))), "020007cccccccccc");
}

TEST(IsoTpSender, TakesNoFlowControlForABlockWhoseLastFrameWasRefused) {
  CanDataFrame two_frames = go_on;
  two_frames.data[1] = 2;
  IsoTpChannel channel = sender_of(counting(100), {}, two_frames);
  (void)channel.poll(start);
  const auto refused = channel.poll(start);
  channel.on_transmit_refused(start);
  channel.on_frame(two_frames, start);
  EXPECT_EQ(channel.counters().ignored_pdus, 1U);
  EXPECT_EQ(channel.poll(start + milliseconds(1)), refused);
}

TEST(IsoTpChannel, AnswersAFirstFrameWhileItsOwnMessageIsAheadOfItsConfirmation) {
  IsoTpChannel channel = sender_of(counting(100), {.frames_ahead = 2});
  const auto ahead = all_due(channel, start);
  ASSERT_EQ(ahead.size(), 2U);
  channel.on_frame({.id = 0x18DA0111, .size = 8, .data = {0x10, 20}}, start);
  const auto control = all_due(channel, start);
  ASSERT_EQ(control.size(), 1U);
  EXPECT_EQ(hex(control[0]), "300000cccccccccc");

  channel.on_transmit_confirm(control[0], start);
  EXPECT_TRUE(channel.receiving());
  EXPECT_FALSE(channel.poll(start)) << "the message has no room ahead yet";
  channel.on_transmit_confirm(ahead[0], start);
  EXPECT_TRUE(channel.poll(start));
}

TEST(IsoTpSender, TakesTheFlowControlThatOvertookTheEchoOfItsFirstFrame) {
  IsoTpChannel channel(to_adcs, {});
  ASSERT_TRUE(channel.send(counting(13), start));
  (void)channel.poll(start);
  channel.on_frame({.id = 0x18DA0111, .size = 8, .data = {0x30, 0, 0}}, start + milliseconds(1));
  const auto last = channel.poll(start + milliseconds(1));
  ASSERT_TRUE(last);
  channel.on_transmit_confirm(*last, start + milliseconds(2));
  EXPECT_TRUE(channel.take_send_result().value().has_value());
}

TEST(IsoTpReceiver, AnswersAFirstFrameWithItsBlockSizeAndSeparationTime) {
  IsoTpSettings settings;
  settings.block_size = 4;
  settings.separation = microseconds(300);
  IsoTpChannel channel(to_computer, settings);
  channel.on_frame(frame_to_adcs("1014000102030405"), start);
  EXPECT_EQ(hex(channel.poll(start)), "3004f3cccccccccc");
}

TEST(IsoTpReceiver, GivesUpWhenConsecutiveFramesStayOut) {
  IsoTpChannel channel(to_computer, without_confirmation());
  channel.on_frame(frame_to_adcs("1014000102030405"), start);
  (void)channel.poll(start);
  EXPECT_FALSE(channel.poll(start));
  EXPECT_EQ(channel.next_deadline(), start + milliseconds(40));

  EXPECT_FALSE(channel.poll(start + milliseconds(40)));
  EXPECT_EQ(channel.take_receive_error(), IsoTpError::timeout_cr);
  EXPECT_FALSE(channel.receiving());
}

TEST(IsoTpReceiver, RefusesAFrameOutOfSequence) {
  IsoTpChannel channel(to_computer, without_confirmation());
  channel.on_frame(frame_to_adcs("1014000102030405"), start);
  (void)channel.poll(start);
  channel.on_frame(frame_to_adcs("2206070809101112"), start);
  EXPECT_EQ(channel.take_receive_error(), IsoTpError::wrong_sequence);
  EXPECT_EQ(channel.messages_waiting(), 0U);
}

TEST(IsoTpReceiver, StartsAnewWhenANewMessageCutsOffTheOldOne) {
  IsoTpChannel channel(to_computer, without_confirmation());
  channel.on_frame(frame_to_adcs("1014000102030405"), start);
  channel.on_frame(frame_to_adcs("02abcdcccccccccc"), start);
  EXPECT_EQ(channel.take_receive_error(), IsoTpError::unexpected_pdu);
  EXPECT_EQ(to_hex(channel.front_message()), "abcd");
  EXPECT_FALSE(channel.receiving());
}

TEST(IsoTpReceiver, IgnoresWhatNobodyWaitsForAndCountsWhatIsImpossible) {
  IsoTpChannel channel(to_computer, without_confirmation());
  channel.on_frame(frame_to_adcs("2101020304050607"), start);
  channel.on_frame(frame_to_adcs("3000000000000000"), start);
  EXPECT_EQ(channel.counters().ignored_pdus, 2U);

  for (const char* impossible :
       {"00", "08010203040506ff", "0501", "1007010203040506", "101401020304", "4000", "ff", "30"}) {
    channel.on_frame(frame_to_adcs(impossible), start);
  }
  channel.on_frame({.id = normal_fixed_id(to_adcs), .size = 0}, start);
  EXPECT_EQ(channel.counters().malformed_pdus, 9U);
  EXPECT_FALSE(channel.next_deadline());
}

TEST(IsoTpReceiver, LeavesFramesOfOtherChannelsAlone) {
  IsoTpChannel channel(to_computer, {});
  channel.on_frame({.id = 0x18DA1201, .size = 2, .data = {0x01, 0xAA}}, start);
  EXPECT_EQ(channel.counters().frames_received, 0U);
  EXPECT_EQ(channel.messages_waiting(), 0U);
}

TEST(IsoTpReceiver, SaysOverflowWhenItsQueueIsFull) {
  IsoTpChannel channel(to_computer, without_confirmation());
  channel.on_frame(frame_to_adcs("01aa"), start);
  channel.on_frame(frame_to_adcs("01bb"), start);
  channel.on_frame(frame_to_adcs("01cc"), start);
  EXPECT_EQ(channel.counters().receive_overflows, 1U);

  channel.on_frame(frame_to_adcs("1014000102030405"), start);
  EXPECT_EQ(hex(channel.poll(start)), "320000cccccccccc");
  EXPECT_EQ(channel.take_receive_error(), IsoTpError::receive_overflow);

  EXPECT_EQ(to_hex(channel.front_message()), "aa");
  channel.pop_message();
  EXPECT_EQ(to_hex(channel.front_message()), "bb");
}

TEST(IsoTpReceiver, SaysOverflowToAMessageAbove4095Octets) {
  IsoTpChannel channel(to_computer, without_confirmation());
  channel.on_frame(frame_to_adcs("1000000010000102"), start);
  EXPECT_EQ(hex(channel.poll(start)), "320000cccccccccc");
  EXPECT_FALSE(channel.receiving());
}

TEST(IsoTpReceiver, MayAskToWaitUntilThereIsRoom) {
  IsoTpSettings patient = without_confirmation();
  patient.receive_queue = 1;
  patient.wait_frames_when_full = 2;
  IsoTpChannel channel(to_computer, patient);
  channel.on_frame(frame_to_adcs("01aa"), start);
  channel.on_frame(frame_to_adcs("1008000102030405"), start);
  EXPECT_EQ(hex(channel.poll(start)), "310000cccccccccc");
  EXPECT_FALSE(channel.poll(start));

  channel.pop_message();
  EXPECT_EQ(hex(channel.poll(start + milliseconds(20))), "300000cccccccccc");
  channel.on_frame(frame_to_adcs("210607"), start + milliseconds(21));
  EXPECT_EQ(to_hex(channel.front_message()), "0001020304050607");
}

TEST(IsoTpReceiver, EndsItsPatienceWithOverflow) {
  IsoTpSettings patient = without_confirmation();
  patient.receive_queue = 1;
  patient.wait_frames_when_full = 1;
  IsoTpChannel channel(to_computer, patient);
  channel.on_frame(frame_to_adcs("01aa"), start);
  channel.on_frame(frame_to_adcs("1008000102030405"), start);
  EXPECT_EQ(hex(channel.poll(start)), "310000cccccccccc");
  EXPECT_FALSE(channel.poll(start));
  EXPECT_EQ(hex(channel.poll(start + milliseconds(20))), "320000cccccccccc");
  EXPECT_FALSE(channel.receiving());
}

TEST(IsoTpReceiver, TakesTheBlockThatOvertookTheEchoOfItsFlowControl) {
  IsoTpSettings settings;
  settings.block_size = 1;
  IsoTpChannel channel(to_computer, settings);
  channel.on_frame(frame_to_adcs("1014000102030405"), start);
  const auto first_control = channel.poll(start);
  channel.on_frame(frame_to_adcs("2106070809101112"), start);
  EXPECT_FALSE(channel.poll(start));  // one frame in flight at a time

  channel.on_transmit_confirm(*first_control, start);
  const auto second_control = channel.poll(start);
  EXPECT_EQ(hex(second_control), "300100cccccccccc");
  channel.on_transmit_confirm(*second_control, start);
  channel.on_frame(frame_to_adcs("2213141516171819"), start);
  EXPECT_EQ(channel.front_message().size(), 20U);
}

TEST(IsoTpChannel, ForgetsBothTransfersWhenAborted) {
  IsoTpChannel channel(to_computer, {});
  ASSERT_TRUE(channel.send(counting(30), start));
  (void)channel.poll(start);
  channel.on_frame(frame_to_adcs("1014000102030405"), start);
  channel.abort();
  EXPECT_FALSE(channel.sending());
  EXPECT_FALSE(channel.receiving());
  EXPECT_FALSE(channel.poll(start));
  EXPECT_FALSE(channel.next_deadline());
  EXPECT_EQ(channel.take_send_result().value().error(), IsoTpError::aborted);
  EXPECT_TRUE(channel.send(counting(30), start));
}

TEST(TwoChannels, TransferEveryLength) {
  Line line;
  for (std::size_t size = 1; size <= isotp_max_message; ++size) {
    const Octets message = counting(size, static_cast<unsigned>(size));
    ASSERT_TRUE(line.computer.send(message, line.now));
    line.run(line.now + seconds(2));
    ASSERT_TRUE(line.computer.take_send_result().value().has_value()) << size;
    ASSERT_TRUE(std::ranges::equal(line.adcs.front_message(), message)) << size;
    line.adcs.pop_message();
  }
  EXPECT_EQ(line.adcs.counters().messages_received, isotp_max_message);
}

TEST(TwoChannels, TransferBothWaysAtOnce) {
  IsoTpSettings settings;
  settings.block_size = 3;
  Line line(settings);
  ASSERT_TRUE(line.computer.send(counting(500, 1), line.now));
  ASSERT_TRUE(line.adcs.send(counting(700, 2), line.now));
  line.run(line.now + seconds(2));
  EXPECT_TRUE(std::ranges::equal(line.adcs.front_message(), counting(500, 1)));
  EXPECT_TRUE(std::ranges::equal(line.computer.front_message(), counting(700, 2)));
}

TEST(TwoChannels, KeepTheReceiversBlockSize) {
  IsoTpSettings receiver;
  receiver.block_size = 5;
  Line line({}, receiver);
  int in_block = 0;
  line.tap = [&](const CanDataFrame& frame, MonotonicTime) {
    if (frame.data[0] >> 4 == 3) in_block = 0;
    if (frame.data[0] >> 4 == 2) {
      EXPECT_LE(++in_block, 5);
    }
  };
  ASSERT_TRUE(line.computer.send(counting(1000), line.now));
  line.run(line.now + seconds(2));
  EXPECT_EQ(line.adcs.front_message().size(), 1000U);
  EXPECT_EQ(line.adcs.counters().frames_sent,
            29U);  // 142 consecutive frames: one flow control for every five, rounded up
}

TEST(TwoChannels, KeepTheReceiversSeparationTime) {
  for (const microseconds separation : {microseconds(0), microseconds(300), microseconds(2000)}) {
    IsoTpSettings receiver;
    receiver.separation = separation;
    Line line({}, receiver);
    std::optional<MonotonicTime> last;
    line.tap = [&](const CanDataFrame& frame, MonotonicTime end) {
      if (frame.data[0] >> 4 != 2) return;
      if (last) {
        EXPECT_EQ(end - *last, separation + microseconds(250));
      }
      last = end;
    };
    ASSERT_TRUE(line.computer.send(counting(200), line.now));
    line.run(line.now + seconds(2));
    EXPECT_EQ(line.adcs.front_message().size(), 200U);
  }
}

// Frames are lost, duplicated and swapped with their successor. ISO-TP delivers either the correct message or
// none, and both ends are idle again within the longest chain of time-outs.
TEST(TwoChannels, NeverDeliverAWrongMessageOverABadLine) {
  std::mt19937 random(20260101);
  const auto chance = [&random](double p) {
    return std::uniform_real_distribution<double>(0, 1)(random) < p;
  };
  std::size_t delivered = 0;
  for (int round = 0; round < 3000; ++round) {
    IsoTpSettings receiver;
    receiver.block_size = static_cast<std::uint8_t>(random() % 4 == 0 ? 0 : random() % 20);
    Line line({}, receiver);
    const double badness = static_cast<double>(random() % 4) * 0.02;
    line.fate = [&](const CanDataFrame&) {
      line.swap_next = chance(badness);
      if (chance(badness)) return 0;
      return chance(badness) ? 2 : 1;
    };
    const Octets message =
        counting(1 + random() % (round % 10 == 0 ? 4095 : 200), static_cast<unsigned>(random()));
    ASSERT_TRUE(line.computer.send(message, line.now));
    line.run(line.now + seconds(3));

    ASSERT_FALSE(line.computer.sending());
    ASSERT_FALSE(line.adcs.receiving());
    ASSERT_TRUE(line.computer.take_send_result().has_value());
    while (line.adcs.messages_waiting() > 0) {
      ASSERT_TRUE(std::ranges::equal(line.adcs.front_message(), message));
      line.adcs.pop_message();
      ++delivered;
    }
  }
  EXPECT_GT(delivered, 1000U);
}

TEST(TwoChannels, AreUsableAgainAfterEveryFailure) {
  std::mt19937 random(7);
  Line line;
  for (int round = 0; round < 300; ++round) {
    line.fate = [&](const CanDataFrame&) { return random() % 10 == 0 ? 0 : 1; };
    ASSERT_TRUE(line.computer.send(counting(100), line.now));
    line.run(line.now + seconds(1));
    (void)line.computer.take_send_result();
    while (line.adcs.messages_waiting() > 0) line.adcs.pop_message();

    line.fate = [](const CanDataFrame&) { return 1; };
    ASSERT_TRUE(line.computer.send(counting(100, 3), line.now));
    line.run(line.now + seconds(1));
    ASSERT_TRUE(line.computer.take_send_result().value().has_value());
    ASSERT_TRUE(std::ranges::equal(line.adcs.front_message(), counting(100, 3)));
    line.adcs.pop_message();
  }
}

TEST(IsoTpChannel, SurvivesRandomFramesAndReturnsToIdle) {
  std::mt19937 random(42);
  for (int round = 0; round < 200; ++round) {
    IsoTpSettings settings;
    settings.block_size = static_cast<std::uint8_t>(random() % 3);
    settings.wait_frames_when_full = static_cast<std::uint8_t>(random() % 3);
    settings.await_confirmation = random() % 2 == 0;
    settings.frames_ahead = 1 + random() % isotp_most_ahead;
    IsoTpChannel channel(to_computer, settings);
    MonotonicTime now = start;
    for (int i = 0; i < 500; ++i) {
      now += microseconds(random() % 5000);
      CanDataFrame frame{.id = normal_fixed_id(to_adcs), .size = static_cast<std::uint8_t>(random() % 9)};
      for (auto& octet : frame.data) octet = static_cast<std::uint8_t>(random());
      if (random() % 2 == 0) frame.data[0] &= 0x3F;
      if (random() % 4 == 0) (void)channel.send(counting(1 + random() % 300), now);
      channel.on_frame(frame, now);
      while (const auto out = channel.poll(now)) {
        if (random() % 8 == 0) {
          channel.on_transmit_refused(now);
        } else if (random() % 8 != 0) {
          channel.on_transmit_confirm(*out, now);
        }
      }
      if (random() % 8 == 0) channel.pop_message();
      (void)channel.take_send_result();
      ASSERT_LE(channel.messages_waiting(), settings.receive_queue);
    }
    for (int i = 0; i < 100 && channel.next_deadline(); ++i) {
      now = std::max(now, *channel.next_deadline());
      (void)channel.poll(now);
    }
    ASSERT_FALSE(channel.next_deadline());
    ASSERT_FALSE(channel.sending());
    ASSERT_FALSE(channel.receiving());
  }
}

}  // namespace
}  // namespace srfs::wire
