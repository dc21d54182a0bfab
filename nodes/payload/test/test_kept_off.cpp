// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/kept_off.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

TEST(KeptOff, IsReadAsItWasWrittenInTheSameBootAlone) {
  const MonotonicTime until{seconds(1234)};
  const std::string text = kept_off_text(until, "boot-a");
  EXPECT_EQ(kept_off_until(text, "boot-a"), until);
  EXPECT_FALSE(kept_off_until(text, "boot-b"));
}

TEST(KeptOff, WhatCannotBeReadKeepsNothingOff) {
  for (const char* text : {"", " ", "1", "1 boot-a", "x boot-a\n", " boot-a\n", "kept off: it babbles\n"})
    EXPECT_FALSE(kept_off_until(text, "boot-a")) << text;
}

}  // namespace
}  // namespace srfs
