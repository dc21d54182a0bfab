// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/frame_count_page.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "nodes/ttc/link/downlink_scheduler.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

wire::TmFrameCounts some_counts() {
  wire::TmFrameCounts counts;
  counts.master = 250;
  counts.vc[0] = 7;
  counts.vc[1] = 255;
  counts.vc[2] = 1;
  counts.vc[wire::tm_idle_vc] = 128;
  return counts;
}

TEST(FrameCountPage, AKilledProcessLeavesItsCountersToTheNext) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.path() / "memory" / "counts";
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    auto page = FrameCountPage::open(file, std::nullopt);
    if (page) page->write(some_counts());
    raise(SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));

  const auto page = FrameCountPage::open(file, std::nullopt);
  ASSERT_TRUE(page) << page.error();
  EXPECT_EQ(page->read(), some_counts());
}

TEST(FrameCountPage, ANewOneHasNone) {
  const testing_support::TemporaryFolder folder;
  const auto page = FrameCountPage::open(folder.path() / "memory" / "counts", std::nullopt);
  ASSERT_TRUE(page) << page.error();
  EXPECT_FALSE(page->read());
}

TEST(DownlinkScheduler, GoesOnWithTheFrameCountersOfAnEarlierOne) {
  DownlinkConfig config;
  config.spacecraft_id = 0xAB;
  config.cadu = {.frame_octets = 223, .reed_solomon = false, .interleave = 1, .randomize = false};
  config.continuous = true;
  wire::TmFrameDecoder decoder(0xAB, 223);
  MonotonicTime now;
  for (int process = 0; process < 3; ++process) {
    DownlinkScheduler downlink(config);
    for (int frame = 0; frame < 200; ++frame) {
      now += milliseconds(10);
      const auto cadu = downlink.next(now, [] { return 0U; });
      ASSERT_TRUE(cadu);
      ASSERT_TRUE(decoder.decode(OctetView(*cadu).last(223)));
    }
    config.first_counts = downlink.frame_counts();
  }
  EXPECT_EQ(decoder.counters().frames, 600U);
  EXPECT_EQ(decoder.counters().lost, 0U);
}

}  // namespace
}  // namespace srfs
