// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <vector>

#include <gtest/gtest.h>

#include "nodes/payload/isotp_peripheral_link.hpp"

namespace srfs {
namespace {

constexpr std::uint8_t address = 0x11;

/// A link and the peripheral's end of its channel, joined by a bus without loss.
struct Link : ::testing::Test {
  IsoTpPeripheralLink link{address};
  wire::IsoTpChannel peripheral{{.target = IsoTpPeripheralLink::computer_address, .source = address},
                                {.await_confirmation = false}};
  MonotonicTime now{seconds(3)};
  std::size_t frames = 0;

  void exchange() {
    for (int i = 0; i < 64; ++i) {
      now += microseconds(200);
      if (const auto frame = link.poll(now)) {
        ++frames;
        link.on_transmit_confirm(*frame, now);
        peripheral.on_frame(*frame, now);
      }
      if (const auto frame = peripheral.poll(now)) link.on_frame(*frame, now);
    }
  }
  wire::PeripheralRequest received() {
    const auto request = wire::decode_request(peripheral.front_message());
    EXPECT_TRUE(request.has_value());
    peripheral.pop_message();
    return request.value_or(wire::PeripheralRequest{});
  }
  void reply(const wire::PeripheralResponse& response) {
    ASSERT_TRUE(peripheral.send(wire::encode(response), now).has_value());
    exchange();
    (void)peripheral.take_send_result();
  }
};
using IsoTpPeripheralLinkTest = Link;

TEST_F(IsoTpPeripheralLinkTest, CarriesARequestAndItsAnswer) {
  link.request(wire::WakeUpRequest{}, now);
  exchange();
  const wire::PeripheralRequest request = received();
  EXPECT_FALSE(link.take_outcome().has_value());
  reply({request.sequence, wire::WakeUpResponse{wire::PeripheralStatus::ready, 5, Octets(65, 7)}});
  const auto outcome = link.take_outcome();
  ASSERT_TRUE(outcome && *outcome);
  EXPECT_EQ(std::get<wire::WakeUpResponse>((*outcome)->body).measurement.size(), 65U);
  EXPECT_FALSE(link.take_outcome().has_value());
}

TEST_F(IsoTpPeripheralLinkTest, CountsALateAnswerAndWaitsForItsOwn) {
  link.request(wire::WakeUpRequest{}, now);
  exchange();
  const wire::PeripheralRequest first = received();
  link.request(wire::ResetRequest{}, now);
  exchange();
  const wire::PeripheralRequest second = received();
  EXPECT_NE(first.sequence, second.sequence);
  reply({first.sequence, wire::ResetResponse{}});
  EXPECT_FALSE(link.take_outcome().has_value());
  EXPECT_EQ(link.counters().late_answers, 1U);
  reply({second.sequence, wire::ResetResponse{}});
  EXPECT_TRUE(link.take_outcome().has_value());
}

TEST_F(IsoTpPeripheralLinkTest, CallsADamagedAnswerGarbage) {
  link.request(wire::WakeUpRequest{}, now);
  exchange();
  const wire::PeripheralRequest request = received();
  Octets answer = wire::encode(wire::PeripheralResponse{request.sequence, wire::WakeUpResponse{}});
  answer[3] ^= 1;
  ASSERT_TRUE(peripheral.send(answer, now).has_value());
  exchange();
  const auto outcome = link.take_outcome();
  ASSERT_TRUE(outcome && !*outcome);
  EXPECT_EQ(outcome->error().kind, RequestFailure::garbage);
}

TEST_F(IsoTpPeripheralLinkTest, TakesWhatWaitedHoweverLateItsThreadLooks) {
  constexpr nanoseconds late = milliseconds(100);  // behind each time-out of the channel
  link.request(wire::WakeUpRequest{}, now);
  const auto request = link.poll(now);
  ASSERT_TRUE(request.has_value());
  peripheral.on_frame(*request, now);
  ASSERT_TRUE(
      peripheral
          .send(wire::encode(wire::PeripheralResponse{
                    received().sequence, wire::WakeUpResponse{wire::PeripheralStatus::ready, 1, Octets(65)}}),
                now)
          .has_value());
  const auto first = peripheral.poll(now);
  ASSERT_TRUE(first.has_value());

  // The echo of the request and the first frame have waited.
  now += late;
  link.on_transmit_confirm(*request, now);
  link.on_frame(*first, now);
  EXPECT_FALSE(link.take_outcome().has_value());
  const auto clear_to_send = link.poll(now);
  ASSERT_TRUE(clear_to_send.has_value());
  peripheral.on_frame(*clear_to_send, now);
  std::vector<wire::CanDataFrame> rest;
  while (const auto frame = peripheral.poll(now)) rest.push_back(*frame);
  ASSERT_EQ(rest.size(), 10U);

  // So have the echo of the flow control and all consecutive frames.
  now += late;
  link.on_transmit_confirm(*clear_to_send, now);
  for (const wire::CanDataFrame& frame : rest) link.on_frame(frame, now);
  const auto outcome = link.take_outcome();
  ASSERT_TRUE(outcome && *outcome);
  EXPECT_EQ(std::get<wire::WakeUpResponse>((*outcome)->body).measurement.size(), 65U);
}

TEST_F(IsoTpPeripheralLinkTest, CallsAnAnswerThatBreaksOffSilence) {
  link.request(wire::WakeUpRequest{}, now);
  exchange();
  const wire::PeripheralRequest request = received();
  const Octets answer = wire::encode(wire::PeripheralResponse{
      request.sequence, wire::WakeUpResponse{wire::PeripheralStatus::ready, 1, Octets(65)}});
  ASSERT_TRUE(peripheral.send(answer, now).has_value());
  link.on_frame(*peripheral.poll(now), now);  // the first frame only
  while (const auto frame = link.poll(now)) link.on_transmit_confirm(*frame, now);
  now += milliseconds(200);
  (void)link.poll(now);
  const auto outcome = link.take_outcome();
  ASSERT_TRUE(outcome && !*outcome);
  EXPECT_EQ(outcome->error().kind, RequestFailure::silent);
}

TEST_F(IsoTpPeripheralLinkTest, SaysThatARequestDidNotLeaveTheBus) {
  link.request(wire::WakeUpRequest{}, now);
  ASSERT_TRUE(link.poll(now).has_value());
  now += milliseconds(100);
  (void)link.poll(now);
  const auto outcome = link.take_outcome();
  ASSERT_TRUE(outcome && !*outcome);
  EXPECT_EQ(outcome->error().kind, RequestFailure::not_sent);
}

TEST_F(IsoTpPeripheralLinkTest, SendsNothingMoreAfterAbort) {
  link.request(wire::CommandRequest{7, 2, Octets(100)}, now);
  ASSERT_TRUE(link.poll(now).has_value());
  link.abort();
  frames = 0;
  exchange();
  EXPECT_EQ(frames, 0U);
  EXPECT_FALSE(link.take_outcome().has_value());
}

}  // namespace
}  // namespace srfs
