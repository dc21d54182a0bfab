// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/bus_arbiter.hpp"

#include <map>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace srfs::sim {
namespace {

constexpr MonotonicTime start{seconds(5)};

BusFrame frame(std::uint32_t id, std::uint8_t size = 8, std::uint8_t fill = 0x5A) {
  BusFrame f{.id = id, .size = size};
  for (std::size_t i = 0; i < size; ++i) f.data[i] = fill;
  return f;
}

std::vector<BusDelivery> run(BusArbiter& bus, MonotonicTime until) {
  std::vector<BusDelivery> all;
  while (const auto delivery = bus.advance(until)) all.push_back(*delivery);
  return all;
}

TEST(BitsOnWire, AreWithinTheBoundsOfTheFrameFormat) {
  // Without stuffing a frame takes 47 + 8 n (standard) or 67 + 8 n (extended) bits, including intermission.
  std::mt19937 random(3);
  for (int i = 0; i < 2000; ++i) {
    BusFrame f{.id = static_cast<std::uint32_t>(random()) & 0x1FFFFFFFU,
               .size = static_cast<std::uint8_t>(random() % 9)};
    for (auto& octet : f.data) octet = static_cast<std::uint8_t>(random());
    const unsigned plain = 67U + 8U * f.size;
    const unsigned stuffable = 54U + 8U * f.size;
    EXPECT_GE(bits_on_wire(f), plain);
    EXPECT_LE(bits_on_wire(f), plain + (stuffable - 1) / 4);
  }
}

// SOF, identifier 0, RTR, IDE, r0, DLC 0 and the CRC of zeros are 34 dominant bits. The first stuff bit
// follows after five bits. Each stuff bit ends the run, so one more follows after every further five bits.
TEST(BitsOnWire, CountTheStuffBitsOfAnAllDominantFrame) {
  const BusFrame zeros{.id = 0, .extended = false, .size = 0};
  EXPECT_EQ(bits_on_wire(zeros), 47U + 6U);
}

TEST(BitsOnWire, DoNotStuffAnAlternatingFrameButFor) {
  BusFrame alternating{.id = 0x2AA, .extended = false, .size = 8};
  alternating.data.fill(0x55);
  EXPECT_LE(bits_on_wire(alternating), 47U + 64U + 3U);
}

TEST(Arbitration, LetsTheLowerIdentifierPass) {
  BusArbiter bus;
  const auto a = bus.add_client();
  const auto b = bus.add_client();
  const auto c = bus.add_client();
  bus.submit(a, frame(0x300), start);  // already holds the bus
  bus.submit(b, frame(0x200), start);
  bus.submit(c, frame(0x100), start);

  const auto order = run(bus, start + seconds(1));
  ASSERT_EQ(order.size(), 3U);
  EXPECT_EQ(order[0].sender, a);
  EXPECT_EQ(order[1].sender, c);
  EXPECT_EQ(order[2].sender, b);
  EXPECT_EQ(order[1].start, order[0].end);
}

TEST(Arbitration, KeepsTheOrderWithinAClient) {
  BusArbiter bus;
  const auto a = bus.add_client();
  bus.submit(a, frame(0x1), start);
  bus.submit(a, frame(0x300), start);
  bus.submit(a, frame(0x100), start);
  const auto order = run(bus, start + seconds(1));
  ASSERT_EQ(order.size(), 3U);
  EXPECT_EQ(order[1].frame.id, 0x300U);
}

TEST(Arbitration, ServesEqualIdentifiersInTheOrderOfWaiting) {
  BusArbiter bus;
  const auto a = bus.add_client();
  const auto b = bus.add_client();
  for (int i = 0; i < 3; ++i) {
    bus.submit(b, frame(0x7), start);
    bus.submit(a, frame(0x7), start);
  }
  const auto order = run(bus, start + seconds(1));
  ASSERT_EQ(order.size(), 6U);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(order[i].sender, i % 2 == 0 ? b : a);
}

TEST(BusArbiter, TakesTheRealBitTime) {
  BusArbiter bus(500'000);
  const auto a = bus.add_client();
  const BusFrame f = frame(0x18DA1101);
  bus.submit(a, f, start);
  EXPECT_EQ(bus.next_deadline(), start + microseconds(2) * bits_on_wire(f));
  EXPECT_FALSE(bus.advance(*bus.next_deadline() - nanoseconds(1)));
  EXPECT_TRUE(bus.advance(start + microseconds(2) * bits_on_wire(f)));
}

TEST(BusArbiter, RefusesTheNewestFrameOfAFullQueue) {
  BusArbiter bus(500'000, 2);
  const auto a = bus.add_client();
  EXPECT_EQ(bus.submit(a, frame(1), start), Submission::queued);  // on the wire
  EXPECT_EQ(bus.submit(a, frame(2), start), Submission::queued);
  EXPECT_EQ(bus.submit(a, frame(3), start), Submission::queued);
  EXPECT_EQ(bus.submit(a, frame(4), start), Submission::queue_full);
  EXPECT_EQ(bus.counters().refused_full, 1U);
  EXPECT_EQ(run(bus, start + seconds(1)).size(), 3U);
}

TEST(BusArbiter, RefusesImpossibleFrames) {
  BusArbiter bus;
  const auto a = bus.add_client();
  EXPECT_EQ(bus.submit(a, frame(1U << 29), start), Submission::invalid);
  EXPECT_EQ(bus.submit(a, {.id = 0x800, .extended = false}, start), Submission::invalid);
  EXPECT_EQ(bus.submit(a, {.id = 1, .size = 9}, start), Submission::invalid);
}

TEST(BusArbiter, CompletesTheFrameOnTheWireOfAClientThatLeftAndDiscardsTheRest) {
  BusArbiter bus;
  const auto a = bus.add_client();
  bus.submit(a, frame(1), start);
  bus.submit(a, frame(2), start);
  bus.remove_client(a);
  EXPECT_EQ(run(bus, start + seconds(1)).size(), 1U);
  EXPECT_EQ(bus.counters().discarded, 1U);
}

// The bus does not pause between frames, however late its owner wakes up.
TEST(BusArbiter, SaturatedCarriesMoreThan95PercentOfTheBitTime) {
  BusArbiter bus;
  const auto a = bus.add_client();
  const auto b = bus.add_client();
  std::mt19937 random(11);
  MonotonicTime now = start;
  while (now < start + seconds(10)) {
    while (bus.waiting(a) < 8) bus.submit(a, frame(0x18DA1101, 8, static_cast<std::uint8_t>(random())), now);
    while (bus.waiting(b) < 8) bus.submit(b, frame(0x18DA0111, 8, static_cast<std::uint8_t>(random())), now);
    now = *bus.next_deadline() + microseconds(random() % 900);
    (void)run(bus, now);
  }
  EXPECT_GE(bus.counters().busy, (now - start) / 100 * 95);
  EXPECT_LE(bus.counters().busy, now - start);
}

TEST(BusFaults, LoseFramesOnTheWayToTheReceiversOnly) {
  BusArbiter bus;
  bus.set_faults({.loss_probability = 1});
  const auto a = bus.add_client();
  bus.submit(a, frame(1), start);
  const auto deliveries = run(bus, start + seconds(1));
  ASSERT_EQ(deliveries.size(), 1U);  // the sender gets its echo
  EXPECT_TRUE(deliveries[0].lost);
  EXPECT_EQ(bus.counters().lost, 1U);
}

TEST(BusFaults, MuteOneSource) {
  BusArbiter bus;
  BusFaults faults;
  faults.muted.insert(0x11);
  bus.set_faults(faults);
  const auto a = bus.add_client();
  bus.submit(a, frame(0x18DA0111), start);
  bus.submit(a, frame(0x18DA0112), start);
  const auto deliveries = run(bus, start + seconds(1));
  ASSERT_EQ(deliveries.size(), 2U);
  EXPECT_TRUE(deliveries[0].lost);
  EXPECT_FALSE(deliveries[1].lost);
  EXPECT_EQ(bus.counters().muted, 1U);
}

TEST(BusFaults, InvertOneBitOfTheDataForReceivers) {
  BusArbiter bus;
  bus.set_faults({.corruption_probability = 1});
  const auto a = bus.add_client();
  bus.submit(a, frame(1), start);
  const auto deliveries = run(bus, start + seconds(1));
  ASSERT_EQ(deliveries.size(), 1U);
  unsigned flipped = 0;
  for (std::size_t i = 0; i < 8; ++i) {
    flipped +=
        static_cast<unsigned>(std::popcount(static_cast<unsigned>(deliveries[0].frame.data[i] ^ 0x5AU)));
  }
  EXPECT_EQ(flipped, 1U);
  EXPECT_EQ(deliveries[0].original, frame(1));
}

TEST(BusFaults, SendAFrameAgainAfterABitError) {
  BusArbiter bus;
  bus.set_faults({.bit_error_probability = 0.05});  // rare enough to avoid bus-off (+8 and -1)
  const auto a = bus.add_client();
  for (int i = 0; i < 50; ++i) bus.submit(a, frame(static_cast<std::uint32_t>(i)), start);
  const auto deliveries = run(bus, start + seconds(1));
  ASSERT_EQ(deliveries.size(), 50U);
  for (std::uint32_t i = 0; i < 50; ++i) EXPECT_EQ(deliveries[i].frame.id, i);
  EXPECT_GT(bus.counters().error_frames, 0U);
}

using Kind = ControllerReport::Kind;

std::vector<Kind> kinds(const std::vector<ControllerReport>& reports, BusStation station) {
  std::vector<Kind> all;
  for (const ControllerReport& r : reports) {
    if (r.station == station && r.kind != Kind::error) all.push_back(r.kind);
  }
  return all;
}

TEST(FaultConfinement, PassesThroughWarningAndPassiveToBusOff) {
  FaultConfinement errors;
  std::vector<unsigned> entered;
  ErrorState before = errors.state();
  for (unsigned i = 1; i <= 40; ++i) {
    errors.on_transmit_error();
    if (errors.state() != before) entered.push_back(i);
    before = errors.state();
  }
  EXPECT_EQ(entered, (std::vector<unsigned>{12, 16, 32}));  // 96, 128, 256
  for (int i = 0; i < 1000; ++i) errors.on_transmitted();
  EXPECT_EQ(errors.state(), ErrorState::bus_off) << "left by a restart only";
  errors.restart();
  EXPECT_EQ(errors.state(), ErrorState::active);
}

TEST(FaultConfinement, AReceiverNeverGoesBusOffAndRecoversToActive) {
  FaultConfinement errors;
  for (int i = 0; i < 1000; ++i) errors.on_receive_error();
  EXPECT_EQ(errors.state(), ErrorState::passive);
  errors.on_received();
  EXPECT_EQ(errors.receive_errors(), 119U);
  for (int i = 0; i < 119; ++i) errors.on_received();
  EXPECT_EQ(errors.receive_errors(), 0U);
}

TEST(BusOff, FollowsWhenNoFrameGetsThroughAndTheReceiversAreErrorPassiveAtMost) {
  BusArbiter bus;
  const auto a = bus.add_client();
  const auto b = bus.add_client();
  bus.set_faults({.bit_error_probability = 1});
  for (int i = 0; i < 3; ++i) bus.submit(a, frame(7), start);
  EXPECT_TRUE(run(bus, start + seconds(1)).empty());
  EXPECT_EQ(bus.counters().error_frames, 32U);
  EXPECT_EQ(bus.counters().lost_in_bus_off, 3U);
  EXPECT_EQ(bus.controller(bus.station_of(b)).receive_errors(), 32U);
  EXPECT_EQ(kinds(bus.take_reports(), bus.station_of(a)),
            (std::vector<Kind>{Kind::state, Kind::state, Kind::bus_off}));
  EXPECT_EQ(bus.submit(a, frame(1), start + seconds(1)), Submission::bus_off);
  EXPECT_EQ(bus.submit(b, frame(1), start + seconds(1)), Submission::queued);
}

TEST(BusOff, DestroysTheFrameOnTheWireAndLosesWhatWaitsOfEveryHandleOfTheStation) {
  BusArbiter bus;
  const auto station = bus.add_station();
  const auto a = bus.add_client(station);
  const auto b = bus.add_client(station);
  const auto other = bus.add_client();
  bus.submit(a, frame(1), start);
  bus.submit(b, frame(2), start);
  bus.submit(other, frame(3), start);
  bus.force_bus_off(station, start + microseconds(50));
  const auto deliveries = run(bus, start + seconds(1));
  ASSERT_EQ(deliveries.size(), 1U);
  EXPECT_EQ(deliveries[0].sender, other);
  EXPECT_EQ(bus.counters().lost_in_bus_off, 2U);
}

TEST(BusOff, EndsByItselfAfterTheRestartTimeAndTheStandardsRecoveryTime) {
  BusArbiter bus;
  bus.set_automatic_restart(milliseconds(100));
  const auto a = bus.add_client();
  bus.force_bus_off(bus.station_of(a), start);
  const MonotonicTime back = start + milliseconds(100) + microseconds(2) * FaultConfinement::recovery_bits;
  EXPECT_EQ(bus.next_deadline(), back);
  EXPECT_FALSE(bus.advance(back - nanoseconds(1)));
  EXPECT_EQ(bus.submit(a, frame(1), back - nanoseconds(1)), Submission::bus_off);
  EXPECT_FALSE(bus.advance(back));
  EXPECT_EQ(kinds(bus.take_reports(), bus.station_of(a)),
            (std::vector<Kind>{Kind::bus_off, Kind::restarted}));
  EXPECT_EQ(bus.submit(a, frame(1), back), Submission::queued);
}

TEST(BusOff, WithoutAutomaticRestartLastsUntilItIsAskedFor) {
  BusArbiter bus;
  const auto a = bus.add_client();
  bus.force_bus_off(bus.station_of(a), start);
  EXPECT_FALSE(bus.advance(start + std::chrono::hours(1)));
  EXPECT_EQ(bus.submit(a, frame(1), start + std::chrono::hours(1)), Submission::bus_off);
  const MonotonicTime asked = start + std::chrono::hours(2);
  bus.request_restart(bus.station_of(a), asked);
  EXPECT_FALSE(bus.advance(asked + milliseconds(3)));
  EXPECT_EQ(bus.submit(a, frame(1), asked + milliseconds(3)), Submission::queued);
}

TEST(Withdrawal, TakesBackWhatWaitsAndLeavesWhatIsOnTheWire) {
  BusArbiter bus;
  const auto a = bus.add_client();
  for (std::uint32_t i = 0; i < 5; ++i) bus.submit(a, frame(i), start);
  EXPECT_EQ(bus.withdraw(a), 1U);
  EXPECT_EQ(run(bus, start + seconds(1)).size(), 1U);
  EXPECT_EQ(bus.counters().withdrawn, 4U);
  EXPECT_EQ(bus.withdraw(a), 0U);
}

TEST(Babble, WithTheHighestPriorityLeavesTheBusToNobodyUntilItEnds) {
  BusArbiter bus;
  const auto a = bus.add_client();
  bus.set_babble(Babble{.frame = {.id = 0, .extended = false, .size = 8}}, start);
  EXPECT_EQ(bus.next_deadline(), start);
  EXPECT_FALSE(bus.advance(start));
  bus.submit(a, frame(1), start + milliseconds(1));
  const auto flood = run(bus, start + milliseconds(100));
  EXPECT_GT(flood.size(), 300U);
  for (const BusDelivery& d : flood) EXPECT_NE(d.sender, a);
  EXPECT_GT(bus.counters().busy, milliseconds(99));
  bus.set_babble(std::nullopt, start + milliseconds(100));
  const auto after = run(bus, start + milliseconds(200));
  ASSERT_EQ(after.size(), 2U) << "the last one of the flood, and the one that waited";
  EXPECT_EQ(after[1].sender, a);
}

TEST(Babble, OfLowPriorityDelaysAFrameByOneAtMost) {
  BusArbiter bus;
  const auto a = bus.add_client();
  const BusFrame noise{.id = 0x1FFFFFFF, .size = 8};
  bus.set_babble(Babble{.frame = noise}, start);
  (void)run(bus, start + milliseconds(10));
  bus.submit(a, frame(1), start + milliseconds(10));
  const auto next = run(bus, start + milliseconds(11));
  ASSERT_GE(next.size(), 2U);
  EXPECT_EQ(next[1].sender, a);
}

TEST(Babble, KeepsItsPauses) {
  BusArbiter bus;
  bus.set_babble(Babble{.frame = frame(5), .pause = milliseconds(10)}, start);
  const auto sent = run(bus, start + milliseconds(100));
  EXPECT_EQ(sent.size(), 10U);
  EXPECT_EQ(sent[1].start - sent[0].end, milliseconds(10));
}

TEST(BusFaults, DelayEveryFrame) {
  BusArbiter bus;
  bus.set_faults({.extra_delay = milliseconds(3)});
  const auto a = bus.add_client();
  bus.submit(a, frame(1), start);
  EXPECT_EQ(bus.next_deadline(), start + milliseconds(3) + bus.time_on_wire(frame(1)));
}

}  // namespace
}  // namespace srfs::sim
