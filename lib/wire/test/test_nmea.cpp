// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/octets.hpp"
#include "wire/nmea.hpp"

namespace srfs::wire {
namespace {

std::string sentence(const std::string& body) {
  const std::uint8_t sum = nmea_checksum(body);
  return "$" + body + "*" + to_hex(OctetView(&sum, 1));
}
NmeaError error_of(const std::string& body) {
  const auto time = parse_nmea(sentence(body));
  EXPECT_FALSE(time) << body;
  return time ? NmeaError{0xFF} : time.error();
}

TEST(Nmea, ReadsAKnownSentenceWithItsChecksum) {
  const auto time = parse_nmea("$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A");
  ASSERT_TRUE(time);
  EXPECT_TRUE(time->fix_valid);
  EXPECT_EQ(time->utc, from_iso8601("1994-03-23T12:35:19Z"));
}

TEST(Nmea, ReadsTimeAndDateOfAnyTalker) {
  const auto rmc = parse_nmea(sentence("GNRMC,080000.250,A,,,,,,,211126,,,D"));
  ASSERT_TRUE(rmc);
  EXPECT_TRUE(rmc->fix_valid);
  EXPECT_EQ(rmc->utc, from_iso8601("2026-11-21T08:00:00.250Z"));
  const auto zda = parse_nmea(sentence("GAZDA,080000.00,21,11,2026,00,00"));
  ASSERT_TRUE(zda);
  EXPECT_EQ(zda->sentence, NmeaSentence::zda);
  EXPECT_EQ(zda->utc, from_iso8601("2026-11-21T08:00:00Z"));
}

TEST(Nmea, ReadsDatesBeyondTheEndOf32Bits) {
  EXPECT_EQ(parse_nmea(sentence("GPRMC,031408,A,,,,,,,190138,,,A"))->utc,
            from_iso8601("2038-01-19T03:14:08Z"));
  EXPECT_EQ(parse_nmea(sentence("GPRMC,000000,A,,,,,,,010179,,,A"))->utc,
            from_iso8601("2079-01-01T00:00:00Z"));
  EXPECT_EQ(parse_nmea(sentence("GPRMC,000000,A,,,,,,,060180,,,A"))->utc,
            from_iso8601("1980-01-06T00:00:00Z"));
}

TEST(Nmea, WithoutAFixTheTimeIsNotValid) {
  const auto warning = parse_nmea(sentence("GNRMC,080000,V,,,,,,,211126,,,N"));
  ASSERT_TRUE(warning);
  EXPECT_FALSE(warning->fix_valid);
  EXPECT_TRUE(warning->utc);
  const auto cold = parse_nmea(sentence("GNRMC,,V,,,,,,,,,,N"));
  ASSERT_TRUE(cold);
  EXPECT_EQ(cold->utc, std::nullopt);
  EXPECT_FALSE(parse_nmea(sentence("GNRMC,080000,A,,,,,,,211126,,,E"))->fix_valid) << "dead reckoning";
  EXPECT_EQ(parse_nmea(sentence("GNZDA,,,,,,"))->utc, std::nullopt);
}

TEST(Nmea, EachFaultIsNamed) {
  EXPECT_EQ(parse_nmea("$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6B").error(),
            NmeaError::bad_checksum);
  for (const char* text : {"", "$", "GPRMC*00", "$GPRMC,1*G0", "$GPRMC,123519", "$GPZDA,\x01,,,,,*00"}) {
    EXPECT_EQ(parse_nmea(text).error(), NmeaError::bad_frame) << text;
  }
  EXPECT_EQ(error_of("GPGGA,080000"), NmeaError::other_sentence);
  EXPECT_EQ(error_of("GPRMC,080000,A,,,,,,,211126"), NmeaError::bad_field_count);
  EXPECT_EQ(error_of("GPZDA,080000,21,11,2026,00"), NmeaError::bad_field_count);
  EXPECT_EQ(error_of("GPRMC,080000,X,,,,,,,211126,,"), NmeaError::bad_status);
  EXPECT_EQ(error_of("GPRMC,080000,A,,,,,,,211126,,,Q"), NmeaError::bad_status);
  EXPECT_EQ(error_of("GPRMC,,A,,,,,,,211126,,"), NmeaError::bad_time);
  EXPECT_EQ(error_of("GPRMC,080000,A,,,,,,,,,"), NmeaError::bad_date);
  for (const char* time :
       {"240000", "086000", "08000", "0800000", "080000.", "080000.1x", "08:000", "080061"}) {
    EXPECT_EQ(error_of(std::string("GPZDA,") + time + ",21,11,2026,00,00"), NmeaError::bad_time) << time;
  }
  for (const char* date :
       {"31,11,2026", "00,11,2026", "21,13,2026", "21,1,2026", "21,11,26", "29,02,2027", ",,"}) {
    EXPECT_EQ(error_of(std::string("GPZDA,080000,") + date + ",00,00"), NmeaError::bad_date) << date;
  }
  EXPECT_EQ(error_of("GPZDA,235960.00,31,12,2026,00,00"), NmeaError::leap_second);
}

}  // namespace
}  // namespace srfs::wire
