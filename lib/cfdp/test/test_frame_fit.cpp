// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/frame_fit.hpp"

#include <gtest/gtest.h>

#include <random>

namespace srfs::cfdp {
namespace {

constexpr std::size_t header = 16;
constexpr std::size_t most = 950;
constexpr FrameFill fresh{.octets = 211, .filled = 0, .overhead = 6};

/// Sends 1 MiB in frames that are lost with probability @p loss. @return the estimate, and the share of file
/// octets that arrived
std::pair<FrameFit, double> after_a_mib(double loss, unsigned seed) {
  std::mt19937_64 random(seed);
  std::bernoulli_distribution lost(loss);
  FrameFit fit;
  FrameFill frame = fresh;
  double on_line = 0;
  double arrived = 0;
  bool frame_lost = lost(random);
  while (on_line < 1 << 20) {
    const std::size_t octets = fit.file_octets(frame, header, most);
    const std::size_t pdu = octets + header;
    fit.on_sent(frame, pdu, octets);
    bool spoiled = frame.filled > 0 ? frame_lost : (frame_lost = lost(random));
    for (std::size_t i = 0; i < (frame.filled + pdu + frame.overhead - 1) / frame.octets; ++i) {
      frame_lost = lost(random);
      spoiled = spoiled || frame_lost;
    }
    if (spoiled) fit.on_lost(octets);
    frame = frame.behind(pdu);
    on_line += static_cast<double>(pdu + frame.overhead);
    arrived += spoiled ? 0 : static_cast<double>(octets);
  }
  return {fit, arrived / on_line};
}

TEST(FrameFits, WhereNothingIsLostPdusAreAsLongAsTheyMayBe) {
  const auto [fit, yield] = after_a_mib(0, 1);
  EXPECT_EQ(fit.file_octets(fresh, header, most), most);
  EXPECT_GT(yield, 0.97);
}

TEST(FrameFits, TheMoreFramesAreLostTheShorterAPdu) {
  EXPECT_EQ(after_a_mib(0.3, 1).first.file_octets(fresh, header, most), 211U - 22);
  EXPECT_EQ(after_a_mib(0.1, 1).first.file_octets(fresh, header, most), 211U - 22);
  EXPECT_GT(after_a_mib(0.02, 1).first.file_octets(fresh, header, most), 211U);
}

TEST(FrameFits, TheEstimateIsNearTheTruthAndTheYieldNearTheBest) {
  for (const double loss : {0.01, 0.03, 0.1, 0.3}) {
    const auto [fit, yield] = after_a_mib(loss, 7);
    EXPECT_NEAR(fit.frame_loss(), loss, 0.3 * loss + 0.01) << loss;
    // Compare with one PDU per frame, none across two frames. At small losses longer PDUs are better.
    EXPECT_GT(yield, 0.98 * (211 - 22) / 211.0 * (1 - loss)) << loss;
  }
}

TEST(FrameFits, APduEndsWithAFrameWhereverItBegins) {
  FrameFit fit = after_a_mib(0.1, 1).first;
  for (std::size_t filled = 0; filled < 211; ++filled) {
    const FrameFill frame{.octets = 211, .filled = filled, .overhead = 6};
    const std::size_t octets = fit.file_octets(frame, header, most);
    EXPECT_EQ(frame.behind(octets + header).filled, 0U) << filled;
    EXPECT_GE(octets, 64U) << filled;
    EXPECT_LE(octets, most) << filled;
  }
}

TEST(FrameFits, FramesLongerThanAnyPduAreLeftAsTheyAre) {
  FrameFit fit;
  fit.on_lost(8192);
  EXPECT_EQ(fit.file_octets({.octets = 1103, .filled = 5, .overhead = 6}, header, most), most);
}

TEST(FrameFits, ALinkWithoutFramesHasTheLongestPdus) {
  FrameFit fit;
  fit.on_lost(100'000);
  EXPECT_EQ(fit.file_octets({}, header, most), most);
}

}  // namespace
}  // namespace srfs::cfdp
