// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Frames and PDUs of a stranger, made of genuine ones, in a row without a pause: nothing crashes, nothing is
// believed, and the counters of each decoder add up to what was sent. SRFS_MUTATIONS=1000000 for as many of
// each.
#include <algorithm>
#include <cstdlib>
#include <functional>
#include <numeric>
#include <random>

#include <gtest/gtest.h>

#include "cfdp/entity.hpp"
#include "fake_spacecraft.hpp"
#include "ground/downlink.hpp"
#include "lib/cfdp/test/memory_file_store.hpp"
#include "nodes/ttc/link/uplink_chain.hpp"
#include "tests/build_kind.hpp"
#include "wire/crc16.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs::ground {
namespace {

std::uint64_t mutations() {
  const char* const wanted = std::getenv("SRFS_MUTATIONS");
  if (wanted != nullptr) return std::strtoull(wanted, nullptr, 10);
  return testing_support::slow ? 2'000 : 20'000;
}

/// Changes octets, some or many; cuts, repeats and inserts, too, when the length may change.
class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : random_(seed) {}

  void change(Octets& octets) {
    const std::size_t places = 1 + below(below(8) == 0 ? 40 : 3);
    for (std::size_t i = 0; i < places && !octets.empty(); ++i)
      octets[below(octets.size())] ^= static_cast<std::uint8_t>(1 + below(255));
  }
  void mutate(Octets& octets) {
    switch (below(6)) {
      case 0:
        octets.resize(below(octets.size() + 1));
        break;
      case 1:
        octets.insert(octets.begin() + static_cast<std::ptrdiff_t>(below(octets.size() + 1)), below(20),
                      static_cast<std::uint8_t>(below(256)));
        break;
      default:
        change(octets);
    }
  }
  std::size_t below(std::size_t n) { return random_() % n; }

 private:
  std::mt19937_64 random_;
};

/// A right checksum behind whatever stands before it.
void set_fecf(Octets& octets) {
  if (octets.size() < 2) return;
  const std::uint16_t crc = wire::crc16(OctetView(octets).first(octets.size() - 2));
  octets[octets.size() - 2] = static_cast<std::uint8_t>(crc >> 8);
  octets[octets.size() - 1] = static_cast<std::uint8_t>(crc & 0xFF);
}

template <class Counters>
std::uint64_t sum_of(const Counters& counters) {
  return std::accumulate(counters.begin(), counters.end(), std::uint64_t{0});
}

TEST(MutatedInput, OfTheDownlinkEveryFrameIsInOneCounterAndNoneIsBelieved) {
  Mutator mutator(1);
  const auto link = sealed_link();
  auto authenticator = wire::TmAuthenticator::create(*wire::SdlsKey::from_hex(tm_test_key));
  Downlink downlink(link, FrameVerifier({.spi = 16}, std::move(*authenticator)));
  const wire::CaduFormat format{.frame_octets = static_cast<std::size_t>(link.tm_frame_length)};
  wire::CaduSynchroniser beside(format);
  FakeSpacecraft spacecraft(link);
  const Octets genuine = spacecraft.send(1, 3, 25, Octets(100, 7));
  const Octets frame = beside.push(genuine).at(0).frame;
  static_cast<void>(downlink.push(genuine));
  std::uint64_t octets = genuine.size();
  for (std::uint64_t i = 0; i < mutations(); ++i) {
    Octets line;
    if (mutator.below(2) == 0) {  // another frame, coded as a stranger can code it
      Octets altered = frame;
      mutator.change(altered);
      set_fecf(altered);
      line = wire::encode_cadu(altered, format);
    } else {
      line = genuine;
      mutator.mutate(line);
    }
    octets += line.size();
    EXPECT_TRUE(downlink.push(line).empty());
    static_cast<void>(beside.push(line));
  }
  const DownlinkCounters counters = downlink.counters();
  const auto& cadus = beside.counters();
  EXPECT_EQ(counters.octets, octets);
  EXPECT_EQ(counters.frames, 1U) << "the genuine one";
  EXPECT_EQ(counters.frames + counters.forged_frames + counters.replayed_frames + counters.old_frames +
                (counters.bad_frames - cadus.rejected),
            cadus.frames);
  const std::uint64_t decided =
      cadus.frames * wire::cadu_octets(format) - cadus.shared_octets + cadus.noise_octets;
  EXPECT_LE(decided, octets);
  EXPECT_GT(decided + 2 * wire::cadu_octets(format), octets) << "the rest waits for its end";
}

