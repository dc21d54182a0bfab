// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/state_files.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.hpp"
#include "suite/node_versions.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::suite {
namespace {

class StateFilesTest : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& content) const {
    ASSERT_TRUE(write_file_atomically(var_.state("node") / name, content));
  }
  [[nodiscard]] std::string text(const std::string& name) const {
    return read_file(var_.state("node") / name).value_or("(none)");
  }
  /// This version accepts files that begin with "1".
  [[nodiscard]] std::optional<std::string> read(const std::string& name,
                                                TakenBack taken_back = TakenBack::yes) const {
    return read_state_file(var_, "node", name, 1000, taken_back,
                           [](const std::string& content) { return content.starts_with("1"); });
  }

  testing_support::TemporaryFolder folder_;
  const VarPaths var_{folder_.path() / "var"};
};

TEST_F(StateFilesTest, ReadsWhatItCan) {
  EXPECT_FALSE(read("target"));
  write("target", "1 north");
  EXPECT_EQ(read("target"), "1 north");
}

TEST_F(StateFilesTest, SetsAsideWhatANewerVersionWroteAndTakesTheSnapshotsCopy) {
  write("target", "1 north");
  ASSERT_TRUE(snapshot_state(var_, "node", update::golden));
  write("target", "2 east");
  EXPECT_EQ(read("target"), "1 north");
  EXPECT_EQ(text("target"), "1 north") << "in its place again";
  EXPECT_EQ(text("target.unreadable"), "2 east");
  EXPECT_EQ(read("target"), "1 north");
}

TEST_F(StateFilesTest, KeepsWhatANewerVersionWroteAndThisOneCanRead) {
  write("target", "1 north");
  ASSERT_TRUE(snapshot_state(var_, "node", update::golden));
  write("target", "1 west");
  EXPECT_EQ(read("target"), "1 west");
}

TEST_F(StateFilesTest, NeverTakesAJournalBack) {
  write("telecommands", "1 old");
  ASSERT_TRUE(snapshot_state(var_, "node", update::golden));
  write("telecommands", "2 new");
  EXPECT_FALSE(read("telecommands", TakenBack::never));
  EXPECT_EQ(text("telecommands.unreadable"), "2 new");
  EXPECT_EQ(text("telecommands"), "(none)");
}

TEST_F(StateFilesTest, DoesWithoutASnapshotOrWithOneThatCannotBeReadEither) {
  write("target", "2 east");
  EXPECT_FALSE(read("target"));
  write("target", "3 south");
  ASSERT_TRUE(snapshot_state(var_, "node", update::golden));
  EXPECT_FALSE(read("target"));
  EXPECT_EQ(text("target.unreadable"), "3 south");
}

TEST_F(StateFilesTest, BoundsTheSnapshotAndReplacesTheOneBefore) {
  write("large", std::string(largest_snapshot - 10, 'x'));
  write("small", "1");
  write("folder/in_it", "1");
  write("old.unreadable", "1");
  ASSERT_TRUE(snapshot_state(var_, "node", update::golden));
  const auto folder = snapshot_folder(var_, "node", update::golden);
  EXPECT_TRUE(std::filesystem::exists(folder / "large"));
  EXPECT_TRUE(std::filesystem::exists(folder / "small"));
  EXPECT_FALSE(std::filesystem::exists(folder / "folder"));
  EXPECT_FALSE(std::filesystem::exists(folder / "old.unreadable"));
  write("large", std::string(largest_snapshot + 1, 'x'));
  ASSERT_TRUE(snapshot_state(var_, "node", update::golden));
  EXPECT_FALSE(std::filesystem::exists(folder / "large"));
  EXPECT_TRUE(std::filesystem::exists(folder / "small"));
}

TEST_F(StateFilesTest, ASnapshotGoesWithItsVersion) {
  ASSERT_TRUE(write_file_atomically(folder_.path() / "program", "#!/bin/sh\n"));
  const auto change = [&](const VersionChange& what) { ASSERT_TRUE(change_versions(var_, "node", what)); };
  const auto add = [&](update::VersionStore& store) -> Result<void, std::string> {
    (void)store.add(folder_.path() / "program", "a test", UtcTime(seconds(1)));
    return {};
  };
  change(add);
  write("target", "1 north");
  for (const update::VersionNumber version : {0U, 1U}) ASSERT_TRUE(snapshot_state(var_, "node", version));
  change(add);
  EXPECT_TRUE(std::filesystem::exists(snapshot_folder(var_, "node", 0)));
  EXPECT_TRUE(std::filesystem::exists(snapshot_folder(var_, "node", 1)));
  change([](update::VersionStore& store) { return store.remove(1); });
  EXPECT_TRUE(std::filesystem::exists(snapshot_folder(var_, "node", 0)));
  EXPECT_FALSE(std::filesystem::exists(snapshot_folder(var_, "node", 1)));
}

}  // namespace
}  // namespace srfs::suite
