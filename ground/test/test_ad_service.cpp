// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The ground's AD service against ttc's uplink chain, with real frames and real security, over a line that
// loses, delays and duplicates frames.
#include <deque>
#include <random>

#include <gtest/gtest.h>

#include "ground/ad_service.hpp"
#include "nodes/ttc/link/uplink_chain.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs::ground {
namespace {

using Kind = AdSignal::Kind;

wire::SdlsKey key(std::uint8_t first) {
  return wire::SdlsKey(std::array<std::uint8_t, wire::sdls_key_octets>{first});
}

UplinkConfig config(bool secured) {
  UplinkConfig config;
  config.spacecraft_id = 0xAB;
  UplinkChannel other{.vc = 5, .associations = {}};
  UplinkChannel channel{.vc = 3, .associations = {}};
  if (secured) {
    channel.associations.push_back({.spi = 1, .key = key(1), .for_ad = false, .for_bd = true});
    channel.associations.push_back({.spi = 2, .key = key(2), .for_ad = true, .for_bd = false});
  }
  config.channels.push_back(std::move(other));
  config.channels.push_back(std::move(channel));
  return config;
}

class AdLink {
 public:
  AdLink(unsigned seed, double loss, milliseconds longest_delay, bool secured,
         wire::FopSettings settings = {.timer = milliseconds(500), .transmission_limit = 255})
      : random_(seed),
        loss_(loss),
        longest_delay_(longest_delay),
        secured_(secured),
        chain_(config(secured), {}),
        ad(3, settings) {}

  void step() {
    now += milliseconds(1 + static_cast<int>(random_() % 20));
    chain_.set_buffer_available(random_() % 10 != 0);
    for (; !up_.empty() && up_.front().first <= now; up_.pop_front())
      take(chain_.push(up_.front().second, now));
    if (const auto idle = chain_.idle_deadline(); idle && now >= *idle) take(chain_.on_idle(now));
    if (!silent && !chance(loss_)) {
      down_last_ = std::max(down_last_, now + delay());
      down_.emplace_back(down_last_, chain_.next_clcw());
    }
    for (; !down_.empty() && down_.front().first <= now; down_.pop_front())
      ad.on_control_word(down_.front().second, now);
    ad.on_time(now);
    settle();
  }
  void settle() {
    while (const auto signal = ad.next_signal()) {
      switch (signal->kind) {
        case Kind::transmit_ad: {
          const wire::SdlsSeal seal{key_, 2, ++counter};
          send(*wire::make_uplink_cltu(channel_, wire::TcFrameType::ad, signal->sequence,
                                       secured_ ? &seal : nullptr, signal->packet));
          break;
        }
        case Kind::transmit_bc:
          send(wire::make_control_cltu(channel_, signal->control));
          break;
        case Kind::delivered:
          delivered.push_back(signal->tag);
          break;
        case Kind::undelivered:
          ++undelivered;
          break;
        case Kind::not_sent:
          ++not_sent;
          break;
        case Kind::changed:
          break;
      }
      if (signal->kind == Kind::transmit_ad || signal->kind == Kind::transmit_bc)
        ad.on_transmitted(signal->kind, line_takes, now);
    }
  }
  bool request(std::uint64_t tag) {
    const bool taken =
        ad.request(tag, {static_cast<std::uint8_t>(tag >> 8), static_cast<std::uint8_t>(tag)}, now);
    settle();
    return taken;
  }
  /// @return false: the condition did not hold within a simulated hour
  template <class Condition>
  [[nodiscard]] bool run_until(const Condition& condition) {
    const MonotonicTime end = now + seconds(3600);
    while (!condition() && now < end) step();
    return condition();
  }
  void lock_out() { stray_frame(128); }
  /// An AD frame of another sender: N(S) = V(R) + @p ahead.
  void stray_frame(int ahead) {
    wire::TcFrame frame{.type = wire::TcFrameType::ad,
                        .spacecraft_id = 0xAB,
                        .vc = 3,
                        .sequence = static_cast<std::uint8_t>(chain_.farm(3).vr + ahead)};
    const wire::SdlsSeal seal{key_, 2, ++counter};
    frame.data = *wire::sdls_apply(seal, 3, wire::segment_header_unsegmented, Octets{1});
    static_cast<void>(chain_.push(wire::encode_cltu(wire::encode_tc_frame(frame), false), now));
  }
  [[nodiscard]] const UplinkChain& chain() const { return chain_; }

