// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/frame_count_file.hpp"

#include <gtest/gtest.h>

#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

wire::TmFrameCounts counts_at(unsigned frames) {
  wire::TmFrameCounts counts;
  counts.master = static_cast<std::uint8_t>(frames);
  counts.vc[0] = static_cast<std::uint8_t>(frames / 2);
  counts.vc[wire::tm_idle_vc] = static_cast<std::uint8_t>(frames - frames / 2);
  return counts;
}

TEST(FrameCountFile, KeepsTheCountersAndADamagedOneHasNone) {
  const testing_support::TemporaryFolder folder;
  const FrameCountFile file(folder.path() / "frame_counts");
  EXPECT_FALSE(file.load()) << "never written";
  ASSERT_TRUE(file.store(counts_at(200)));
  ASSERT_TRUE(file.store(counts_at(250)));
  EXPECT_EQ(FrameCountFile(folder.path() / "frame_counts").load(), counts_at(250));

  std::string content = read_file(folder.path() / "frame_counts").value();
  content[7] = static_cast<char>(content[7] ^ 1);
  ASSERT_TRUE(write_file_atomically(folder.path() / "frame_counts", content));
  EXPECT_FALSE(file.load());
  EXPECT_FALSE(FrameCountFile(folder.path()).store(counts_at(1))) << "a folder is no file";
}

TEST(FrameCountReserve, WhateverIsOnDiskWasNotUsedYetAndIsWrittenNowAndThenOnly) {
  FrameCountReserve reserve;
  std::optional<wire::TmFrameCounts> stored;
  unsigned writes = 0;
  constexpr unsigned frames = 3000;
  for (unsigned sent = 0; sent < frames; ++sent) {
    const wire::TmFrameCounts next = counts_at(sent);
    if (const auto wanted = reserve.wanted(next)) {
      stored = wanted;
      reserve.on_stored(*wanted);
      ++writes;
    }
    ASSERT_TRUE(stored);
    const auto jump = static_cast<std::uint8_t>(stored->master - next.master);
    EXPECT_LE(jump, FrameCountReserve::frames_ahead);
    EXPECT_GT(jump, 0);
    for (const std::size_t vc : {std::size_t{0}, std::size_t{wire::tm_idle_vc}}) {
      const auto ahead = static_cast<std::uint8_t>(stored->vc.at(vc) - next.vc.at(vc));
      EXPECT_TRUE(ahead > 0 && ahead <= FrameCountReserve::frames_ahead) << vc;
    }
  }
  EXPECT_EQ(writes, 1 + (frames - 1) / FrameCountReserve::frames_used);
}

TEST(FrameCountReserve, WhatCouldNotBeWrittenIsWantedAgain) {
  FrameCountReserve reserve;
  EXPECT_TRUE(reserve.wanted(counts_at(5)));
  EXPECT_TRUE(reserve.wanted(counts_at(5)));
  reserve.on_stored(*reserve.wanted(counts_at(5)));
  EXPECT_FALSE(reserve.wanted(counts_at(5)));
}

}  // namespace
}  // namespace srfs
