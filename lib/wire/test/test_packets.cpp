// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "lib/wire/test/link_vectors.hpp"
#include "wire/crc16.hpp"
#include "wire/cuc.hpp"
#include "wire/pus.hpp"
#include "wire/space_packet.hpp"

namespace srfs::wire {
namespace {

const std::string ping_hex = "1801c01600062f11010000ab62";

/// Changes one octet and corrects the error control.
Octets altered(std::string_view hex, std::size_t at, std::uint8_t value) {
  Octets octets = octets_of(hex);
  octets[at] = value;
  const std::uint16_t crc = crc16(OctetView(octets).first(octets.size() - 2));
  octets[octets.size() - 2] = static_cast<std::uint8_t>(crc >> 8);
  octets[octets.size() - 1] = static_cast<std::uint8_t>(crc & 0xFF);
  return octets;
}

TEST(SpacePacket, LengthFieldMustSayExactlyWhatIsThere) {
  Octets packet = encode_space_packet({.apid = 5}, octets_of("0102"));
  EXPECT_TRUE(decode_space_packet(packet));
  packet.push_back(0);
  EXPECT_EQ(decode_space_packet(packet).error(), SpacePacketError::length_differs);
  packet.resize(7);
  EXPECT_EQ(decode_space_packet(packet).error(), SpacePacketError::length_differs);
  packet.resize(6);
  EXPECT_EQ(decode_space_packet(packet).error(), SpacePacketError::too_short);
}

TEST(SpacePacket, RefusesAnotherVersion) {
  EXPECT_EQ(decode_space_packet(octets_of("2005c000000000")).error(), SpacePacketError::bad_version);
}

TEST(SpacePacket, TheLongestPacketSurvives) {
  const Octets packet = encode_space_packet({.apid = 5}, Octets(65536, 1));
  EXPECT_EQ(packet.size(), packet_octets_max);
  EXPECT_EQ(decode_space_packet(packet)->data.size(), 65536U);
}

TEST(Cuc, DecodingAndEncodingAgainGivesTheSameOctets) {
  std::mt19937 random(1);
  for (int i = 0; i < 20000; ++i) {
    Octets time{cuc_p_field};
    for (int k = 0; k < 7; ++k) time.push_back(static_cast<std::uint8_t>(random()));
    const auto again = encode_cuc(decode_cuc(time).value());
    ASSERT_EQ(to_hex(again), to_hex(time));
  }
}

TEST(Cuc, AFractionThatRoundsUpCarriesIntoTheSecond) {
  EXPECT_EQ(to_hex(encode_cuc(TaiTime(nanoseconds(1'999'999'999)))), "1f00000002000000");
}

TEST(Cuc, TimesOutsideTheFormatBecomeTheNearestOne) {
  EXPECT_EQ(to_hex(encode_cuc(TaiTime(nanoseconds(-1)))), "1f00000000000000");
  EXPECT_EQ(to_hex(encode_cuc(TaiTime(seconds(4'294'967'296)))), "1fffffffffffffff");
}

TEST(Cuc, RefusesAnotherFormat) {
  EXPECT_EQ(decode_cuc(octets_of("1e8193ae25800000")).error(), CucError::wrong_p_field);
  EXPECT_EQ(decode_cuc(octets_of("1f8193ae258000")).error(), CucError::wrong_length);
}

TEST(PusTelecommand, EachFaultHasItsFailureCode) {
  using Error = TcPacketError;
  const auto error_of = [](const Octets& octets) { return parse_tc_packet(octets).error(); };
  EXPECT_EQ(error_of({}), Error::too_short);
  EXPECT_EQ(error_of(octets_of("1801c01600031122ab62")), Error::too_short);
  EXPECT_EQ(error_of(altered(ping_hex, 0, 0x38)), Error::bad_packet_version);
  EXPECT_EQ(error_of(altered(ping_hex, 5, 7)), Error::length_differs);
  EXPECT_EQ(error_of(octets_of("1801c01600062f11010000ab63")), Error::bad_checksum);
  EXPECT_EQ(error_of(altered(ping_hex, 0, 0x08)), Error::not_a_telecommand);
  EXPECT_EQ(error_of(altered(ping_hex, 0, 0x10)), Error::no_secondary_header);
  EXPECT_EQ(error_of(altered(ping_hex, 2, 0x40)), Error::segmented);
  EXPECT_EQ(error_of([] {
              Octets idle = altered(ping_hex, 0, 0x1F);
              return altered(to_hex(idle), 1, 0xFF);
            }()),
            Error::idle_packet);
  EXPECT_EQ(error_of(altered(ping_hex, 6, 0x1F)), Error::bad_pus_version);
  EXPECT_EQ(failure_code(Error::too_short), 1);
  EXPECT_EQ(failure_code(Error::bad_checksum), 4);
}

TEST(PusTelecommand, RequestIdIsTheFirstFourOctetsAlsoOfARefusedPacket) {
  const RequestId expected{.packet_identification = 0x1801, .packet_sequence_control = 0xC016};
  EXPECT_EQ(request_id(*parse_tc_packet(octets_of(ping_hex))), expected);
  EXPECT_EQ(peek_request_id(octets_of("1801c016ffff")), expected);
  EXPECT_EQ(peek_request_id(octets_of("1801c0")), std::nullopt);
}

TEST(PusTelecommand, AnySingleWrongBitIsRefused) {
  const Octets good = octets_of(ping_hex);
  for (std::size_t bit = 0; bit < good.size() * 8; ++bit) {
    Octets bad = good;
    bad[bit / 8] ^= static_cast<std::uint8_t>(0x80 >> bit % 8);
    EXPECT_FALSE(parse_tc_packet(bad)) << bit;
  }
}

TEST(PusTelemetry, EachFaultIsNamed) {
  using Error = TmPacketError;
  const std::string pong = to_hex(vector_named("PUS TM 17,2 CUC 4+3 time"));
  const auto error_of = [](const Octets& octets) { return parse_tm_packet(octets).error(); };
  EXPECT_EQ(error_of(octets_of(ping_hex)), Error::too_short);
  EXPECT_EQ(error_of(altered(pong, 0, 0x18)), Error::not_telemetry);
  EXPECT_EQ(error_of(altered(pong, 0, 0x00)), Error::no_secondary_header);
  EXPECT_EQ(error_of(altered(pong, 2, 0x00)), Error::segmented);
  EXPECT_EQ(error_of(altered(pong, 6, 0x10)), Error::bad_pus_version);
  EXPECT_EQ(error_of(altered(pong, 13, 0x2F)), Error::bad_time_code);
}

TEST(PusTelemetry, TheLongestPacketSurvives) {
  const TmPacket packet{.apid = 2, .service = 3, .subtype = 25, .source = Octets(tm_source_octets_max, 7)};
  EXPECT_EQ(parse_tm_packet(make_tm_packet(packet)).value(), packet);
}

}  // namespace
}  // namespace srfs::wire
