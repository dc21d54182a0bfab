// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/tm_sdls.hpp"

#include <gtest/gtest.h>

#include <random>

#include "wire/crc16.hpp"
#include "wire/tm_frame.hpp"

namespace srfs::wire {
namespace {

constexpr std::uint16_t spacecraft = 0xAB;
constexpr std::uint16_t spi = 16;
constexpr std::size_t frame_octets = 80;

TmAuthenticator authenticator(std::uint8_t key = 7) {
  return std::move(*TmAuthenticator::create(SdlsKey(std::array<std::uint8_t, sdls_key_octets>{key})));
}
TmSeal seal() {
  return {.spi = spi, .authenticator = authenticator()};
}
TmFrame some_frame() {
  return {.spacecraft_id = spacecraft,
          .vc = 1,
          .master_count = 200,
          .vc_count = 3,
          .first_header = 4,
          .ocf = 0x01040006,
          .data = Octets(frame_octets - tm_frame_overhead_octets - tm_sdls_overhead_octets, 0x33)};
}
Octets some_octets(std::uint64_t number = 5) {
  TmSeal with = seal();
  return encode_tm_frame(some_frame(), with, number);
}
/// With a right FECF whatever stands before it: a stranger can make one.
Octets with_fecf(Octets octets) {
  const std::uint16_t crc = crc16(OctetView(octets).first(octets.size() - tm_fecf_octets));
  octets[octets.size() - 2] = static_cast<std::uint8_t>(crc >> 8);
  octets[octets.size() - 1] = static_cast<std::uint8_t>(crc & 0xFF);
  return octets;
}
struct Opened {
  TmFrame frame;
  std::uint64_t number;
};
Result<Opened, TmSdlsError> open(const Octets& octets, std::uint16_t of = spi, std::uint8_t key = 7) {
  auto frame = decode_tm_frame(octets, spacecraft, octets.size());
  EXPECT_TRUE(frame) << to_string(frame.error());
  TmAuthenticator with = authenticator(key);
  const auto number = tm_sdls_open(octets, *frame, of, with);
  if (!number) return Err(number.error());
  return Opened{*frame, *number};
}

TEST(TmSdls, GivesFrameAndNumberBack) {
  for (const std::uint64_t number : {std::uint64_t{0}, std::uint64_t{0x123456789ABC}, tm_sdls_number_max}) {
    const Octets octets = some_octets(number);
    EXPECT_EQ(octets.size(), frame_octets);
    const auto opened = open(octets);
    ASSERT_TRUE(opened);
    EXPECT_EQ(opened->frame, some_frame());
    EXPECT_EQ(opened->number, number);
  }
}

TEST(TmSdls, NoBitOfAFrameCanBeChangedNotOfItsControlWordNorOfItsCounters) {
  const Octets good = some_octets();
  for (std::size_t bit = 0; bit < (good.size() - tm_fecf_octets) * 8; ++bit) {
    Octets bad = good;
    bad[bit / 8] ^= static_cast<std::uint8_t>(0x80 >> bit % 8);
    bad = with_fecf(std::move(bad));
    auto frame = decode_tm_frame(bad, spacecraft, bad.size());
    if (!frame) continue;  // refused before: version, spacecraft, flags
    TmAuthenticator with = authenticator();
    EXPECT_FALSE(tm_sdls_open(bad, *frame, spi, with)) << bit;
  }
}

TEST(TmSdls, AFrameIsBoundToItsKeyAndAssociation) {
  const Octets good = some_octets();
  EXPECT_EQ(open(good, spi + 1).error(), TmSdlsError::wrong_spi);
  EXPECT_EQ(open(good, spi, 8).error(), TmSdlsError::bad_mac);
}

TEST(TmSdls, WithoutAKeyTheLayoutStaysAndNothingIsAuthentic) {
  TmSeal keyless{.spi = spi, .authenticator = {}};
  const Octets octets = encode_tm_frame(some_frame(), keyless, 5);
  EXPECT_EQ(octets.size(), frame_octets);
  EXPECT_EQ(crc16(octets), 0);
  EXPECT_EQ(open(octets).error(), TmSdlsError::bad_mac);
}

TEST(TmSdls, RefusesFramesWithoutRoomAndPointersIntoTheMac) {
  TmFrame small = some_frame();
  small.first_header = no_packet_starts;
  small.data = Octets(tm_sdls_overhead_octets, 0);
  EXPECT_EQ(open(encode_tm_frame(small)).error(), TmSdlsError::too_short);

  TmFrame pointing = some_frame();
  pointing.first_header = static_cast<std::uint16_t>(pointing.data.size());
  TmSeal with = seal();
  EXPECT_EQ(open(encode_tm_frame(pointing, with, 5)).error(), TmSdlsError::bad_header_pointer);
}

TEST(TmSdls, WhatCannotBeOpenedStaysAsItWas) {
  const Octets octets = some_octets();
  auto frame = decode_tm_frame(octets, spacecraft, octets.size());
  const TmFrame unopened = *frame;
  TmAuthenticator other = authenticator(9);
  EXPECT_FALSE(tm_sdls_open(octets, *frame, spi, other));
  EXPECT_EQ(*frame, unopened);
}

/// Property: whatever is queued, on whatever channels, comes out of sealed frames as it went in.
TEST(TmSdls, PacketsOfAllChannelsPassThroughSealedFrames) {
  std::mt19937 random(7);
  for (int round = 0; round < 200; ++round) {
    const std::size_t octets = tm_frame_octets_min + tm_sdls_overhead_octets + random() % 300;
    TmFrameBuilder builder({.spacecraft_id = spacecraft, .frame_octets = octets}, seal());
    EXPECT_EQ(builder.field_octets(), octets - tm_frame_overhead_octets - tm_sdls_overhead_octets);
    std::array<std::vector<Octets>, 3> sent;
    std::array<std::vector<Octets>, 3> received;
    std::array<TmPacketReassembly, 3> channels;
    TmAuthenticator with = authenticator();
    std::uint64_t number = 0;
    const auto pass = [&](const Octets& line) {
      auto frame = decode_tm_frame(line, spacecraft, octets);
      ASSERT_TRUE(frame);
      ASSERT_EQ(tm_sdls_open(line, *frame, spi, with), number);
      if (frame->vc == tm_idle_vc) return;
      for (Octets& packet : channels.at(frame->vc).push(*frame))
        received.at(frame->vc).push_back(std::move(packet));
    };
    for (int i = 0; i < 30; ++i) {
      const auto vc = static_cast<std::uint8_t>(random() % 3);
      Octets packet =
          encode_space_packet({.apid = 5}, Octets(1 + random() % 400, static_cast<std::uint8_t>(i)));
      if (builder.queue_packet(vc, packet)) sent.at(vc).push_back(std::move(packet));
      ++number;
      pass(random() % 4 == 0 ? builder.build_idle(1, number) : builder.build(vc, 1, number));
    }
    for (std::uint8_t vc = 0; vc < 3; ++vc) {
      while (builder.queued_octets(vc) > 0) pass(builder.build(vc, 1, ++number));
      EXPECT_EQ(received.at(vc), sent.at(vc));
    }
  }
}

}  // namespace
}  // namespace srfs::wire
