// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/temporary_folder.hpp"

#include <fstream>

#include <gtest/gtest.h>

namespace srfs::testing_support {
namespace {

namespace fs = std::filesystem;

TEST(TemporaryFolders, AreThereUntilTheirOwnerIsGone) {
  fs::path path;
  {
    const TemporaryFolder folder;
    path = folder.path();
    std::ofstream(path / "file") << "content";
    TemporaryFolder::remove_abandoned(path.parent_path(), 0);
    EXPECT_TRUE(fs::exists(path / "file"));
  }
  EXPECT_FALSE(fs::exists(path));
}

TEST(TemporaryFolders, OfKilledOwnersAreRemovedAndNothingElse) {
  const TemporaryFolder parent;
  const fs::path abandoned = parent.path() / "srfs_test_abandoned";
  const fs::path foreign = parent.path() / "foreign";
  fs::create_directories(abandoned / "below");
  fs::create_directories(foreign);

  TemporaryFolder::remove_abandoned(parent.path());
  EXPECT_TRUE(fs::exists(abandoned)) << "it is young: its owner may be about to lock it";
  TemporaryFolder::remove_abandoned(parent.path(), 0);
  EXPECT_FALSE(fs::exists(abandoned));
  EXPECT_TRUE(fs::exists(foreign));
}

}  // namespace
}  // namespace srfs::testing_support
