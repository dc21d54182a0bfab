#include <gtest/gtest.h>

#include "unit/wire/link_vectors.hpp"
#include "wire/farm1.hpp"

namespace srfs::wire {
namespace {

TcFrame ad(std::uint8_t sequence) {
  return {.type = TcFrameType::ad, .spacecraft_id = 0xAB, .sequence = sequence, .data = {0xC0, 1}};
}
TcFrame bd() {
  return {.type = TcFrameType::bd, .spacecraft_id = 0xAB, .data = {0xC0, 1}};
}
TcFrame bc(Octets data) {
  return {.type = TcFrameType::bc, .spacecraft_id = 0xAB, .data = std::move(data)};
}
const FarmState locked{.mode = FarmMode::lockout, .vr = 10, .lockout = true, .retransmit = true};
const FarmState waiting{.mode = FarmMode::wait, .vr = 10, .wait = true, .retransmit = true};

TEST(FarmOne, AcceptsTheExpectedFrameAndCountsModulo256) {
  const auto outcome = farm_receive({.vr = 255, .retransmit = true}, ad(255), true);
  EXPECT_EQ(outcome.verdict, FarmVerdict::accept_sequenced);
  EXPECT_EQ(outcome.state, (FarmState{.vr = 0}));
}

TEST(FarmOne, AsksForRetransmissionAfterAGap) {
  const auto outcome = farm_receive({.vr = 10}, ad(11), true);
  EXPECT_EQ(outcome.verdict, FarmVerdict::discard);
  EXPECT_EQ(outcome.state, (FarmState{.vr = 10, .retransmit = true}));
}

TEST(FarmOne, DropsARepeatedFrameQuietly) {
  const auto outcome = farm_receive({.vr = 10}, ad(9), true);
  EXPECT_EQ(outcome.verdict, FarmVerdict::discard);
  EXPECT_EQ(outcome.state, (FarmState{.vr = 10}));
}

TEST(FarmOne, WindowsHaveTheirStandardBordersForEveryVr) {
  for (int vr = 0; vr < 256; ++vr) {
    const FarmState state{.vr = static_cast<std::uint8_t>(vr)};
    for (int distance = 0; distance < 256; ++distance) {
      const FarmEvent event = classify(state, ad(static_cast<std::uint8_t>(vr + distance)), true, 64);
      const FarmEvent expected = distance == 0     ? FarmEvent::e1_in_sequence
                                 : distance <= 31  ? FarmEvent::e3_in_positive_window
                                 : distance >= 224 ? FarmEvent::e4_in_negative_window
                                                   : FarmEvent::e5_outside_window;
      ASSERT_EQ(event, expected) << vr << ' ' << distance;
    }
  }
}

TEST(FarmOne, LocksOutOnAFrameOutsideTheWindow) {
  const auto outcome = farm_receive({.vr = 10}, ad(42), true);
  EXPECT_EQ(outcome.verdict, FarmVerdict::discard);
  EXPECT_EQ(outcome.state, (FarmState{.mode = FarmMode::lockout, .vr = 10, .lockout = true}));
  EXPECT_EQ(farm_receive(outcome.state, ad(10), true).verdict, FarmVerdict::discard);
}

TEST(FarmOne, WaitsWithoutABufferAndGoesOnWhenItIsReleased) {
  auto outcome = farm_receive({.vr = 10}, ad(10), false);
  EXPECT_EQ(outcome.verdict, FarmVerdict::discard);
  EXPECT_EQ(outcome.state, waiting);

  outcome = farm_receive(outcome.state, ad(10), false);
  EXPECT_EQ(outcome.state, waiting);

  outcome = farm_step(outcome.state, FarmEvent::e10_buffer_released);
  EXPECT_EQ(outcome.verdict, FarmVerdict::none);
  EXPECT_EQ(outcome.state, (FarmState{.vr = 10, .retransmit = true}));
  EXPECT_EQ(farm_receive(outcome.state, ad(10), true).verdict, FarmVerdict::accept_sequenced);
}

TEST(FarmOne, ABufferReleasedInLockoutClearsOnlyTheWaitFlag) {
  FarmState state = locked;
  state.wait = true;
  EXPECT_EQ(farm_step(state, FarmEvent::e10_buffer_released).state, locked);
}

TEST(FarmOne, PassesExpeditedFramesInEveryStateAndCountsThem) {
  for (const FarmState& state : {FarmState{.vr = 10}, waiting, locked}) {
    const auto outcome = farm_receive(state, bd(), false);
    FarmState expected = state;
    ++expected.farm_b_counter;
    EXPECT_EQ(outcome.verdict, FarmVerdict::accept_expedited);
    EXPECT_EQ(outcome.state, expected);
  }
}

TEST(FarmOne, UnlockOpensFromEveryState) {
  for (const FarmState& state : {FarmState{.vr = 10, .retransmit = true}, waiting, locked}) {
    const auto outcome = farm_receive(state, bc({0x00}), true);
    EXPECT_EQ(outcome.verdict, FarmVerdict::control_executed);
    EXPECT_EQ(outcome.state, (FarmState{.vr = 10, .farm_b_counter = 1}));
  }
}

TEST(FarmOne, SetVrWorksUnlessLockedOut) {
  for (const FarmState& state : {FarmState{.vr = 10, .retransmit = true}, waiting}) {
    EXPECT_EQ(farm_receive(state, bc({0x82, 0x00, 0x2A}), true).state,
              (FarmState{.vr = 0x2A, .farm_b_counter = 1}));
  }
  FarmState expected = locked;
  ++expected.farm_b_counter;
  EXPECT_EQ(farm_receive(locked, bc({0x82, 0x00, 0x2A}), true).state, expected);
}

TEST(FarmOne, AnUnknownControlCommandChangesNothing) {
  const auto outcome = farm_receive(locked, bc({0x01}), true);
  EXPECT_EQ(outcome.verdict, FarmVerdict::discard);
  EXPECT_EQ(outcome.state, locked);
}

TEST(Clcw, ReportsTheFarm) {
  FarmState state = locked;
  state.farm_b_counter = 7;
  const Clcw clcw = make_clcw(state, 5);
  EXPECT_EQ(clcw,
            (Clcw{.vc = 5, .lockout = true, .retransmit = true, .farm_b_counter = 3, .report_value = 10}));
  EXPECT_EQ(decode_clcw(encode_clcw(clcw)).value(), clcw);
}

TEST(Clcw, IsReadStrictly) {
  EXPECT_TRUE(decode_clcw(0x01040006));
  EXPECT_EQ(decode_clcw(0x81040006).error(), ClcwError::not_a_clcw);
  EXPECT_EQ(decode_clcw(0x21040006).error(), ClcwError::not_a_clcw);
  EXPECT_EQ(decode_clcw(0x00040006).error(), ClcwError::not_cop1);
  EXPECT_EQ(decode_clcw(0x01050006).error(), ClcwError::reserved_bits);
  EXPECT_EQ(decode_clcw(0x01040106).error(), ClcwError::reserved_bits);
}

}  // namespace
}  // namespace srfs::wire
