// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "wire/gnss_time.hpp"
#include "wire/nmea.hpp"
#include "wire/ubx.hpp"

namespace srfs::wire {
namespace {

const UtcTime eight = *from_iso8601("2026-11-21T08:00:00Z");
const UtcTime not_before = *from_iso8601("2026-01-01T00:00:00Z");

std::string sentence(const std::string& body) {
  const std::uint8_t sum = nmea_checksum(body);
  return "$" + body + "*" + to_hex(OctetView(&sum, 1)) + "\r\n";
}
Octets octets(const std::string& text) {
  return Octets(text.begin(), text.end());
}
Octets joined(std::initializer_list<Octets> parts) {
  Octets all;
  for (const Octets& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}
const Octets good_sentence = octets(sentence("GPZDA,080000,21,11,2026,00,00"));

struct TimeUtc {
  std::int32_t fraction_ns = 0;
  std::uint16_t year = 2026;
  std::uint8_t month = 11, day = 21, hour = 8, minute = 0, second = 0, valid = 0x07;
  [[nodiscard]] Octets payload() const {
    const auto n = static_cast<std::uint32_t>(fraction_ns);
    return {0,
            0,
            0,
            0,
            25,
            0,
            0,
            0,
            static_cast<std::uint8_t>(n),
            static_cast<std::uint8_t>(n >> 8U),
            static_cast<std::uint8_t>(n >> 16U),
            static_cast<std::uint8_t>(n >> 24U),
            static_cast<std::uint8_t>(year & 0xFFU),
            static_cast<std::uint8_t>(year >> 8U),
            month,
            day,
            hour,
            minute,
            second,
            valid};
  }
  [[nodiscard]] Octets frame() const { return ubx_frame(ubx_class_nav, ubx_nav_timeutc, payload()); }
};

TEST(Ubx, MakesAKnownFrame) {
  // The poll request of NAV-TIMEUTC as shown by u-blox' tool.
  EXPECT_EQ(ubx_frame(0x01, 0x21, {}), (Octets{0xB5, 0x62, 0x01, 0x21, 0x00, 0x00, 0x22, 0x67}));
}

TEST(Ubx, ReadsTheTimeWithItsFractionAndAccuracy) {
  const auto time = parse_nav_timeutc(TimeUtc{.fraction_ns = -250}.payload());
  ASSERT_TRUE(time);
  EXPECT_TRUE(time->valid);
  EXPECT_EQ(time->utc, eight - nanoseconds(250));
  EXPECT_EQ(time->accuracy, nanoseconds(25));
}

TEST(Ubx, IsValidOnlyWhenAllThreePartsAre) {
  for (int valid = 0; valid < 0x100; ++valid) {
    const auto time = parse_nav_timeutc(TimeUtc{.valid = static_cast<std::uint8_t>(valid)}.payload());
    ASSERT_TRUE(time);
    EXPECT_EQ(time->valid, (valid & 0x07) == 0x07) << valid;
  }
}

TEST(Ubx, EachFaultIsNamed) {
  EXPECT_EQ(parse_nav_timeutc(Octets(19)).error(), UbxError::bad_length);
  EXPECT_EQ(parse_nav_timeutc(Octets(21)).error(), UbxError::bad_length);
  EXPECT_EQ(parse_nav_timeutc(TimeUtc{.hour = 24}.payload()).error(), UbxError::bad_time);
  EXPECT_EQ(parse_nav_timeutc(TimeUtc{.minute = 60}.payload()).error(), UbxError::bad_time);
  EXPECT_EQ(parse_nav_timeutc(TimeUtc{.second = 61}.payload()).error(), UbxError::bad_time);
  EXPECT_EQ(parse_nav_timeutc(TimeUtc{.fraction_ns = 1'000'000'001}.payload()).error(), UbxError::bad_time);
  EXPECT_EQ(parse_nav_timeutc(TimeUtc{.year = 1979}.payload()).error(), UbxError::bad_date);
  EXPECT_EQ(parse_nav_timeutc(TimeUtc{.year = 2027, .month = 2, .day = 29}.payload()).error(),
            UbxError::bad_date);
  EXPECT_EQ(parse_nav_timeutc(TimeUtc{.second = 60}.payload()).error(), UbxError::leap_second);
}

TEST(WeekRollover, IsResolvedToTheEraThatBeginsAtTheNotBeforeDate) {
  constexpr std::chrono::hours era(1024 * 7 * 24);
  EXPECT_EQ(in_era_of(eight, not_before), eight);
  EXPECT_EQ(in_era_of(eight - era, not_before), eight);
  EXPECT_EQ(in_era_of(eight - 2 * era, not_before), eight);
  EXPECT_EQ(in_era_of(eight + era, not_before), eight);
  EXPECT_EQ(in_era_of(not_before, not_before), not_before);
  EXPECT_EQ(in_era_of(not_before - nanoseconds(1), not_before), not_before + era - nanoseconds(1));
  EXPECT_EQ(in_era_of(not_before + era, not_before), not_before);
  const UtcTime end_of_32_bits = *from_iso8601("2038-01-19T03:14:08Z");
  EXPECT_EQ(in_era_of(end_of_32_bits, not_before), end_of_32_bits);
}

TEST(WeekRollover, ADateOfAReceiverThatKnowsNoneIsNoDate) {
  EXPECT_FALSE(in_era_of(*from_iso8601("1980-01-06T00:00:00Z"), not_before));
  EXPECT_FALSE(in_era_of(*from_iso8601("1980-01-12T23:59:59Z"), not_before));
  EXPECT_TRUE(in_era_of(*from_iso8601("1980-01-13T00:00:00Z"), not_before));
}

TEST(GnssTimeStream, ReadsBothProtocolsFromOneLine) {
  GnssTimeStream stream;
  const auto times = stream.push(
      joined({octets(sentence("GNRMC,075959,A,,,,,,,211126,,,A")), TimeUtc{}.frame(), good_sentence}));
  ASSERT_EQ(times.size(), 3U);
  EXPECT_EQ(times[0], (GnssTime{.fix_valid = true, .utc = eight - seconds(1)}));
  EXPECT_EQ(times[1], (GnssTime{.fix_valid = true, .utc = eight}));
  EXPECT_EQ(times[2], (GnssTime{.fix_valid = false, .utc = eight}));
  EXPECT_EQ(stream.counters().times, 3U);
  EXPECT_EQ(stream.counters().rejected(), 0U);
}

TEST(GnssTimeStream, RoundsASolutionToItsSecondAndNoOther) {
  GnssTimeStream stream;
  EXPECT_EQ(stream.push(TimeUtc{.fraction_ns = -4'999'999}.frame()).front().utc, eight);
  EXPECT_EQ(stream.push(TimeUtc{.fraction_ns = 4'999'999}.frame()).front().utc, eight);
  EXPECT_EQ(stream.push(TimeUtc{.fraction_ns = 200'000'000}.frame()).front().utc, eight + milliseconds(200));
}

TEST(GnssTimeStream, CountsWhatItDropsByReason) {
  GnssTimeStream stream;
  Octets broken = TimeUtc{}.frame();
  broken[20] ^= 1U;
  const Octets input =
      joined({octets("noise"), good_sentence,
              octets("$GPZDA,0800"),  // cut short by the next sentence
              good_sentence, octets("$" + std::string(200, 'x') + "\r\n"), octets("$GPZDA,1*00\r\n"),
              octets(sentence("GPGGA,1")), octets(sentence("GPZDA,1,2")), broken,
              ubx_frame(0x01, 0x07, Octets(92)),  // NAV-PVT
              ubx_frame(0x01, 0x21, Octets(3)), TimeUtc{.second = 60}.frame(),
              octets(sentence("GPZDA,235960,31,12,2026,00,00")), Octets{0xB5, 0x62, 1, 0x21, 0xFF, 0xFF},
              good_sentence});
  std::size_t times = 0;
  for (const std::uint8_t octet : input) times += stream.push(OctetView(&octet, 1)).size();
  const auto& counters = stream.counters();
  EXPECT_EQ(times, 3U);
  EXPECT_EQ(counters.times, 3U);
  EXPECT_EQ(counters.cut_short, 1U);
  EXPECT_EQ(counters.too_long, 2U);
  EXPECT_EQ(counters.bad_checksum, 2U);
  EXPECT_EQ(counters.others, 2U);
  EXPECT_EQ(counters.malformed, 2U);
  EXPECT_EQ(counters.leap_seconds, 2U);
  EXPECT_GE(counters.noise_octets, 5U);
}

TEST(GnssTimeStream, FindsAMessageInsideABrokenFrame) {
  GnssTimeStream stream;
  // The first frame lost two octets, so its announced length reaches into the following data.
  Octets first = TimeUtc{}.frame();
  first.erase(first.begin() + 10, first.begin() + 12);
  const auto times = stream.push(joined({first, TimeUtc{.second = 7}.frame(), good_sentence}));
  ASSERT_EQ(times.size(), 2U);
  EXPECT_EQ(times[0].utc, eight + seconds(7));
  EXPECT_EQ(times[1].utc, eight);
}

TEST(GnssTimeStream, AnInterruptedLineLeavesNoHalfMessage) {
  GnssTimeStream stream;
  EXPECT_TRUE(stream.push(octets("$GPZDA,080")).empty());
  stream.discard_partial();
  EXPECT_TRUE(stream.push(octets("000,21,11,2026,00,00*45\r\n")).empty());
  EXPECT_EQ(stream.push(good_sentence).size(), 1U);
}

TEST(GnssTimeStream, ReadsEveryGoodMessageBehindAnyNoiseOnceAFrameAnnouncedIsOver) {
  std::mt19937 random(7);  // NOLINT(bugprone-random-generator-seed): a failure must repeat
  const Octets likely = joined({TimeUtc{}.frame(), good_sentence});
  for (int round = 0; round < 2000; ++round) {
    GnssTimeStream stream;
    Octets noise;
    for (std::size_t i = random() % 200; i > 0; --i) {
      noise.push_back(random() % 2 ? static_cast<std::uint8_t>(random()) : likely[random() % likely.size()]);
    }
    (void)stream.push(noise);
    (void)stream.push(Octets(ubx_payload_octets_max + ubx_overhead_octets, '\n'));
    ASSERT_EQ(stream.push(good_sentence).size(), 1U) << round;
    ASSERT_EQ(stream.push(TimeUtc{}.frame()).size(), 1U) << round;
  }
}

}  // namespace
}  // namespace srfs::wire
