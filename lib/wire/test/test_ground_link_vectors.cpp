// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <functional>

#include "base/time.hpp"
#include "lib/wire/test/link_vectors.hpp"
#include "wire/cadu.hpp"
#include "wire/cltu.hpp"
#include "wire/crc16.hpp"
#include "wire/cuc.hpp"
#include "wire/farm1.hpp"
#include "wire/pus.hpp"
#include "wire/randomizer.hpp"
#include "wire/reed_solomon.hpp"
#include "wire/sdls.hpp"
#include "wire/space_packet.hpp"
#include "wire/tc_frame.hpp"
#include "wire/tc_uplink.hpp"
#include "wire/tm_frame.hpp"

namespace srfs::wire {
namespace {

constexpr std::uint16_t spacecraft = 0xAB;

TaiTime tai(const std::string& iso) {
  return to_tai(from_iso8601(iso).value());
}
Octets as_octets(std::uint32_t word) {
  OctetWriter out;
  out.u32(word);
  return out.take();
}
Octets joined(std::initializer_list<Octets> parts) {
  Octets all;
  for (const Octets& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

Octets ping() {
  return make_tc_packet(
      {.apid = 1, .sequence_count = 22, .ack_flags = ack::all, .service = 17, .subtype = 1});
}
TmPacket tm(std::uint16_t apid, std::uint16_t count, std::uint8_t service, std::uint8_t subtype,
            std::uint16_t type_counter, Octets source) {
  return {.apid = apid,
          .sequence_count = count,
          .service = service,
          .subtype = subtype,
          .type_counter = type_counter,
          .time = tai("2026-11-21T08:00:00.5Z"),
          .source = std::move(source)};
}
Octets tc_frame(TcFrameType type, std::uint8_t sequence, Octets data) {
  return encode_tc_frame(
      {.type = type, .spacecraft_id = spacecraft, .vc = 1, .sequence = sequence, .data = std::move(data)});
}
Octets segment(const Octets& packet) {
  return joined({{segment_header_unsegmented}, packet});
}
Octets ad_frame() {
  return tc_frame(TcFrameType::ad, 5, segment(ping()));
}
Octets unlock_frame() {
  return tc_frame(TcFrameType::bc, 0, encode_control_command({.kind = ControlCommand::Kind::unlock}));
}
Octets rs_parity(const Octets& data) {
  const Octets codeblock = rs_encode(data, 1);
  return {codeblock.end() - rs_parity_octets, codeblock.end()};
}
Octets counting(std::size_t octets) {
  Octets data(octets);
  for (std::size_t i = 0; i < octets; ++i) data[i] = static_cast<std::uint8_t>(i);
  return data;
}
SdlsKey counting_key() {
  std::array<std::uint8_t, sdls_key_octets> key{};
  for (std::size_t i = 0; i < key.size(); ++i) key[i] = static_cast<std::uint8_t>(i);
  return SdlsKey(key);
}
Octets secured(TcFrameType type, std::uint8_t sequence, std::uint64_t counter) {
  const SdlsKey key = counting_key();
  return tc_frame(
      type, sequence,
      sdls_apply({.key = key, .spi = 4, .counter = counter}, 1, segment_header_unsegmented, ping()).value());
}
/// On a strict link; taken out of its CLTU.
Octets strict(std::uint64_t counter,
              const std::function<Octets(const TcUplinkChannel&, const SdlsSeal&)>& make) {
  const SdlsKey key = counting_key();
  const TcUplinkChannel channel{.spacecraft_id = spacecraft, .vc = 1, .whole_header = true};
  CltuDecoder decoder({});
  return decoder
      .push(make(channel, {.key = key, .spi = 4, .counter = counter, .sender = 0x07A1B2C3}), MonotonicTime{})
      .at(0);
}
Octets tm_frame_with_packet() {
  // The octets contain virtual channel 2; "vc1" in the vector's name is the channel reported by its CLCW.
  Octets data = encode_space_packet({.apid = 0x2A, .sequence_count = 1}, octets_of("deadbeef"));
  const Octets idle = make_idle_packet(28 - data.size(), 0x55);
  data.insert(data.end(), idle.begin(), idle.end());
  return encode_tm_frame({.spacecraft_id = spacecraft,
                          .vc = 2,
                          .master_count = 17,
                          .vc_count = 34,
                          .first_header = 0,
                          .ocf = 0x01040006,
                          .data = data});
}
Octets tm_idle_frame() {
  TmFrameBuilder builder({.spacecraft_id = spacecraft, .frame_octets = 40});
  return builder.build_idle(0x01040006);
}
TmSeal counting_seal() {
  return {.spi = 16, .authenticator = TmAuthenticator::create(counting_key())};
}
Octets sealed_frame_with_packet() {
  Octets data = encode_space_packet({.apid = 0x2A, .sequence_count = 1}, octets_of("deadbeef"));
  const Octets idle = make_idle_packet(28 - data.size(), 0x55);
  data.insert(data.end(), idle.begin(), idle.end());
  TmSeal seal = counting_seal();
  return encode_tm_frame({.spacecraft_id = spacecraft,
                          .vc = 2,
                          .master_count = 17,
                          .vc_count = 34,
                          .first_header = 0,
                          .ocf = 0x01040006,
                          .data = data},
                         seal, 0x0343DCACBC01);
}
Octets sealed_idle_frame() {
  TmFrameBuilder builder({.spacecraft_id = spacecraft, .frame_octets = 68}, counting_seal());
  return builder.build_idle(0x01040006, 0x0343DCACBC03);
}
Octets cuc(const char* utc) {
  const auto time = encode_cuc(tai(utc));
  return {time.begin(), time.end()};
}
template <class Sequence>
Octets first_of(const Sequence& sequence, std::size_t octets) {
  return Octets(sequence.begin(), sequence.begin() + static_cast<std::ptrdiff_t>(octets));
}

/// For each vector, the function that makes it with this library.
const std::map<std::string, std::function<Octets()>>& makers() {
  static const std::map<std::string, std::function<Octets()>> all{
      {"SP TC 17,1 ping apid 1 seq 22", ping},
      {"SP TM apid 2a seq 3fff data 010203",
       [] { return encode_space_packet({.apid = 0x2A, .sequence_count = 0x3FFF}, octets_of("010203")); }},
      {"SP idle 1 octet", [] { return make_idle_packet(7); }},
      {"PUS TC 3,27 sid 7 apid 16",
       [] {
         return make_tc_packet(
             {.apid = 16, .service = 3, .subtype = 27, .application = octets_of("00010007")});
       }},
      {"PUS TC 8,1 apid 7fe seq 3fff ack 9 data 12346869",
       [] {
         return make_tc_packet({.apid = 0x7FE,
                                .sequence_count = 0x3FFF,
                                .ack_flags = ack::acceptance | ack::completion,
                                .service = 8,
                                .subtype = 1,
                                .source_id = 0x1234,
                                .application = octets_of("6869")});
       }},
      {"PUS TC 20,3 one parameter float 1.0",
       [] {
         return make_tc_packet({.apid = 18,
                                .sequence_count = 1,
                                .service = 20,
                                .subtype = 3,
                                .source_id = 1,
                                .application = octets_of("000100053f800000")});
       }},
      {"PUS TM 17,2 CUC 4+3 time", [] { return make_tm_packet(tm(1, 3, 17, 2, 9, {})); }},
      {"PUS TM 1,1", [] { return make_tm_packet(tm(1, 4, 1, 1, 0, octets_of("1801c016"))); }},
      {"PUS TM 5,2 \"CAN timeout\"",
       [] { return make_tm_packet(tm(16, 5, 5, 2, 1, octets_of("002a43414e2074696d656f7574"))); }},
      {"CUC 2026-11-21T08:00:00Z", [] { return cuc("2026-11-21T08:00:00Z"); }},
      {"CUC 2026-11-21T08:00:00.5Z", [] { return cuc("2026-11-21T08:00:00.5Z"); }},
      {"TC frame AD N(S)=5 seg c0 of the ping", ad_frame},
      {"TC frame BD of the ping", [] { return tc_frame(TcFrameType::bd, 0, segment(ping())); }},
      {"TC frame BC unlock", unlock_frame},
      {"TC frame BC set V(R)=2a",
       [] {
         return tc_frame(TcFrameType::bc, 0,
                         encode_control_command({.kind = ControlCommand::Kind::set_vr, .vr = 0x2A}));
       }},
      {"CLTU of the AD frame", [] { return encode_cltu(ad_frame(), false); }},
      {"CLTU of unlock", [] { return encode_cltu(unlock_frame(), false); }},
      {"CLTU of the AD frame, randomized (one source)", [] { return encode_cltu(ad_frame(), true); }},
      {"TC randomizer, first 16", [] { return first_of(tc_random_sequence(), 16); }},
      {"TM randomizer, first 40", [] { return first_of(tm_random_sequence(), 40); }},
      {"CLCW vc1 V(R)=6", [] { return as_octets(encode_clcw({.vc = 1, .report_value = 6})); }},
      {"CLCW vc1 lockout + retransmit, FARM-B 3, V(R)=255",
       [] {
         return as_octets(encode_clcw(
             {.vc = 1, .lockout = true, .retransmit = true, .farm_b_counter = 3, .report_value = 255}));
       }},
      {"TM frame, length 40, vc1 mc 17 vc 34, packet + idle, OCF 01040006", tm_frame_with_packet},
      // Forty octets with a correct FECF; the length in the vector's name is wrong.
      {"TM idle frame vc7, length 68", tm_idle_frame},
      {"Sealed TM frame, length 64, SPI 16, number 0343dcacbc01, vc 2 mc 17 vc 34, packet + idle, OCF "
       "01040006",
       sealed_frame_with_packet},
      {"Sealed TM idle frame vc7, length 68, SPI 16, number 0343dcacbc03, OCF 01040006", sealed_idle_frame},
      {"RS(255,223) dual basis parity of 00..de", [] { return rs_parity(counting(223)); }},
      {"RS(255,223) dual basis parity of ff x 223", [] { return rs_parity(Octets(223, 0xFF)); }},
      {"SDLS key 000102..1f, SPI 4, AES-256-GCM, IV 1, BD ping",
       [] { return secured(TcFrameType::bd, 0, 1); }},
      {"SDLS same, IV 2, AD N(S)=5", [] { return secured(TcFrameType::ad, 5, 2); }},
      {"Strict SDLS, IV 07a1b2c3 000001a1ee565e00, AD N(S)=5 of the ping",
       [] {
         return strict(1'795'000'000'000, [](const auto& channel, const auto& seal) {
           return make_uplink_cltu(channel, TcFrameType::ad, 5, &seal, ping()).value();
         });
       }},
      {"Strict SDLS, IV 07a1b2c3 000001a1ee565e01, BC set V(R)=2a",
       [] {
         return strict(1'795'000'000'001, [](const auto& channel, const auto& seal) {
           return make_secured_control_cltu(channel, {.kind = ControlCommand::Kind::set_vr, .vr = 0x2A}, seal)
               .value();
         });
       }},
  };
  return all;
}

bool has_codec_elsewhere(const std::string& name) {
  return name.starts_with("CFDP") || name.starts_with("Ed25519");
}

TEST(GroundLinkVectors, EveryVectorIsReproducedOctetForOctetOrBelongsToAnotherCodec) {
  ASSERT_GE(link_vectors().size(), 40U);
  for (const auto& [name, expected] : link_vectors()) {
    if (has_codec_elsewhere(name)) continue;
    if (name.starts_with("CRC16(")) {
      const auto data = from_hex(name.substr(6, name.size() - 7));
      ASSERT_TRUE(data) << name;
      OctetWriter crc;
      crc.u16(crc16(*data));
      EXPECT_EQ(to_hex(crc.view()), to_hex(expected)) << name;
      continue;
    }
    const auto maker = makers().find(name);
    if (maker == makers().end()) {
      ADD_FAILURE() << "nothing makes the vector " << name;
      continue;
    }
    EXPECT_EQ(to_hex(maker->second()), to_hex(expected)) << name;
  }
}

TEST(GroundLinkVectors, NoMakerIsLeftWithoutItsVector) {
  for (const auto& [name, maker] : makers()) EXPECT_TRUE(link_vectors().contains(name)) << name;
}

TEST(GroundLinkVectors, TelecommandPacketsAreReadBack) {
  for (const auto& [name, octets] : link_vectors()) {
    if (!name.starts_with("PUS TC") && !name.starts_with("SP TC")) continue;
    const auto packet = parse_tc_packet(octets);
    ASSERT_TRUE(packet) << name;
    EXPECT_EQ(make_tc_packet(*packet), octets) << name;
  }
}

TEST(GroundLinkVectors, TelemetryPacketsAreReadBack) {
  for (const auto& [name, octets] : link_vectors()) {
    if (!name.starts_with("PUS TM")) continue;
    const auto packet = parse_tm_packet(octets);
    ASSERT_TRUE(packet) << name;
    EXPECT_EQ(make_tm_packet(*packet), octets) << name;
  }
}

TEST(GroundLinkVectors, FramesAreReadBack) {
  for (const auto& [name, octets] : link_vectors()) {
    if (name.starts_with("TC frame") || name.starts_with("SDLS")) {
      const auto frame = decode_tc_frame(octets, spacecraft);
      ASSERT_TRUE(frame) << name;
      EXPECT_EQ(encode_tc_frame(*frame), octets) << name;
    }
    if (name.starts_with("TM frame") || name.starts_with("TM idle")) {
      const auto frame = decode_tm_frame(octets, spacecraft, octets.size());
      ASSERT_TRUE(frame) << name;
      EXPECT_EQ(encode_tm_frame(*frame), octets) << name;
    }
  }
}

TEST(GroundLinkVectors, SealedFramesAreOpened) {
  TmSeal seal = counting_seal();
  unsigned opened = 0;
  for (const auto& [name, octets] : link_vectors()) {
    if (!name.starts_with("Sealed TM")) continue;
    auto frame = decode_tm_frame(octets, spacecraft, octets.size());
    ASSERT_TRUE(frame) << name;
    const auto number = tm_sdls_open(octets, *frame, 16, *seal.authenticator);
    ASSERT_TRUE(number) << name << ": " << to_string(number.error());
    EXPECT_EQ(encode_tm_frame(*frame, seal, *number), octets) << name;
    ++opened;
  }
  EXPECT_EQ(opened, 2U);
}

TEST(GroundLinkVectors, CltusAreReadBack) {
  for (const bool randomized : {false, true}) {
    CltuDecoder decoder({.randomized = randomized});
    const auto frames = decoder.push(
        vector_named(randomized ? "CLTU of the AD frame, randomized (one source)" : "CLTU of the AD frame"),
        {});
    ASSERT_EQ(frames.size(), 1U);
    EXPECT_EQ(frames[0], ad_frame());
  }
}

TEST(GroundLinkVectors, SecuredFramesAreOpened) {
  const SdlsKey key = counting_key();
  for (const auto& [name, octets] : link_vectors()) {
    if (!name.starts_with("SDLS")) continue;
    const auto frame = decode_tc_frame(octets, spacecraft);
    ASSERT_TRUE(frame);
    const auto opened = sdls_open(key, 4, 1, frame->data);
    ASSERT_TRUE(opened) << name;
    EXPECT_EQ(opened->packet, ping());
    EXPECT_EQ(opened->counter, frame->type == TcFrameType::bd ? 1U : 2U);
  }
}

}  // namespace
}  // namespace srfs::wire
