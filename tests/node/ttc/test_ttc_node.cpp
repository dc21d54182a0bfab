// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// TtcNode between a pty, which acts as the RS422 line, and the other nodes' topics over real DDS.

#include <array>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <set>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/epoll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <mission/structures.hpp>
#include <rcl_interfaces/srv/get_parameters.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>

#include "base/crc32c.hpp"
#include "base/file.hpp"
#include "ground/downlink.hpp"
#include "nodes/ttc/ttc_node.hpp"
#include "suite/command_keys.hpp"
#include "suite/commanding/command_proof.hpp"
#include "tests/dds_domain.hpp"
#include "tests/node/ttc/disk_faults.hpp"
#include "tests/var_folder.hpp"
#include "wire/cuc.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs {
namespace {

using srfs_msgs::msg::PayloadTelemetry;
using srfs_msgs::msg::Telecommand;
using srfs_msgs::msg::TelecommandReport;
using testing::HasSubstr;

constexpr std::uint8_t open_vc = 1;
const std::string open_channel = "{ vc: 1, security: none }";

/// ttc has one participant, all other nodes share another, and the ground is at the far end of a pty. All run
/// on one work thread.
class TtcNodeTest : public testing::Test {
 protected:
  void SetUp() override {
    open_line();
    here_ = ros::Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
    there_ = ros::Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
  }
  void TearDown() override {
    line_watch_.reset();
    if (node_) {
      node_->go_to(ros::State::unconfigured);
      node_->go_to(ros::State::finalized);
    }
    node_.reset();
    ticks_.reset();
    std::filesystem::remove_all(suite::VarPaths{folder_}.memory());
  }

  void open_line() {
    line_ = Fd(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK));
    ASSERT_EQ(::grantpt(line_.get()), 0);
    ASSERT_EQ(::unlockpt(line_.get()), 0);
    std::array<char, 64> name{};
    ASSERT_EQ(::ptsname_r(line_.get(), name.data(), name.size()), 0);
    std::filesystem::create_symlink(name.data(), folder_ / "line");
  }
  void make_node(const std::string& channels) {
    const std::string yaml =
        "deployment: t\n"
        "devices: { rs422: \"serial:line\" }\n"
        "link: { spacecraft_id: 0xAB, tc_channels: [" +
        channels +
        "] }\n"
        "nodes: [{ name: ttc, executable: ttc_node,\n"
        "          parameters: { initial_mode: nominal, housekeeping_period_ms: 100, beacon_period_ms: 1000 "
        "} },\n"
        "        { name: image_acquisition, executable: image_acquisition_node },\n"
        "        { name: image_processing, executable: image_processing_node }]\n";
    ASSERT_TRUE(write_file_atomically(folder_ / "d.yaml", yaml));
    deployment_ = std::make_unique<suite::Deployment>(suite::Deployment::load(folder_ / "d.yaml"));
    context_ = std::make_unique<suite::NodeContext>(
        suite::NodeContext{"ttc", *deployment_, suite::VarPaths{folder_}, 1, executor_, *here_});
    node_ = std::make_unique<TtcNode>(*context_);
  }
  void activate(const std::string& channels = open_channel) {
    make_node(channels);
    ASSERT_TRUE(node_->go_to(ros::State::active)) << node_->failure_reason();
    downlink_ = std::make_unique<ground::Downlink>(deployment_->link);
    line_watch_ = executor_.add_fd(line_.get(), EPOLLIN, [this](std::uint32_t) { read_line(); });
  }
  void read_line() {
    std::array<std::uint8_t, 4096> octets{};
    const ssize_t n = ::read(line_.get(), octets.data(), octets.size());
    if (n <= 0) return;
    for (auto& received : downlink_->push(OctetView(octets.data(), static_cast<std::size_t>(n))))
      packets_.push_back(std::move(received.packet));
  }
  /// Ends ttc like a kill: ttc sends and writes nothing more.
  void end_without_a_word() {
    line_watch_.reset();
    node_.reset();
    packets_.clear();
  }
  /// @return the request id as in the reports
  Octets send(std::uint16_t apid, std::uint8_t service, std::uint8_t subtype, Octets data = {}) {
    wire::TcPacket packet;
    packet.apid = apid;
    packet.sequence_count = ++sequence_;
    packet.ack_flags = wire::ack::all;
    packet.service = service;
    packet.subtype = subtype;
    packet.application = std::move(data);
    const Octets octets = wire::make_tc_packet(packet);
    write_frame(wire::TcFrameType::bd, octets);
    return {octets.begin(), octets.begin() + 4};
  }
  void write_frame(wire::TcFrameType type, const Octets& packet) {
    const Octets cltu =
        wire::make_uplink_cltu({.spacecraft_id = 0xAB, .vc = open_vc}, type, 0, nullptr, packet).value();
    EXPECT_EQ(::write(line_.get(), cltu.data(), cltu.size()), static_cast<ssize_t>(cltu.size()));
  }
  /// The newest matching sample of ttc's own counters.
  std::optional<mission::TtcHousekeeping> counters(
      const std::function<bool(const mission::TtcHousekeeping&)>& fits) {
    std::optional<mission::TtcHousekeeping> found;
    comes(3, 25, [&](const wire::TmPacket& p) {
      if (p.source.size() < 2 || p.source[0] != 0 || p.source[1] != mission::structure::ttc) return false;
      found = mission::TtcHousekeeping::decode(OctetView(p.source).subspan(2));
      return found && fits(*found);
    });
    return found;
  }
  [[nodiscard]] std::ptrdiff_t count(std::uint8_t service, std::uint8_t subtype) const {
    return std::count_if(packets_.begin(), packets_.end(), [&](const wire::TmPacket& p) {
      return p.service == service && p.subtype == subtype;
    });
  }
  bool event_comes(std::uint16_t id, std::uint8_t severity) {
    return comes(5, severity, [&](const wire::TmPacket& p) {
      return p.source.size() >= 2 && (p.source[0] << 8 | p.source[1]) == id;
    });
  }
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(20));
  }
  /// Whether a matching packet has arrived or arrives in time.
  bool comes(
      std::uint8_t service, std::uint8_t subtype,
      const std::function<bool(const wire::TmPacket&)>& fits = [](const wire::TmPacket&) { return true; }) {
    return wait([&] {
      return std::any_of(packets_.begin(), packets_.end(), [&](const wire::TmPacket& p) {
        return p.service == service && p.subtype == subtype && fits(p);
      });
    });
  }
  bool verified(std::uint8_t subtype, const Octets& request) {
    return comes(1, subtype, [&](const wire::TmPacket& p) { return p.source == request; });
  }

  /// @return a telecommand packet for a payload
  Octets payload_packet() {
    wire::TcPacket packet;
    packet.apid = mission::apid::payload_eps;
    packet.sequence_count = ++sequence_;
    packet.ack_flags = wire::ack::all;
    packet.service = 8;
    packet.subtype = 1;
    packet.application = {0, 1, 2, 1};
    return wire::make_tc_packet(packet);
  }
  /// Schedules @p packet. @return the request id of the insertion
  Octets schedule(const Octets& packet, UtcTime release) {
    OctetWriter data;
    data.u16(1);
    data.u8(0);
    data.bytes(wire::encode_cuc(to_tai(release)));
    data.bytes(packet);
    return send(mission::apid::ttc, 11, 4, data.take());
  }
  /// Sends ticks with the valid time @p utc until @p condition holds.
  bool wait_at(UtcTime utc, const std::function<bool()>& condition) {
    if (!ticks_)
      ticks_ = std::make_unique<ros::Publisher<srfs_msgs::msg::TimeTick>>(*there_, suite::topics::time_tick);
    const MonotonicTime deadline = monotonic_now() + seconds(20);
    bool holds = false;
    while (!holds && monotonic_now() < deadline) {
      srfs_msgs::msg::TimeTick tick;
      tick.cycle = ++cycle_;
      tick.utc.sec = static_cast<std::int32_t>(utc.since_epoch() / seconds(1));
      tick.monotonic_ns = static_cast<std::uint64_t>(monotonic_now().ns());
      tick.period_us = 1'000'000;
      tick.time_valid = true;
      tick.sync_state = 2;
      ticks_->publish(tick);
      holds = executor_.spin_until(condition, monotonic_now() + milliseconds(200));
    }
    return holds;
  }
  [[nodiscard]] bool has_come(std::uint8_t subtype, const Octets& source) const {
    return std::any_of(packets_.begin(), packets_.end(), [&](const wire::TmPacket& p) {
      return p.service == 1 && p.subtype == subtype && p.source == source;
    });
  }

  /// Sends a telecommand in the ground's notation.
  Octets send(const std::string& name, const std::vector<std::string>& arguments) {
    static const auto dictionary = mission::Dictionary::load(mission::Dictionary::default_folder());
    const auto encoded = dictionary.encode(name, arguments);
    EXPECT_TRUE(encoded) << (encoded ? "" : encoded.error().message);
    return send(encoded->command->apid, encoded->command->service, encoded->command->subtype, encoded->data);
  }
  /// Whether the request fails in @p subtype with @p code.
  bool fails(std::uint8_t subtype, const Octets& request, std::uint16_t code) {
    return comes(1, subtype, [&](const wire::TmPacket& p) {
      return p.source.size() >= 6 && Octets(p.source.begin(), p.source.begin() + 4) == request &&
             (p.source[4] << 8 | p.source[5]) == code;
    });
  }

  /// What the payload says of it, with its proof.
  [[nodiscard]] TelecommandReport report(std::uint64_t id, std::uint8_t stage) const {
    TelecommandReport m;
    m.id = id;
    m.node = "payload_eps";
    m.stage = stage;
    m.success = true;
    m.proof = prove(eps_key(), m);
    return m;
  }
  [[nodiscard]] suite::CommandKey eps_key() const {
    return suite::command_key(suite::VarPaths{folder_}, "payload_eps").value();
  }

  ros::Executor executor_;
  std::unique_ptr<ros::Participant> here_;
  std::unique_ptr<ros::Participant> there_;
  const testing_support::VarFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  Fd line_;
  std::unique_ptr<suite::Deployment> deployment_;
  std::unique_ptr<suite::NodeContext> context_;
  std::unique_ptr<TtcNode> node_;
  std::unique_ptr<ground::Downlink> downlink_;
  ros::Executor::Handle line_watch_;
  std::vector<wire::TmPacket> packets_;
  std::uint16_t sequence_ = 0;
  std::unique_ptr<ros::Publisher<srfs_msgs::msg::TimeTick>> ticks_;
  std::uint64_t cycle_ = 0;
};