 private:
  bool chance(double probability) { return std::uniform_real_distribution<>(0, 1)(random_) < probability; }
  milliseconds delay() {
    return milliseconds(static_cast<int>(random_() % static_cast<unsigned>(longest_delay_.count())));
  }
  void send(Octets cltu) {
    if (!line_takes || chance(loss_)) return;
    up_last_ = std::max(up_last_, now + delay());
    up_.emplace_back(up_last_, cltu);
    if (chance(loss_ / 2)) up_.emplace_back(up_last_, std::move(cltu));
  }
  void take(const std::vector<UplinkedPacket>& packets) {
    for (const auto& packet : packets)
      received.push_back(static_cast<std::uint64_t>(packet.packet[0]) << 8 | packet.packet[1]);
    chain_.on_stored(chain_.state());
  }

  std::mt19937 random_;
  double loss_;
  milliseconds longest_delay_;
  bool secured_;
  UplinkChain chain_;
  const wire::TcUplinkChannel channel_{.spacecraft_id = 0xAB, .vc = 3};
  const wire::SdlsKey key_ = key(2);
  std::deque<std::pair<MonotonicTime, Octets>> up_;
  std::deque<std::pair<MonotonicTime, std::uint32_t>> down_;
  MonotonicTime up_last_;
  MonotonicTime down_last_;

 public:
  AdService ad;
  MonotonicTime now{seconds(10)};
  std::uint64_t counter = 1000;
  bool silent = false;  ///< no CLCW arrives on the downlink
  bool line_takes = true;
  std::vector<std::uint64_t> received;
  std::vector<std::uint64_t> delivered;
  std::uint64_t undelivered = 0;
  std::uint64_t not_sent = 0;
};

TEST(AdServiceOverTheUplinkChain, EveryPacketArrivesOnceInOrderWithAndWithoutSecurity) {
  constexpr std::uint64_t packets = 300;
  for (unsigned seed = 0; seed < 12; ++seed) {
    AdLink link(seed, (seed % 4) * 0.15, milliseconds(1 + seed * 60), seed % 2 == 0);
    std::uint64_t next = 0;
    while (link.delivered.size() < packets) {
      if (link.ad.phase() == AdPhase::off) {
        ASSERT_EQ(next, 0U) << link.ad.report().problem << ", seed " << seed;
        link.ad.start(link.now);
      }
      while (next < packets && link.ad.report().queued < 20 && link.ad.phase() == AdPhase::on &&
             link.request(next))
        ++next;
      link.step();
      ASSERT_LT(link.now, MonotonicTime(seconds(7200))) << "it hangs, seed " << seed;
    }
    std::vector<std::uint64_t> all(packets);
    for (std::uint64_t i = 0; i < packets; ++i) all[i] = i;
    EXPECT_EQ(link.received, all) << "seed " << seed;
    EXPECT_EQ(link.delivered, all) << "seed " << seed;
    const bool doubles = seed % 4 != 0;  // a duplicate of a frame accepted by FARM-1 is a replay
    EXPECT_EQ(link.chain().counters().replayed > 0, doubles && seed % 2 == 0) << "seed " << seed;
  }
}

TEST(AdServiceOverTheUplinkChain, OnlyAnAcceptedFrameAdvancesTheCounterOfItsAssociation) {
  AdLink link(1, 0, milliseconds(1), true);
  link.ad.start(link.now);
  ASSERT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::on; }));
  ASSERT_TRUE(link.request(7));
  ASSERT_TRUE(link.run_until([&] { return link.delivered.size() == 1; }));
  const auto accepted = link.chain().counter(2);
  ASSERT_TRUE(accepted);
  EXPECT_FALSE(link.chain().counter(1)) << "BD has its own";
  link.lock_out();
  EXPECT_EQ(link.chain().counter(2), accepted);
}

class AdServiceTest : public ::testing::Test {
 protected:
  AdLink link{
      1, 0, milliseconds(1), false, {.window = 2, .timer = milliseconds(500), .transmission_limit = 3}};
};

TEST_F(AdServiceTest, TakesVsFromTheSpacecraft) {
  link.ad.set_vr(200, link.now);
  ASSERT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::on; }));
  link.ad.stop(link.now);
  EXPECT_EQ(link.ad.phase(), AdPhase::off);
  EXPECT_TRUE(link.ad.report().problem.empty());
  link.ad.start(link.now);
  ASSERT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::on; }));
  EXPECT_EQ(link.ad.report().vs, 200);
}

TEST_F(AdServiceTest, AsksWithAControlFrameWhenNoClcwComesByItself) {
  link.silent = true;
  link.ad.start(link.now);
  ASSERT_TRUE(link.run_until([&] { return link.chain().farm(3).farm_b_counter == 1; }));
  link.silent = false;
  EXPECT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::on; }));
}

