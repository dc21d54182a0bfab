// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// srfs_rescue on a line that is a pty: what a ground station sees of it.
#include "programs/rescue/rescuer.hpp"

#include <array>
#include <functional>
#include <thread>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/process.hpp"
#include "tests/temporary_folder.hpp"
#include "wire/cadu.hpp"
#include "wire/cltu.hpp"
#include "wire/farm1.hpp"
#include "wire/pus.hpp"
#include "wire/tc_uplink.hpp"
#include "wire/tm_frame.hpp"

namespace srfs::rescue {
namespace {

constexpr std::uint16_t spacecraft = 0xAB;
constexpr std::uint16_t frame_octets = 223;
constexpr int patience_ms = 20'000;
constexpr wire::CaduFormat format{.frame_octets = frame_octets, .reed_solomon = false, .randomize = false};

class RescuerOnTheLine : public ::testing::Test {
 protected:
  RescuerOnTheLine() : master_(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK)), frames_(format) {
    EXPECT_EQ(grantpt(master_.get()), 0);
    EXPECT_EQ(unlockpt(master_.get()), 0);
    std::array<char, 64> name{};
    EXPECT_EQ(ptsname_r(master_.get(), name.data(), name.size()), 0);
    settings_.var = (folder_.path() / "var").string();
    settings_.program = (folder_.path() / "opt/bin/srfs").string();
    settings_.deployment = (folder_.path() / "etc/deployment.yaml").string();
    settings_.rs422 = std::string("serial:") + name.data();
    settings_.baud = 115200;
    settings_.spacecraft = spacecraft;
    settings_.frame_octets = frame_octets;
    settings_.reed_solomon = false;
    settings_.tm_randomizer = false;
    settings_.open_channels = {0};
  }
  void begin() {
    auto rescuer = Rescuer::create(settings_, suite::StepRecord{.step = suite::BootStep::rescue});
    ASSERT_TRUE(rescuer) << rescuer.error();
    rescuer_ = std::move(*rescuer);
    serving_ = std::thread([this] { end_ = rescuer_->serve(); });
  }
  ~RescuerOnTheLine() override {
    if (!serving_.joinable()) return;
    send(start_suite());
    serving_.join();
  }
  void await_end() { serving_.join(); }

  static Octets cltu(wire::TcFrame frame) {
    frame.spacecraft_id = spacecraft;
    return wire::encode_cltu(wire::encode_tc_frame(frame), false);
  }
  static Octets set_vr(std::uint8_t vr) {
    return cltu({.type = wire::TcFrameType::bc,
                 .data = wire::encode_control_command({wire::ControlCommand::Kind::set_vr, vr})});
  }
  static Octets data_frame(wire::TcFrameType type, std::uint8_t sequence, const Octets& packet) {
    Octets data{wire::segment_header_unsegmented};
    data.insert(data.end(), packet.begin(), packet.end());
    return cltu({.type = type, .sequence = sequence, .data = data});
  }
  static Octets ping() { return wire::make_tc_packet({.apid = 1, .service = 17, .subtype = 1}); }
  static Octets start_suite() {
    OctetWriter content;
    content.u16(mission::RescueStartSuite::function_id);
    content.bytes(mission::RescueStartSuite{}.encoded());
    return data_frame(
        wire::TcFrameType::bd, 0,
        wire::make_tc_packet({.apid = 1, .service = 8, .subtype = 1, .application = content.take()}));
  }
  void send(const Octets& octets) const {
    ASSERT_EQ(write(master_.get(), octets.data(), octets.size()), static_cast<ssize_t>(octets.size()));
  }
  /// Reads until a control word is as wanted.
  template <class Wanted>
  [[nodiscard]] bool await_clcw(Wanted wanted) {
    while (true) {
      pollfd line{.fd = master_.get(), .events = POLLIN, .revents = 0};
      if (poll(&line, 1, patience_ms) <= 0) return false;
      std::array<std::uint8_t, 4096> part{};
      const ssize_t got = read(master_.get(), part.data(), part.size());
      if (got <= 0) return false;
      for (const auto& found : frames_.push({part.data(), static_cast<std::size_t>(got)})) {
        const auto frame = wire::decode_tm_frame(found.frame, spacecraft, frame_octets);
        if (frame && on_frame_) on_frame_(found.frame, *frame);
        const auto clcw = frame ? wire::decode_clcw(frame->ocf) : Err(wire::ClcwError::not_a_clcw);
        if (clcw && wanted(*clcw)) return true;
      }
    }
  }
  [[nodiscard]] bool is_silent() const {
    pollfd line{.fd = master_.get(), .events = POLLIN, .revents = 0};
    return poll(&line, 1, 0) == 0 || (line.revents & POLLIN) == 0;
  }
  [[nodiscard]] LinkState stored_link() const {
    return LinkStore(std::filesystem::path(settings_.var) / "state/ttc").load(MonotonicTime());
  }