TEST_F(TtcNodeTest, AnswersAPingFromTheLine) {
  activate();
  const Octets request = send(mission::apid::ttc, 17, 1);
  EXPECT_TRUE(verified(1, request));
  EXPECT_TRUE(comes(17, 2));
  EXPECT_TRUE(verified(7, request));
}

TEST_F(TtcNodeTest, PublishesATelecommandUntilItsNodeHasItAndSendsDownWhatTheNodeReports) {
  activate();
  std::map<std::uint64_t, std::vector<Telecommand>> published;
  ros::Subscription<Telecommand> telecommands(
      executor_, *there_, suite::topics::telecommand,
      [&](const Telecommand& m, const ros::MessageInfo&) { published[m.id].push_back(m); });
  ros::Publisher<TelecommandReport> reports(*there_, suite::topics::telecommand_report);
  ASSERT_TRUE(wait([&] { return telecommands.publisher_count() == 1 && reports.subscription_count() == 1; }));

  const Octets request = send(mission::apid::payload_eps, 8, 1, {0, 1, 2, 1});
  EXPECT_TRUE(verified(1, request));
  ASSERT_TRUE(wait([&] { return !published.empty() && published.begin()->second.size() >= 2; }))
      << "again, because nobody has said that it has it";
  const Telecommand telecommand = published.begin()->second.front();
  EXPECT_EQ(telecommand.target, "payload_eps");
  EXPECT_EQ(telecommand.function_id, mission::EpsSwitchLoad::function_id);
  EXPECT_EQ(telecommand.arguments, (Octets{2, 1}));
  EXPECT_EQ(telecommand, published.begin()->second.back());
  const suite::CommandKey key = eps_key();
  EXPECT_EQ(rejection_of(&key, telecommand), std::nullopt);

  for (const std::uint8_t stage :
       {TelecommandReport::ACCEPTED, TelecommandReport::STARTED, TelecommandReport::COMPLETED}) {
    reports.publish(report(telecommand.id, stage));
  }
  EXPECT_TRUE(verified(3, request));
  EXPECT_TRUE(verified(7, request));
  EXPECT_EQ(published.size(), 1U);
}

TEST_F(TtcNodeTest, BelievesNoReportThatTheNodeDidNotMake) {
  activate();
  std::vector<std::uint64_t> ids;
  ros::Subscription<Telecommand> telecommands(
      executor_, *there_, suite::topics::telecommand,
      [&](const Telecommand& m, const ros::MessageInfo&) { ids.push_back(m.id); });
  ros::Publisher<TelecommandReport> reports(*there_, suite::topics::telecommand_report);
  ASSERT_TRUE(wait([&] { return telecommands.publisher_count() == 1 && reports.subscription_count() == 1; }));
  const Octets request = send(mission::apid::payload_eps, 8, 1, {0, 1, 2, 1});
  ASSERT_TRUE(wait([&] { return !ids.empty(); }));

  TelecommandReport forged = report(ids.front(), TelecommandReport::COMPLETED);
  forged.proof = {};
  reports.publish(forged);
  forged = report(ids.front(), TelecommandReport::ACCEPTED);
  forged.stage = TelecommandReport::COMPLETED;
  reports.publish(forged);
  EXPECT_TRUE(comes(5, 3, [](const wire::TmPacket& p) {
    return p.source.size() >= 2 &&
           (p.source[0] << 8 | p.source[1]) == mission::NodeForeignSamplesEvent::event_id;
  }));
  const std::size_t before = ids.size();
  EXPECT_TRUE(wait([&] { return ids.size() > before; })) << "still published: nobody has it";
  EXPECT_FALSE(has_come(7, request));

  reports.publish(report(ids.front(), TelecommandReport::COMPLETED));
  EXPECT_TRUE(verified(7, request));
}

TEST_F(TtcNodeTest, AfterAKillPublishesAgainUnderTheSameIdAndTellsTheEndToTheOneWhoAsked) {
  activate();
  std::vector<std::uint64_t> ids;
  ros::Subscription<Telecommand> telecommands(
      executor_, *there_, suite::topics::telecommand,
      [&](const Telecommand& m, const ros::MessageInfo&) { ids.push_back(m.id); });
  const Octets request = send(mission::apid::payload_eps, 8, 1, {0, 1, 2, 1});
  ASSERT_TRUE(verified(1, request));
  ASSERT_TRUE(wait([&] { return !ids.empty(); }));
  const std::uint64_t id = ids.front();

  end_without_a_word();
  ids.clear();
  activate();
  ASSERT_TRUE(wait([&] { return !ids.empty(); }));
  EXPECT_EQ(ids.front(), id);
  ros::Publisher<TelecommandReport> reports(*there_, suite::topics::telecommand_report);
  ASSERT_TRUE(wait([&] { return reports.subscription_count() == 1; }));
  reports.publish(report(id, TelecommandReport::COMPLETED));
  EXPECT_TRUE(verified(3, request));
  EXPECT_TRUE(verified(7, request));

  end_without_a_word();
  ids.clear();
  activate();
  const Octets ping = send(mission::apid::ttc, 17, 1);
  EXPECT_TRUE(verified(7, ping));
  EXPECT_TRUE(ids.empty()) << "it has ended";
}

