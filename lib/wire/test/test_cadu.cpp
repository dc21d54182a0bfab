// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "lib/wire/test/link_vectors.hpp"
#include "wire/cadu.hpp"
#include "wire/tm_frame.hpp"

namespace srfs::wire {
namespace {

const CaduFormat short_format{.frame_octets = 223, .interleave = 1};
const CaduFormat long_format{.frame_octets = 1115, .interleave = 5};
const CaduFormat plain_format{.frame_octets = 100, .reed_solomon = false, .randomize = false};

/// Different frames, each with a correct FECF.
struct Source {
  explicit Source(const CaduFormat& with)
      : format(with), builder({.spacecraft_id = 0xAB, .frame_octets = with.frame_octets}) {}
  Octets next_frame() { return builder.build(0, 0x01040006); }
  CaduFormat format;
  TmFrameBuilder builder;
};
void append(Octets& line, const Octets& more) {
  line.insert(line.end(), more.begin(), more.end());
}

TEST(CaduSynchroniser, FindsEveryFrameWhateverThePieces) {
  std::mt19937 random(1);
  for (const CaduFormat& format : {short_format, long_format, plain_format}) {
    Source source(format);
    CaduSynchroniser synchroniser(format);
    Octets line = octets_of("1acf1acffc1a");
    std::vector<Octets> sent;
    for (int i = 0; i < 30; ++i) {
      sent.push_back(source.next_frame());
      append(line, encode_cadu(sent.back(), format));
    }
    std::vector<Octets> received;
    for (OctetView rest(line); !rest.empty();) {
      const std::size_t piece = std::min<std::size_t>(1 + random() % 700, rest.size());
      for (auto& found : synchroniser.push(rest.first(piece))) received.push_back(std::move(found.frame));
      rest = rest.subspan(piece);
    }
    EXPECT_EQ(received, sent);
    EXPECT_TRUE(synchroniser.locked());
    EXPECT_EQ(synchroniser.counters().locks, 1U);
    EXPECT_EQ(synchroniser.counters().noise_octets, 6U);
  }
}

TEST(CaduSynchroniser, HandsOutAFrameWithItsLastOctet) {
  Source source(short_format);
  CaduSynchroniser synchroniser(short_format);
  const Octets cadu = encode_cadu(source.next_frame(), short_format);
  EXPECT_EQ(cadu.size(), cadu_octets(short_format));
  EXPECT_TRUE(synchroniser.push(OctetView(cadu).first(cadu.size() - 1)).empty());
  EXPECT_EQ(synchroniser.push(OctetView(cadu).last(1)).size(), 1U);
}

TEST(CaduSynchroniser, ALostOrAnExtraOctetCostsOnlyItsOwnCadu) {
  for (const CaduFormat& format : {short_format, plain_format}) {
    const std::size_t length = cadu_octets(format);
    for (const bool lost : {true, false}) {
      for (std::size_t at = 0; at < length; ++at) {
        Source source(format);
        CaduSynchroniser synchroniser(format);
        std::vector<Octets> sent;
        Octets line;
        for (int i = 0; i < 4; ++i) {
          sent.push_back(source.next_frame());
          Octets cadu = encode_cadu(sent.back(), format);
          const auto place = cadu.begin() + static_cast<std::ptrdiff_t>(at);
          if (i == 1 && lost) cadu.erase(place);
          if (i == 1 && !lost) cadu.insert(place, 0xA5);
          append(line, cadu);
        }
        std::vector<Octets> received;
        for (auto& found : synchroniser.push(line)) received.push_back(std::move(found.frame));
        ASSERT_GE(received.size(), 3U) << at;
        ASSERT_EQ(received[0], sent[0]);
        ASSERT_EQ(received[received.size() - 2], sent[2]) << at;
        ASSERT_EQ(received.back(), sent[3]) << at;
        const auto& counters = synchroniser.counters();
        ASSERT_EQ(counters.frames * length - counters.shared_octets + counters.noise_octets, line.size())
            << at << ": each octet counts once";
      }
    }
  }
}

TEST(CaduSynchroniser, WhileLockedAMarkerMayHaveThreeWrongBits) {
  Source source(short_format);
  CaduSynchroniser synchroniser(short_format);
  EXPECT_EQ(synchroniser.push(encode_cadu(source.next_frame(), short_format)).size(), 1U);
  Octets hit = encode_cadu(source.next_frame(), short_format);
  hit[0] ^= 0x81;
  hit[3] ^= 0x10;
  EXPECT_EQ(synchroniser.push(hit).size(), 1U);
  EXPECT_EQ(synchroniser.counters().marker_bit_errors, 3U);
  hit = encode_cadu(source.next_frame(), short_format);
  hit[0] ^= 0x0F;
  EXPECT_TRUE(synchroniser.push(hit).empty());
  EXPECT_EQ(synchroniser.counters().losses_of_lock, 1U);
  EXPECT_EQ(synchroniser.push(encode_cadu(source.next_frame(), short_format)).size(), 1U);
}

TEST(CaduSynchroniser, UnlockedTheMarkerMustBeExact) {
  Source source(short_format);
  CaduSynchroniser synchroniser(short_format);
  Octets hit = encode_cadu(source.next_frame(), short_format);
  hit[0] ^= 0x01;
  EXPECT_TRUE(synchroniser.push(hit).empty());
  EXPECT_EQ(synchroniser.counters().locks, 0U);
}

TEST(CaduSynchroniser, ABlockBeyondCorrectionIsRejectedAndTheNextOneFound) {
  Source source(short_format);
  CaduSynchroniser synchroniser(short_format);
  Octets line = encode_cadu(source.next_frame(), short_format);
  Octets bad = encode_cadu(source.next_frame(), short_format);
  for (std::size_t i = 10; i < 40; ++i) bad[i] ^= 0x77;
  append(line, bad);
  append(line, encode_cadu(source.next_frame(), short_format));
  EXPECT_EQ(synchroniser.push(line).size(), 2U);
  EXPECT_EQ(synchroniser.counters().rejected, 1U);
}

/// Sends packets of random sizes on three channels through frames, coding and correctable noise, and decodes
/// them.
void expect_round_trip(const CaduFormat& format, std::size_t errors_per_codeword, unsigned seed) {
  std::mt19937 random(seed);
  TmFrameBuilder builder(
      {.spacecraft_id = 0xAB, .frame_octets = format.frame_octets, .queue_octets_max = 400'000});
  std::map<std::uint8_t, std::vector<Octets>> sent;
  std::map<std::uint8_t, std::vector<Octets>> received;
  for (std::uint16_t i = 0; i < 150; ++i) {
    const auto vc = static_cast<std::uint8_t>(random() % 3);
    Octets data(1 + random() % (i % 10 == 0 ? 5000 : 200));
    for (std::uint8_t& octet : data) octet = static_cast<std::uint8_t>(random());
    sent[vc].push_back(encode_space_packet({.apid = vc, .sequence_count = i}, data));
    ASSERT_TRUE(builder.queue_packet(vc, sent[vc].back()));
  }

  CaduSynchroniser synchroniser(format);
  TmFrameDecoder decoder(0xAB, format.frame_octets);
  std::map<std::uint8_t, TmPacketReassembly> reassemblies;
  while (builder.queued_octets(0) + builder.queued_octets(1) + builder.queued_octets(2) > 0) {
    const auto vc = static_cast<std::uint8_t>(random() % 4);
    Octets line =
        encode_cadu(vc == 3 ? builder.build_idle(0x01040006) : builder.build(vc, 0x01040006), format);
    for (unsigned codeword = 0; codeword < format.interleave; ++codeword) {
      for (std::size_t i = 0; i < errors_per_codeword; ++i) {
        const std::size_t octets = (line.size() - 4) / format.interleave;
        line[4 + (random() % octets) * format.interleave + codeword] = static_cast<std::uint8_t>(random());
      }
    }
    for (const auto& found : synchroniser.push(line)) {
      const auto frame = decoder.decode(found.frame);
      ASSERT_TRUE(frame);
      for (Octets& packet : reassemblies[frame->vc].push(*frame))
        received[frame->vc].push_back(std::move(packet));
    }
  }
  EXPECT_EQ(received, sent);
  EXPECT_EQ(decoder.counters().lost, 0U);
  for (const auto& [vc, reassembly] : reassemblies) {
    EXPECT_EQ(reassembly.counters().header_mismatches, 0U);
    EXPECT_EQ(reassembly.counters().cut_packets, 0U);
  }
}

TEST(TelemetryChain, PacketsComeBackIdenticalAndInOrderThroughNoise) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    expect_round_trip(short_format, 16, seed);
    expect_round_trip(long_format, 12, seed);
    expect_round_trip(plain_format, 0, seed);
  }
}

TEST(TelemetryChain, NoPacketIsEverInventedOnALineThatLosesOctets) {
  std::mt19937 random(11);
  TmFrameBuilder builder({.spacecraft_id = 0xAB, .frame_octets = 223});
  CaduSynchroniser synchroniser(short_format);
  TmFrameDecoder decoder(0xAB, 223);
  TmPacketReassembly reassembly;
  std::vector<Octets> sent;
  std::vector<Octets> received;
  for (std::uint16_t i = 0; i < 2000; ++i) {
    sent.push_back(encode_space_packet({.apid = 1, .sequence_count = i},
                                       Octets(1 + random() % 400, static_cast<std::uint8_t>(i))));
    ASSERT_TRUE(builder.queue_packet(0, sent.back()));
    while (builder.queued_octets(0) > 300) {
      Octets line = encode_cadu(builder.build(0, 0x01040006), short_format);
      if (random() % 10 == 0) line.erase(line.begin() + static_cast<std::ptrdiff_t>(random() % line.size()));
      for (const auto& found : synchroniser.push(line)) {
        const auto frame = decoder.decode(found.frame);
        if (!frame) continue;
        for (Octets& packet : reassembly.push(*frame)) received.push_back(std::move(packet));
      }
    }
  }
  EXPECT_GT(received.size(), sent.size() / 2);
  auto place = sent.begin();
  for (const Octets& packet : received) {
    place = std::find(place, sent.end(), packet);
    ASSERT_NE(place, sent.end()) << "a packet nobody sent, or out of order";
    ++place;
  }
}

}  // namespace
}  // namespace srfs::wire
