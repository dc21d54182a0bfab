// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/uplink_chain.hpp"

#include <array>
#include <random>
#include <tuple>

#include <gtest/gtest.h>

#include "nodes/ttc/command/persistence_gate.hpp"
#include "wire/pus.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs {
namespace {

constexpr std::uint16_t spacecraft = 0xAB;

wire::SdlsKey test_key() {
  std::array<std::uint8_t, wire::sdls_key_octets> key{};
  for (std::size_t i = 0; i < key.size(); ++i) key[i] = static_cast<std::uint8_t>(i);
  return wire::SdlsKey(key);
}

Octets ping(std::uint16_t sequence = 22) {
  wire::TcPacket packet;
  packet.apid = 1;
  packet.sequence_count = sequence;
  packet.service = 17;
  packet.subtype = 1;
  return wire::make_tc_packet(packet);
}

class Uplink : public testing::Test {
 protected:
  static UplinkConfig config() {
    UplinkConfig c;
    c.spacecraft_id = spacecraft;
    UplinkChannel secured;
    secured.vc = 0;
    secured.associations.push_back(
        UplinkAssociation{.spi = 1, .key = test_key(), .for_ad = true, .for_bd = true});
    c.channels.push_back(std::move(secured));
    c.channels.push_back(UplinkChannel{.vc = 1, .associations = {}});
    return c;
  }
  [[nodiscard]] Octets open_bd(OctetView packet, std::uint16_t scid = spacecraft, std::uint8_t vc = 1) const {
    return wire::make_uplink_cltu({.spacecraft_id = scid, .vc = vc, .randomize = false},
                                  wire::TcFrameType::bd, 0, nullptr, packet)
        .value();
  }
  [[nodiscard]] Octets secured(std::uint64_t counter, wire::TcFrameType type = wire::TcFrameType::bd,
                               std::uint8_t sequence = 0) const {
    const wire::SdlsSeal seal{.key = key_, .spi = 1, .counter = counter};
    return wire::make_uplink_cltu({.spacecraft_id = spacecraft, .vc = 0, .randomize = false}, type, sequence,
                                  &seal, ping())
        .value();
  }
  std::size_t push(const Octets& octets, int ms = 0) {
    return chain_.push(octets, MonotonicTime(milliseconds(ms))).size();
  }
  wire::SdlsKey key_ = test_key();
  UplinkChain chain_{config(), LinkState{}};
};

TEST_F(Uplink, HandsOutThePacketOfTheIndependentVector) {
  // "CLTU of the AD frame" of tests/vectors/ground_link.txt carries N(S) = 5.
  const wire::TcUplinkChannel channel{.spacecraft_id = spacecraft, .vc = 1, .randomize = false};
  push(wire::make_control_cltu(channel, {.kind = wire::ControlCommand::Kind::set_vr, .vr = 5}));

  const auto got = chain_.push(
      *from_hex("eb9000ab041405c0186401c01600062f1124010000ab62d16fe8c5c5c5c5c5c5c579"), MonotonicTime{});

  ASSERT_EQ(got.size(), 1U);
  EXPECT_EQ(to_hex(got[0].packet), "1801c01600062f11010000ab62");
  EXPECT_EQ(got[0].frame.type, wire::TcFrameType::ad);
  EXPECT_FALSE(got[0].frame.spi);
  EXPECT_EQ(chain_.farm(1).vr, 6);
}

TEST_F(Uplink, TakesACltuInSingleOctets) {
  std::size_t packets = 0;
  for (const std::uint8_t octet : open_bd(ping())) packets += push({octet});
  EXPECT_EQ(packets, 1U);
}

TEST_F(Uplink, CountsEachKindOfBadInputAndTheNextGoodOneWorks) {
  Octets bad_block = open_bd(ping());
  bad_block[5] ^= 0xFF;
  push(bad_block);
  EXPECT_EQ(chain_.cltu_counters().blocks_rejected, 1U);

  push(open_bd(ping(), 0x55));
  EXPECT_EQ(chain_.counters().wrong_scid, 1U);

  push(open_bd(ping(), spacecraft, 9));
  EXPECT_EQ(chain_.counters().wrong_vc, 1U);

  Octets wrong_fecf = *from_hex("20ab041400c01801c01600062f11010000ab62849b");
  wrong_fecf.back() ^= 1;
  push(wire::encode_cltu(wrong_fecf, false));
  EXPECT_EQ(chain_.cltu_counters().bad_fecf, 1U);

  wire::TcFrame segmented{.type = wire::TcFrameType::bd,
                          .spacecraft_id = spacecraft,
                          .vc = 1,
                          .sequence = 0,
                          .data = {0x40, 1, 2}};
  push(wire::encode_cltu(wire::encode_tc_frame(segmented), false));
  EXPECT_EQ(chain_.counters().bad_segment, 1U);

  push(Octets(4000, 0x55));
  EXPECT_EQ(push(open_bd(ping())), 1U);
  EXPECT_EQ(chain_.counters().packets, 1U);
}

TEST_F(Uplink, KeepsThePacketsOfAuthenticFramesThatCameBefore) {
  EXPECT_EQ(push(secured(5)), 1U);
  EXPECT_TRUE(chain_.take_refused().empty());

  EXPECT_EQ(push(secured(5)), 0U);
  auto refused = chain_.take_refused();
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0].frame.spi, 1);
  EXPECT_EQ(refused[0].frame.counter, 5U);
  EXPECT_EQ(refused[0].packet, ping());

  EXPECT_EQ(push(secured(6, wire::TcFrameType::ad, 0)), 1U);
  EXPECT_EQ(push(secured(7, wire::TcFrameType::ad, 0)), 0U) << "FARM-1 has it";
  refused = chain_.take_refused();
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0].frame.type, wire::TcFrameType::ad);
  EXPECT_EQ(refused[0].frame.sequence, 0);
  EXPECT_EQ(refused[0].packet, ping());

  Octets forged = secured(5);
  forged[20] ^= 0x01;
  for (int i = 0; i < 40; ++i) push(secured(5));
  push(forged);
  EXPECT_EQ(chain_.take_refused().size(), UplinkChain::max_refused);
}