TEST_F(TtcNodeTest, TheFrameCountersGoOnAfterAKill) {
  activate();
  ASSERT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
  end_without_a_word();
  // The receiver stays the same, so it misses only frames that were really lost.
  make_node(open_channel);
  ASSERT_TRUE(node_->go_to(ros::State::active)) << node_->failure_reason();
  line_watch_ = executor_.add_fd(line_.get(), EPOLLIN, [this](std::uint32_t) { read_line(); });
  ASSERT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
  EXPECT_LE(downlink_->counters().lost_frames, 1U) << "that which the kill cut, if any";
  EXPECT_GE(downlink_->counters().frames, 4U);
}

TEST_F(TtcNodeTest, TheFrameCountersGoOnWhenTheMemoryOfTheSuiteIsGone) {
  const auto next_process = [this](bool orderly) {
    if (orderly) {
      node_->go_to(ros::State::unconfigured);
      executor_.spin_until([] { return false; },
                           monotonic_now() + milliseconds(100));  // for the last frames to arrive
    }
    end_without_a_word();
    std::filesystem::remove_all(suite::VarPaths{folder_}.memory());
    make_node(open_channel);
    ASSERT_TRUE(node_->go_to(ros::State::active)) << node_->failure_reason();
    line_watch_ = executor_.add_fd(line_.get(), EPOLLIN, [this](std::uint32_t) { read_line(); });
    ASSERT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
  };
  activate();
  ASSERT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
  next_process(true);  // srfs down, srfs up
  EXPECT_EQ(downlink_->counters().lost_frames, 0U);
  next_process(false);  // a reset of the computer
  const auto lost = downlink_->counters().lost_frames;
  EXPECT_LE(lost, FrameCountReserve::frames_ahead);
  EXPECT_GT(lost, 0U) << "no counter is used twice";
  next_process(true);
  EXPECT_EQ(downlink_->counters().lost_frames, lost);
}

TEST_F(TtcNodeTest, ARetransmittedFrameIsReportedAgainAndNotExecutedAgain) {
  activate();
  wire::TcPacket ping;
  ping.apid = mission::apid::ttc;
  ping.ack_flags = wire::ack::all;
  ping.service = 17;
  ping.subtype = 1;
  const Octets packet = wire::make_tc_packet(ping);
  const Octets request(packet.begin(), packet.begin() + 4);
  write_frame(wire::TcFrameType::ad, packet);
  ASSERT_TRUE(verified(7, request));

  packets_.clear();
  write_frame(wire::TcFrameType::ad, packet);
  EXPECT_TRUE(verified(1, request));
  EXPECT_TRUE(verified(7, request));
  EXPECT_EQ(count(17, 2), 0) << "the answer is what the execution is seen by";

  end_without_a_word();
  activate();
  write_frame(wire::TcFrameType::ad, packet);
  EXPECT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
  EXPECT_EQ(count(17, 2), 1) << "of the newer one: the frame is known over a restart too";
}

TEST_F(TtcNodeTest, ATelecommandThatIsRepeatedAtTheRateOfTheLineIsAnsweredOnceASecondAndNotStoredAgain) {
  activate();
  wire::TcPacket ping;
  ping.apid = mission::apid::ttc;
  ping.ack_flags = wire::ack::all;
  ping.service = 17;
  ping.subtype = 1;
  const Octets packet = wire::make_tc_packet(ping);
  const Octets request(packet.begin(), packet.begin() + 4);
  write_frame(wire::TcFrameType::ad, packet);
  ASSERT_TRUE(verified(7, request));
  packets_.clear();

  constexpr unsigned repeats = 400;
  const MonotonicTime begun = monotonic_now();
  for (unsigned sent = 0; sent < repeats;) {
    for (int i = 0; i < 20; ++i, ++sent) write_frame(wire::TcFrameType::ad, packet);
    executor_.spin_until([] { return false; }, monotonic_now() + milliseconds(5));
  }
  ASSERT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
  const auto answers = std::count_if(packets_.begin(), packets_.end(), [&](const wire::TmPacket& p) {
    return p.service == 1 && p.subtype == 7 && p.source == request;
  });
  EXPECT_GE(answers, 1);
  EXPECT_LE(answers, (monotonic_now() - begun) / seconds(1) + 1);
  const auto told = counters([](const auto& h) { return h.store_records[2] >= 6; });
  ASSERT_TRUE(told);
  EXPECT_EQ(told->store_records[2], 6U) << "of the two that were executed";
  EXPECT_EQ(told->tc_repeats, repeats);
  EXPECT_EQ(told->tc_repeats_unanswered, repeats - static_cast<unsigned>(answers));
}

TEST_F(TtcNodeTest, AFloodOfControlCommandsWithoutAKeyCostsNoWrite) {
  activate();
  const auto before = counters([](const auto&) { return true; });
  ASSERT_TRUE(before);
  packets_.clear();
  constexpr unsigned frames = 600;
  const wire::TcUplinkChannel channel{.spacecraft_id = 0xAB, .vc = open_vc, .randomize = false};
  for (unsigned sent = 0; sent < frames;) {
    for (int i = 0; i < 20; ++i, ++sent) {
      const Octets cltu = wire::make_control_cltu(channel, {.kind = wire::ControlCommand::Kind::set_vr,
                                                            .vr = static_cast<std::uint8_t>(1 + sent % 200)});
      EXPECT_EQ(::write(line_.get(), cltu.data(), cltu.size()), static_cast<ssize_t>(cltu.size()));
    }
    executor_.spin_until([] { return false; }, monotonic_now() + milliseconds(5));
  }
  const auto after = counters([](const auto& h) { return h.control_commands == frames; });
  ASSERT_TRUE(after);
  EXPECT_EQ(after->journal_syncs, before->journal_syncs) << "they need no key, and cost no write";
  EXPECT_EQ(after->journal_octets, before->journal_octets);
}

TEST_F(TtcNodeTest, WhatFindsTooManyWaitingForTheDiskIsRefusedWithItsReasonAndRecorded) {
  activate();
  const Octets first = send(mission::apid::ttc, 17, 1);
  ASSERT_TRUE(verified(7, first));
  packets_.clear();
  // ttc reads all telecommands at once; none is on disk before the last has arrived.
  std::vector<Octets> requests;
  for (std::size_t i = 0; i < PersistenceGate::capacity + 20; ++i)
    requests.push_back(send(mission::apid::ttc, 17, 1));
  const Octets nowhere = send(0x123, 17, 1);
  EXPECT_TRUE(fails(10, nowhere, mission::failure::unknown_apid));
  EXPECT_TRUE(fails(2, requests.back(), mission::failure::queue_full));
  EXPECT_TRUE(verified(1, requests.front()));

  end_without_a_word();
  JournalFile file(folder_ / "state" / "ttc" / "telecommands");
  JournalLog log(file);
  AcceptanceJournal journal("boot", seconds(60));
  for (const JournalRecord& record : log.load().records) EXPECT_TRUE(journal.apply(record));
  const auto recorded = [&](const Octets& request) {
    return std::any_of(journal.refused().begin(), journal.refused().end(), [&](const RefusedTelecommand& r) {
      OctetWriter id;
      id.u16(r.origin.request.packet_identification);
      id.u16(r.origin.request.packet_sequence_control);
      return id.take() == request;
    });
  };
  EXPECT_TRUE(recorded(requests.back()));
  EXPECT_TRUE(recorded(nowhere));
}

