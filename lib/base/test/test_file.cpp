// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>

#include "base/file.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

class FileTest : public testing::Test {
 protected:
  const testing_support::TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
};

TEST_F(FileTest, AtomicWriteReplacesTheWholeContentAndLeavesNoTemporaryFile) {
  ASSERT_TRUE(write_file_atomically(folder_ / "a/b.txt", "one, longer"));
  ASSERT_TRUE(write_file_atomically(folder_ / "a/b.txt", "two"));
  EXPECT_EQ(read_file(folder_ / "a/b.txt").value(), "two");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_ / "a"), {}), 1);
}

TEST_F(FileTest, ErrorsNameThePathAndTheReason) {
  EXPECT_EQ(read_file(folder_ / "none").error().message,
            (folder_ / "none").string() + ": cannot open: No such file or directory (ENOENT)");
  ASSERT_TRUE(write_file_atomically(folder_ / "big", "12345"));
  EXPECT_FALSE(read_file(folder_ / "big", 4));
  EXPECT_FALSE(write_file_atomically("/proc/nowhere/x", "1"));
}

}  // namespace
}  // namespace srfs
