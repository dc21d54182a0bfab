// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <utility>

#include <gtest/gtest.h>

#include "nodes/payload/frame_peripheral_link.hpp"

namespace srfs {
namespace {

using wire::CanDataFrame;

constexpr std::uint32_t asks = 0x321;
constexpr std::uint32_t answers = 0x3A1;

CanDataFrame standard(std::uint32_t id, const Octets& data) {
  return wire::make_data_frame(id, false, data);
}

/// Wake-up: one frame; a measurement of two frames, the second asked for. Command: `function` frames.
class TwoPartProtocol final : public FrameProtocol {
 public:
  [[nodiscard]] std::vector<wire::CanIdentifierPair> identifiers() const override {
    return {{.request = asks, .answer = answers, .extended = false}};
  }
  [[nodiscard]] Frames begin(const PeripheralLink::Body& request) override {
    block_.clear();
    if (std::holds_alternative<wire::WakeUpRequest>(request)) return {standard(asks, {1})};
    if (const auto* command = std::get_if<wire::CommandRequest>(&request)) {
      const auto id = command->arguments.empty() ? asks : 0x111U;
      return Frames(command->function, standard(id, {2}));
    }
    return {};
  }
  [[nodiscard]] Heard hear(const CanDataFrame& frame) override {
    const OctetView data = frame.view();
    if (data.empty()) return not_understood("a frame without data");
    if (data[0] == 2) return carried_out(wire::PeripheralResult::done);
    block_.insert(block_.end(), data.begin() + 1, data.end());
    if (data[0] == 1) return SendMore{{standard(asks, {3})}};
    return measured(std::exchange(block_, {}));
  }

 private:
  Octets block_;
};

struct FrameLink : ::testing::Test {
  FramePeripheralLink link{std::make_unique<TwoPartProtocol>()};
  MonotonicTime now{seconds(3)};

  std::size_t sent() {
    std::size_t n = 0;
    while (link.poll(now)) ++n;
    return n;
  }
  RequestFailure failure() {
    const auto outcome = link.take_outcome();
    EXPECT_TRUE(outcome && !*outcome);
    return outcome && !*outcome ? outcome->error().kind : RequestFailure::silent;
  }
};

TEST_F(FrameLink, GathersAnAnswerThatIsAskedForInParts) {
  link.request(wire::WakeUpRequest{}, now);
  EXPECT_EQ(sent(), 1U);
  link.on_frame(standard(answers, {1, 10, 11}), now);
  EXPECT_FALSE(link.take_outcome());
  EXPECT_EQ(sent(), 1U);
  link.on_frame(standard(answers, {4, 12}), now);
  const auto outcome = link.take_outcome();
  ASSERT_TRUE(outcome && *outcome);
  EXPECT_EQ(std::get<wire::WakeUpResponse>((*outcome)->body).measurement, (Octets{10, 11, 12}));
  EXPECT_FALSE(link.take_outcome());
}

TEST_F(FrameLink, AnswersATelecommandWithItsId) {
  link.request(wire::CommandRequest{77, 1, {}}, now);
  link.on_frame(standard(answers, {2}), now);
  const auto outcome = link.take_outcome();
  ASSERT_TRUE(outcome && *outcome);
  EXPECT_EQ(std::get<wire::CommandResponse>((*outcome)->body).telecommand_id, 77U);
}

TEST_F(FrameLink, SaysThatARequestWasNotSent) {
  link.request(wire::ResetRequest{}, now);
  EXPECT_EQ(failure(), RequestFailure::not_sent) << "the protocol has none";
  link.request(wire::CommandRequest{1, FramePeripheralLink::frames_max + 1, {}}, now);
  EXPECT_EQ(failure(), RequestFailure::not_sent) << "more frames than fit";
  link.request(wire::CommandRequest{1, 1, {0}}, now);
  EXPECT_EQ(failure(), RequestFailure::not_sent) << "an identifier that nothing echoes";
  EXPECT_EQ(sent(), 0U);
}

TEST_F(FrameLink, SendsNothingMoreAfterAnEnd) {
  link.request(wire::CommandRequest{1, 5, {}}, now);
  EXPECT_TRUE(link.poll(now));
  link.on_frame(standard(answers, {}), now);
  EXPECT_EQ(failure(), RequestFailure::garbage);
  EXPECT_EQ(link.counters().transport_errors, 1U);
  EXPECT_EQ(sent(), 0U);
  link.on_frame(standard(answers, {2}), now);
  EXPECT_FALSE(link.take_outcome());
  EXPECT_EQ(link.counters().late_answers, 1U);
}

TEST_F(FrameLink, GivesARefusedFrameAgain) {
  link.request(wire::CommandRequest{1, 3, {}}, now);
  EXPECT_TRUE(link.poll(now));
  link.on_transmit_refused(now);
  EXPECT_FALSE(link.poll(now));
  ASSERT_EQ(link.next_deadline(), now + FramePeripheralLink::offered_again);
  now += FramePeripheralLink::offered_again;
  EXPECT_EQ(sent(), 3U);
  link.abort();
  link.on_transmit_refused(now);
  EXPECT_EQ(sent(), 0U) << "of a request that is forgotten";
}

TEST_F(FrameLink, HearsNothingButItsAnswers) {
  link.request(wire::WakeUpRequest{}, now);
  CanDataFrame extended = standard(answers, {2});
  extended.extended = true;
  link.on_frame(extended, now);
  link.on_frame(standard(asks, {2}), now);
  EXPECT_FALSE(link.take_outcome());
  EXPECT_EQ(link.counters().late_answers, 0U);
}

}  // namespace
}  // namespace srfs