TEST_F(TtcNodeTest, AFirstStartSaysSoAndWhenItIsKilledTheNextOneMissesNothing) {
  activate();
  EXPECT_TRUE(event_comes(mission::event::ttc_first_start, 1));
  end_without_a_word();
  activate();
  ASSERT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
  for (const wire::TmPacket& p : packets_) {
    if (p.service != 5 || p.source.size() < 2) continue;
    const int event = p.source[0] << 8 | p.source[1];
    EXPECT_NE(event, mission::event::ttc_journal_damaged);
    EXPECT_NE(event, mission::event::ttc_counters_lost);
    EXPECT_NE(event, mission::event::ttc_first_start);
  }
}

/// A secured channel with counters that the test chooses.
class TtcCountersTest : public TtcNodeTest {
 protected:
  void SetUp() override {
    TtcNodeTest::SetUp();
    std::filesystem::create_directories(folder_ / "keys");
    ASSERT_TRUE(write_file_atomically(folder_ / "keys" / "a.key", std::string(64, '7') + "\n"));
    ASSERT_EQ(::chmod((folder_ / "keys" / "a.key").c_str(), 0600), 0);
  }
  Octets ping_with(std::uint64_t counter) {
    static const auto key = wire::SdlsKey::from_hex(std::string(64, '7')).value();
    wire::TcPacket ping;
    ping.apid = mission::apid::ttc;
    ping.sequence_count = ++sequence_;
    ping.ack_flags = wire::ack::all;
    ping.service = 17;
    ping.subtype = 1;
    const Octets packet = wire::make_tc_packet(ping);
    const wire::SdlsSeal seal{key, 1, counter};
    const Octets cltu =
        wire::make_uplink_cltu({.spacecraft_id = 0xAB, .vc = 0}, wire::TcFrameType::bd, 0, &seal, packet)
            .value();
    EXPECT_EQ(::write(line_.get(), cltu.data(), cltu.size()), static_cast<ssize_t>(cltu.size()));
    return Octets(packet.begin(), packet.begin() + 4);
  }
  [[nodiscard]] bool lost_with(std::uint64_t least) const {
    return std::any_of(packets_.begin(), packets_.end(), [&](const wire::TmPacket& p) {
      OctetReader in(p.source);
      if (p.service != 5 || in.u16() != mission::event::ttc_counters_lost) return false;
      const auto event = mission::TtcCountersLostEvent::decode(in);
      return event && event->floor >= least && (least > 0 || event->floor == 0);
    });
  }
  [[nodiscard]] bool beacon_has(std::uint64_t least) const {
    return std::any_of(packets_.begin(), packets_.end(), [&](const wire::TmPacket& p) {
      if (p.service != 3 || p.subtype != 25 || p.source.size() < 2 || p.source[0] != 0 ||
          p.source[1] != mission::Beacon::structure_id)
        return false;
      const auto beacon = mission::Beacon::decode(OctetView(p.source).subspan(2));
      return beacon && beacon->sdls_counter[0] >= least;
    });
  }
  [[nodiscard]] bool has_event(std::uint16_t id) const {
    return std::any_of(packets_.begin(), packets_.end(), [&](const wire::TmPacket& p) {
      return p.service == 5 && p.source.size() >= 2 && (p.source[0] << 8 | p.source[1]) == id;
    });
  }
  [[nodiscard]] bool floor_is_stored() const {
    return !std::filesystem::exists(folder_ / "state" / "ttc" / "counters_lost");
  }

