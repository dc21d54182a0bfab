// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <functional>
#include <random>

#include "lib/wire/test/link_vectors.hpp"
#include "wire/cfdp_checksum.hpp"
#include "wire/cfdp_pdu.hpp"

namespace srfs::wire {
namespace {

OctetView view(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// The header in the vectors, whose generator uses sequence numbers of two octets.
CfdpHeader vector_header() {
  return {.sequence_number_octets = 2, .source_entity = 1, .sequence_number = 7, .destination_entity = 2};
}

std::uint32_t checksum(CfdpChecksumType type, OctetView data) {
  CfdpChecksum sum(type);
  sum.update(data);
  return sum.value();
}

Octets checksum_octets(CfdpChecksumType type, OctetView data) {
  OctetWriter out;
  out.u32(checksum(type, data));
  return out.take();
}

const std::map<std::string, std::function<Octets()>>& makers() {
  static const std::map<std::string, std::function<Octets()>> all = {
      {"CFDP metadata src 1 dst 2 seq 7, size 9, a.bin -> b.bin",
       [] {
         return encode_cfdp_pdu(
             vector_header(),
             CfdpMetadata{.checksum_type = static_cast<std::uint8_t>(CfdpChecksumType::crc32),
                          .file_size = 9,
                          .source_file = "a.bin",
                          .destination_file = "b.bin"});
       }},
      {"CFDP file data offset 0 \"123456789\"",
       [] { return encode_cfdp_pdu(vector_header(), CfdpFileData{.offset = 0, .data = view("123456789")}); }},
      {"CFDP EOF (checksum field CRC-32 cbf43926)",
       [] {
         return encode_cfdp_pdu(
             vector_header(),
             CfdpEof{.checksum = checksum(CfdpChecksumType::crc32, view("123456789")), .file_size = 9});
       }},
      {"CFDP NAK 0-9, segment (3,6) + metadata",
       [] {
         return encode_cfdp_pdu(vector_header(), CfdpNak{.scope = {0, 9}, .segments = {{0, 0}, {3, 6}}});
       }},
      {"CFDP ACK(EOF)", [] { return encode_cfdp_pdu(vector_header(), CfdpAck{}); }},
      {"CFDP finished", [] { return encode_cfdp_pdu(vector_header(), CfdpFinished{}); }},
      {"CFDP modular checksum of \"123456789\"",
       [] { return checksum_octets(CfdpChecksumType::modular, view("123456789")); }},
      {"CFDP modular checksum of 00..ff",
       [] {
         Octets all_octets;
         for (unsigned i = 0; i < 256; ++i) all_octets.push_back(static_cast<std::uint8_t>(i));
         return checksum_octets(CfdpChecksumType::modular, all_octets);
       }},
  };
  return all;
}

TEST(CfdpVectors, EveryVectorIsReproducedOctetForOctet) {
  std::size_t vectors = 0;
  for (const auto& [name, expected] : link_vectors()) {
    if (!name.starts_with("CFDP")) continue;
    ++vectors;
    ASSERT_TRUE(makers().contains(name)) << "nothing makes the vector " << name;
    EXPECT_EQ(to_hex(makers().at(name)()), to_hex(expected)) << name;
  }
  EXPECT_EQ(vectors, makers().size());
}

TEST(CfdpVectors, PdusAreReadBack) {
  for (const auto& [name, octets] : link_vectors()) {
    if (!name.starts_with("CFDP") || name.find("checksum of") != std::string::npos) continue;
    const auto pdu = decode_cfdp_pdu(octets);
    ASSERT_TRUE(pdu) << name << ": " << to_string(pdu.error());
    EXPECT_EQ(pdu->header, vector_header()) << name;
    EXPECT_EQ(encode_cfdp_pdu(pdu->header, pdu->body), octets) << name;
  }
}

TEST(CfdpChecksums, AreThoseOfTheirRegistries) {
  EXPECT_EQ(checksum(CfdpChecksumType::crc32, view("123456789")), 0xCBF43926U);
  EXPECT_EQ(checksum(CfdpChecksumType::crc32c, view("123456789")), 0xE3069283U);
  EXPECT_EQ(checksum(CfdpChecksumType::null, view("123456789")), 0U);
  EXPECT_FALSE(CfdpChecksum::of_type(1));
  EXPECT_FALSE(CfdpChecksum::of_type(7));
}

TEST(CfdpChecksums, DoNotDependOnWhereThePiecesEnd) {
  Octets file(10'007);
  std::mt19937 random(1);
  for (auto& octet : file) octet = static_cast<std::uint8_t>(random());
  for (const std::uint8_t type : std::initializer_list<std::uint8_t>{0, 2, 3, 15}) {
    auto pieces = CfdpChecksum::of_type(type).value();
    for (std::size_t at = 0; at < file.size();) {
      const std::size_t n = std::min<std::size_t>(file.size() - at, 1 + random() % 700);
      pieces.update(OctetView(file).subspan(at, n));
      at += n;
    }
    EXPECT_EQ(pieces.value(), checksum(static_cast<CfdpChecksumType>(type), file)) << int{type};
  }
}

TEST(CfdpPdus, ComeBackWithEveryLengthOfIdsWithCrcAndForLargeFiles) {
  const std::uint8_t data[] = {1, 2, 3};
  const std::vector<CfdpBody> bodies = {
      CfdpMetadata{.closure_requested = true,
                   .file_size = 200'000,
                   .source_file = "image.fits",
                   .destination_file = "",
                   .options = {{.type = CfdpTlv::message_to_user, .value = {1, 2}},
                               {.type = CfdpTlv::flow_label, .value = {}}}},
      CfdpFileData{.offset = 0x12345678, .data = data},
      CfdpEof{.condition = CfdpCondition::cancel_request, .file_size = 7, .fault_location = 1},
      CfdpFinished{.condition = CfdpCondition::filestore_rejection,
                   .incomplete = true,
                   .file_status = CfdpFileStatus::rejected,
                   .fault_location = 2},
      CfdpAck{.of_finished = true, .status = CfdpTransactionStatus::unrecognized},
      CfdpNak{.scope = {10, 90}, .segments = {{10, 20}, {30, 90}}},
      CfdpPrompt{.keep_alive = true},
      CfdpPrompt{},
      CfdpKeepAlive{.progress = 99},
  };
  for (const CfdpBody& body : bodies) {
    for (const std::uint8_t ids : std::initializer_list<std::uint8_t>{1, 2, 4, 8}) {
      for (const std::uint8_t numbers : std::initializer_list<std::uint8_t>{1, 2, 4, 8}) {
        for (const int flags : {0, 1, 2, 3}) {
          const CfdpHeader header{.crc = (flags & 1) != 0,
                                  .large_file = (flags & 2) != 0,
                                  .entity_id_octets = ids,
                                  .sequence_number_octets = numbers,
                                  .source_entity = 1,
                                  .sequence_number = 250,
                                  .destination_entity = 2};
          const Octets octets = encode_cfdp_pdu(header, body);
          const auto pdu = decode_cfdp_pdu(octets);
          ASSERT_TRUE(pdu) << to_string(pdu.error());
          EXPECT_EQ(pdu->header, header);
          EXPECT_EQ(pdu->body.index(), body.index());
          EXPECT_EQ(encode_cfdp_pdu(pdu->header, pdu->body), octets);
        }
      }
    }
  }
}

TEST(CfdpPdus, HoldNoMoreSegmentsAndDataThanSaid) {
  for (const bool large : {false, true}) {
    const CfdpHeader header{.crc = large, .large_file = large, .source_entity = 1, .destination_entity = 2};
    for (const std::size_t octets : {40U, 100U, 231U}) {
      const std::size_t segments = cfdp_nak_segments_max(header, octets);
      CfdpNak nak;
      nak.segments.resize(segments);
      EXPECT_LE(encode_cfdp_pdu(header, nak).size(), octets);
      nak.segments.resize(segments + 1);
      EXPECT_GT(encode_cfdp_pdu(header, nak).size(), octets);
    }
    EXPECT_EQ(cfdp_nak_segments_max(header, 10), 0U);
    const Octets data(100);
    EXPECT_EQ(encode_cfdp_pdu(header, CfdpFileData{.data = data}).size(),
              100 + cfdp_file_data_overhead(header));
  }
}

constexpr auto malformed_pdus = std::to_array<std::pair<std::string_view, CfdpPduError>>({
    {"", CfdpPduError::too_short},
    {"200012", CfdpPduError::too_short},
    {"2000001100010007", CfdpPduError::too_short},
    {"0000031100010007000206400100", CfdpPduError::bad_version},
    {"280003110001000700020640", CfdpPduError::length_differs},
    {"2800031100010007000206400100", CfdpPduError::length_differs},
    {"2800032100010007000206400100", CfdpPduError::bad_id_length},
    {"28000312000100070002064001", CfdpPduError::bad_id_length},
    {"2a000511000100070002064001abcd", CfdpPduError::bad_crc},
    {"2a0001110001000700020a", CfdpPduError::truncated},
    {"30000d9100010007000200000000313233343536373839", CfdpPduError::record_structure},
    {"30000d1900010007000200000000313233343536373839", CfdpPduError::segment_metadata},
    {"30000411000100070002"
     "00000000",
     CfdpPduError::empty_file_data},
    {"30000311000100070002"
     "000000",
     CfdpPduError::truncated},
    {"30000511000100070002"
     "ffffffff31",
     CfdpPduError::bad_segment},
    {"20000011000100070002", CfdpPduError::truncated},
    {"2000011100010007000200", CfdpPduError::unknown_directive},
    {"200001110001000700020a", CfdpPduError::unknown_directive},
    {"20000311000100070002064001", CfdpPduError::wrong_direction},
    {"2800051100010007000200000000"
     "31",
     CfdpPduError::unknown_directive},
    {"3800051100010007000200000000"
     "31",
     CfdpPduError::wrong_direction},
    {"28000a110001000700020400cbf4392600000009", CfdpPduError::wrong_direction},
    {"20000a110001000700020401cbf4392600000009", CfdpPduError::reserved_value},
    {"20000a1100010007000204c0cbf4392600000009", CfdpPduError::reserved_value},
    {"200009110001000700020400cbf43926000000", CfdpPduError::truncated},
    {"20000c110001000700020410cbf43926000000090602", CfdpPduError::truncated},
    {"20000c110001000700020410cbf43926000000090600", CfdpPduError::bad_option},
    {"20000d110001000700020410cbf4392600000009020101", CfdpPduError::bad_option},
    {"2800021100010007000205"
     "08",
     CfdpPduError::reserved_value},
    {"2800021100010007000205"
     "d0",
     CfdpPduError::reserved_value},
    {"28000311000100070002067001", CfdpPduError::reserved_value},
    {"28000311000100070002064005", CfdpPduError::reserved_value},
    {"2800041100010007000206400100", CfdpPduError::trailing_octets},
    {"20001211000100070002"
     "0783"
     "00000009"
     "05612e62696e"
     "05622e62696e",
     CfdpPduError::reserved_value},
    {"20001111000100070002"
     "0703"
     "00000009"
     "05612e62696e"
     "05622e6269",
     CfdpPduError::truncated},
    {"20001511000100070002"
     "0703"
     "00000009"
     "05612e62696e"
     "05622e62696e"
     "000101",
     CfdpPduError::filestore_request},
    {"20001511000100070002"
     "0703"
     "00000009"
     "05612e62696e"
     "05622e62696e"
     "020201",
     CfdpPduError::truncated},
    {"20001511000100070002"
     "0703"
     "00000009"
     "05612e62696e"
     "05622e62696e"
     "060101",
     CfdpPduError::bad_option},
    {"28000a11000100070002"
     "08"
     "0000000000000009"
     "00",
     CfdpPduError::truncated},
    {"28000911000100070002"
     "08"
     "0000000a00000009",
     CfdpPduError::bad_segment},
    {"28001111000100070002"
     "08"
     "0000000000000009"
     "0000000600000003",
     CfdpPduError::bad_segment},
    {"20000211000100070002"
     "0901",
     CfdpPduError::reserved_value},
    {"28000411000100070002"
     "0c000000",
     CfdpPduError::truncated},
});

TEST(CfdpPdus, MalformedOnesAreRefusedWithTheirReason) {
  for (const auto& [hex, error] : malformed_pdus) {
    const auto pdu = decode_cfdp_pdu(octets_of(hex));
    ASSERT_FALSE(pdu) << hex;
    EXPECT_EQ(to_string(pdu.error()), to_string(error)) << hex;
  }
}

TEST(CfdpPdus, EveryOctetCutOffIsNoticed) {
  for (const auto& [name, octets] : link_vectors()) {
    if (!name.starts_with("CFDP") || name.find("checksum of") != std::string::npos) continue;
    for (std::size_t n = 0; n < octets.size(); ++n) {
      EXPECT_FALSE(decode_cfdp_pdu(OctetView(octets).first(n))) << name << " " << n;
    }
  }
}

}  // namespace
}  // namespace srfs::wire
