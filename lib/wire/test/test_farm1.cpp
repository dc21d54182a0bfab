// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <string>

#include <gtest/gtest.h>

#include "lib/wire/test/link_vectors.hpp"
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

// CCSDS 232.1-B-2, table 6-1, transcribed independently. Before each event, all flags that the state can have
// are set, V(R) is 10 and the FARM-B counter is 5. V(R) and FARM-B stay unchanged unless the cell names them.
struct FarmRow {
  std::string_view name;
  FarmEvent event;
  std::array<std::string_view, 3> cells;  // S1 open, S2 wait, S3 lockout
};
const std::array<FarmRow, 10> standard{{
    {"E1", FarmEvent::e1_in_sequence, {"accept S1 vr=11", "discard S2 R W", "discard S3 R W L"}},
    {"E2", FarmEvent::e2_in_sequence_no_buffer, {"discard S2 R W", "discard S2 R W", "discard S3 R W L"}},
    {"E3", FarmEvent::e3_in_positive_window, {"discard S1 R", "discard S2 R W", "discard S3 R W L"}},
    {"E4", FarmEvent::e4_in_negative_window, {"discard S1 R", "discard S2 R W", "discard S3 R W L"}},
    {"E5", FarmEvent::e5_outside_window, {"discard S3 R L", "discard S3 R W L", "discard S3 R W L"}},
    {"E6", FarmEvent::e6_expedited, {"accept S1 R b=6", "accept S2 R W b=6", "accept S3 R W L b=6"}},
    {"E7", FarmEvent::e7_unlock, {"control S1 b=6", "control S1 b=6", "control S1 b=6"}},
    {"E8", FarmEvent::e8_set_vr, {"control S1 vr=200 b=6", "control S1 vr=200 b=6", "control S3 R W L b=6"}},
    {"E9", FarmEvent::e9_invalid, {"discard S1 R", "discard S2 R W", "discard S3 R W L"}},
    {"E10", FarmEvent::e10_buffer_released, {"none S1 R", "none S1 R", "none S3 R L"}},
}};
const std::array<FarmState, 3> before{{
    {.mode = FarmMode::open, .vr = 10, .retransmit = true, .farm_b_counter = 5},
    {.mode = FarmMode::wait, .vr = 10, .wait = true, .retransmit = true, .farm_b_counter = 5},
    {.mode = FarmMode::lockout,
     .vr = 10,
     .lockout = true,
     .wait = true,
     .retransmit = true,
     .farm_b_counter = 5},
}};

std::string text(const FarmState& was, const FarmOutcome& outcome) {
  std::string text = outcome.verdict == FarmVerdict::discard            ? "discard"
                     : outcome.verdict == FarmVerdict::control_executed ? "control"
                     : outcome.verdict == FarmVerdict::none             ? "none"
                                                                        : "accept";
  const FarmState& after = outcome.state;
  text += " S" + std::to_string(static_cast<int>(after.mode) + 1);
  if (after.retransmit) text += " R";
  if (after.wait) text += " W";
  if (after.lockout) text += " L";
  if (after.vr != was.vr) text += " vr=" + std::to_string(after.vr);
  if (after.farm_b_counter != was.farm_b_counter) text += " b=" + std::to_string(after.farm_b_counter);
  return text;
}

TEST(FarmOneTable, IsTheStandardsRowByRowE1ToE10) {
  for (const auto& row : standard) {
    for (std::size_t state = 0; state < before.size(); ++state) {
      EXPECT_EQ(text(before[state], farm_step(before[state], row.event, 200)), row.cells[state])
          << row.name << " in S" << state + 1;
    }
  }
}

TEST(FarmOneTable, E11ReportsEachStateInTheBitsOfTheClcw) {
  // 0 vvvvvv: type, version, status, COP 1; VC; two spare; no RF, no bit lock, lockout, wait, retransmit,
  // FARM-B (2), spare; N(R). VC 9.
  EXPECT_EQ(encode_clcw(make_clcw({.vr = 10}, 9)), 0x0124000AU);
  EXPECT_EQ(encode_clcw(make_clcw({.vr = 10, .retransmit = true}, 9)), 0x0124080AU);
  EXPECT_EQ(encode_clcw(make_clcw(before[0], 9)), 0x01240A0AU);
  EXPECT_EQ(encode_clcw(make_clcw(before[1], 9)), 0x01241A0AU);
  EXPECT_EQ(encode_clcw(make_clcw(before[2], 9)), 0x01243A0AU);
}

TEST(FarmOneTable, EveryFrameTypeIsItsEvent) {
  const FarmState state{.vr = 10};
  EXPECT_EQ(farm_window_default, 64);
  EXPECT_EQ(classify(state, ad(10), true), FarmEvent::e1_in_sequence);
  EXPECT_EQ(classify(state, ad(10), false), FarmEvent::e2_in_sequence_no_buffer);
  EXPECT_EQ(classify(state, ad(11), true), FarmEvent::e3_in_positive_window);
  EXPECT_EQ(classify(state, ad(10 + 31), true), FarmEvent::e3_in_positive_window);
  EXPECT_EQ(classify(state, ad(9), true), FarmEvent::e4_in_negative_window);
  EXPECT_EQ(classify(state, ad(static_cast<std::uint8_t>(10 - 32)), true), FarmEvent::e4_in_negative_window);
  EXPECT_EQ(classify(state, ad(10 + 32), true), FarmEvent::e5_outside_window);
  EXPECT_EQ(classify(state, ad(static_cast<std::uint8_t>(10 - 33)), true), FarmEvent::e5_outside_window);
  EXPECT_EQ(classify(state, bd(), false), FarmEvent::e6_expedited);
  EXPECT_EQ(classify(state, bc({0x00}), true), FarmEvent::e7_unlock);
  EXPECT_EQ(classify(state, bc({0x82, 0x00, 0x2A}), true), FarmEvent::e8_set_vr);
  for (const Octets& unknown : {Octets{0x01}, Octets{0x00, 0x00}, Octets{0x82}, Octets{0x82, 0x01, 0x2A},
                                Octets{0x82, 0x00, 0x2A, 0x00}})
    EXPECT_EQ(classify(state, bc(unknown), true), FarmEvent::e9_invalid);
}

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
