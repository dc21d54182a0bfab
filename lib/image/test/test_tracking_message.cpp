// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/product/tracking_message.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace srfs::image {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

const TrackingHeader header{*from_iso8601("2026-11-26T12:00:00Z"), "SRFS", "SRFS-1"};

SkyPoint point(double begin_s, double ra_deg, double dec_deg) {
  return {{ra_deg, dec_deg, 1.5, 0.7, 0.25}, begin_s, 2.0, Magnitude{7.5, 0.1}};
}

TEST(TrackingMessage, HoldsTheAnglesOfTheMiddleOfEachExposureByTime) {
  const std::string text = tracking_message(
      header, {{"TRACK_001", {}, {point(1000010, 332.5, -16.25), point(1000000, 332.25, -16)}}});
  EXPECT_EQ(text,
            "CCSDS_TDM_VERS = 2.0\n"
            "CREATION_DATE = 2026-11-26T12:00:00.000000Z\n"
            "ORIGINATOR = SRFS\n"
            "META_START\n"
            "TIME_SYSTEM = UTC\n"
            "START_TIME = 1970-01-12T13:46:41.000000Z\n"
            "STOP_TIME = 1970-01-12T13:46:51.000000Z\n"
            "PARTICIPANT_1 = SRFS-1\n"
            "PARTICIPANT_2 = TRACK_001\n"
            "MODE = SEQUENTIAL\n"
            "PATH = 2,1\n"
            "ANGLE_TYPE = RADEC\n"
            "REFERENCE_FRAME = EME2000\n"
            "META_STOP\n"
            "DATA_START\n"
            "COMMENT 1970-01-12T13:46:41.000000Z: 1 sigma 1.500 arcsec east, 0.700 north, correlation 0.250; "
            "magnitude V_T, 1 sigma 0.100\n"
            "COMMENT 1970-01-12T13:46:51.000000Z: 1 sigma 1.500 arcsec east, 0.700 north, correlation 0.250; "
            "magnitude V_T, 1 sigma 0.100\n"
            "ANGLE_1 = 1970-01-12T13:46:41.000000Z 332.2500000\n"
            "ANGLE_2 = 1970-01-12T13:46:41.000000Z -16.0000000\n"
            "MAG = 1970-01-12T13:46:41.000000Z 7.500\n"
            "ANGLE_1 = 1970-01-12T13:46:51.000000Z 332.5000000\n"
            "ANGLE_2 = 1970-01-12T13:46:51.000000Z -16.2500000\n"
            "MAG = 1970-01-12T13:46:51.000000Z 7.500\n"
            "DATA_STOP\n");
}

TEST(TrackingMessage, IsEmptyWhereNoPointHasATime) {
  SkyPoint timeless = point(0, 1, 2);
  timeless.begin_s.reset();
  EXPECT_THAT(tracking_message(header, {}), IsEmpty());
  EXPECT_THAT(tracking_message(header, {{"A", {}, {timeless}}, {"B", {}, {}}}), IsEmpty());
}

TEST(TrackingMessage, HasNoCharacterThatTheStandardHasNot) {
  const std::string text =
      tracking_message({header.created, "\xc3\xa9\n", ""}, {{"A\nB", {"x\ty"}, {point(1e6, 1, 2)}}});
  EXPECT_THAT(text, HasSubstr("ORIGINATOR = ___\n"));
  EXPECT_THAT(text, HasSubstr("PARTICIPANT_1 = UNKNOWN\nPARTICIPANT_2 = A_B\n"));
  EXPECT_THAT(text, HasSubstr("COMMENT x_y\n"));
  EXPECT_THAT(text, Not(HasSubstr("\t")));
}

}  // namespace
}  // namespace srfs::image
