// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/boot_store.hpp"

#include <fstream>

#include <gtest/gtest.h>
#include <unistd.h>

namespace srfs::suite {
namespace {

class BootStoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "srfs_boot_XXXXXX").string();
    folder = mkdtemp(pattern.data());
  }
  void TearDown() override { std::filesystem::remove_all(folder); }
  void damage(const char* copy) const { std::ofstream(folder / copy, std::ios::trunc) << "srfs-boot 1\ncou"; }

  std::filesystem::path folder;
};

TEST_F(BootStoreTest, FindsNothingBeforeTheFirstBoot) {
  EXPECT_FALSE(BootStore(folder / "boot").load().state);
}

TEST_F(BootStoreTest, GivesBackTheRecordWhicheverCopyIsLost) {
  for (const char* lost : {"record_a", "record_b"}) {
    for (const bool removed : {true, false}) {
      const wire::BootRecord record{.count = 5, .boot_id = "a", .revision = 9};
      ASSERT_EQ(BootStore(folder).store(record).copies, 2U);
      if (removed) {
        std::filesystem::remove(folder / lost);
      } else {
        damage(lost);
      }
      EXPECT_EQ(BootStore(folder).load().state, record) << lost;
    }
  }
}

TEST_F(BootStoreTest, TakesTheNewerCopyAfterAPowerLossBetweenTheTwo) {
  ASSERT_EQ(BootStore(folder).store({.count = 5, .boot_id = "a", .revision = 9}).copies, 2U);
  std::filesystem::rename(folder / "record_b", folder / "old");
  ASSERT_EQ(BootStore(folder).store({.count = 6, .boot_id = "b", .revision = 10}).copies, 2U);
  std::filesystem::rename(folder / "old", folder / "record_b");
  EXPECT_EQ(BootStore(folder).load().state->count, 6U);
}

TEST_F(BootStoreTest, SaysWhenTheDiskDoesNotTakeIt) {
  std::ofstream(folder / "file") << "in the way";
  EXPECT_FALSE(BootStore(folder / "file").store({}).durable());
}

}  // namespace
}  // namespace srfs::suite