TEST_F(Uplink, AHalfCltuFollowedBySilenceDoesNotHoldTheLine) {
  Octets half = open_bd(ping());
  half.resize(half.size() / 2);
  EXPECT_EQ(push(half, 0), 0U);
  ASSERT_TRUE(chain_.idle_deadline());

  EXPECT_TRUE(chain_.on_idle(*chain_.idle_deadline()).empty());

  EXPECT_EQ(chain_.cltu_counters().cut_short, 1U);
  EXPECT_FALSE(chain_.idle_deadline());
  EXPECT_EQ(push(open_bd(ping()), 2000), 1U);
}

TEST(UplinkConfig, NamesTheAssociationsThatShareAKey) {
  const auto association = [](std::uint16_t spi, std::uint8_t first_octet) {
    return UplinkAssociation{
        .spi = spi,
        .key = wire::SdlsKey(std::array<std::uint8_t, wire::sdls_key_octets>{first_octet}),
        .for_ad = true,
        .for_bd = true};
  };
  const auto channel = [](std::uint8_t vc, UplinkAssociation only) {
    UplinkChannel made{.vc = vc, .associations = {}};
    made.associations.push_back(std::move(only));
    return made;
  };
  UplinkConfig config;
  config.channels.push_back(channel(0, association(1, 7)));
  config.channels.front().associations.push_back(association(2, 8));
  EXPECT_FALSE(associations_with_one_key(config).has_value());
  config.channels.push_back(channel(1, association(3, 8)));
  EXPECT_EQ(associations_with_one_key(config), std::pair(std::uint16_t{2}, std::uint16_t{3}));
}

