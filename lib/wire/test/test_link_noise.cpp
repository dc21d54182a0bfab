// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Jamming and noise on both directions of the ground link. `./run bench link --link-parts noise` prints the
// figures.
#include <gtest/gtest.h>

#include "tests/link_noise.hpp"

namespace srfs::wire {
namespace {

using testing_support::Disturbance;
using testing_support::Downlink;
using testing_support::NoisyLine;
using testing_support::Uplink;

constexpr int trials = 100;
/// A start sequence that noise imitates may claim the longest frame: until its blocks fail.
constexpr std::size_t longest_cltu =
    cltu_start_sequence.size() + cltu_tail_sequence.size() +
    (tc_frame_octets_max + bch_information_octets - 1) / bch_information_octets * bch_block_octets;

TEST(LinkNoise, TelemetryIsBackWithTheSecondCaduAfterAnyDisturbance) {
  for (const Disturbance disturbance : testing_support::all_disturbances) {
    NoisyLine noise(1);
    for (int trial = 0; trial < trials; ++trial) {
      const auto octets = testing_support::octets_to_acquire(Downlink(), disturbance, noise);
      ASSERT_TRUE(octets) << to_text(disturbance);
      EXPECT_LT(*octets, 2 * Downlink::unit_octets()) << to_text(disturbance);
    }
  }
}

TEST(LinkNoise, TelecommandsAreTakenAgainAfterAnyDisturbance) {
  for (const Disturbance disturbance : testing_support::all_disturbances) {
    NoisyLine noise(2);
    for (int trial = 0; trial < trials; ++trial) {
      const auto octets = testing_support::octets_to_acquire(Uplink(), disturbance, noise);
      ASSERT_TRUE(octets) << to_text(disturbance);
      EXPECT_LT(*octets, longest_cltu + 2 * Uplink().unit_octets()) << to_text(disturbance);
    }
  }
}

TEST(LinkNoise, ATelecommandBehindAJamIsTakenWhenTheLineIsSilentAtTheLatest) {
  NoisyLine noise(3);
  for (int trial = 0; trial < 5 * trials; ++trial) {
    Uplink uplink;
    EXPECT_FALSE(uplink.take(noise.jam(1 + noise.number(3000))));
    const bool at_once = uplink.take(uplink.next_unit());
    EXPECT_TRUE(at_once || uplink.silence()) << trial;
  }
}

/// @return units that were accepted of @p units, in noise
template <class Direction>
std::uint64_t accepted_in_noise(Direction& direction, double rate, std::uint64_t units, std::uint64_t seed) {
  NoisyLine noise(seed);
  for (std::uint64_t i = 0; i < units; ++i) {
    Octets unit = direction.next_unit();
    noise.spoil_bits(unit, rate);
    direction.take(unit);
  }
  return direction.accepted();
}

TEST(LinkNoise, OneBitInAThousandCostsNoTelemetry) {
  Downlink downlink;
  EXPECT_EQ(accepted_in_noise(downlink, 1e-3, 1000, 4), 1000U);
  EXPECT_GT(downlink.corrected(), 1000U);
}

TEST(LinkNoise, TelecommandsPassNoiseThatHasOneBitInABlock) {
  Uplink uplink;
  EXPECT_GE(accepted_in_noise(uplink, 1e-4, 1000, 5), 995U);
}

TEST(LinkNoise, HalfTheBitsWrongIsNoTelemetryAndNoTelecommand) {
  Downlink downlink;
  EXPECT_EQ(accepted_in_noise(downlink, 0.5, 300, 6), 0U);
  Uplink uplink;
  EXPECT_EQ(accepted_in_noise(uplink, 0.5, 300, 7), 0U);
}

}  // namespace
}  // namespace srfs::wire
