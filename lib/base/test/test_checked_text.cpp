// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/checked_text.hpp"

namespace srfs {
namespace {

TEST(CheckedText, ComesBackAsItWasStored) {
  EXPECT_EQ(without_check(with_check("mode 1\n2 words")), "mode 1\n2 words");
}

// CRC-32C of "123456789" in the catalogue of parametrised CRC algorithms.
TEST(CheckedText, HasItsChecksumBehindIt) {
  EXPECT_EQ(with_check("123456789"), "123456789 e3069283\n");
}

TEST(CheckedText, DamagedOrCutAnywhereIsNoText) {
  const std::string stored = with_check("mode 1");
  for (std::size_t i = 0; i < stored.size(); ++i) {
    std::string damaged = stored;
    damaged[i] = static_cast<char>(damaged[i] ^ 1);
    EXPECT_EQ(without_check(damaged), std::nullopt) << i;
    EXPECT_EQ(without_check(stored.substr(0, i)), std::nullopt) << i;
  }
}

}  // namespace
}  // namespace srfs