TEST_F(Uplink, RefusesAReplayAndAnOldCounterOnASecuredChannel) {
  const Octets tenth = secured(10);
  EXPECT_EQ(push(tenth), 1U);
  EXPECT_EQ(push(tenth), 0U);
  EXPECT_EQ(push(secured(9)), 0U);
  EXPECT_EQ(push(secured(1'000'000)), 1U) << "any higher counter is fresh";

  EXPECT_EQ(chain_.counters().replayed, 2U);
  EXPECT_EQ(chain_.counter(1), 1'000'000U);
  EXPECT_EQ(chain_.counters().refused_counter, 9U);
}

TEST_F(Uplink, RefusesAnythingNotAuthenticOnASecuredChannel) {
  EXPECT_EQ(push(open_bd(ping(), spacecraft, 0)), 0U);
  EXPECT_EQ(chain_.counters().not_authentic, 1U);

  // Altered before BCH and FECF are computed, so only the MAC can detect the change.
  const wire::SdlsSeal seal{.key = key_, .spi = 1, .counter = 5};
  Octets field = wire::sdls_apply(seal, 0, wire::segment_header_unsegmented, ping()).value();
  field[20] ^= 1;
  const wire::TcFrame frame{
      .type = wire::TcFrameType::bd, .spacecraft_id = spacecraft, .vc = 0, .sequence = 0, .data = field};
  EXPECT_EQ(push(wire::encode_cltu(wire::encode_tc_frame(frame), false)), 0U);
  EXPECT_EQ(chain_.counters().not_authentic, 2U);
  EXPECT_FALSE(chain_.counter(1));
}

TEST_F(Uplink, ACounterOfMoreThan64BitsIsRefusedForThatReason) {
  // Generated with Python's ctypes and libcrypto: SPI 1, IV 2^64 + 9, the ping of the vectors.
  Octets field = *from_hex(
      "c000010000000100000000000000098c7ab47754befc332a30be26cf2d9b"
      "b4f1a156d8a2c2114900a18f0280");
  const auto push_field = [&] {
    const wire::TcFrame frame{
        .type = wire::TcFrameType::bd, .spacecraft_id = spacecraft, .vc = 0, .sequence = 0, .data = field};
    return push(wire::encode_cltu(wire::encode_tc_frame(frame), false));
  };
  EXPECT_EQ(push_field(), 0U);
  EXPECT_EQ(chain_.counters().counter_out_of_range, 1U);
  EXPECT_EQ(chain_.counters().not_authentic, 0U);
  EXPECT_FALSE(chain_.counter(1));

  field.back() ^= 1;
  EXPECT_EQ(push_field(), 0U);
  EXPECT_EQ(chain_.counters().not_authentic, 1U) << "the MAC is checked first";
  EXPECT_EQ(chain_.counters().counter_out_of_range, 1U);
}

