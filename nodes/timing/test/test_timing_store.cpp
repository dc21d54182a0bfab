// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "nodes/timing/timing_store.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

class TimingStoreTest : public testing::Test {
 protected:
  TimingRecord load() const { return TimingStore(temporary_.path()).load(); }
  void damage(const char* name) const {
    ASSERT_TRUE(write_file_atomically(temporary_.path() / name, "damage"));
  }
  const testing_support::TemporaryFolder temporary_;
};

TEST_F(TimingStoreTest, BeginsAtZeroWhereNothingWasStored) {
  EXPECT_EQ(load().cycle_ceiling, 0U);
}

TEST_F(TimingStoreTest, FindsTheLastOfTheRecordsThatWereWrittenInTurn) {
  for (MissionCycle ceiling = 1000; ceiling <= 5000; ceiling += 1000) {
    TimingStore store(temporary_.path());  // of a new process each time
    (void)store.load();
    ASSERT_TRUE(store.save({.cycle_ceiling = ceiling, .utc = {}, .at = {}}));
    EXPECT_EQ(load().cycle_ceiling, ceiling);
  }
}

TEST_F(TimingStoreTest, JumpsAheadOfWhateverADamagedFileMayHaveSaid) {
  TimingStore store(temporary_.path());
  ASSERT_TRUE(store.save({.cycle_ceiling = 3000, .utc = {}, .at = {}}));
  ASSERT_TRUE(store.save({.cycle_ceiling = 4000, .utc = {}, .at = {}}));
  damage("cycle_b");
  EXPECT_EQ(load().cycle_ceiling, 3000U + 2 * CycleReservation::step);
  damage("cycle_a");
  EXPECT_EQ(load().cycle_ceiling, 2 * CycleReservation::step);
}

}  // namespace
}  // namespace srfs