  testing_support::TemporaryFolder folder_;
  Fd master_;
  wire::CaduSynchroniser frames_;
  std::function<void(OctetView octets, wire::TmFrame frame)> on_frame_;
  suite::RescueSettings settings_;
  std::unique_ptr<Rescuer> rescuer_;
  std::thread serving_;
  RescueEnd end_;
};

TEST_F(RescuerOnTheLine, SealsItsFramesWithNumbersAboveThoseThatTtcReserved) {
  const Octets key(wire::sdls_key_octets, 9);
  const std::string rotten = (folder_.path() / "rotten.key").string();
  ASSERT_TRUE(write_file_atomically(rotten, to_hex(Octets(wire::sdls_key_octets, 8)) + "\n"));
  settings_.seal = suite::RescueSettings::Seal{.spi = 16, .key = key, .key_file = rotten};
  auto numbers = frame_number_file(std::filesystem::path(settings_.var) / "state/ttc/frame_numbers");
  std::filesystem::create_directories(std::filesystem::path(settings_.var) / "state/ttc");
  constexpr std::uint64_t reserved = 1'000'000;
  ASSERT_TRUE(numbers.store(reserved).durable());
  auto authenticator = wire::TmAuthenticator::create(*wire::SdlsKey::from_hex(to_hex(key)));
  begin();
  std::uint64_t seen = 0;
  on_frame_ = [&](OctetView octets, wire::TmFrame frame) {
    const auto number = wire::tm_sdls_open(octets, frame, 16, *authenticator);
    ASSERT_TRUE(number) << wire::to_string(number.error());
    EXPECT_GE(*number, std::max(reserved, seen + 1));
    seen = *number;
  };
  ASSERT_TRUE(await_clcw([](const wire::Clcw&) { return true; }));
  send(set_vr(77));
  EXPECT_TRUE(await_clcw([](const wire::Clcw& clcw) { return clcw.report_value == 77; }));
  EXPECT_GE(seen, reserved);
  EXPECT_GT(frame_number_file(std::filesystem::path(settings_.var) / "state/ttc/frame_numbers").load().state,
            seen)
      << "ttc goes on above them";
}

TEST_F(RescuerOnTheLine, AControlCommandIsAnsweredAtOnce) {
  begin();
  ASSERT_TRUE(await_clcw([](const wire::Clcw& clcw) { return clcw.report_value == 0; })) << "the beacon";

  send(set_vr(77));

  EXPECT_TRUE(await_clcw([](const wire::Clcw& clcw) { return clcw.report_value == 77; }));
}

TEST_F(RescuerOnTheLine, AFrameThatFarmDiscardsIsAnsweredAtOnce) {
  begin();
  ASSERT_TRUE(await_clcw([](const wire::Clcw&) { return true; }));

  send(data_frame(wire::TcFrameType::ad, 5, ping()));

  EXPECT_TRUE(await_clcw([](const wire::Clcw& clcw) { return clcw.retransmit; }));
}

TEST_F(RescuerOnTheLine, WhatControlCommandsSetIsKeptAtTheEnd) {
  begin();
  Octets both = start_suite();
  const Octets control = set_vr(42);
  both.insert(both.end(), control.begin(), control.end());
  send(both);
  await_end();

  const LinkState link = stored_link();

  EXPECT_EQ(end_.kind, RescueEnd::Kind::start_suite);
  ASSERT_EQ(link.channels.size(), 1U);
  EXPECT_EQ(link.channels[0].farm.vr, 42);
}

TEST_F(RescuerOnTheLine, ACommandedSilenceIsKept) {
  const std::string boot = kernel_boot_id().value_or("unknown");
  TransmitterSwitch transmitter(boot, "", MonotonicTime());
  transmitter.switch_off(seconds(3600), monotonic_now() - TransmitterSwitch::grace);
  ASSERT_TRUE(write_file_atomically(std::filesystem::path(settings_.var) / "state/ttc/transmitter",
                                    transmitter.stored_text()));
  begin();
  Octets both = data_frame(wire::TcFrameType::bd, 0, ping());
  const Octets last = start_suite();
  both.insert(both.end(), last.begin(), last.end());
  send(both);
  await_end();

  EXPECT_EQ(end_.kind, RescueEnd::Kind::start_suite) << "it heard the orders";
  EXPECT_TRUE(is_silent());
}

TEST_F(RescuerOnTheLine, ATelecommandEndsTheSilence) {
  const std::filesystem::path file = std::filesystem::path(settings_.var) / "state/ttc/transmitter";
  TransmitterSwitch transmitter("earlier-boot", "", MonotonicTime());
  transmitter.switch_off(seconds(3600), MonotonicTime());
  ASSERT_TRUE(write_file_atomically(file, transmitter.stored_text()));
  begin();
  OctetWriter content;
  content.u16(mission::TtcTransmitterOn::function_id);

  send(data_frame(
      wire::TcFrameType::bd, 0,
      wire::make_tc_packet({.apid = 1, .service = 8, .subtype = 1, .application = content.take()})));

  EXPECT_TRUE(await_clcw([](const wire::Clcw&) { return true; })) << "it speaks";
  EXPECT_EQ(read_file(file).value_or("none"), "");
}

TEST_F(RescuerOnTheLine, SessionKeysOfTtcAreTakenAndTheFirstFrameUnderANewOneEndsTheOld) {
  const wire::SdlsKey old({7, 1});
  const wire::SdlsKey fresh({8, 1});
  const std::filesystem::path folder = wire::session_key_folder(settings_.var);
  auto keys = wire::SessionKeys{}.uploaded(128, old)->activated(128)->rekeyed(1, 128)->confirmed(1, 128);
  keys = *keys.uploaded(129, fresh)->activated(129)->rekeyed(1, 129);
  ASSERT_TRUE(store_session_keys(folder, keys));
  settings_.associations = {{.vc = 1, .spi = 1, .key = Octets(32, 0x42), .key_file = "/nonexistent"}};
  begin();
  ASSERT_TRUE(await_clcw([](const wire::Clcw&) { return true; }));

  const wire::SdlsSeal seal{.key = fresh, .spi = 1, .counter = 1};
  send(*wire::make_uplink_cltu({.spacecraft_id = spacecraft, .vc = 1}, wire::TcFrameType::bd, 0, &seal,
                               ping()));

  send(data_frame(wire::TcFrameType::bd, 0, ping()));
  ASSERT_TRUE(await_clcw([](const wire::Clcw& clcw) { return clcw.vc == 0 && clcw.farm_b_counter == 1; }))
      << "what came before is done";
  const auto stored = wire::session_key_file(folder / "session_keys").load().state;
  ASSERT_TRUE(stored);
  EXPECT_EQ(stored->use_of(1), (wire::SessionKeys::Use{.spi = 1, .current = 129}));
}

}  // namespace
}  // namespace srfs::rescue
