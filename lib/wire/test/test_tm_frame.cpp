// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "lib/wire/test/link_vectors.hpp"
#include "wire/crc16.hpp"
#include "wire/tm_frame.hpp"

namespace srfs::wire {
namespace {

constexpr std::uint16_t spacecraft = 0xAB;
constexpr std::uint32_t clcw = 0x01040006;

Octets packet_of(std::size_t data_octets, std::uint16_t count = 0) {
  return encode_space_packet({.apid = 3, .sequence_count = count},
                             Octets(data_octets, static_cast<std::uint8_t>(count)));
}
TmFrame decoded(const Octets& octets) {
  return decode_tm_frame(octets, spacecraft, octets.size()).value();
}
TmFrameBuilder builder_of(std::size_t frame_octets) {
  return TmFrameBuilder({.spacecraft_id = spacecraft, .frame_octets = frame_octets});
}

TEST(TmFrame, EachFaultIsNamed) {
  using Error = TmFrameError;
  const Octets good = builder_of(40).build(0, clcw);
  const auto error_of = [&](std::size_t at, std::uint8_t value) {
    Octets octets = good;
    octets[at] = value;
    const std::uint16_t crc = crc16(OctetView(octets).first(octets.size() - 2));
    octets[octets.size() - 2] = static_cast<std::uint8_t>(crc >> 8);
    octets[octets.size() - 1] = static_cast<std::uint8_t>(crc & 0xFF);
    return decode_tm_frame(octets, spacecraft, 40).error();
  };
  EXPECT_EQ(decode_tm_frame(good, spacecraft, 41).error(), Error::wrong_length);
  Octets damaged = good;
  damaged[20] ^= 1;
  EXPECT_EQ(decode_tm_frame(damaged, spacecraft, 40).error(), Error::bad_fecf);
  EXPECT_EQ(error_of(0, 0x4A), Error::bad_version);
  EXPECT_EQ(error_of(0, 0x0B), Error::wrong_spacecraft);
  EXPECT_EQ(error_of(1, 0xB0), Error::no_ocf);
  for (const std::uint8_t status : octets_of("98583810"))
    EXPECT_EQ(error_of(4, status), Error::bad_data_status);
  EXPECT_EQ(error_of(5, 28), Error::bad_header_pointer);
}

TEST(TmFrameBuilder, CountsEveryChannelAndTheMasterChannel) {
  TmFrameBuilder builder = builder_of(40);
  for (int i = 0; i < 300; ++i) {
    const TmFrame live = decoded(builder.build(0, clcw));
    EXPECT_EQ(live.master_count, static_cast<std::uint8_t>(2 * i));
    EXPECT_EQ(live.vc_count, static_cast<std::uint8_t>(i));
    const TmFrame idle = decoded(builder.build_idle(clcw));
    EXPECT_EQ(idle.master_count, static_cast<std::uint8_t>(2 * i + 1));
    EXPECT_EQ(idle.vc, tm_idle_vc);
    EXPECT_EQ(idle.first_header, only_idle_data);
  }
}

TEST(TmFrameBuilder, APacketSpansFramesAndTheHeaderPointerShowsTheNextOne) {
  TmFrameBuilder builder = builder_of(40);  // 28 octets of data in each frame
  ASSERT_TRUE(builder.queue_packet(1, packet_of(54)));
  ASSERT_TRUE(builder.queue_packet(1, packet_of(2)));
  EXPECT_EQ(builder.queued_octets(1), 68U);
  EXPECT_EQ(decoded(builder.build(1, clcw)).first_header, 0);
  EXPECT_EQ(builder.queued_octets(1), 40U);
  EXPECT_EQ(decoded(builder.build(1, clcw)).first_header, no_packet_starts);
  EXPECT_EQ(decoded(builder.build(1, clcw)).first_header, 4);
  EXPECT_EQ(builder.queued_octets(1), 0U);
}

TEST(TmFrameBuilder, LessRoomThanAnIdlePacketNeedsIsFilledByOneThatGoesOn) {
  TmFrameBuilder builder = builder_of(40);
  TmPacketReassembly reassembly;
  ASSERT_TRUE(builder.queue_packet(0, packet_of(19)));  // leaves three octets
  auto packets = reassembly.push(decoded(builder.build(0, clcw)));
  ASSERT_EQ(packets.size(), 1U);
  EXPECT_EQ(builder.queued_octets(0), 0U);
  ASSERT_TRUE(builder.queue_packet(0, packet_of(5)));
  const TmFrame next = decoded(builder.build(0, clcw));
  EXPECT_EQ(next.first_header, 4);
  EXPECT_EQ(reassembly.push(next).size(), 1U);
  EXPECT_EQ(reassembly.counters().header_mismatches, 0U);
}

TEST(TmFrameBuilder, AFullQueueRefusesTheNewestPacketAndCountsIt) {
  TmFrameBuilder builder({.spacecraft_id = spacecraft, .frame_octets = 40, .queue_octets_max = 20});
  EXPECT_TRUE(builder.queue_packet(0, packet_of(10)));
  EXPECT_EQ(builder.free_octets(0), 4U);
  EXPECT_FALSE(builder.queue_packet(0, packet_of(1)));
  EXPECT_EQ(builder.counters(0).refused_packets, 1U);
  EXPECT_TRUE(builder.queue_packet(1, packet_of(1))) << "channels do not share their queues";
}

TEST(TmFrameDecoder, CountsFramesMissingFromTheMasterChannel) {
  TmFrameBuilder builder = builder_of(40);
  TmFrameDecoder decoder(spacecraft, 40);
  EXPECT_TRUE(decoder.decode(builder.build(0, clcw)));
  (void)builder.build(0, clcw);
  (void)builder.build_idle(clcw);
  EXPECT_TRUE(decoder.decode(builder.build(0, clcw)));
  EXPECT_FALSE(decoder.decode(Octets(40)));
  EXPECT_EQ(decoder.counters().frames, 2U);
  EXPECT_EQ(decoder.counters().lost, 2U);
  EXPECT_EQ(decoder.counters().refused[static_cast<std::size_t>(TmFrameError::bad_fecf)], 1U);
}

TEST(TmPacketReassembly, AMissingFrameCostsOnlyThePacketsItTouched) {
  TmFrameBuilder builder = builder_of(40);
  for (std::uint16_t i = 0; i < 20; ++i)
    ASSERT_TRUE(builder.queue_packet(0, packet_of(34, i)));  // 40 octets each
  TmPacketReassembly reassembly;
  std::vector<Octets> packets;
  for (int i = 0; builder.queued_octets(0) > 0; ++i) {
    const TmFrame frame = decoded(builder.build(0, clcw));
    if (i == 5) continue;  // octets 140 to 167: parts of packets 3 and 4
    for (Octets& packet : reassembly.push(frame)) packets.push_back(std::move(packet));
  }
  ASSERT_EQ(packets.size(), 18U);
  EXPECT_EQ(packets[2], packet_of(34, 2));
  EXPECT_EQ(packets[3], packet_of(34, 5));
  EXPECT_EQ(reassembly.counters().lost_frames, 1U);
  EXPECT_EQ(reassembly.counters().cut_packets, 1U);
}

TEST(TmPacketReassembly, AHeaderPointerThatContradictsThePacketUnderWayDropsThatPacket) {
  TmPacketReassembly reassembly;
  Octets first = packet_of(30);  // 36 octets, of which this frame has 28
  first.resize(28);
  EXPECT_TRUE(reassembly.push({.vc_count = 0, .first_header = 0, .data = first}).empty());
  Octets second(4, 0);
  const Octets whole = packet_of(18, 9);
  second.insert(second.end(), whole.begin(), whole.end());
  const auto packets = reassembly.push({.vc_count = 1, .first_header = 4, .data = second});
  ASSERT_EQ(packets.size(), 1U);
  EXPECT_EQ(packets[0], whole);
  EXPECT_EQ(reassembly.counters().header_mismatches, 1U);
  EXPECT_EQ(reassembly.counters().cut_packets, 1U);
}

TEST(TmPacketReassembly, APacketThatEndsInsideAFrameWithoutHeaderPointerIsNotBelieved) {
  TmPacketReassembly reassembly;
  Octets first = packet_of(30);
  first.resize(28);
  (void)reassembly.push({.vc_count = 0, .first_header = 0, .data = first});
  (void)reassembly.push({.vc_count = 1, .first_header = no_packet_starts, .data = Octets(28, 0)});
  EXPECT_EQ(reassembly.counters().header_mismatches, 1U);
  EXPECT_EQ(reassembly.push({.vc_count = 2, .first_header = 0, .data = packet_of(22)}).size(), 1U);
}

TEST(TmPacketReassembly, WaitsForAHeaderBeforeTheFirstPacket) {
  TmPacketReassembly reassembly;
  EXPECT_TRUE(
      reassembly.push({.vc_count = 7, .first_header = no_packet_starts, .data = Octets(28, 1)}).empty());
  Octets data(3, 0xFF);
  const Octets packet = packet_of(19);
  data.insert(data.end(), packet.begin(), packet.end());
  EXPECT_EQ(reassembly.push({.vc_count = 8, .first_header = 3, .data = data}).size(), 1U);
  EXPECT_EQ(reassembly.counters().header_mismatches, 0U);
}

TEST(TmPacketReassembly, APacketOverTheLimitIsTakenForNonsense) {
  TmPacketReassembly reassembly(100);
  Octets data = packet_of(200);
  data.resize(28);
  EXPECT_TRUE(reassembly.push({.vc_count = 0, .first_header = 0, .data = data}).empty());
  EXPECT_EQ(reassembly.counters().bad_packets, 1U);
}

}  // namespace
}  // namespace srfs::wire
