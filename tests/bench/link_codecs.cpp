// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

extern "C" {
#include <fec.h>
}

#include "tests/bench/link_measures.hpp"
#include "wire/cadu.hpp"
#include "wire/cltu.hpp"
#include "wire/reed_solomon.hpp"
#include "wire/sdls.hpp"
#include "wire/tc_frame.hpp"
#include "wire/tm_frame.hpp"

namespace srfs::bench {
namespace {

using wire::rs_codeword_octets;
using wire::rs_data_octets;
using wire::rs_parity_octets;

constexpr std::size_t words = 64;  // per round: at least about ten microseconds
constexpr std::uint16_t spacecraft = 0xAB;

void require(bool right, const std::string& what) {
  if (!right) throw std::runtime_error("wrong answer: " + what);
}

Octets noise(std::mt19937_64& random, std::size_t octets) {
  Octets data(octets);
  for (std::uint8_t& octet : data) octet = static_cast<std::uint8_t>(random());
  return data;
}

/// Microseconds per item.
template <typename Work>
double time_of(std::size_t pieces, const Work& work) {
  const MonotonicTime begin = monotonic_now();
  work();
  return static_cast<double>((monotonic_now() - begin).count()) * 1e-3 / static_cast<double>(pieces);
}

struct Pair {
  std::vector<double> ours;
  std::vector<double> peer;
};

Json to_json(const Pair& pair) {
  return {{"ours_us", summary(pair.ours)},
          {"libfec_us", summary(pair.peer)},
          // speed-up: the peer's time divided by ours
          {"ratio", ratio(pair.peer, pair.ours)}};
}

Pair measure_encoding(const CodecOptions& options, std::mt19937_64& random) {
  Pair pair;
  for (int round = 0; round < options.rounds; ++round) {
    std::vector<Octets> data;
    for (std::size_t i = 0; i < words; ++i) data.push_back(noise(random, rs_data_octets));
    std::vector<Octets> coded(words);
    std::vector<std::array<std::uint8_t, rs_parity_octets>> parity(words);
    const auto ours = [&] {
      for (std::size_t i = 0; i < words; ++i) coded[i] = wire::rs_encode(data[i], 1);
    };
    const auto peer = [&] {
      for (std::size_t i = 0; i < words; ++i) encode_rs_ccsds(data[i].data(), parity[i].data(), 0);
    };
    const bool first = round % 2 == 0;
    if (first) pair.ours.push_back(time_of(words, ours));
    pair.peer.push_back(time_of(words, peer));
    if (!first) pair.ours.push_back(time_of(words, ours));
    for (std::size_t i = 0; i < words; ++i)
      require(std::equal(parity[i].begin(), parity[i].end(), coded[i].begin() + rs_data_octets), "parity");
  }
  return pair;
}

Pair measure_decoding(const CodecOptions& options, std::mt19937_64& random, unsigned errors) {
  Pair pair;
  for (int round = 0; round < options.rounds; ++round) {
    std::vector<Octets> sent;
    std::vector<Octets> received;
    for (std::size_t i = 0; i < words; ++i) {
      sent.push_back(wire::rs_encode(noise(random, rs_data_octets), 1));
      received.push_back(sent.back());
      std::array<std::size_t, rs_codeword_octets> places{};
      for (std::size_t k = 0; k < places.size(); ++k) places[k] = k;
      std::shuffle(places.begin(), places.end(), random);
      for (unsigned k = 0; k < errors; ++k)
        received.back()[places[k]] ^= static_cast<std::uint8_t>(1 + random() % 255);
    }
    std::vector<Octets> decoded(words);
    std::vector<Octets> in_place = received;
    const auto ours = [&] {
      for (std::size_t i = 0; i < words; ++i) {
        auto word = wire::rs_decode(received[i], 1);
        if (word) decoded[i] = std::move(word->data);
      }
    };
    const auto peer = [&] {
      for (Octets& word : in_place) decode_rs_ccsds(word.data(), nullptr, 0, 0);
    };
    const bool first = round % 2 == 0;
    if (first) pair.ours.push_back(time_of(words, ours));
    pair.peer.push_back(time_of(words, peer));
    if (!first) pair.ours.push_back(time_of(words, ours));
    for (std::size_t i = 0; i < words; ++i) {
      require(in_place[i] == sent[i], "libfec's decoded word");
      require(
          std::equal(decoded[i].begin(), decoded[i].end(), sent[i].begin(), sent[i].begin() + rs_data_octets),
          "decoded word");
    }
  }
  return pair;
}

/// Encodes a frame of random data into its CADU and decodes it.
Json measure_cadu(const CodecOptions& options, std::mt19937_64& random, unsigned interleave) {
  const wire::CaduFormat format{.frame_octets = rs_data_octets * interleave, .interleave = interleave};
  std::vector<double> encode;
  std::vector<double> decode;
  for (int round = 0; round < options.rounds; ++round) {
    wire::TmFrame frame{.spacecraft_id = spacecraft,
                        .data = noise(random, format.frame_octets - wire::tm_frame_overhead_octets)};
    std::vector<Octets> cadus(words);
    Octets octets;
    encode.push_back(time_of(words, [&] {
      for (Octets& cadu : cadus) cadu = wire::encode_cadu(wire::encode_tm_frame(frame), format);
    }));
    for (const Octets& cadu : cadus) octets.insert(octets.end(), cadu.begin(), cadu.end());
    wire::CaduSynchroniser synchroniser(format);
    std::vector<wire::CaduSynchroniser::Frame> found;
    decode.push_back(time_of(words, [&] { found = synchroniser.push(octets); }));
    require(found.size() == words, "frames of a row of CADUs");
    const auto read = wire::decode_tm_frame(found.back().frame, spacecraft, format.frame_octets);
    require(read && *read == frame, "frame of a CADU");
  }
  return {{"interleave", interleave},
          {"frame_to_cadu_us", summary(encode)},
          {"cadu_to_frame_us", summary(decode)}};
}

/// Encodes a packet of 100 octets into its secured CLTU and decodes it.
Json measure_cltu(const CodecOptions& options, std::mt19937_64& random) {
  constexpr std::size_t packet_octets = 100;
  constexpr std::uint16_t spi = 1;
  const wire::SdlsKey key({1, 2, 3});
  std::vector<double> encode;
  std::vector<double> decode;
  std::uint64_t counter = 0;
  for (int round = 0; round < options.rounds; ++round) {
    const Octets packet = noise(random, packet_octets);
    std::vector<Octets> cltus(words);
    encode.push_back(time_of(words, [&] {
      for (Octets& cltu : cltus) {
        auto data = wire::sdls_apply({key, spi, ++counter}, 0, 0xC0, packet);
        cltu = wire::encode_cltu(
            wire::encode_tc_frame({.spacecraft_id = spacecraft, .data = std::move(*data)}), false);
      }
    }));
    wire::CltuDecoder decoder({});
    std::size_t right = 0;
    decode.push_back(time_of(words, [&] {
      for (const Octets& cltu : cltus) {
        for (const Octets& octets : decoder.push(cltu, MonotonicTime())) {
          const auto frame = wire::decode_tc_frame(octets, spacecraft);
          const auto opened =
              frame ? wire::sdls_open(key, spi, frame->vc, frame->data) : Err(wire::SdlsError::bad_mac);
          right += opened && opened->packet == packet ? 1U : 0U;
        }
      }
    }));
    require(right == words, "packets of a row of CLTUs");
  }
  return {{"packet_octets", packet_octets},
          {"packet_to_cltu_us", summary(encode)},
          {"cltu_to_packet_us", summary(decode)}};
}

/// A frame of 223 octets as it leaves for Reed-Solomon: without security, sealed; and verified again.
Json measure_seal(const CodecOptions& options, std::mt19937_64& random) {
  constexpr std::uint16_t spi = 16;
  const auto seal = [] {
    return wire::TmSeal{.spi = spi, .authenticator = wire::TmAuthenticator::create(wire::SdlsKey({1, 2, 3}))};
  };
  wire::TmFrameBuilder open({.spacecraft_id = spacecraft, .frame_octets = rs_data_octets});
  wire::TmFrameBuilder sealed({.spacecraft_id = spacecraft, .frame_octets = rs_data_octets}, seal());
  auto authenticator = wire::TmAuthenticator::create(wire::SdlsKey({1, 2, 3}));
  std::vector<double> without;
  std::vector<double> with;
  std::vector<double> verify;
  std::uint64_t number = 0;
  for (int round = 0; round < options.rounds; ++round) {
    const auto fill = [&](wire::TmFrameBuilder& builder) {
      while (builder.queued_octets(0) < words * rs_data_octets)
        require(builder.queue_packet(0, wire::encode_space_packet({.apid = 1}, noise(random, 500))), "room");
    };
    fill(open);
    fill(sealed);
    std::vector<Octets> frames(words);
    without.push_back(time_of(words, [&] {
      for (Octets& frame : frames) frame = open.build(0, 0);
    }));
    with.push_back(time_of(words, [&] {
      for (Octets& frame : frames) frame = sealed.build(0, 0, ++number);
    }));
    std::vector<wire::TmFrame> read;
    for (const Octets& octets : frames)
      read.push_back(*wire::decode_tm_frame(octets, spacecraft, rs_data_octets));
    std::size_t right = 0;
    verify.push_back(time_of(words, [&] {
      for (std::size_t i = 0; i < words; ++i)
        right += wire::tm_sdls_open(frames[i], read[i], spi, *authenticator) ? 1U : 0U;
    }));
    require(right == words, "sealed frames");
  }
  return {{"packet_octets_of_a_frame", {{"open", open.field_octets()}, {"sealed", sealed.field_octets()}}},
          {"frame_us", summary(without)},
          {"sealed_frame_us", summary(with)},
          {"verify_us", summary(verify)}};
}

}  // namespace

Json measure_codecs(const CodecOptions& options) {
  std::mt19937_64 random(options.seed);
  Json result{{"encode", to_json(measure_encoding(options, random))}};
  for (const unsigned errors : {0U, 1U, 8U, wire::rs_correctable_octets})
    result["decode_" + std::to_string(errors) + "_errors"] =
        to_json(measure_decoding(options, random, errors));
  for (const unsigned interleave : {1U, 5U})
    result["cadu"].push_back(measure_cadu(options, random, interleave));
  result["cltu"] = measure_cltu(options, random);
  result["seal"] = measure_seal(options, random);
  return result;
}

}  // namespace srfs::bench