TEST_F(AdServiceTest, LeavesVrWhereItWasLastSeenWhenItAsks) {
  link.ad.set_vr(200, link.now);
  ASSERT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::on; }));
  link.ad.stop(link.now);
  link.silent = true;
  link.ad.start(link.now);
  ASSERT_TRUE(link.run_until([&] { return link.chain().farm(3).farm_b_counter == 2; }));
  EXPECT_EQ(link.chain().farm(3).vr, 200);
}

TEST_F(AdServiceTest, GivesUpOnASilentSpacecraftAndReturnsWhatWaits) {
  link.silent = true;
  link.ad.start(link.now);
  ASSERT_TRUE(link.request(1));
  ASSERT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::off; }));
  EXPECT_EQ(link.not_sent, 1U);
  EXPECT_NE(link.ad.report().problem.find("acknowledges nothing"), std::string::npos);
  EXPECT_FALSE(link.request(2)) << "it is off";
}

TEST_F(AdServiceTest, EndsOnLockoutAndUnlockBringsItBack) {
  link.ad.start(link.now);
  ASSERT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::on; }));
  link.lock_out();
  ASSERT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::off; }));
  EXPECT_NE(link.ad.report().problem.find("locked out"), std::string::npos);
  EXPECT_TRUE(link.ad.report().clcw->lockout);
  link.ad.start(link.now);
  ASSERT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::off; }));
  EXPECT_NE(link.ad.report().problem.find("locked out"), std::string::npos);
  link.ad.set_vr(9, link.now);
  ASSERT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::off; }));
  EXPECT_NE(link.ad.report().problem.find("locked out"), std::string::npos) << "set V(R) does not unlock";

  link.ad.unlock(link.now);
  ASSERT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::on; }));
  EXPECT_FALSE(link.chain().farm(3).lockout);
  ASSERT_TRUE(link.request(5));
  EXPECT_TRUE(link.run_until([&] { return link.delivered == std::vector<std::uint64_t>{5}; }));
}

TEST_F(AdServiceTest, UnlocksWithoutHavingSeenAClcw) {
  link.ad.set_vr(50, link.now);
  ASSERT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::on; }));
  link.ad.stop(link.now);
  link.lock_out();
  AdService fresh(3, {.timer = milliseconds(500)});
  std::swap(link.ad, fresh);
  link.silent = true;
  link.ad.unlock(link.now);
  ASSERT_TRUE(link.run_until([&] { return !link.chain().farm(3).lockout; }));
  link.silent = false;
  EXPECT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::on; }));
  EXPECT_EQ(link.ad.report().vs, 50);
}

TEST_F(AdServiceTest, StartsOverARetransmitFlagThatSomebodyLeftBehind) {
  link.stray_frame(1);
  ASSERT_TRUE(link.chain().farm(3).retransmit);
  link.ad.start(link.now);
  EXPECT_TRUE(link.run_until([&] { return link.ad.phase() != AdPhase::seeking; }));
  EXPECT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::on; }));
  EXPECT_FALSE(link.chain().farm(3).retransmit);
  ASSERT_TRUE(link.request(1));
  EXPECT_TRUE(link.run_until([&] { return link.delivered.size() == 1; }));
}

TEST_F(AdServiceTest, ALineThatTakesNothingEndsIt) {
  link.ad.start(link.now);
  ASSERT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::on; }));
  link.line_takes = false;
  ASSERT_TRUE(link.request(1));
  EXPECT_EQ(link.ad.phase(), AdPhase::off);
  EXPECT_NE(link.ad.report().problem.find("the line takes no frame"), std::string::npos);
  EXPECT_EQ(link.undelivered, 1U);
}

TEST_F(AdServiceTest, KeepsABoundedQueue) {
  link.ad.start(link.now);
  std::size_t taken = 0;
  while (link.ad.request(taken, {1}, link.now)) ++taken;
  EXPECT_EQ(taken, AdService::queue_capacity);
}

TEST_F(AdServiceTest, IgnoresOtherChannelsAndCountsWhatIsNoClcw) {
  link.ad.on_control_word(wire::encode_clcw({.vc = 5, .lockout = true}), link.now);
  EXPECT_FALSE(link.ad.report().clcw);
  link.ad.on_control_word(0x80000000, link.now);
  EXPECT_EQ(link.ad.report().bad_clcws, 1U);
}

TEST_F(AdServiceTest, EndsOnAControlWordOfItsChannelThatIsInvalid) {
  link.ad.start(link.now);
  ASSERT_TRUE(link.run_until([&] { return link.ad.phase() == AdPhase::on; }));
  link.ad.on_control_word(wire::encode_clcw({.vc = 3}) | 0x100U, link.now);
  EXPECT_EQ(link.ad.phase(), AdPhase::off);
  EXPECT_NE(link.ad.report().problem.find("E15"), std::string::npos);
}

}  // namespace
}  // namespace srfs::ground
