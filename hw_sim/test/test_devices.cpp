// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <bit>

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>

#include "base/process.hpp"
#include "hw/sim/seqpacket.hpp"
#include "hw_sim/can_log.hpp"
#include "hw_sim/gpio_bank.hpp"
#include "hw_sim/gps_receiver.hpp"
#include "hw_sim/seqpacket_server.hpp"
#include "hw_sim/serial_line.hpp"
#include "hw_sim/settings.hpp"
#include "hw_sim/starvation_timer.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::sim {
namespace {

const UtcTime utc = *from_iso8601("2026-11-21T08:00:00Z");
constexpr MonotonicTime origin{seconds(1000)};
constexpr RunningTime armed_at{seconds(1000)};

std::string text(const Octets& octets) {
  return {octets.begin(), octets.end()};
}

TEST(Control, WhatAsksMayBeStoppedMeanwhile) {
  const testing_support::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "control.sock";
  const Fd listener = hw::listen_seqpacket(path, 1).value();
  const pid_t asker = fork();
  if (asker == 0)
    _exit(ask_seqpacket(path, "what?", seconds(60)) == Result<std::string, std::string>("that") ? 0 : 1);
  pollfd wait{.fd = listener.get(), .events = POLLIN, .revents = 0};
  ASSERT_EQ(poll(&wait, 1, 60'000), 1);
  const Fd client(accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC));
  std::array<char, 8> request{};
  ASSERT_EQ(recv(client.get(), request.data(), request.size(), 0), 5);
  while (process_state(asker) == 'R') poll(nullptr, 0, 1);  // until it waits for the answer

  int status = 0;
  kill(asker, SIGSTOP);
  ASSERT_EQ(waitpid(asker, &status, WUNTRACED), asker);
  ASSERT_TRUE(WIFSTOPPED(status));
  kill(asker, SIGCONT);
  ASSERT_EQ(waitpid(asker, &status, WCONTINUED), asker);
  while (process_state(asker) == 'R') poll(nullptr, 0, 1);  // has it given up?
  send(client.get(), "that", 4, MSG_NOSIGNAL);
  ASSERT_EQ(waitpid(asker, &status, 0), asker);
  EXPECT_EQ(status, 0);
}

TEST(GpsReceiver, PulsesAtEachWholeSecond) {
  GpsReceiver gps({});
  const TrueTime time(origin, utc + milliseconds(250), 0);
  for (int i = 1; i <= 5; ++i) {
    const GpsPulse pulse = gps.next_pulse(time, origin + milliseconds(1000 * (i - 1) + 1));
    EXPECT_EQ(pulse.utc, utc + seconds(i));
    EXPECT_EQ(pulse.edge, origin + milliseconds(1000 * i - 250));
    EXPECT_EQ(pulse.counter, static_cast<std::uint64_t>(i - 1));
    EXPECT_TRUE(pulse.emitted);
  }
}

TEST(GpsReceiver, ShowsTheDriftOfTheBoardsClock) {
  const TrueTime time(origin, utc, 10);
  EXPECT_EQ(time.utc(origin + seconds(100)), utc + seconds(100) + milliseconds(1));
  EXPECT_EQ(time.monotonic(time.utc(origin + seconds(100))), origin + seconds(100));
}

TEST(GpsReceiver, GivesEachPulseOnceInSpiteOfJitter) {
  GpsSettings settings;
  settings.jitter_us = 500;
  GpsReceiver gps(settings);
  const TrueTime time(origin, utc, 0);
  MonotonicTime now = origin;
  for (int i = 1; i <= 100; ++i) {
    const GpsPulse pulse = gps.next_pulse(time, now);
    ASSERT_EQ(pulse.utc, utc + seconds(i));
    now = pulse.edge + microseconds(30);
  }
}

TEST(GpsReceiver, CountsThePulsesItMissedWhileStopped) {
  GpsReceiver gps({});
  const TrueTime time(origin, utc, 0);
  EXPECT_EQ(gps.next_pulse(time, origin).counter, 0U);
  const GpsPulse later = gps.next_pulse(time, origin + seconds(10));
  EXPECT_EQ(later.utc, utc + seconds(11));
  EXPECT_EQ(later.counter, 10U);
}

TEST(GpsReceiver, WritesSentencesThatTheFlightSoftwareReads) {
  GpsReceiver gps({});
  EXPECT_EQ(text(gps.messages(utc, {48.1173, -11.5166, 7612, 84.4})),
            "$GPRMC,080000.00,A,4807.0380,N,01130.9960,W,14796.5,84.4,211126,,,A*76\r\n$GPZDA,080000.00,21,"
            "11,2026,00,00*6B\r\n");
  EXPECT_TRUE(gps.messages(utc + milliseconds(100), {}).empty());
}

TEST(GpsReceiver, NeverPrintsSixtyMinutes) {
  EXPECT_NE(nmea_rmc(utc, {9.9999999, 0, 0, 0}, true).find(",1000.0000,N,"), std::string::npos);
}

TEST(GpsReceiver, LosesPulseOrFixByFault) {
  GpsReceiver gps({});
  const TrueTime time(origin, utc, 0);
  gps.disturb({.fault = GpsFault::no_pulse});
  EXPECT_FALSE(gps.next_pulse(time, origin).emitted);
  EXPECT_NE(text(gps.messages(utc, {})).find("RMC,080000.00,A"), std::string::npos);
  gps.disturb({.fault = GpsFault::no_fix});
  EXPECT_EQ(text(gps.messages(utc, {})), "$GPRMC,,V,,,,,,,,,,N*53\r\n$GPZDA,,,,,,*48\r\n");
  gps.disturb({.fault = GpsFault::off});
  EXPECT_TRUE(gps.messages(utc, {}).empty());
}

TEST(GpsReceiver, ItsOscillatorSwingsWithTheTemperature) {
  const TrueTime time(origin, utc, 0, 0.1, seconds(4000));
  EXPECT_EQ(time.utc(origin + seconds(4000)), utc + seconds(4000));
  EXPECT_NEAR(static_cast<double>((time.utc(origin + seconds(2000)) - (utc + seconds(2000))).count()),
              127'324, 1);
  EXPECT_EQ(time.monotonic(time.utc(origin + seconds(1234))), origin + seconds(1234));
}

TEST(GpsReceiver, IsDisturbedAsItIsTold) {
  const TrueTime time(origin, utc, 0);
  GpsReceiver gps({});
  gps.disturb({.pulse_step = milliseconds(3), .second_receiver = milliseconds(200)});
  const GpsPulse pulse = gps.next_pulse(time, origin);
  EXPECT_EQ(pulse.edge, origin + milliseconds(1003));
  EXPECT_EQ(pulse.strays[0], origin + milliseconds(1200));
  EXPECT_FALSE(pulse.strays[1].has_value());

  gps.disturb({.time_step = seconds(-5)});
  EXPECT_NE(text(gps.messages(utc, {})).find("RMC,075955.00,A"), std::string::npos);
  gps.disturb({.week_eras = -1});
  EXPECT_NE(text(gps.messages(utc, {})).find("ZDA,080000.00,07,04,2007"), std::string::npos);
  gps.disturb({.cut_short = 1});
  EXPECT_EQ(text(gps.messages(utc, {})).find('\n'), std::string::npos);

  gps.disturb({.lost_pulses = 0.5, .false_pulses = 0.5});
  int lost = 0;
  int added = 0;
  for (int i = 0; i < 1000; ++i) {
    const GpsPulse next = gps.next_pulse(time, origin + seconds(i + 2));
    lost += next.emitted ? 0 : 1;
    added += next.strays[1] ? 1 : 0;
  }
  EXPECT_NEAR(lost, 500, 100);
  EXPECT_NEAR(added, 500, 100);
}

TEST(GpsReceiver, InsertsALeapSecondAtTheEndOfTheMinute) {
  GpsSettings settings;
  settings.protocol = GpsProtocol::both;
  GpsReceiver gps(settings);
  gps.disturb({.leap_second = true});
  const UtcTime end = *from_iso8601("2028-12-31T23:59:59Z");
  EXPECT_NE(text(gps.messages(end, {})).find("ZDA,235959.00,31,12,2028"), std::string::npos);
  const Octets leap = gps.messages(end + seconds(1), {});
  EXPECT_NE(text(leap).find("ZDA,235960.00,31,12,2028"), std::string::npos);
  EXPECT_EQ(leap[leap.size() - 4], 60) << "second of NAV-TIMEUTC";
  EXPECT_NE(text(gps.messages(end + seconds(2), {})).find("ZDA,000000.00,01,01,2029"), std::string::npos);
}

TEST(SerialLine, CarriesOctetsAtTheLinesRate) {
  SerialLine line(10'000, 1);  // one octet per millisecond
  line.accept(Octets(100, 0x55), origin);
  line.advance(origin + milliseconds(10));
  EXPECT_EQ(line.arrived(1000).size(), 10U);
  line.advance(origin + milliseconds(99));
  EXPECT_EQ(line.arrived(1000).size(), 99U);
  line.advance(origin + milliseconds(100));
  EXPECT_EQ(line.arrived(1000), Octets(100, 0x55));
  EXPECT_FALSE(line.next_deadline());
}

TEST(SerialLine, ContinuesWithoutAGapBehindWhatWaits) {
  SerialLine line(10'000, 1);
  line.accept(Octets{1, 2}, origin);
  line.accept(Octets{3}, origin + microseconds(1500));
  line.advance(origin + milliseconds(3));
  EXPECT_EQ(line.arrived(9), (Octets{1, 2, 3}));
}

TEST(SerialLine, HoldsBackTheSenderAndDropsTheOldestForASlowReader) {
  SerialLine line(4'000'000, 1);
  line.accept(Octets(SerialLine::capacity, 1), origin);
  EXPECT_EQ(line.room(), 0U);
  line.advance(origin + seconds(1));
  EXPECT_EQ(line.room(), SerialLine::capacity);
  line.accept(Octets(10, 2), origin + seconds(1));
  line.advance(origin + seconds(2));
  EXPECT_EQ(line.counters().dropped, 10U);
  EXPECT_EQ(line.arrived(SerialLine::capacity).back(), 2);
}

TEST(SerialLine, InvertsBitsWithTheGivenProbability) {
  SerialLine line(4'000'000, 1);
  line.set_flip_probability(0.01);
  line.accept(Octets(50'000, 0), origin);
  line.advance(origin + seconds(10));
  int ones = 0;
  for (const std::uint8_t octet : line.arrived(50'000)) ones += std::popcount(octet);
  EXPECT_NEAR(ones, 4000, 300);
  EXPECT_EQ(line.counters().flipped_bits, static_cast<std::uint64_t>(ones));
}

TEST(SerialLine, DrownsOctetsInBurstsWithTheGivenProbability) {
  SerialLine line(4'000'000, 1);
  line.set_burst_probability(1e-3);
  line.accept(Octets(50'000, 7), origin);
  line.advance(origin + seconds(10));
  std::uint64_t wrong = 0;
  for (const std::uint8_t octet : line.arrived(50'000)) wrong += octet == 7 ? 0 : 1;
  EXPECT_NEAR(static_cast<double>(line.counters().bursts), 50 / 1.032, 20);
  EXPECT_LE(wrong, line.counters().bursts * SerialLine::burst_octets);
  EXPECT_GT(wrong, (line.counters().bursts - 1) * SerialLine::burst_octets);
}

TEST(StarvationTimer, IsArmedByTheFirstFeedAndBitesOnce) {
  StarvationTimer watchdog(milliseconds(500));
  EXPECT_FALSE(watchdog.bites(armed_at + seconds(100)));
  watchdog.feed(armed_at);
  EXPECT_FALSE(watchdog.bites(armed_at + milliseconds(499)));
  EXPECT_TRUE(watchdog.bites(armed_at + milliseconds(500)));
  EXPECT_FALSE(watchdog.bites(armed_at + seconds(10)));  // bites only once until it is fed again
  watchdog.feed(armed_at + seconds(10));
  EXPECT_TRUE(watchdog.bites(armed_at + seconds(11)));
}

TEST(StarvationTimer, DoesNotBiteWhenDisarmed) {
  StarvationTimer watchdog(milliseconds(500));
  watchdog.feed(armed_at);
  watchdog.disarm();
  EXPECT_FALSE(watchdog.bites(armed_at + seconds(10)));
}

TEST(GpioBank, SwitchesPowerAndReadsInputs) {
  std::vector<std::pair<std::size_t, bool>> switched;
  GpioBank bank([] { return std::uint8_t{0b0101}; },
                [&](std::size_t line, bool on) { switched.emplace_back(line, on); });
  EXPECT_EQ(bank.on_request(Octets{0, 1, 0, 0}), (std::array<std::uint8_t, 4>{0, 1, 1, 0}));
  EXPECT_EQ(bank.on_request(Octets{1, 1, 0, 0}), (std::array<std::uint8_t, 4>{0, 1, 0, 0}));
  EXPECT_EQ(bank.on_request(Octets{1, 1, 0, 0})[0], GpioBank::ok);
  EXPECT_EQ(switched, (std::vector<std::pair<std::size_t, bool>>{{1, false}}));  // no change, no event
  EXPECT_EQ(bank.on_request(Octets{0, 10, 0, 0})[2], 1);
  EXPECT_EQ(bank.on_request(Octets{2, 0, 0, 0})[2], 0b0101);
}

TEST(GpioBank, RefusesWhatItDoesNotHave) {
  GpioBank bank([] { return std::uint8_t{0}; }, [](std::size_t, bool) {});
  EXPECT_EQ(bank.on_request(Octets{0, 12, 0, 0})[0], GpioBank::no_such_line);
  EXPECT_EQ(bank.on_request(Octets{1, 8, 1, 0})[0], GpioBank::not_an_output);
  EXPECT_EQ(bank.on_request(Octets{7, 0, 0, 0})[0], GpioBank::bad_request);
  EXPECT_EQ(bank.on_request(Octets{1})[0], GpioBank::bad_request);
  EXPECT_EQ(bank.counters().refused, 4U);
}

TEST(CanLog, WritesCandumpsFormat) {
  BusDelivery delivery;
  delivery.frame = {.id = 0x18DA1101, .size = 3, .data = {0x02, 0x01, 0xAB}};
  delivery.end = MonotonicTime(seconds(12) + microseconds(345));
  EXPECT_EQ(candump_line(delivery), "(12.000345) can0 18DA1101#0201AB\n");
}

TEST(Settings, RefuseAKeyThatIsUnknown) {
  const std::string devices =
      "devices: {can: 'sim:a', rs422: 'serial:b', gps_pulse: 'sim:c', gps_serial: 'serial:d', gpio: 'sim:e', "
      "watchdog: 'sim:f'}\n";
  const SimulationSettings plain = read_settings(ConfigSection::parse(devices, "x.yaml"));
  EXPECT_EQ(plain.baud, 921'600U);
  EXPECT_EQ(plain.world.time_acceleration, 60);
  EXPECT_THROW((void)read_settings(ConfigSection::parse(devices + "simulation: {sed: 1}\n", "x.yaml")),
               ConfigError);
  for (const char* gps :
       {"{pulse_period_ms: 300}", "{wander_ppm: 0.1}", "{protocol: sirf}", "{script: [{at_s: 1, fault: of}]}",
        "{script: [{at_s: 2}, {at_s: 1}]}", "{script: [{at_s: 1, lost: 1}]}"}) {
    EXPECT_THROW(
        (void)read_settings(ConfigSection::parse(devices + "simulation: {gps: " + gps + "}\n", "x.yaml")),
        ConfigError)
        << gps;
  }
  const SimulationSettings scripted = read_settings(ConfigSection::parse(
      devices +
          "simulation: {gps: {script: [{at_s: 20, fault: no_fix}, {at_s: 30.5, pulse_step_us: -70}]}}\n",
      "x.yaml"));
  ASSERT_EQ(scripted.gps.script.size(), 2U);
  EXPECT_EQ(scripted.gps.script[0].disturbance.fault, GpsFault::no_fix);
  EXPECT_EQ(scripted.gps.script[1].at, milliseconds(30'500));
  EXPECT_EQ(scripted.gps.script[1].disturbance.pulse_step, microseconds(-70));
}

TEST(Settings, AreGoodInTheDeploymentsThatShip) {
  for (const char* name : {"sim", "sim_open", "sim_open_i5", "vcan"}) {
    const auto file =
        std::filesystem::path(SRFS_SOURCE_DIR) / "launch_config" / (std::string(name) + ".yaml");
    EXPECT_EQ(read_settings(ConfigSection::load(file)).key_files,
              (std::vector<std::string>{"keys/tc_uplink.key", "keys/tc_uplink_ad.key", "keys/tc_uplink_b.key",
                                        "keys/tc_uplink_ad_b.key", "keys/tc_contingency.key",
                                        "keys/tm_downlink.key", "keys/key_encryption_1.key",
                                        "keys/key_encryption_2.key"}));
  }
}

}  // namespace
}  // namespace srfs::sim
