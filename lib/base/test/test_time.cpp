// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/time.hpp"

namespace srfs {
namespace {

TEST(Time, WritesAndReadsIso8601) {
  const UtcTime t(seconds(1795248000) + milliseconds(500));
  EXPECT_EQ(to_iso8601(t, 1), "2026-11-21T08:00:00.5Z");
  EXPECT_EQ(from_iso8601("2026-11-21T08:00:00.5Z"), t);
  EXPECT_EQ(from_iso8601("2026-11-21T08:00:00Z"), t - milliseconds(500));
}

TEST(Time, RefusesTextThatIsNoTime) {
  for (const char* text :
       {"", "now", "2026-13-01T00:00:00Z", "2026-11-21", "2026-11-21T08:00:00Zx", "2026-02-31T00:00:00Z",
        "2026-02-29T00:00:00Z", "2026-04-31T23:59:59Z", "2262-01-01T00:00:00Z", "9999-01-01T00:00:00Z"}) {
    EXPECT_FALSE(from_iso8601(text)) << text;
  }
}

TEST(Time, TakesLeapDaysAndLeapSeconds) {
  EXPECT_TRUE(from_iso8601("2028-02-29T00:00:00Z"));
  EXPECT_EQ(from_iso8601("2016-12-31T23:59:60Z"), from_iso8601("2017-01-01T00:00:00Z"));
  EXPECT_TRUE(from_iso8601("1970-01-01T00:00:00Z"));
}

TEST(Time, TaiLeadsUtcByTheLeapSecondsAndCountsFrom1958) {
  const UtcTime utc(seconds(1795248000));
  EXPECT_EQ(to_tai(utc).since_epoch(), seconds(0x8193ae25));  // the CUC vector of the ground link
  EXPECT_EQ(to_utc(to_tai(utc, 38), 38), utc);
}

}  // namespace
}  // namespace srfs
