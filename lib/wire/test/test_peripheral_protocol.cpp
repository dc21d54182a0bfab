// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/peripheral_protocol.hpp"

#include <random>

#include <gtest/gtest.h>

#include "wire/crc16.hpp"

namespace srfs::wire {
namespace {

using Error = PeripheralProtocolError;

Octets with_crc(const char* hex) {
  Octets octets = *from_hex(hex);
  const std::uint16_t crc = crc16(octets);
  octets.push_back(static_cast<std::uint8_t>(crc >> 8));
  octets.push_back(static_cast<std::uint8_t>(crc));
  return octets;
}

const PeripheralRequest set_mode{
    .sequence = 6, .body = CommandRequest{.telecommand_id = 0x00000102, .function = 1, .arguments = {2}}};

TEST(PeripheralRequest, HasTheOctetsOfTheInterfaceDocument) {
  EXPECT_EQ(to_hex(encode(PeripheralRequest{.sequence = 5, .body = WakeUpRequest{}})),
            to_hex(with_crc("0105")));
  EXPECT_EQ(to_hex(encode(set_mode)), to_hex(with_crc("0206000001020102")));
  EXPECT_EQ(to_hex(encode(PeripheralRequest{.sequence = 7, .body = ResetRequest{}})),
            to_hex(with_crc("0307")));
}

TEST(PeripheralResponse, HasTheOctetsOfTheInterfaceDocument) {
  const PeripheralResponse awake{
      .sequence = 5,
      .body = WakeUpResponse{.status = PeripheralStatus::ready, .uptime_ms = 1000, .measurement = {0xAA}}};
  EXPECT_EQ(to_hex(encode(awake)), to_hex(with_crc("810500000003e8aa")));
  const PeripheralResponse done{
      .sequence = 6,
      .body = CommandResponse{.telecommand_id = 0x102, .result = PeripheralResult::already_done}};
  EXPECT_EQ(to_hex(encode(done)), to_hex(with_crc("82060000010201")));
  const PeripheralResponse resetting{.sequence = 7, .body = ResetResponse{}};
  EXPECT_EQ(to_hex(encode(resetting)), to_hex(with_crc("830700")));
}

TEST(PeripheralProtocol, ReadsBackWhatItWrites) {
  const PeripheralRequest requests[] = {
      {.sequence = 0, .body = WakeUpRequest{}}, set_mode, {.sequence = 255, .body = ResetRequest{}}};
  for (const auto& request : requests) EXPECT_EQ(decode_request(encode(request)), request);

  const PeripheralResponse responses[] = {
      {.sequence = 1,
       .body =
           WakeUpResponse{.status = PeripheralStatus::booting, .uptime_ms = 0xFFFFFFFF, .measurement = {}}},
      {.sequence = 2,
       .body = WakeUpResponse{.uptime_ms = 3, .measurement = Octets(peripheral_measurement_max, 0x55)}},
      {.sequence = 3, .body = CommandResponse{.telecommand_id = 9, .result = PeripheralResult::cannot_now}},
      {.sequence = 4, .body = ResetResponse{}}};
  for (const auto& response : responses) EXPECT_EQ(decode_response(encode(response)), response);
}

TEST(PeripheralProtocol, RefusesEveryTruncationAndEveryFlippedBit) {
  const Octets request = encode(set_mode);
  for (std::size_t n = 0; n < request.size(); ++n) EXPECT_FALSE(decode_request(OctetView(request).first(n)));
  for (std::size_t bit = 0; bit < request.size() * 8; ++bit) {
    Octets damaged = request;
    damaged[bit / 8] = static_cast<std::uint8_t>(damaged[bit / 8] ^ 1U << bit % 8);
    EXPECT_EQ(decode_request(damaged).error(), Error::bad_crc);
  }
}

TEST(PeripheralProtocol, SaysWhatIsWrong) {
  EXPECT_EQ(decode_request(*from_hex("0105ff")).error(), Error::too_short);
  EXPECT_EQ(decode_request(with_crc("0105aa")).error(), Error::too_long);
  EXPECT_EQ(decode_request(with_crc("02050000")).error(), Error::too_short);
  EXPECT_EQ(decode_request(with_crc("0405")).error(), Error::wrong_opcode);
  EXPECT_EQ(decode_request(with_crc("8105")).error(), Error::wrong_opcode);
  EXPECT_EQ(decode_request(Octets(4096)).error(), Error::too_long);

  EXPECT_EQ(decode_response(with_crc("0105")).error(), Error::wrong_opcode);
  EXPECT_EQ(decode_response(with_crc("8405")).error(), Error::wrong_opcode);
  EXPECT_EQ(decode_response(with_crc("8105000000")).error(), Error::too_short);
  EXPECT_EQ(decode_response(with_crc("81050200000000")).error(), Error::bad_value);
  EXPECT_EQ(decode_response(with_crc("82050000000105")).error(), Error::bad_value);
  EXPECT_EQ(decode_response(with_crc("8205000000010000")).error(), Error::too_long);
  EXPECT_EQ(decode_response(with_crc("830502")).error(), Error::bad_value);
}

TEST(PeripheralProtocol, AcceptsOnlyTheAnswerToItsRequest) {
  const auto answer = [](std::uint8_t sequence, std::uint32_t id) {
    return encode(PeripheralResponse{.sequence = sequence, .body = CommandResponse{.telecommand_id = id}});
  };
  EXPECT_TRUE(decode_response(answer(6, 0x102), set_mode));
  EXPECT_EQ(decode_response(answer(5, 0x102), set_mode).error(), Error::wrong_sequence);
  EXPECT_EQ(decode_response(answer(6, 0x103), set_mode).error(), Error::wrong_sequence);
  const Octets reset = encode(PeripheralResponse{.sequence = 6, .body = ResetResponse{}});
  EXPECT_EQ(decode_response(reset, set_mode).error(), Error::wrong_opcode);
}

TEST(PeripheralProtocol, SurvivesRandomOctets) {
  std::mt19937 random(1);
  for (int i = 0; i < 20000; ++i) {
    Octets octets(random() % 40);
    for (auto& octet : octets) octet = static_cast<std::uint8_t>(random());
    if (octets.size() > 3 && random() % 2 == 0) {  // a correct CRC, so that the bodies are decoded too
      octets[0] = static_cast<std::uint8_t>((random() % 5) | (random() % 2 << 7));
      octets.resize(octets.size() - 2);
      octets = with_crc(to_hex(octets).c_str());
    }
    if (const auto request = decode_request(octets)) {
      EXPECT_EQ(encode(*request), octets);
    }
    if (const auto response = decode_response(octets)) {
      EXPECT_EQ(encode(*response), octets);
    }
  }
}

}  // namespace
}  // namespace srfs::wire
