// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/bounded_queue.hpp"
#include "base/octets.hpp"

namespace srfs {
namespace {

TEST(Octets, WriterAndReaderAgreeOnBigEndianFields) {
  OctetWriter w;
  w.u8(1);
  w.u16(0x0203);
  w.u24(0x040506);
  w.u32(0x0708090a);
  w.f32(1.0F);
  EXPECT_EQ(to_hex(w.view()), "0102030405060708090a3f800000");
  OctetReader r(w.view());
  EXPECT_EQ(r.u8(), 1);
  EXPECT_EQ(r.u16(), 0x0203);
  EXPECT_EQ(r.u24(), 0x040506U);
  EXPECT_EQ(r.u32(), 0x0708090aU);
  EXPECT_EQ(r.f32(), 1.0F);
  EXPECT_TRUE(r.ok());
}

TEST(Octets, ReaderTurnsBadPastTheEndAndStaysBad) {
  const Octets data{1, 2};
  OctetReader r(data);
  EXPECT_EQ(r.u32(), 0U);
  EXPECT_FALSE(r.ok());
  EXPECT_EQ(r.u8(), 0);
  EXPECT_EQ(r.remaining(), 0U);
}

TEST(Octets, WriterNeverGrowsPastItsLimit) {
  OctetWriter w(3);
  w.u16(1);
  w.u16(2);
  EXPECT_FALSE(w.ok());
  EXPECT_EQ(w.size(), 2U);
}

TEST(Octets, HexIsReadStrictly) {
  EXPECT_EQ(from_hex("0aFf"), (Octets{0x0a, 0xff}));
  EXPECT_FALSE(from_hex("0"));
  EXPECT_FALSE(from_hex("0g"));
}

TEST(BoundedQueue, CountsWhatItsOverflowRuleDrops) {
  BoundedQueue<int> oldest(2, Overflow::drop_oldest);
  BoundedQueue<int> newest(2, Overflow::drop_newest);
  for (int i = 1; i <= 3; ++i) {
    EXPECT_TRUE(oldest.push(i));
    EXPECT_EQ(newest.push(i), i < 3);
  }
  EXPECT_EQ(oldest.pop(), 2);
  EXPECT_EQ(newest.pop(), 1);
  EXPECT_EQ(oldest.dropped(), 1U);
  EXPECT_EQ(newest.dropped(), 1U);
}

}  // namespace
}  // namespace srfs