  const std::string secured_ = "{ vc: 0, security: sdls, spi: 1, key_file: keys/a.key }";
  const UtcTime today_{seconds(1'795'000'000)};
  const std::uint64_t floor_ = lost_counter_floor(today_);
};

TEST_F(TtcCountersTest, CountersThatAreLostAreSaidAndGoOnBehindAFloorFromTheValidTime) {
  activate(secured_);
  ASSERT_TRUE(verified(7, ping_with(1000)));
  end_without_a_word();
  for (const char* file : {"telecommands.0", "telecommands.1", "link_state"})
    std::filesystem::remove(folder_ / "state" / "ttc" / file);

  activate(secured_);
  EXPECT_TRUE(wait([&] { return lost_with(0); }));
  EXPECT_TRUE(verified(7, ping_with(1001))) << "nobody is locked out while the time is not valid";
  end_without_a_word();
  activate(secured_);
  EXPECT_TRUE(wait([&] { return lost_with(0); })) << "still";
  EXPECT_TRUE(wait_at(today_, [&] { return lost_with(floor_); }));
  const Octets recorded = ping_with(5000);
  EXPECT_TRUE(event_comes(mission::event::ttc_frames_refused, 3));
  EXPECT_FALSE(has_come(1, recorded));
  EXPECT_TRUE(verified(7, ping_with(floor_ + 3'600'000)));
  EXPECT_TRUE(wait([&] { return floor_is_stored(); }));

  end_without_a_word();
  activate(secured_);
  (void)ping_with(5001);
  EXPECT_TRUE(event_comes(mission::event::ttc_frames_refused, 3));
  EXPECT_FALSE(lost_with(0)) << "it is over";
}

TEST_F(TtcCountersTest, WhenNothingButTheKeysIsLeftTheFirstValidTimeBringsTheFloorToo) {
  activate(secured_);
  ASSERT_TRUE(verified(7, ping_with(floor_ - 86'400'000)));
  end_without_a_word();
  for (const char* left : {"state", "store"}) std::filesystem::remove_all(folder_ / left);

  activate(secured_);
  EXPECT_TRUE(event_comes(mission::event::ttc_first_start, 1));
  end_without_a_word();
  activate(secured_);  // the counter floor is not yet set
  EXPECT_TRUE(verified(7, ping_with(floor_ - 86'300'000)))
      << "nobody is locked out while the time is not valid";
  EXPECT_TRUE(wait_at(today_, [&] { return beacon_has(floor_); }));
  const Octets recorded = ping_with(floor_ - 86'200'000);
  EXPECT_TRUE(event_comes(mission::event::ttc_frames_refused, 3));
  EXPECT_FALSE(has_come(1, recorded));
  EXPECT_TRUE(verified(7, ping_with(floor_ + 60'000)));
  EXPECT_TRUE(wait([&] { return floor_is_stored(); }));
  EXPECT_FALSE(has_event(mission::event::ttc_counters_lost));
  end_without_a_word();
  activate(secured_);
  (void)ping_with(floor_ - 86'100'000);
  EXPECT_TRUE(event_comes(mission::event::ttc_frames_refused, 3));
}

TEST_F(TtcCountersTest, AtAFirstStartAGroundStationThatCountsFromOneIsNotLockedOutByTheValidTime) {
  activate(secured_);
  ASSERT_TRUE(verified(7, ping_with(1)));
  EXPECT_FALSE(floor_is_stored());
  EXPECT_TRUE(wait_at(today_, [&] { return floor_is_stored(); })) << "nothing waits for it any more";
  EXPECT_TRUE(verified(7, ping_with(2)));
  (void)ping_with(2);
  EXPECT_TRUE(event_comes(mission::event::ttc_frames_refused, 3));
}

TEST_F(TtcNodeTest, AnyApplicationProcessTellsWhetherItIsThere) {
  using GetState = lifecycle_msgs::srv::GetState;
  activate();
  EXPECT_TRUE(fails(8, send(mission::apid::payload_eps, 17, 1), mission::failure::node_unavailable));
  ros::Service<GetState> service(
      executor_, *there_, "/payload_eps/get_state", ros::Qos{}, ros::Priority::normal,
      [](const GetState::Request&, GetState::Response& response) { response.current_state.id = 3; });
  const Octets alive = send(mission::apid::payload_eps, 17, 1);
  EXPECT_TRUE(comes(17, 2, [](const wire::TmPacket& p) { return p.apid == mission::apid::payload_eps; }));
  EXPECT_TRUE(verified(7, alive));
  const Octets tested = send("ttc.test_connection", {"tested_apid=17"});
  EXPECT_TRUE(comes(17, 4, [](const wire::TmPacket& p) { return p.source == Octets({0, 17}); }));
  EXPECT_TRUE(verified(7, tested));
  EXPECT_TRUE(fails(10, send(0x123, 17, 1), mission::failure::unknown_apid));
}

TEST_F(TtcNodeTest, AScheduledTelecommandIsReleasedAtItsTimeAlsoAfterAKill) {
  const UtcTime morning(seconds(1'795'000'000));
  const UtcTime release = morning + seconds(3600);
  activate();
  std::vector<std::uint64_t> ids;
  ros::Subscription<Telecommand> telecommands(
      executor_, *there_, suite::topics::telecommand,
      [&](const Telecommand& m, const ros::MessageInfo&) { ids.push_back(m.id); });
  const Octets packet = payload_packet();
  const Octets request(packet.begin(), packet.begin() + 4);
  const Octets insertion = schedule(packet, release);
  ASSERT_TRUE(wait_at(morning, [&] { return has_come(7, insertion); }));
  EXPECT_FALSE(has_come(1, request));
  EXPECT_TRUE(ids.empty());

  end_without_a_word();
  activate();
  ASSERT_TRUE(wait_at(release + seconds(1), [&] { return has_come(1, request) && !ids.empty(); }));
  const std::uint64_t id = ids.front();

  // The telecommand is no longer scheduled but in progress. It keeps its id and is not released again.
  end_without_a_word();
  ids.clear();
  activate();
  ASSERT_TRUE(wait_at(release + seconds(1), [&] { return !ids.empty(); }));
  ros::Publisher<TelecommandReport> reports(*there_, suite::topics::telecommand_report);
  ASSERT_TRUE(wait([&] { return reports.subscription_count() == 1; }));
  reports.publish(report(id, TelecommandReport::COMPLETED));
  EXPECT_TRUE(wait_at(release + seconds(2), [&] { return has_come(7, request); }));
  EXPECT_EQ(std::set<std::uint64_t>(ids.begin(), ids.end()), std::set<std::uint64_t>{id});

  const Octets list = send(mission::apid::ttc, 11, 17);
  EXPECT_TRUE(verified(7, list));
  EXPECT_TRUE(comes(11, 13, [](const wire::TmPacket& p) { return p.source == Octets{0, 0}; }));
}

TEST_F(TtcNodeTest, AScheduledTelecommandThatIsTooLateIsDroppedWithAnEventAndUnderItsOwnRequestId) {
  const UtcTime morning(seconds(1'795'000'000));
  activate();
  const Octets packet = payload_packet();
  const Octets insertion = schedule(packet, morning + seconds(10));
  ASSERT_TRUE(wait_at(morning, [&] { return has_come(7, insertion); }));

  Octets expired(packet.begin(), packet.begin() + 4);
  expired.insert(expired.end(), {0, 20});
  EXPECT_TRUE(wait_at(morning + seconds(10 + 61), [&] { return has_come(2, expired); })) << "the clock steps";
  EXPECT_TRUE(event_comes(mission::event::schedule_activity_dropped, 3));
}

TEST_F(TtcNodeTest, SendsTimeReportsAtTheRateThatWasSet) {
  activate();
  const UtcTime noon(seconds(1'795'000'000));
  const Octets rate = send(mission::apid::ttc, 9, 1, {1});
  ASSERT_TRUE(wait_at(noon, [&] { return has_come(7, rate); }));
  EXPECT_TRUE(wait_at(noon, [&] {
    return std::any_of(packets_.begin(), packets_.end(), [&](const wire::TmPacket& p) {
      return p.apid == 0 && p.service == 9 && p.source == Octets{1} && p.time - to_tai(noon) < seconds(5) &&
             to_tai(noon) - p.time < seconds(5);
    });
  }));
}

TEST_F(TtcNodeTest, ADamagedJournalIsSaidAndLocksNobodyOut) {
  activate();
  ASSERT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
  end_without_a_word();
  for (const char* file : {"telecommands.0", "telecommands.1"}) {
    const std::filesystem::path path = folder_ / "state" / "ttc" / file;
    if (std::filesystem::exists(path)) {
      ASSERT_TRUE(write_file_atomically(path, std::string(4096, 'x')));
    }
  }
  activate();
  EXPECT_TRUE(event_comes(mission::event::ttc_journal_damaged, 4));
  EXPECT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
}

TEST_F(TtcNodeTest, WithoutAJournalRecoveryCommandsRunWithAnEventAndOthersAreRefused) {
  for (const char* file : {"telecommands.0", "telecommands.1"})
    std::filesystem::create_directories(folder_ / "state" / "ttc" / file);
  activate();
  EXPECT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
  EXPECT_TRUE(event_comes(mission::event::ttc_recovery_without_storage, 3));
  const Octets refused = send(mission::apid::ttc, 3, 5, {0, 1, 0, 1});
  EXPECT_TRUE(comes(1, 2, [&](const wire::TmPacket& p) {
    return p.source.size() == 6 && Octets(p.source.begin(), p.source.begin() + 4) == refused &&
           p.source[5] == 11;
  }));

  for (const char* file : {"telecommands.0", "telecommands.1"})
    std::filesystem::remove(folder_ / "state" / "ttc" / file);
  bool accepted = false;
  for (int attempt = 0; attempt < 20 && !accepted; ++attempt) {  // ttc retries every second
    const Octets request = send(mission::apid::ttc, 3, 5, {0, 1, 0, 1});
    const auto answered = [&](const wire::TmPacket& p) {
      return p.service == 1 && p.subtype <= 2 && Octets(p.source.begin(), p.source.begin() + 4) == request;
    };
    ASSERT_TRUE(wait([&] { return std::any_of(packets_.begin(), packets_.end(), answered); }));
    accepted = std::find_if(packets_.begin(), packets_.end(), answered)->subtype == 1;
  }
  EXPECT_TRUE(accepted);
}

TEST_F(TtcNodeTest, SendsDownTheTelemetryOfANodeAndCountsWhatClaimsToBeIt) {
  activate();
  ros::Publisher<PayloadTelemetry> telemetry(*there_, suite::topics::telemetry("payload_eps"));
  ASSERT_TRUE(wait([&] { return telemetry.subscription_count() == 1; }));
  PayloadTelemetry sample;
  sample.source = "payload_eps";
  sample.apid = mission::apid::payload_adcs;
  sample.structure_id = mission::structure::payload_eps;
  telemetry.publish(sample);
  const auto foreign = [](const wire::TmPacket& p) {
    if (p.source.size() < 2 || p.source[0] != 0 || p.source[1] != mission::structure::ttc) return false;
    const auto h = mission::TtcHousekeeping::decode(OctetView(p.source).subspan(2));
    return h && h->dds_foreign == 1;
  };
  EXPECT_TRUE(comes(3, 25, foreign));

  mission::PayloadEpsHousekeeping hk;
  hk.cycle = 77;
  sample.apid = mission::apid::payload_eps;
  sample.data = hk.encoded();
  telemetry.publish(sample);
  EXPECT_TRUE(comes(3, 25, [&](const wire::TmPacket& p) {
    return p.apid == mission::apid::payload_eps &&
           Octets(p.source.begin() + 2, p.source.end()) == sample.data;
  }));
}

TEST_F(TtcNodeTest, AHazardousTelecommandRunsOnceAfterItWasArmedAndARestartDisarms) {
  activate();
  wire::TcPacket hazard;
  hazard.apid = mission::EpsPowerCyclePeripheral::apid;
  hazard.ack_flags = wire::ack::all;
  hazard.service = 8;
  hazard.subtype = 1;
  hazard.application = {0, mission::EpsPowerCyclePeripheral::function_id, 0, 200};
  const auto arm = [&] {
    mission::TtcArm arming;
    arming.of_apid = hazard.apid;
    arming.of_service = hazard.service;
    arming.of_subtype = hazard.subtype;
    arming.digest = crc32c(hazard.application);
    OctetWriter data;
    data.u16(arming.function_id);
    data.bytes(arming.encoded());
    return send(mission::apid::ttc, 8, 1, data.take());
  };
  const auto fire = [&] {
    hazard.sequence_count = static_cast<std::uint16_t>(++sequence_);
    const Octets packet = wire::make_tc_packet(hazard);
    write_frame(wire::TcFrameType::bd, packet);
    return Octets(packet.begin(), packet.begin() + 4);
  };
  const auto refused = [&](const Octets& request) {
    Octets report = request;
    report.insert(report.end(), {0, 9});
    return verified(2, report);
  };
  EXPECT_TRUE(refused(fire()));
  ASSERT_TRUE(verified(7, arm()));
  EXPECT_TRUE(event_comes(mission::event::ttc_armed, 3));
  EXPECT_TRUE(verified(1, fire()));
  EXPECT_TRUE(event_comes(mission::event::ttc_disarmed, 3));
  EXPECT_TRUE(refused(fire())) << "once";

  ASSERT_TRUE(verified(7, arm()));
  end_without_a_word();
  activate();
  EXPECT_TRUE(refused(fire()));
}

class TtcOnABadDisk : public TtcNodeTest, public testing::WithParamInterface<testing_support::DiskFault> {
 protected:
  void TearDown() override {
    testing_support::set_disk_fault(testing_support::DiskFault::none, folder_);
    TtcNodeTest::TearDown();
  }
  bool beacon_says(mission::StorageState state) {
    return comes(3, 25, [&](const wire::TmPacket& p) {
      if (p.source.size() < 2 || p.source[0] != 0 || p.source[1] != mission::Beacon::structure_id)
        return false;
      const auto beacon = mission::Beacon::decode(OctetView(p.source).subspan(2));
      return beacon && beacon->storage_state == state;
    });
  }
  bool counters_say(const std::function<bool(const mission::TtcHousekeeping&)>& fits) {
    return comes(3, 25, [&](const wire::TmPacket& p) {
      if (p.source.size() < 2 || p.source[0] != 0 || p.source[1] != mission::structure::ttc) return false;
      const auto h = mission::TtcHousekeeping::decode(OctetView(p.source).subspan(2));
      return h && fits(*h);
    });
  }
  /// Sends a telecommand that is not marked recovery. @return whether ttc accepted it
  bool takes_an_ordinary_command() {
    const Octets request = send(mission::apid::ttc, 3, 5, {0, 1, 0, 1});
    const auto answer = [&] {
      return std::find_if(packets_.begin(), packets_.end(), [&](const wire::TmPacket& p) {
        return p.service == 1 && p.subtype <= 2 && Octets(p.source.begin(), p.source.begin() + 4) == request;
      });
    };
    EXPECT_TRUE(wait([&] { return answer() != packets_.end(); }));
    if (answer() == packets_.end()) return false;
    const bool accepted = answer()->subtype == 1;
    EXPECT_TRUE(accepted || answer()->source[5] == 11) << "storage_unavailable";
    return accepted;
  }
};

TEST_P(TtcOnABadDisk, CommandingNeverStopsAndEverythingIsBackWithTheDisk) {
  activate();
  ASSERT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
  ASSERT_TRUE(takes_an_ordinary_command());
  ASSERT_TRUE(counters_say([](const auto& h) { return h.store_records[0] > 0; })) << "the stores work";

  testing_support::set_disk_fault(GetParam(), folder_);
  // ttc writes an existing journal in place, so a full disk does not affect it.
  const bool journal_works = GetParam() == testing_support::DiskFault::full;
  EXPECT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
  EXPECT_EQ(takes_an_ordinary_command(), journal_works);
  EXPECT_TRUE(event_comes(mission::event::ttc_storage_unavailable, 4));
  EXPECT_TRUE(
      beacon_says(journal_works ? mission::StorageState::stores_fail : mission::StorageState::both_fail));
  EXPECT_TRUE(counters_say([](const auto& h) { return h.store_write_failures > 0; }));
  if (!journal_works) {
    EXPECT_TRUE(event_comes(mission::event::ttc_recovery_without_storage, 3));
    EXPECT_TRUE(counters_say([](const auto& h) { return h.journal_write_failures > 0; }));
  }
  const Octets last = send(mission::apid::ttc, 17, 1);
  EXPECT_TRUE(verified(7, last));

  packets_.clear();
  testing_support::set_disk_fault(testing_support::DiskFault::none, folder_);
  EXPECT_TRUE(event_comes(mission::event::ttc_storage_available, 1));
  EXPECT_TRUE(beacon_says(mission::StorageState::works));
  bool accepted = false;
  for (int attempt = 0; attempt < 20 && !accepted; ++attempt) accepted = takes_an_ordinary_command();
  EXPECT_TRUE(accepted);
}

std::string disk_name(const testing::TestParamInfo<testing_support::DiskFault>& fault) {
  constexpr std::array names{"None", "Full", "ReadOnly", "Failing"};
  return names.at(static_cast<std::size_t>(fault.param));
}

INSTANTIATE_TEST_SUITE_P(Disks, TtcOnABadDisk,
                         testing::Values(testing_support::DiskFault::full,
                                         testing_support::DiskFault::read_only,
                                         testing_support::DiskFault::failing),
                         disk_name);

TEST_F(TtcNodeTest, DoesNotConfigureWithOneKeyInTwoFilesAndNamesThem) {
  std::filesystem::create_directories(folder_ / "keys");
  for (const char* file : {"keys/a.key", "keys/b.key"}) {
    ASSERT_TRUE(write_file_atomically(folder_ / file, std::string(64, '7') + "\n"));
    ASSERT_EQ(::chmod((folder_ / file).c_str(), 0600), 0);
  }
  make_node(
      "{ vc: 0, security: sdls, spi: 1, key_file: keys/a.key },"
      "{ vc: 0, security: sdls, spi: 2, key_file: keys/b.key }");
  EXPECT_FALSE(node_->go_to(ros::State::inactive));
  EXPECT_THAT(node_->failure_reason(), HasSubstr("d.yaml"));
  EXPECT_THAT(node_->failure_reason(),
              HasSubstr("the same one in keys/a.key (SPI 1) and keys/b.key (SPI 2)"));
}

TEST_F(TtcNodeTest, ReportsAndDeletesAFileOfTheFolderOfFiles) {
  std::filesystem::create_directories(folder_ / "files");
  ASSERT_TRUE(write_file_atomically(folder_ / "files" / "abc", "abc"));
  activate();
  const Octets report = send("file.report", {"file=abc"});
  EXPECT_TRUE(verified(3, report));
  EXPECT_TRUE(comes(23, 4, [](const wire::TmPacket& p) {
    const auto told = mission::FileAttributes::decode(OctetView(p.source));
    return told && told->file == "abc" && told->octets == 3 && told->checksum == 0x61626300;
  }));
  EXPECT_TRUE(verified(7, report));
  EXPECT_TRUE(verified(7, send("file.delete", {"file=abc"})));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "files" / "abc"));
  EXPECT_TRUE(fails(4, send("file.delete", {"file=abc"}), mission::failure::file_not_found));
  EXPECT_TRUE(
      fails(4, send("file.delete", {"repository=..", "file=d.yaml"}), mission::failure::bad_file_name));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "d.yaml"));
}

TEST_F(TtcNodeTest, ADeletionThatAKillInterruptedIsDoneAgainAndIsNoFailure) {
  std::filesystem::create_directories(folder_ / "files");
  ASSERT_TRUE(write_file_atomically(folder_ / "files" / "abc", "abc"));
  activate();
  ASSERT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
  // Kill ttc as soon as the file is gone: the request is accepted, but its end is not recorded.
  const Octets request = send("file.delete", {"file=abc"});
  ASSERT_TRUE(wait([&] { return !std::filesystem::exists(folder_ / "files" / "abc"); }));
  end_without_a_word();
  activate();
  EXPECT_TRUE(verified(7, request));
}

TEST_F(TtcNodeTest, ACopyBeginsOnTheLinkAndIsInTheStatusUntilItIsCancelled) {
  std::filesystem::create_directories(folder_ / "files");
  ASSERT_TRUE(write_file_atomically(folder_ / "files" / "image", std::string(3000, 'x')));
  activate();
  EXPECT_TRUE(verified(7, send("file.copy", {"operation=9", "source_file=image"})));
  EXPECT_TRUE(wait([&] { return !downlink_->take_file_pdus().empty(); }));
  EXPECT_TRUE(verified(7, send("file.suspend", {"operation=9"})));
  EXPECT_TRUE(verified(7, send("file.report_copies", {})));
  EXPECT_TRUE(comes(23, 23, [](const wire::TmPacket& p) {
    const auto told = mission::FileCopyStatus::decode(OctetView(p.source));
    return told && told->operation == 9 && told->state == mission::FileCopyState::suspended;
  }));
  EXPECT_TRUE(fails(4, send("file.abort", {"operation=10"}), mission::failure::unknown_operation));
  EXPECT_TRUE(verified(7, send("file.abort", {"operation=9"})));
}

TEST_F(TtcNodeTest, AFolderOfFilesThatCannotBeOpenedFailsItsRequestsAndNothingElse) {
  ASSERT_TRUE(write_file_atomically(folder_ / "files", "not a folder"));
  activate();
  EXPECT_TRUE(fails(4, send("file.list", {}), mission::failure::disk_failed));
  EXPECT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
  std::filesystem::remove(folder_ / "files");
  EXPECT_TRUE(verified(7, send("file.list", {}))) << "as soon as it is there";
}

/// The parameter services of another node.
class TtcParametersTest : public TtcNodeTest {
 protected:
  using GetParameters = rcl_interfaces::srv::GetParameters;
  using SetParameters = rcl_interfaces::srv::SetParameters;

  void serve() {
    get_ = std::make_unique<ros::Service<GetParameters>>(
        executor_, *there_, "/timing/get_parameters", ros::Qos{}, ros::Priority::normal,
        [this](const GetParameters::Request& request, GetParameters::Response& response) {
          EXPECT_EQ(request.names, std::vector<std::string>{"leap_seconds"});
          response.values.push_back(ros::to_message(ros::ParameterValue(leap_seconds_)));
        });
    set_ = std::make_unique<ros::Service<SetParameters>>(
        executor_, *there_, "/timing/set_parameters", ros::Qos{}, ros::Priority::normal,
        [this](const SetParameters::Request& request, SetParameters::Response& response) {
          rcl_interfaces::msg::SetParametersResult result;
          const auto value = ros::from_message(request.parameters.front().value);
          result.successful = value && std::get<std::int64_t>(*value) != 40;
          if (result.successful) leap_seconds_ = std::get<std::int64_t>(*value);
          if (!result.successful) result.reason = "forty is too round";
          response.results.push_back(result);
        });
  }

  std::unique_ptr<ros::Service<GetParameters>> get_;
  std::unique_ptr<ros::Service<SetParameters>> set_;
  std::int64_t leap_seconds_ = 37;
};

TEST_F(TtcParametersTest, ReadsAndChangesAParameterOfAnotherNode) {
  serve();
  activate();
  const auto told = [&](std::uint8_t value) {
    return comes(20, 2, [&](const wire::TmPacket& p) { return p.source == (Octets{0, 1, 0, 102, value}); });
  };
  const Octets report = send("parameters.report", {"parameter=timing.leap_seconds"});
  EXPECT_TRUE(verified(3, report));
  EXPECT_TRUE(told(37));
  EXPECT_TRUE(verified(7, report));
  EXPECT_TRUE(verified(7, send("parameters.set", {"parameter=timing.leap_seconds", "value=38"})));
  EXPECT_EQ(leap_seconds_, 38);
  EXPECT_TRUE(verified(7, send("parameters.report", {"parameter=timing.leap_seconds"})));
  EXPECT_TRUE(told(38));
}

TEST_F(TtcParametersTest, AValueThatTheNodeRefusesFailsWithItsReasonAsEvent) {
  serve();
  activate();
  EXPECT_TRUE(fails(8, send("parameters.set", {"parameter=timing.leap_seconds", "value=40"}),
                    mission::failure::parameter_refused));
  EXPECT_EQ(leap_seconds_, 37);
  EXPECT_TRUE(comes(5, 2, [](const wire::TmPacket& p) {
    OctetReader in(p.source);
    if (in.u16() != mission::event::parameter_refused) return false;
    const auto event = mission::ParameterRefusedEvent::decode(in);
    return event && event->parameter == 102 && event->reason == "forty is too round";
  }));
}

TEST_F(TtcParametersTest, ANodeThatDoesNotAnswerFailsItsRequestsInTime) {
  activate();
  const Octets request = send("parameters.report", {"parameter=timing.leap_seconds"});
  EXPECT_TRUE(fails(8, request, mission::failure::parameter_node_silent));
  EXPECT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
}

TEST_F(TtcParametersTest, TtcAnswersForItself) {
  activate();
  EXPECT_TRUE(verified(7, send("parameters.set", {"parameter=ttc.callback_budget_ms", "value=25"})));
  EXPECT_TRUE(verified(7, send("parameters.report", {"parameter=ttc.callback_budget_ms"})));
  EXPECT_TRUE(comes(20, 2, [](const wire::TmPacket& p) { return p.source == (Octets{0, 1, 0, 11, 0, 25}); }));
}

/// Stands in for the two imaging nodes; the test controls what they do.
class TtcImagingTest : public TtcNodeTest {
 protected:
  using Capture = srfs_msgs::action::CaptureImage;
  using Process = srfs_msgs::action::ProcessImage;
  template <class A>
  using Goals = std::vector<std::shared_ptr<ros::ServerGoal<A>>>;

  void serve() {
    ros::ActionHandlers<Capture> capture;
    capture.accepted = [this](auto goal) { captures_.push_back(std::move(goal)); };
    capture_ = std::make_unique<ros::ActionServer<Capture>>(executor_, *there_, "/image/capture",
                                                            std::move(capture));
    ros::ActionHandlers<Process> process;
    process.accepted = [this](auto goal) { processes_.push_back(std::move(goal)); };
    process_ = std::make_unique<ros::ActionServer<Process>>(executor_, *there_, "/image/process",
                                                            std::move(process));
  }
  void TearDown() override {
    captures_.clear();
    processes_.clear();
    capture_.reset();
    process_.reset();
    TtcNodeTest::TearDown();
  }
  void write(const std::string& name, const std::string& content) {
    std::filesystem::create_directories((folder_ / name).parent_path());
    ASSERT_TRUE(write_file_atomically(folder_ / name, content));
  }
  /// Stores a frame and ends the newest capture successfully.
  void end_capture() {
    write("images/frames/0000000005/0001.fits", "frame");
    Capture::Result result;
    result.files = {"frames/0000000005/0001.fits"};
    captures_.back()->succeed(result);
  }
  bool progressed(std::uint8_t step, const Octets& request) {
    Octets source = request;
    source.push_back(step);
    return verified(5, source);
  }

  std::unique_ptr<ros::ActionServer<Capture>> capture_;
  std::unique_ptr<ros::ActionServer<Process>> process_;
  Goals<Capture> captures_;
  Goals<Process> processes_;
};

TEST_F(TtcImagingTest, ATelecommandIsCapturedProcessedAndItsProductsGoDown) {
  serve();
  activate();
  const Octets request = send("image.capture", {"task=5", "exposure_us=20000", "frames=1", "method=tracklet",
                                                "parameters=threshold=4", "budget_octets=9000"});
  EXPECT_TRUE(verified(3, request));
  ASSERT_TRUE(wait([&] { return captures_.size() == 1; }));
  EXPECT_EQ(captures_[0]->goal().task, 5U);
  EXPECT_EQ(captures_[0]->goal().exposure_us, 20000U);
  EXPECT_EQ(captures_[0]->goal().start, builtin_interfaces::msg::Time{});
  end_capture();
  EXPECT_TRUE(progressed(100, request));
  ASSERT_TRUE(wait([&] { return processes_.size() == 1; }));
  const Process::Goal goal = processes_[0]->goal();
  EXPECT_EQ(goal.task, 5U);
  EXPECT_EQ(goal.files, std::vector<std::string>{"frames/0000000005/0001.fits"});
  EXPECT_EQ(goal.method, "tracklet");
  EXPECT_EQ(goal.parameters, "threshold=4");
  EXPECT_EQ(goal.budget_octets, 9000U);
  EXPECT_FALSE(goal.full_frames);

  write("images/products/0000000005/findings.json", "{}");
  Process::Result result;
  result.products = {"products/0000000005/findings.json"};
  processes_[0]->succeed(result);
  EXPECT_TRUE(progressed(200, request));
  EXPECT_TRUE(verified(7, request));
  EXPECT_TRUE(wait([&] { return !downlink_->take_file_pdus().empty(); })) << "it is being sent";
  EXPECT_TRUE(std::filesystem::exists(folder_ / "images/products/0000000005/findings.json"));

  // The ground does not receive the file, so it can still be withdrawn.
  const std::string queued = fmt::format("files/outbox/image_001_r{:08x}_0000000005_findings.json",
                                         image::run_of_goal(processes_[0]->id()));
  ASSERT_TRUE(std::filesystem::exists(folder_ / queued));
  EXPECT_TRUE(verified(7, send("image.cancel", {"task=5"})));
  EXPECT_FALSE(std::filesystem::exists(folder_ / queued));
  EXPECT_TRUE(fails(8, send("image.cancel", {"task=6"}), mission::failure::unknown_task));
}

TEST_F(TtcImagingTest, ARunningGoalIsCancelledAndItsTelecommandAborted) {
  serve();
  activate();
  const Octets request = send("image.capture", {"task=5", "frames=9"});
  ASSERT_TRUE(wait([&] { return captures_.size() == 1; }));
  EXPECT_TRUE(verified(7, send("image.cancel", {"task=5"})));
  ASSERT_TRUE(wait([&] { return captures_[0]->is_cancel_requested(); }));
  captures_[0]->canceled();
  EXPECT_TRUE(fails(8, request, mission::failure::aborted));
  EXPECT_TRUE(event_comes(mission::event::image_task_failed, 3));
}

TEST_F(TtcImagingTest, AFailureOfTheNodeIsThatOfTheTelecommand) {
  serve();
  activate();
  const Octets request = send("image.capture", {"task=5"});
  ASSERT_TRUE(wait([&] { return captures_.size() == 1; }));
  Capture::Result result;
  result.failure_code = mission::failure::camera_absent;
  captures_[0]->abort(result);
  EXPECT_TRUE(fails(8, request, mission::failure::camera_absent));
}

TEST_F(TtcImagingTest, AServerThatIsGoneLosesItsTask) {
  serve();
  activate();
  const Octets request = send("image.capture", {"task=5"});
  ASSERT_TRUE(wait([&] { return captures_.size() == 1; }));
  captures_.clear();
  capture_.reset();
  EXPECT_TRUE(fails(8, request, mission::failure::imaging_lost));
  EXPECT_TRUE(verified(7, send(mission::apid::ttc, 17, 1)));
}

TEST_F(TtcImagingTest, ACaptureUnderWayIsNotTakenAgainWhenTtcWasKilled) {
  serve();
  activate();
  const Octets request = send("image.capture", {"task=5"});
  ASSERT_TRUE(wait([&] { return captures_.size() == 1; }));
  end_without_a_word();
  activate();
  EXPECT_TRUE(fails(8, request, mission::failure::interrupted));
  EXPECT_TRUE(wait([&] { return captures_[0]->is_cancel_requested(); })) << "nobody waits for it";
  EXPECT_FALSE(has_come(7, request));
  EXPECT_EQ(captures_.size(), 1U);
  static_cast<void>(send("image.capture", {"task=6"}));
  EXPECT_TRUE(wait([&] { return captures_.size() == 2; }));
  EXPECT_FALSE(captures_[1]->is_cancel_requested());
}

TEST_F(TtcImagingTest, FramesThatWereStoredAreProcessedWhenTtcWasKilled) {
  serve();
  activate();
  const Octets request = send("image.capture", {"task=5"});
  ASSERT_TRUE(wait([&] { return captures_.size() == 1; }));
  end_capture();
  ASSERT_TRUE(wait([&] { return processes_.size() == 1; }));
  end_without_a_word();
  activate();
  ASSERT_TRUE(wait([&] { return processes_.size() == 2; }));
  EXPECT_EQ(processes_[1]->goal().files, processes_[0]->goal().files);
  processes_[1]->succeed();
  EXPECT_TRUE(verified(7, request));
  EXPECT_EQ(captures_.size(), 1U);
}

TEST_F(TtcImagingTest, ATimedCaptureIsAskedForShortlyBeforeItsTime) {
  const UtcTime morning(seconds(1'795'000'000));
  serve();
  activate();
  const Octets request = send("image.capture", {"task=5", "start=" + to_iso8601(morning + seconds(600))});
  EXPECT_TRUE(wait_at(morning, [&] { return has_come(3, request); }));
  EXPECT_TRUE(captures_.empty());
  EXPECT_TRUE(wait_at(morning + seconds(595), [&] { return captures_.size() == 1; }));
  EXPECT_EQ(ros::from_message(captures_[0]->goal().start), morning + seconds(600));
}

}  // namespace
}  // namespace srfs