TEST_F(Uplink, CountersThatWereLostGoOnBehindAFloorOfTheTime) {
  const UtcTime now(seconds(1'795'000'000));
  const std::uint64_t floor = lost_counter_floor(now);
  EXPECT_EQ(floor, 1'794'999'940'000U) << "milliseconds, a minute ago";
  EXPECT_EQ(lost_counter_floor(UtcTime{}), 0U);
  push(secured(5));
  const std::uint64_t before = chain_.state().generation;
  chain_.raise_counters(floor);
  EXPECT_GT(chain_.state().generation, before) << "it goes to the disk at once";
  EXPECT_EQ(chain_.counter(1), floor);
  EXPECT_EQ(push(secured(6)), 0U) << "a recording";
  EXPECT_EQ(push(secured(floor)), 0U);
  EXPECT_EQ(push(secured(floor + 1)), 1U);
  chain_.raise_counters(floor);
  EXPECT_EQ(chain_.counter(1), floor + 1) << "never back";
}

TEST_F(Uplink, AFrameThatFarmDiscardsDoesNotAdvanceTheCounter) {
  EXPECT_EQ(push(secured(7, wire::TcFrameType::ad, 3)), 0U) << "V(R) is 0";

  EXPECT_FALSE(chain_.counter(1));
  EXPECT_EQ(chain_.counters().farm_discarded, 1U);
  EXPECT_TRUE(chain_.farm(0).retransmit);
  EXPECT_EQ(push(secured(7, wire::TcFrameType::ad, 0)), 1U);
  EXPECT_EQ(chain_.counter(1), 7U);
}

TEST_F(Uplink, RemembersCounterAndFarmAcrossARestart) {
  push(secured(12, wire::TcFrameType::ad, 0));
  const auto copy = decode_link_state(encode_link_state(chain_.state()));
  ASSERT_TRUE(copy);

  UplinkChain next(config(), *copy);

  EXPECT_EQ(next.counter(1), 12U);
  EXPECT_EQ(next.farm(0).vr, 1);
  EXPECT_TRUE(next.push(secured(12), MonotonicTime{}).empty());
}

TEST_F(Uplink, CarriesTheCountersOfADeploymentThatIsAwayAlong) {
  LinkState stored;
  stored.channels.push_back({.vc = 5, .farm = {.vr = 77}});
  stored.associations.push_back({.spi = 9, .counter = 4711});
  UplinkChain chain(config(), stored);
  (void)chain.push(secured(12), MonotonicTime{});

  const auto copy = decode_link_state(encode_link_state(chain.state()));

  ASSERT_TRUE(copy);
  UplinkConfig other;
  other.spacecraft_id = spacecraft;
  other.channels.push_back(UplinkChannel{.vc = 5, .associations = {}});
  other.channels[0].associations.push_back(UplinkAssociation{.spi = 9, .key = test_key()});
  const UplinkChain next(std::move(other), *copy);
  EXPECT_EQ(next.counter(9), 4711U);
  EXPECT_EQ(next.counter(1), 12U);
  EXPECT_EQ(next.farm(5).vr, 77);
}

TEST_F(Uplink, CarriesOnlySoManyForeignCountersAlong) {
  LinkState stored;
  for (std::uint16_t i = 0; i < max_link_associations; ++i)
    stored.associations.push_back({.spi = static_cast<std::uint16_t>(100 + i), .counter = i});
  for (std::uint8_t i = 0; i < max_link_channels; ++i)
    stored.channels.push_back({.vc = static_cast<std::uint8_t>(10 + i), .farm = {}});
  UplinkChain chain(config(), stored);
  (void)chain.push(secured(12), MonotonicTime{});

  EXPECT_EQ(chain.state().associations.size(), max_link_associations);
  EXPECT_EQ(chain.state().channels.size(), max_link_channels);
  EXPECT_EQ(chain.counter(1), 12U);
}

TEST_F(Uplink, TheControlWordAcknowledgesOnlyWhatIsStored) {
  const auto report_value = [this] {
    const std::uint32_t word = chain_.next_clcw();
    (void)chain_.next_clcw();  // skips the CLCW of the other channel
    return word & 0xFF;
  };
  const auto packets = chain_.push(secured(1, wire::TcFrameType::ad, 0), MonotonicTime{});
  ASSERT_EQ(packets.size(), 1U);
  const LinkState first = chain_.state();
  EXPECT_EQ(packets[0].link, first);
  push(secured(2, wire::TcFrameType::ad, 1));
  EXPECT_EQ(chain_.farm(0).vr, 2);
  EXPECT_EQ(report_value(), 0U);

  EXPECT_TRUE(chain_.on_stored(first));
  EXPECT_EQ(report_value(), 1U);
  EXPECT_EQ(chain_.stored_state(), first);
  EXPECT_FALSE(chain_.on_stored(first)) << "nothing new";
  EXPECT_TRUE(chain_.on_stored(chain_.state()));
  EXPECT_EQ(report_value(), 2U);
}

TEST_F(Uplink, ControlCommandsAndFlagsShowAtOnceUnlessDataWaitsBeforeThem) {
  const wire::TcUplinkChannel channel{.spacecraft_id = spacecraft, .vc = 0, .randomize = false};
  const auto set_vr = [&](std::uint8_t vr) {
    push(wire::make_control_cltu(channel, {.kind = wire::ControlCommand::Kind::set_vr, .vr = vr}));
  };
  const auto report_value = [this] {
    const std::uint32_t word = chain_.next_clcw();
    (void)chain_.next_clcw();
    return word & 0xFF;
  };
  const std::uint64_t before = chain_.state().generation;
  set_vr(7);
  EXPECT_EQ(report_value(), 7U);
  EXPECT_EQ(chain_.state().generation, before) << "nothing that goes to the disk";

  push(secured(1, wire::TcFrameType::ad, 7));
  EXPECT_GT(chain_.state().generation, before);
  set_vr(20);
  EXPECT_EQ(report_value(), 7U) << "the frame is not stored yet";
  chain_.on_stored(chain_.state());
  EXPECT_EQ(report_value(), 20U);

  push(secured(2, wire::TcFrameType::ad, 20));
  chain_.set_buffer_available(false);
  push(secured(3, wire::TcFrameType::ad, 21));
  const std::uint32_t word = chain_.next_clcw();
  EXPECT_EQ(word & 0xFF, 20U);
  EXPECT_EQ(word & 0x1800, 0x1800U) << "wait and retransmit at once";
}

TEST_F(Uplink, TheControlWordAlternatesOverTheChannels) {
  push(secured(1, wire::TcFrameType::ad, 0));
  chain_.on_stored(chain_.state());

  EXPECT_EQ(chain_.next_clcw(), 0x01000001U);
  EXPECT_EQ(chain_.next_clcw(), 0x01040000U);
  EXPECT_EQ(chain_.next_clcw(), 0x01000001U);
}

TEST_F(Uplink, MakesAdFramesWaitWhileTheBufferIsFull) {
  chain_.set_buffer_available(false);
  EXPECT_EQ(push(secured(1, wire::TcFrameType::ad, 0)), 0U);
  EXPECT_TRUE(chain_.farm(0).wait);

  chain_.set_buffer_available(true);

  EXPECT_FALSE(chain_.farm(0).wait);
  EXPECT_EQ(push(secured(2, wire::TcFrameType::ad, 0)), 1U);
}

TEST_F(Uplink, EveryGoodCltuComesThroughAHundredThousandRandomOctets) {
  std::mt19937 random(1);
  std::size_t sent = 0;
  std::size_t received = 0;
  std::size_t noise = 0;
  int ms = 0;
  while (noise < 100'000) {
    Octets chunk(random() % 300);
    for (std::uint8_t& octet : chunk) octet = static_cast<std::uint8_t>(random());
    noise += chunk.size();
    received += push(chunk, ++ms);
    if (random() % 4 == 0) {  // sometimes a false start sequence
      received += push({0xEB, 0x90, static_cast<std::uint8_t>(random())}, ms);
      noise += 3;
    }
    received += push(open_bd(ping(static_cast<std::uint16_t>(sent & 0x3FFF))), ms);
    ++sent;
  }
  received += chain_.on_idle(MonotonicTime(seconds(3600))).size();

  EXPECT_GT(sent, 500U);
  EXPECT_EQ(received, sent);
}

JudgedTelecommand judged() {
  return {};
}

TEST(PersistenceGate, HoldsATelecommandUntilItsRecordIsOnDisk) {
  PersistenceGate gate(milliseconds(1000));
  ASSERT_TRUE(gate.enter(judged(), 1, MonotonicTime{}));
  ASSERT_TRUE(gate.wants_write(1));
  gate.on_write_begun(1);
  ASSERT_TRUE(gate.enter(judged(), 2, MonotonicTime{}));
  EXPECT_FALSE(gate.wants_write(2)) << "one write at a time";
  EXPECT_TRUE(gate.take_passed().empty());

  gate.on_write_done(true, MonotonicTime{});

  EXPECT_EQ(gate.take_passed().size(), 1U);
  EXPECT_TRUE(gate.wants_write(2));
  gate.on_write_begun(2);
  gate.on_write_done(true, MonotonicTime{});
  const auto passed = gate.take_passed();
  ASSERT_EQ(passed.size(), 1U);
  EXPECT_TRUE(passed[0].durable);
}

Report end_of(std::uint64_t id) {
  Report report;
  report.ends = id;
  return report;
}

TEST(PersistenceGate, HoldsTheReportOfAnEndUntilItsRecordIsOnDisk) {
  PersistenceGate gate(milliseconds(1000));
  gate.hold(end_of(1), 1, MonotonicTime{});
  ASSERT_TRUE(gate.wants_write(1));
  gate.on_write_begun(1);
  gate.hold(end_of(2), 2, MonotonicTime{});
  EXPECT_TRUE(gate.take_released().empty());

  gate.on_write_done(true, MonotonicTime{});
  const auto released = gate.take_released();
  ASSERT_EQ(released.size(), 1U);
  EXPECT_EQ(released[0].report.ends, 1U);
  EXPECT_TRUE(released[0].sure);
  gate.hold(end_of(3), 1, MonotonicTime{});
  EXPECT_TRUE(gate.take_released().empty()) << "in their order";

  EXPECT_EQ(gate.next_due(), MonotonicTime(milliseconds(5000)));
  gate.on_time(MonotonicTime(milliseconds(4999)));
  EXPECT_TRUE(gate.take_released().empty()) << "a slow disk makes no end unsure";
  gate.on_time(MonotonicTime(milliseconds(5000)));
  const auto unsure = gate.take_released();
  ASSERT_EQ(unsure.size(), 2U) << "a hanging disk does not keep the ground waiting";
  EXPECT_FALSE(unsure[0].sure);
}

TEST(PersistenceGate, AFailedWriteReleasesTheReportsThatWaitedForIt) {
  PersistenceGate gate(milliseconds(1000));
  gate.hold(end_of(1), 1, MonotonicTime{});
  gate.on_write_begun(1);
  gate.on_write_done(false, MonotonicTime{});
  const auto released = gate.take_released();
  ASSERT_EQ(released.size(), 1U);
  EXPECT_FALSE(released[0].sure);
}

TEST(PersistenceGate, BeyondItsBoundTheOldestReportLeavesUnsure) {
  PersistenceGate gate(milliseconds(1000));
  for (std::uint64_t id = 0; id <= PersistenceGate::held_capacity; ++id)
    gate.hold(end_of(id), 1, MonotonicTime{});
  const auto released = gate.take_released();
  ASSERT_EQ(released.size(), 1U);
  EXPECT_EQ(released[0].report.ends, 0U);
  EXPECT_FALSE(released[0].sure);
}

TEST(PersistenceGate, AFailingOrHangingDiskLetsTelecommandsPassAsNotDurable) {
  PersistenceGate gate(milliseconds(1000));
  ASSERT_TRUE(gate.enter(judged(), 1, MonotonicTime{}));
  gate.on_write_begun(1);
  gate.on_write_done(false, MonotonicTime{});
  auto passed = gate.take_passed();
  ASSERT_EQ(passed.size(), 1U);
  EXPECT_FALSE(passed[0].durable);

  ASSERT_TRUE(gate.enter(judged(), 2, MonotonicTime{}));
  gate.on_write_begun(2);
  EXPECT_EQ(gate.next_due(), MonotonicTime(milliseconds(1000)));
  gate.on_time(MonotonicTime(milliseconds(1000)));
  passed = gate.take_passed();
  ASSERT_EQ(passed.size(), 1U);
  EXPECT_FALSE(passed[0].durable);
}

TEST(PersistenceGate, WaitsASecondAfterAFailedWriteBeforeTheNext) {
  PersistenceGate gate(milliseconds(1000));
  gate.on_write_begun(1);
  gate.on_write_done(false, MonotonicTime(milliseconds(500)));

  EXPECT_FALSE(gate.wants_write(1));
  EXPECT_EQ(gate.next_due(), MonotonicTime(milliseconds(1500)));
  gate.on_time(MonotonicTime(milliseconds(1499)));
  EXPECT_FALSE(gate.wants_write(1));
  gate.on_time(MonotonicTime(milliseconds(1500)));
  EXPECT_TRUE(gate.wants_write(1));
  EXPECT_FALSE(gate.next_due());
}

TEST(PersistenceGate, DoesNotWriteAgainWhatWasLoaded) {
  PersistenceGate gate(milliseconds(1000), 12);
  EXPECT_FALSE(gate.wants_write(12));
  EXPECT_TRUE(gate.wants_write(13));
}

TEST(PersistenceGate, IsBounded) {
  PersistenceGate gate(milliseconds(1000));
  for (std::size_t i = 0; i < PersistenceGate::capacity; ++i)
    ASSERT_TRUE(gate.enter(judged(), i + 1, MonotonicTime{}));
  EXPECT_FALSE(gate.has_room());
  EXPECT_FALSE(gate.enter(judged(), 100, MonotonicTime{}));
  EXPECT_EQ(gate.counters().refused, 1U);
}

TEST(UplinkKeys, TheSelectedSetIsTakenAndTheContingencyAlways) {
  const auto key_of = [](std::uint8_t spi) { return wire::SdlsKey({spi}); };
  UplinkConfig config;
  config.spacecraft_id = spacecraft;
  UplinkChannel channel{.vc = 0, .associations = {}};
  for (const auto& [spi, set, ad, bd] : {std::tuple{1, std::optional(KeySet::a), false, true},
                                         {2, KeySet::a, true, false},
                                         {3, KeySet::b, true, true},
                                         {5, std::nullopt, true, true}}) {
    const auto number = static_cast<std::uint8_t>(spi);
    channel.associations.push_back(
        {.spi = number, .key = key_of(number), .for_ad = ad, .for_bd = bd, .set = set});
  }
  config.channels.push_back(std::move(channel));
  UplinkChain chain(std::move(config), {});
  std::uint64_t counter = 0;
  const auto takes = [&](std::uint8_t spi) {
    const wire::SdlsKey key = key_of(spi);
    const wire::SdlsSeal seal{.key = key, .spi = spi, .counter = ++counter};
    return chain
               .push(wire::make_uplink_cltu({.spacecraft_id = spacecraft, .vc = 0}, wire::TcFrameType::bd, 0,
                                            &seal, ping())
                         .value(),
                     MonotonicTime(seconds(counter)))
               .size() == 1;
  };
  const auto used = [&] {
    const auto a = chain.associations();
    return std::array{a.bd, a.ad, a.contingency};
  };

  EXPECT_TRUE(takes(1) && !takes(3) && takes(5));
  EXPECT_EQ(used(), (std::array<std::uint16_t, 3>{1, 2, 5}));
  EXPECT_TRUE(chain.select(0, KeySet::b));
  EXPECT_TRUE(!takes(1) && takes(3) && takes(5));
  EXPECT_EQ(used(), (std::array<std::uint16_t, 3>{3, 3, 5}));
  EXPECT_FALSE(chain.select(1, KeySet::b)) << "there is no such channel";
  EXPECT_TRUE(chain.select(0, KeySet::a));
  EXPECT_TRUE(takes(1) && !takes(3) && takes(5));
  EXPECT_EQ(chain.counters().not_authentic, 3U);
}

}  // namespace
}  // namespace srfs
