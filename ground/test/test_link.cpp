// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <fstream>
#include <set>

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>
#include <mission/structures.hpp>

#include "fake_spacecraft.hpp"
#include "ground/downlink.hpp"
#include "ground/link.hpp"
#include "ground/uplink.hpp"
#include "tests/mission_dictionary.hpp"
#include "wire/time_packet.hpp"

namespace srfs::ground {
namespace {

using ::testing::HasSubstr;
using testing_support::dictionary;

const UtcTime now = *from_iso8601("2026-11-21T08:00:00Z");

mission::EncodedCommand switch_load() {
  return *dictionary().encode("eps.switch_load", {"load=2", "state=on"});
}

TEST(Uplink, SendsWhatTheSpacecraftCanOpen) {
  const VarFolder var;
  auto uplink = Uplink::open(secured_link(), var.path(), var.path() / "ground", now);
  ASSERT_TRUE(uplink) << uplink.error();

  const auto telecommand = uplink->make(switch_load());

  ASSERT_TRUE(telecommand);
  FakeSpacecraft spacecraft(secured_link());
  const auto packets = spacecraft.receive(telecommand->cltu);
  ASSERT_EQ(packets.size(), 1U);
  EXPECT_EQ(packets[0].apid, mission::apid::payload_eps);
  EXPECT_EQ(packets[0].service, 8);
  EXPECT_EQ(to_hex(packets[0].application), "00010201");
  EXPECT_EQ(wire::request_id(packets[0]), telecommand->request);
  EXPECT_EQ(spacecraft.last_counter, telecommand->security_counter);
}

TEST(Uplink, NeverUsesACounterTwiceAcrossRuns) {
  const VarFolder var;
  FakeSpacecraft spacecraft(secured_link());
  std::vector<std::uint16_t> sequence_counts;
  for (int run = 0; run < 3; ++run) {
    auto uplink = Uplink::open(secured_link(), var.path(), var.path() / "ground", now);
    ASSERT_TRUE(uplink);
    for (int i = 0; i < 2; ++i) {
      const auto packets = spacecraft.receive(uplink->make(switch_load())->cltu);
      ASSERT_EQ(packets.size(), 1U) << "a replay in run " << run;
      sequence_counts.push_back(packets[0].sequence_count);
    }
  }
  EXPECT_THAT(sequence_counts, testing::ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST(Uplink, StartsAboveEveryOldCounterWhenItsStateWasLost) {
  const VarFolder var;
  FakeSpacecraft spacecraft(secured_link());
  auto first = Uplink::open(secured_link(), var.path(), var.path() / "ground", now);
  for (int i = 0; i < 20; ++i) ASSERT_EQ(spacecraft.receive(first->make(switch_load())->cltu).size(), 1U);

  std::filesystem::remove_all(var.path() / "ground");
  auto second = Uplink::open(secured_link(), var.path(), var.path() / "ground", now + seconds(1));

  EXPECT_EQ(spacecraft.receive(second->make(switch_load())->cltu).size(), 1U);
}

TEST(Uplink, UsesNoCounterAgainWhenAnOlderCopyOfItsStateIsPutBack) {
  const VarFolder var;
  const auto state = var.path() / "ground";
  FakeSpacecraft spacecraft(secured_link());
  const auto send = [&](UtcTime at, int telecommands) {
    auto uplink = Uplink::open(secured_link(), var.path(), state, at);
    EXPECT_EQ(uplink->warning(), "");
    for (int i = 0; i < telecommands; ++i)
      EXPECT_EQ(spacecraft.receive(uplink->make(switch_load())->cltu).size(), 1U)
          << "a counter was used again";
  };
  send(now, 3);
  std::filesystem::copy(state, var.path() / "backup", std::filesystem::copy_options::recursive);
  send(now + seconds(60), 500);

  std::filesystem::remove_all(state);
  std::filesystem::copy(var.path() / "backup", state, std::filesystem::copy_options::recursive);
  const std::uint64_t used = *spacecraft.last_counter;
  auto restored = Uplink::open(secured_link(), var.path(), state, now + seconds(120));
  const auto told = restored->on_spacecraft_counter(1, used);

  ASSERT_TRUE(told) << "it has not sent this counter";
  EXPECT_THAT(*told, HasSubstr("an older copy, or another ground station commands"));
  EXPECT_FALSE(restored->on_spacecraft_counter(1, used)) << "once";
  const auto next = restored->make(switch_load());
  EXPECT_GT(next->security_counter, used);
  EXPECT_EQ(spacecraft.receive(next->cltu).size(), 1U);
  EXPECT_FALSE(restored->on_spacecraft_counter(1, *next->security_counter)) << "its own";
}

TEST(Uplink, OfTheSameStateIsNotTakenForAnotherGround) {
  const VarFolder var;
  std::uint64_t used = 0;
  for (int run = 0; run < 3; ++run) {
    auto uplink = Uplink::open(secured_link(), var.path(), var.path() / "ground", now + seconds(run));
    if (run > 0) {
      EXPECT_FALSE(uplink->on_spacecraft_counter(1, used)) << "of the run before";
    }
    used = *uplink->make(switch_load())->security_counter;
    EXPECT_FALSE(uplink->on_spacecraft_counter(1, used));
    ASSERT_TRUE(uplink->make_file_cltu(Octets(20)));
    EXPECT_FALSE(uplink->on_spacecraft_counter(1, ++used)) << "of a file";
  }
}

TEST(Uplink, SaysThatTheClockIsBehindItsCounters) {
  const VarFolder var;
  const auto first = Uplink::open(secured_link(), var.path(), var.path() / "ground", now)
                         ->make(switch_load())
                         ->security_counter;
  auto behind = Uplink::open(secured_link(), var.path(), var.path() / "ground", now - seconds(3600));
  EXPECT_THAT(behind->warning(), HasSubstr("3600 s ahead of this computer's clock"));
  EXPECT_GT(behind->make(switch_load())->security_counter, first);
}

TEST(Uplink, FollowsTheCounterOfTheBeaconUpwardsOnly) {
  const VarFolder var;
  auto uplink = Uplink::open(secured_link(), var.path(), var.path() / "ground", now);
  const std::uint64_t base = *uplink->make(switch_load())->security_counter;

  EXPECT_TRUE(uplink->on_spacecraft_counter(1, base + 1000));
  EXPECT_EQ(uplink->make(switch_load())->security_counter, base + 1001);
  EXPECT_FALSE(uplink->on_spacecraft_counter(1, 5));
  EXPECT_EQ(uplink->make(switch_load())->security_counter, base + 1002);
  EXPECT_FALSE(uplink->on_spacecraft_counter(2, base + 9000));
  EXPECT_EQ(uplink->make(switch_load())->security_counter, base + 1003);
}

/// secured_link() with a second key set and a contingency association.
suite::LinkSettings link_with_sets() {
  suite::LinkSettings link = secured_link();
  using Security = suite::ChannelSecurity;
  using Set = suite::AssociationSet;
  link.channels.push_back({link.channels[0].virtual_channel, Security::sdls, 3, "keys/b.key", Set::b});
  link.channels.push_back(
      {link.channels[0].virtual_channel, Security::sdls, 5, "keys/c.key", Set::contingency});
  return link;
}

TEST(Uplink, OnAStrictLinkEveryCounterCarriesTheTimeAndAllAssociationsHaveOneOrder) {
  const VarFolder var;
  FakeSpacecraft spacecraft(strict_link());
  auto uplink = Uplink::open(strict_link(), var.path(), var.path() / "ground", now, std::nullopt, 7);
  ASSERT_TRUE(uplink) << uplink.error();
  const auto ms = [](UtcTime t) { return static_cast<std::uint64_t>(t.ns() / 1'000'000); };
  const Octets packet = uplink->make_packet(switch_load())->packet;

  ASSERT_EQ(spacecraft.receive(uplink->make(switch_load())->cltu).size(), 1U);
  ASSERT_EQ(spacecraft.receive(*uplink->make_ad_cltu(0, packet)).size(), 1U);
  EXPECT_EQ(spacecraft.last_ad_counter, ms(now) + 1) << "one above that of the BD frame";
  EXPECT_EQ(spacecraft.last_sender >> 24, 7U);
  const Octets set_vr = *uplink->make_bc_cltu({.kind = wire::ControlCommand::Kind::set_vr, .vr = 42});
  spacecraft.receive(set_vr);
  EXPECT_EQ(spacecraft.farm.vr, 42);
  EXPECT_EQ(spacecraft.last_counter, ms(now) + 2);
  ASSERT_EQ(spacecraft.receive(*uplink->make_ad_cltu(42, packet)).size(), 1U);
  spacecraft.receive(set_vr);
  EXPECT_EQ(spacecraft.farm.vr, 43) << "a replay";

  uplink->on_time(now + seconds(100));
  EXPECT_EQ(uplink->make(switch_load())->security_counter, ms(now + seconds(100)));
  uplink->on_time(now);
  EXPECT_EQ(uplink->make(switch_load())->security_counter, ms(now + seconds(100)) + 1) << "never back";
}

TEST(Uplink, TwoRunsOfOneStationDrawDifferentVectorsOnAStrictLink) {
  const VarFolder var;
  std::set<std::uint32_t> senders;
  for (int run = 0; run < 3; ++run) {  // at one time, each with the folder as it was at first
    std::filesystem::remove_all(var.path() / "ground");
    FakeSpacecraft spacecraft(strict_link());
    auto uplink = Uplink::open(strict_link(), var.path(), var.path() / "ground", now);
    ASSERT_EQ(spacecraft.receive(uplink->make(switch_load())->cltu).size(), 1U);
    senders.insert(spacecraft.last_sender);
  }
  EXPECT_EQ(senders.size(), 3U);
}

TEST(Uplink, AForgedBeaconDoesNotUseTheCountersUp) {
  const VarFolder var;
  auto uplink = Uplink::open(secured_link(), var.path(), var.path() / "ground", now);
  const std::uint64_t used = *uplink->make(switch_load())->security_counter;
  const auto told = uplink->on_spacecraft_counter(1, UINT64_MAX - 1);
  ASSERT_TRUE(told);
  EXPECT_THAT(*told, HasSubstr("more than 30 days ahead"));
  EXPECT_FALSE(uplink->on_spacecraft_counter(1, UINT64_MAX - 1)) << "once";
  EXPECT_EQ(uplink->make(switch_load())->security_counter, used + 1);
}

std::uint16_t spi_of(const OutgoingTelecommand& telecommand) {
  // CLTU: start sequence (2), then blocks of 7 octets and a parity octet. The blocks hold the frame header
  // (5), segment header and SPI.
  return static_cast<std::uint16_t>(telecommand.cltu[2 + 6] << 8 | telecommand.cltu[2 + 8]);
}

TEST(Uplink, SwitchesItsKeysAndCountsEachOfThemOverRuns) {
  const VarFolder var;
  var.write_key("b", std::string(64, 'b'));
  const auto open = [&](std::optional<suite::AssociationSet> forced = std::nullopt) {
    return Uplink::open(link_with_sets(), var.path(), var.path() / "ground", now, forced);
  };
  std::uint64_t of_a = 0;
  std::uint64_t of_b = 0;
  {
    auto uplink = open();
    ASSERT_TRUE(uplink) << uplink.error();
    for (int i = 0; i < 3; ++i) of_a = *uplink->make(switch_load())->security_counter;
    EXPECT_EQ(uplink->select(suite::AssociationSet::b).value(), true);
    EXPECT_EQ(uplink->select(suite::AssociationSet::b).value(), false) << "already";
    EXPECT_TRUE(uplink->on_spacecraft_counter(3, of_a + 1000));
    const auto telecommand = uplink->make(switch_load());
    EXPECT_EQ(spi_of(*telecommand), 3);
    of_b = *telecommand->security_counter;
    EXPECT_EQ(of_b, of_a + 1001);
    EXPECT_FALSE(uplink->select(suite::AssociationSet::contingency)) << "its key is not here";
  }
  auto uplink = open();
  auto telecommand = uplink->make(switch_load());
  EXPECT_EQ(spi_of(*telecommand), 3) << "remembered";
  EXPECT_EQ(*telecommand->security_counter, of_b + 1);
  ASSERT_TRUE(uplink->select(suite::AssociationSet::a));
  telecommand = uplink->make(switch_load());
  EXPECT_EQ(spi_of(*telecommand), 1);
  EXPECT_EQ(*telecommand->security_counter, of_a + 1);

  EXPECT_FALSE(open(suite::AssociationSet::contingency));
  var.write_key("c", std::string(64, 'c'));
  auto contingency = open(suite::AssociationSet::contingency);
  ASSERT_TRUE(contingency) << contingency.error();
  EXPECT_EQ(contingency->select(suite::AssociationSet::b).value(), false) << "from the next run on";
  EXPECT_EQ(spi_of(*contingency->make(switch_load())), 5);
  EXPECT_EQ(open()->key_set(), suite::AssociationSet::b);
}

TEST(Uplink, TakesOverTheOneCounterOfAnOlderFileForEveryAssociation) {
  const VarFolder var;
  std::filesystem::create_directories(var.path() / "ground");
  std::ofstream(var.path() / "ground/uplink.json")
      << R"({"next_security_counter": 4711, "next_sequence_counts": 5})";
  // Use a clock that was never set; the milliseconds of a set clock exceed the stored counter.
  auto uplink = Uplink::open(secured_link(), var.path(), var.path() / "ground", UtcTime(seconds(3)));
  ASSERT_TRUE(uplink) << uplink.error();
  EXPECT_EQ(uplink->make(switch_load())->security_counter, 4711U);
}

TEST(Uplink, SaysWhatIsWrongWithItsFiles) {
  const VarFolder var;
  std::filesystem::create_directories(var.path() / "ground");
  std::ofstream(var.path() / "ground/uplink.json") << "{ \"next_sec";
  const auto damaged = Uplink::open(secured_link(), var.path(), var.path() / "ground", now);
  ASSERT_FALSE(damaged);
  EXPECT_THAT(damaged.error(), HasSubstr("uplink.json: not a state file of the ground tool"));

  std::filesystem::remove_all(var.path() / "ground");
  std::ofstream(var.path() / "keys/tc_uplink.key") << "secret";
  const auto bad_key = Uplink::open(secured_link(), var.path(), var.path() / "ground", now);
  ASSERT_FALSE(bad_key);
  EXPECT_THAT(bad_key.error(), HasSubstr("expected a link key of 64 hexadecimal digits"));
  EXPECT_THAT(bad_key.error(), testing::Not(HasSubstr("secret")));

  const auto key_file = var.path() / "keys/tc_uplink.key";
  std::filesystem::permissions(key_file, std::filesystem::perms::group_read,
                               std::filesystem::perm_options::add);
  EXPECT_THAT(Uplink::open(secured_link(), var.path(), var.path() / "ground", now).error(),
              HasSubstr("others may read this key (mode 0640): chmod 600"));

  std::filesystem::remove(key_file);
  EXPECT_THAT(Uplink::open(secured_link(), var.path(), var.path() / "ground", now).error(),
              HasSubstr("makes a test key"));
}

TEST(Uplink, SendsInTheClearOnAnOpenChannel) {
  const VarFolder var;
  suite::LinkSettings open;
  open.channels.push_back({1, suite::ChannelSecurity::none, 0, ""});
  auto uplink = Uplink::open(open, var.path(), var.path() / "ground", now);
  ASSERT_TRUE(uplink);
  const auto telecommand = uplink->make(switch_load());
  EXPECT_FALSE(telecommand->security_counter);
  EXPECT_THAT(to_hex(telecommand->cltu), HasSubstr("eb90"));
}

TEST(Downlink, HandsOutPacketsOfLiveAndPlaybackChannel) {
  FakeSpacecraft spacecraft(secured_link());
  Downlink downlink(secured_link());
  Octets line = spacecraft.idle();
  for (const auto& part : {spacecraft.send(17, 3, 25, Octets(500, 7)), spacecraft.idle(),
                           spacecraft.send(1, 17, 2, {}, tm_channel::playback)}) {
    line.insert(line.end(), part.begin(), part.end());
  }

  std::vector<ReceivedPacket> received;
  for (std::size_t at = 0; at < line.size(); at += 37) {
    const auto some = downlink.push(OctetView(line).subspan(at, std::min<std::size_t>(37, line.size() - at)));
    received.insert(received.end(), some.begin(), some.end());
  }

  ASSERT_EQ(received.size(), 2U);
  EXPECT_EQ(received[0].vc, tm_channel::live);
  EXPECT_EQ(received[0].packet.source, Octets(500, 7));
  EXPECT_EQ(received[1].vc, tm_channel::playback);
  EXPECT_EQ(downlink.counters().idle_frames, 2U);
  EXPECT_EQ(downlink.counters().packets, 2U);
  EXPECT_EQ(downlink.counters().bad_frames, 0U);
  EXPECT_EQ(downlink.clcw(), 0x01000000U);
}

TEST(Downlink, HandsOutTimePacketsAsTimeReports) {
  const auto link = secured_link();
  wire::TmFrameBuilder frames({.spacecraft_id = static_cast<std::uint16_t>(link.spacecraft_id),
                               .frame_octets = static_cast<std::size_t>(link.tm_frame_length)});
  const TaiTime time = to_tai(*from_iso8601("2026-11-22T10:00:00.5Z"));
  ASSERT_TRUE(frames.queue_packet(0, wire::make_time_packet({.sequence_count = 4, .rate = 3, .time = time})));
  Downlink downlink(link);
  const Octets cadu =
      wire::encode_cadu(frames.build(0, 0), {.frame_octets = static_cast<std::size_t>(link.tm_frame_length),
                                             .reed_solomon = link.tm_reed_solomon,
                                             .interleave = static_cast<unsigned>(link.tm_interleave),
                                             .randomize = link.tm_randomizer});
  const auto packets = downlink.push(cadu);
  ASSERT_EQ(packets.size(), 1U);
  EXPECT_EQ(packets[0].packet.service, 9);
  EXPECT_EQ(packets[0].packet.subtype, 2);
  EXPECT_EQ(packets[0].packet.time, time);
  EXPECT_EQ(packets[0].packet.source, Octets{3});
  EXPECT_EQ(downlink.counters().bad_packets, 0U);
}

TEST(Downlink, CountsADamagedFrameAndGoesOn) {
  FakeSpacecraft spacecraft(secured_link());
  Downlink downlink(secured_link());
  static_cast<void>(downlink.push(spacecraft.idle()));
  Octets damaged = spacecraft.idle();
  for (std::size_t i = 10; i < 80; ++i) damaged[i] ^= 0x5a;
  static_cast<void>(downlink.push(damaged));
  static_cast<void>(downlink.push(spacecraft.idle()));
  const auto after = downlink.push(spacecraft.send(1, 17, 2, {}));
  EXPECT_EQ(after.size(), 1U);
  EXPECT_GE(downlink.counters().bad_frames, 1U);
  EXPECT_EQ(downlink.counters().lost_frames, 1U);
}

/// A port whose other end reads only when the test says so.
class StallingLine : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(far_);
    ASSERT_EQ(::grantpt(far_.get()), 0);
    ASSERT_EQ(::unlockpt(far_.get()), 0);
    auto port = Port::open(::ptsname(far_.get()), 115200);
    ASSERT_TRUE(port) << port.error();
    port_ = std::move(*port);
  }
  /// Chunks of which each octet is the chunk's number, until one is refused.
  std::string fill() {
    for (std::size_t rounds = 0; rounds < 1000; ++rounds) {
      const auto taken = port_.queue(Octets(chunk, static_cast<std::uint8_t>(chunks_)), now_);
      if (!taken) return taken.error();
      ++chunks_;
    }
    return "";
  }
  /// What is on the line now.
  Octets read() {
    pollfd wait{far_.get(), POLLIN, 0};
    static_cast<void>(::poll(&wait, 1, 10));
    Octets all;
    Octets some(chunk);
    for (ssize_t got = 0; (got = ::read(far_.get(), some.data(), some.size())) > 0;)
      all.insert(all.end(), some.begin(), some.begin() + got);
    return all;
  }

  static constexpr std::size_t chunk = 4096;
  Fd far_{::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK)};
  Port port_ = Port::closed("port");
  MonotonicTime now_{seconds(100)};
  std::size_t chunks_ = 0;
};

TEST_F(StallingLine, TakesABoundedNumberOfOctetsAndLosesNoneOfThem) {
  EXPECT_THAT(fill(), HasSubstr("octets wait for the line already"));
  ASSERT_GE(chunks_, Port::waiting_octets_max / chunk);

  Octets came;
  for (int rounds = 0; rounds < 100'000 && came.size() < chunks_ * chunk; ++rounds) {
    const Octets more = read();
    came.insert(came.end(), more.begin(), more.end());
    ASSERT_TRUE(port_.flush(now_));
  }

  EXPECT_FALSE(port_.has_waiting());
  ASSERT_EQ(came.size(), chunks_ * chunk) << "and nothing of the one that was refused";
  for (std::size_t i = 0; i < came.size(); ++i) ASSERT_EQ(came[i], static_cast<std::uint8_t>(i / chunk));
}

TEST_F(StallingLine, DiscardsWhatIsTooOldAndRefusesUntilOctetsAreTakenAgain) {
  fill();
  now_ += Port::flush_patience - milliseconds(1);
  ASSERT_TRUE(port_.flush(now_));
  ASSERT_TRUE(port_.has_waiting());

  now_ += milliseconds(1);
  const auto flushed = port_.flush(now_);
  ASSERT_FALSE(flushed);
  EXPECT_THAT(flushed.error(), HasSubstr("discarded"));
  EXPECT_FALSE(port_.has_waiting());
  EXPECT_FALSE(port_.queue(Octets{1, 2, 3}, now_)) << "at once";
  EXPECT_FALSE(port_.has_waiting());

  bool taken = false;
  for (int rounds = 0; rounds < 100'000 && !taken; ++rounds) {
    read();
    taken = port_.queue(Octets{1, 2, 3}, now_).has_value();
  }
  EXPECT_TRUE(taken);
  EXPECT_TRUE(port_.queue(Octets{4}, now_));
}

TEST_F(StallingLine, ThatIsClosedTakesNothing) {
  port_ = Port::closed("port");
  EXPECT_FALSE(port_.queue(Octets{1}, now_));
  EXPECT_TRUE(port_.flush(now_));
}

/// The other end of a network port, at the loopback.
class NetworkPort : public ::testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    far_ = Fd(::socket(AF_INET, GetParam(), 0));
    ASSERT_TRUE(far_);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    ASSERT_EQ(::bind(far_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    socklen_t length = sizeof address;
    ASSERT_EQ(::getsockname(far_.get(), reinterpret_cast<sockaddr*>(&address), &length), 0);
    name_ = fmt::format("{}:{}", GetParam() == SOCK_STREAM ? "tcp" : "udp", ntohs(address.sin_port));
  }
  /// The near end opens the line, sends 1, and the far end has it.
  void connect() {
    ASSERT_TRUE(GetParam() != SOCK_STREAM || ::listen(far_.get(), 1) == 0);
    opener_ = PortOpener::of(name_, 921600);
    ASSERT_TRUE(opener_) << opener_.error();
    auto port = opener_->open(milliseconds(5000));
    ASSERT_TRUE(port) << port.error();
    port_ = std::move(*port);
    ASSERT_TRUE(port_.queue(Octets{1}, now_));
    if (GetParam() == SOCK_STREAM) {
      far_ = Fd(::accept(far_.get(), nullptr, nullptr));
    } else {
      sockaddr_in near{};
      socklen_t length = sizeof near;
      ASSERT_EQ(::recvfrom(far_.get(), nullptr, 0, MSG_PEEK, reinterpret_cast<sockaddr*>(&near), &length), 0);
      ASSERT_EQ(::connect(far_.get(), reinterpret_cast<const sockaddr*>(&near), length), 0);
    }
    EXPECT_EQ(received_far(), Octets{1});
  }
  Octets received_far() {
    Octets octets(4096);
    const ssize_t got = ::recv(far_.get(), octets.data(), octets.size(), 0);
    octets.resize(got < 0 ? 0 : static_cast<std::size_t>(got));
    return octets;
  }
  void send_far(const Octets& octets) {
    ASSERT_EQ(::send(far_.get(), octets.data(), octets.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(octets.size()));
  }
  void wait_near() {
    pollfd wait{port_.fd(), POLLIN, 0};
    ASSERT_EQ(::poll(&wait, 1, 5000), 1);
  }

  Fd far_;
  std::string name_;
  Result<PortOpener, std::string> opener_ = Err(std::string());
  Port port_ = Port::closed("port");
  MonotonicTime now_{seconds(100)};
};
INSTANTIATE_TEST_SUITE_P(Kinds, NetworkPort, ::testing::Values(SOCK_STREAM, SOCK_DGRAM),
                         [](const auto& kind) { return kind.param == SOCK_STREAM ? "Tcp" : "Udp"; });

TEST_P(NetworkPort, CarriesOctetsInBothDirections) {
  connect();
  EXPECT_EQ(port_.read(), Octets{}) << "nothing is there yet";
  send_far({7, 8, 9});
  wait_near();
  EXPECT_EQ(port_.read(), (Octets{7, 8, 9}));
  ASSERT_TRUE(port_.write(Octets{4, 5}, milliseconds(100)));
  EXPECT_EQ(received_far(), (Octets{4, 5}));
}

TEST_P(NetworkPort, WhoseOtherEndIsGoneKillsNobody) {
  connect();
  far_.reset();
  for (int i = 0; i < 3; ++i) static_cast<void>(port_.write(Octets{1}, milliseconds(10)));
  wait_near();
  // A connection has an end that can be seen; datagrams are lost as on a radio link.
  EXPECT_EQ(port_.read().has_value(), GetParam() == SOCK_DGRAM);
}

using DatagramPort = NetworkPort;
INSTANTIATE_TEST_SUITE_P(Udp, DatagramPort, ::testing::Values(SOCK_DGRAM));

TEST_P(DatagramPort, HearsNobodyButTheAddressItNames) {
  connect();
  sockaddr_in near{};
  socklen_t length = sizeof near;
  ASSERT_EQ(::getpeername(far_.get(), reinterpret_cast<sockaddr*>(&near), &length), 0);
  const Fd stranger(::socket(AF_INET, SOCK_DGRAM, 0));
  const Octets forged{6, 6, 6};
  ASSERT_EQ(::sendto(stranger.get(), forged.data(), forged.size(), 0,
                     reinterpret_cast<const sockaddr*>(&near), length),
            3);
  Octets heard;
  for (int i = 0; i < 100 && heard.empty(); ++i) {
    send_far({1, 2});
    pollfd wait{port_.fd(), POLLIN, 0};
    static_cast<void>(::poll(&wait, 1, 100));
    heard = port_.read().value();
  }
  EXPECT_EQ(heard, (Octets{1, 2})) << "and nothing of the stranger's before it";
}

TEST_P(DatagramPort, TakesAnEmptyDatagramForNothing) {
  connect();
  send_far({});
  send_far({3});
  wait_near();
  EXPECT_EQ(port_.read(), Octets{});
  EXPECT_EQ(port_.read(), Octets{3});
}

TEST_P(DatagramPort, SendsMoreThanAPacketOfTheNetworkTakesInSeveral) {
  connect();
  ASSERT_TRUE(port_.write(Octets(2000, 5), milliseconds(100)));
  EXPECT_EQ(received_far().size(), 1472U);
  EXPECT_EQ(received_far().size(), 528U);
}

using ConnectedPort = NetworkPort;
INSTANTIATE_TEST_SUITE_P(Tcp, ConnectedPort, ::testing::Values(SOCK_STREAM));

TEST_P(ConnectedPort, IsRefusedUntilSomebodyListensAndOpensThen) {
  auto opener = PortOpener::of(name_, 921600);
  ASSERT_TRUE(opener);
  const auto refused = opener->open(milliseconds(5000));
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error(), HasSubstr("refused"));
  ASSERT_EQ(::listen(far_.get(), 1), 0);
  EXPECT_TRUE(opener->open(milliseconds(5000)));
}

TEST(NetworkPortName, ThatIsMalformedIsRefusedBeforeAnythingIsOpened) {
  for (const char* name : {"tcp:", "tcp:x", "tcp:127.0.0.1:0", "tcp:127.0.0.1:99999", "tcp:localhost:5000",
                           "tcp:127.0.0.1:5000,5001", "udp:", "udp:127.0.0.1:5000,", "udp:127.0.0.1:5000,x",
                           "udp:127.0.0.1:5000,70000"}) {
    const auto opener = PortOpener::of(name, 921600);
    ASSERT_FALSE(opener) << name;
    EXPECT_THAT(opener.error(), HasSubstr("expected tcp:")) << name;
  }
  for (const char* name :
       {"tcp:5000", "udp:127.0.0.1:5000", "udp:10.0.0.1:5000,5001", "/dev/ttyS0", "var/rs422"})
    EXPECT_TRUE(PortOpener::of(name, 921600)) << name;
}

}  // namespace
}  // namespace srfs::ground
