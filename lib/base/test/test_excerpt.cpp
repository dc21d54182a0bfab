// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/excerpt.hpp"

namespace srfs {
namespace {

TEST(Excerpt, IsTheTextWhereItFitsElseItsBegin) {
  EXPECT_EQ(excerpt("12345678", 8), "12345678");
  EXPECT_EQ(excerpt("123456789", 8), "12345...");
  EXPECT_EQ(excerpt("", 3), "");
  EXPECT_EQ(excerpt("1234", 3), "...");
  EXPECT_EQ(excerpt(std::string(200'000, 'x')).size(), 64U);
}

TEST(Excerpt, CutsNoCharacterInTwo) {
  EXPECT_EQ(excerpt("abcd\u00e9fghi", 8), "abcd...") << "the e with its accent is two octets";
  EXPECT_EQ(excerpt("ab\u20acdefghi", 8), "ab\u20ac...");
}

TEST(Excerpt, EndsAlsoWhereNothingIsUtf8) {
  EXPECT_EQ(excerpt(std::string(100, '\x80'), 8), "...");
}

}  // namespace
}  // namespace srfs
