// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "lib/wire/test/link_vectors.hpp"
#include "wire/crc16.hpp"
#include "wire/tc_frame.hpp"

namespace srfs::wire {
namespace {

constexpr std::uint16_t spacecraft = 0xAB;

Octets with_first_octet(std::uint8_t value) {
  Octets frame = encode_tc_frame({.spacecraft_id = spacecraft, .vc = 1, .data = octets_of("c00102")});
  frame[0] = value;
  const std::uint16_t crc = crc16(OctetView(frame).first(frame.size() - 2));
  frame[frame.size() - 2] = static_cast<std::uint8_t>(crc >> 8);
  frame[frame.size() - 1] = static_cast<std::uint8_t>(crc & 0xFF);
  return frame;
}

TEST(TcFrame, EachFaultIsNamed) {
  using Error = TcFrameError;
  const auto error_of = [](const Octets& octets) { return decode_tc_frame(octets, spacecraft).error(); };
  const Octets good = with_first_octet(0x20);
  ASSERT_TRUE(decode_tc_frame(good, spacecraft));

  EXPECT_EQ(error_of(octets_of("20ab0406000102")), Error::too_short);
  EXPECT_EQ(error_of(Octets(1025)), Error::too_long);
  EXPECT_EQ(error_of(with_first_octet(0x60)), Error::bad_version);
  Octets longer = good;
  longer.push_back(0);
  EXPECT_EQ(error_of(longer), Error::wrong_length);
  Octets damaged = good;
  damaged[6] ^= 1;
  EXPECT_EQ(error_of(damaged), Error::bad_crc);
  EXPECT_EQ(error_of(with_first_octet(0x24)), Error::reserved_bits);
  EXPECT_EQ(error_of(with_first_octet(0x10)), Error::reserved_type);
  EXPECT_EQ(decode_tc_frame(good, 0xAC).error(), Error::wrong_spacecraft);
}

TEST(TcFrame, TheLongestFrameSurvives) {
  const TcFrame frame{.type = TcFrameType::ad,
                      .spacecraft_id = 0x3FF,
                      .vc = 63,
                      .sequence = 255,
                      .data = Octets(tc_data_octets_max, 9)};
  const Octets octets = encode_tc_frame(frame);
  EXPECT_EQ(octets.size(), tc_frame_octets_max);
  EXPECT_EQ(decode_tc_frame(octets, 0x3FF).value(), frame);
}

TEST(TcFrame, OnlyUnsegmentedDataOfMapZeroIsTaken) {
  EXPECT_EQ(to_hex(segment_payload(octets_of("c001")).value()), "01");
  EXPECT_EQ(segment_payload(octets_of("c0")).error(), SegmentError::no_payload);
  EXPECT_EQ(segment_payload(octets_of("4001")).error(), SegmentError::segmented);
  EXPECT_EQ(segment_payload(octets_of("c101")).error(), SegmentError::wrong_map);
}

TEST(TcFrame, ControlCommandsOtherThanUnlockAndSetVrAreUnknown) {
  for (const char* hex : {"", "01", "0000", "8200", "82002a00", "83002a", "82012a"}) {
    EXPECT_FALSE(decode_control_command(octets_of(hex))) << hex;
  }
  EXPECT_EQ(decode_control_command(octets_of("82002a"))->vr, 0x2A);
}

}  // namespace
}  // namespace srfs::wire