TEST(MutatedInput, OfTheUplinkEveryFrameIsInOneCounterAndNoneIsExecuted) {
  Mutator mutator(2);
  constexpr std::uint16_t spacecraft = 0xAB;
  const auto key = [](std::uint16_t spi) { return wire::SdlsKey({static_cast<std::uint8_t>(spi)}); };
  UplinkConfig config;
  config.spacecraft_id = spacecraft;
  config.strict = true;
  config.cltu.correct_single_bits = true;
  UplinkChannel channel{.vc = 0, .associations = {}};
  channel.associations.push_back({.spi = 1, .key = key(1), .for_ad = false, .for_bd = true});
  channel.associations.push_back({.spi = 2, .key = key(2), .for_ad = true, .for_bd = false});
  config.channels.push_back(std::move(channel));
  UplinkChain chain(std::move(config), {});
  const wire::TcUplinkChannel ground{
      .spacecraft_id = spacecraft, .vc = 0, .randomize = false, .whole_header = true};
  std::vector<Octets> genuine;
  std::vector<Octets> frames;
  std::uint64_t executed = 0;
  std::uint64_t octets = 0;
  const auto push = [&](const Octets& line) {
    octets += line.size();
    executed += chain.push(line, MonotonicTime{}).size();
    static_cast<void>(chain.take_refused());
  };
  for (std::uint64_t counter = 1; counter <= 4; ++counter) {
    const bool is_ad = counter % 2 == 0;
    const wire::SdlsKey used = key(is_ad ? 2 : 1);
    const wire::SdlsSeal seal{
        .key = used, .spi = static_cast<std::uint16_t>(is_ad ? 2 : 1), .counter = counter};
    const auto sequence = static_cast<std::uint8_t>(is_ad ? counter / 2 - 1 : 0);
    genuine.push_back(wire::make_uplink_cltu(ground, is_ad ? wire::TcFrameType::ad : wire::TcFrameType::bd,
                                             sequence, &seal, Octets(20 * counter, 7))
                          .value());
    wire::CltuDecoder decoder({});
    frames.push_back(decoder.push(genuine.back(), MonotonicTime{}).at(0));
    push(genuine.back());
  }
  ASSERT_EQ(executed, genuine.size());
  for (std::uint64_t i = 0; i < mutations(); ++i) {
    const std::size_t which = mutator.below(genuine.size());
    Octets line = genuine[which];
    if (mutator.below(2) == 0) {
      Octets altered = frames[which];
      mutator.change(altered);
      set_fecf(altered);
      line = wire::encode_cltu(altered, false);
    } else if (mutator.below(8) != 0) {
      mutator.mutate(line);
    }
    push(line);
  }
  executed += chain.on_idle(MonotonicTime{} + seconds(1)).size();
  const UplinkCounters& c = chain.counters();
  EXPECT_EQ(executed, genuine.size()) << "those of the ground alone";
  EXPECT_EQ(c.octets, octets);
  EXPECT_EQ(std::uint64_t{c.wrong_scid} + c.wrong_header + c.wrong_vc + c.not_authentic + c.replayed +
                c.too_old + c.counter_out_of_range + c.farm_discarded + c.bad_control_command +
                c.bad_segment + c.control_commands + c.packets,
            chain.cltu_counters().cltus_decoded);
  EXPECT_FALSE(chain.farm(0).lockout);
}

TEST(MutatedInput, OfFilesEveryPduIsInOneCounterAndMemoryIsBounded) {
  Mutator mutator(3);
  cfdp::Settings settings;
  settings.own_entity = 2;
  settings.peer_entity = 1;
  settings.transactions_max = 8;
  settings.receiving_max = 4;
  settings.receiving_octets_max = 1U << 20;
  settings.file_octets_max = 1U << 18;
  cfdp::MemoryFileStore files;
  files.add("a", Octets(3000, 7));
  cfdp::Entity entity(settings, files, 1);
  MonotonicTime now{seconds(1)};
  const wire::CfdpHeader up{.source_entity = 1, .sequence_number = 7, .destination_entity = 2};
  const wire::CfdpHeader down{.source_entity = 2, .sequence_number = 1, .destination_entity = 1};
  const Octets data(200, 5);
  const std::vector<Octets> genuine{
      wire::encode_cfdp_pdu(
          up, wire::CfdpMetadata{.file_size = 4000, .source_file = "x", .destination_file = "y"}),
      wire::encode_cfdp_pdu(up, wire::CfdpFileData{.offset = 400, .data = data}),
      wire::encode_cfdp_pdu(up, wire::CfdpEof{.checksum = 1, .file_size = 4000}),
      wire::encode_cfdp_pdu(down, wire::CfdpNak{.scope = {0, 3000}, .segments = {{0, 100}, {500, 900}}}),
      wire::encode_cfdp_pdu(down, wire::CfdpFinished{}),
      wire::encode_cfdp_pdu(down, wire::CfdpAck{}),
  };
  for (std::uint64_t i = 0; i < mutations(); ++i) {
    if (i % 64 == 0) static_cast<void>(entity.put("a", "b"));
    Octets pdu = genuine[mutator.below(genuine.size())];
    if (mutator.below(8) != 0) mutator.mutate(pdu);
    entity.on_pdu(pdu, now);
    static_cast<void>(entity.next_pdu(cfdp::Entity::pdu_octets_min, now));
    static_cast<void>(entity.take_events());
    now += milliseconds(1);
    ASSERT_LE(entity.transactions().size(), settings.transactions_max);
    ASSERT_LE(files.temporaries(), settings.transactions_max);
  }
  EXPECT_EQ(sum_of(entity.counts().malformed) + entity.counts().pdus_received, mutations());
}

}  // namespace
}  // namespace srfs::ground
