// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/file_tree.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include <sys/stat.h>

#include "temporary_folder.hpp"

namespace srfs::cfdp {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::IsEmpty;

class FileTreeTest : public testing::Test {
 protected:
  FileTreeTest() { fs::create_directory(root_); }
  void write(const std::string& name, const std::string& content = "") const {
    std::ofstream(root_ / name) << content;
  }
  static std::vector<std::string> names(const FolderPage& page) {
    std::vector<std::string> found;
    for (const FolderEntry& entry : page.entries) found.push_back(entry.name);
    return found;
  }

  testing_support::TemporaryFolder folder_;
  fs::path root_ = folder_.path() / "files";
  std::optional<FileTree> tree_;
  void SetUp() override { tree_ = FileTree::open(root_).value(); }
};

TEST_F(FileTreeTest, ListsAFolderInTheOrderOfNamesPageByPage) {
  for (const char* name : {"c", "a", "e", "b", "d", ".hidden"}) write(name);
  const auto first = tree_->list("", "", 2).value();
  EXPECT_THAT(names(first), ElementsAre("a", "b"));
  EXPECT_EQ(first.total, 5U);
  EXPECT_EQ(first.left, 3U);
  const auto second = tree_->list("", "b", 2).value();
  EXPECT_THAT(names(second), ElementsAre("c", "d"));
  EXPECT_EQ(second.left, 1U);
  const auto last = tree_->list("", "d", 2).value();
  EXPECT_THAT(names(last), ElementsAre("e"));
  EXPECT_EQ(last.left, 0U);
  EXPECT_THAT(tree_->list("", "e", 2).value().entries, IsEmpty());
  EXPECT_EQ(tree_->list("", "e", 2).value().total, 5U);
}

TEST_F(FileTreeTest, APageGoesOnBehindANameThatIsNoLongerThere) {
  for (const char* name : {"a", "b", "c"}) write(name);
  ASSERT_TRUE(tree_->remove_file("b"));
  EXPECT_THAT(names(tree_->list("", "b", 5).value()), ElementsAre("c"));
}

TEST_F(FileTreeTest, AListingSaysWhatIsAFileAndHowLargeAndWhatIsNot) {
  write("file", "12345");
  fs::create_directory(root_ / "folder");
  fs::create_symlink("file", root_ / "link");
  const auto page = tree_->list("", "", 10).value();
  ASSERT_THAT(names(page), ElementsAre("file", "folder", "link"));
  EXPECT_EQ(page.entries[0].kind, EntryKind::file);
  EXPECT_EQ(page.entries[0].octets, 5U);
  EXPECT_EQ(page.entries[1].kind, EntryKind::folder);
  EXPECT_EQ(page.entries[2].kind, EntryKind::other);
}

TEST_F(FileTreeTest, AFolderIsListedAgainFromItsBeginning) {
  write("a");
  for (int i = 0; i < 3; ++i) EXPECT_THAT(names(tree_->list("", "", 10).value()), ElementsAre("a"));
}

TEST_F(FileTreeTest, NoNameLeavesTheRoot) {
  fs::create_directory(folder_.path() / "outside");
  std::ofstream(folder_.path() / "outside" / "secret") << "secret";
  fs::create_directory(root_ / "sub");
  fs::create_directory(root_ / ".cfdp");
  write(".cfdp/1-7.part");
  fs::create_symlink(folder_.path() / "outside", root_ / "link");
  fs::create_symlink("..", root_ / "sub" / "up");
  for (const std::string folder :
       {"..", ".", "/", "/etc", "sub/..", "sub/", "sub//", "link", "sub/up", ".cfdp", "./sub"}) {
    EXPECT_EQ(tree_->list(folder, "", 1).error(), FileFault::bad_name) << folder;
    for (const std::string& name : {folder + "/secret", folder + "/1-7.part"}) {
      EXPECT_EQ(tree_->open_file(name).error(), FileFault::bad_name) << name;
      EXPECT_EQ(tree_->remove_file(name).error(), FileFault::bad_name) << name;
      EXPECT_EQ(tree_->make_folder(name).error(), FileFault::bad_name) << name;
      EXPECT_EQ(tree_->remove_folder(name).error(), FileFault::bad_name) << name;
    }
  }
  EXPECT_EQ(tree_->remove_file("").error(), FileFault::bad_name);
  EXPECT_EQ(tree_->open_file(std::string_view("a\0b", 3)).error(), FileFault::bad_name);
  EXPECT_TRUE(fs::exists(folder_.path() / "outside" / "secret"));
  EXPECT_TRUE(fs::exists(root_ / ".cfdp" / "1-7.part"));
}

TEST_F(FileTreeTest, OfALinkTheLinkIsRemoved) {
  write("file", "x");
  fs::create_symlink("file", root_ / "link");
  EXPECT_EQ(tree_->open_file("link").error(), FileFault::bad_name);
  EXPECT_TRUE(tree_->remove_file("link"));
  EXPECT_TRUE(fs::exists(root_ / "file"));
  EXPECT_FALSE(fs::exists(fs::symlink_status(root_ / "link")));
}

TEST_F(FileTreeTest, FoldersAreMadeAndRemovedOnlyWhenEmpty) {
  EXPECT_TRUE(tree_->make_folder("images"));
  EXPECT_TRUE(tree_->make_folder("images")) << "it is there";
  EXPECT_TRUE(tree_->make_folder("images/2026"));
  EXPECT_EQ(tree_->make_folder("missing/x").error(), FileFault::not_found);
  EXPECT_EQ(tree_->remove_folder("images").error(), FileFault::not_empty);
  EXPECT_EQ(tree_->remove_file("images").error(), FileFault::not_a_file);
  EXPECT_TRUE(tree_->remove_folder("images/2026"));
  EXPECT_TRUE(tree_->remove_folder("images"));
  EXPECT_EQ(tree_->remove_folder("images").error(), FileFault::not_found);
  write("file");
  EXPECT_EQ(tree_->remove_folder("file").error(), FileFault::not_a_folder);
  EXPECT_EQ(tree_->make_folder("file").error(), FileFault::not_a_folder);
  EXPECT_EQ(tree_->list("file", "", 1).error(), FileFault::not_a_folder);
}

TEST_F(FileTreeTest, OnlyFilesAreOpened) {
  ASSERT_EQ(mkfifo((root_ / "fifo").c_str(), 0600), 0);
  fs::create_directory(root_ / "folder");
  EXPECT_EQ(tree_->open_file("fifo").error(), FileFault::not_a_file);
  EXPECT_EQ(tree_->open_file("folder").error(), FileFault::not_a_file);
  EXPECT_EQ(tree_->open_file("missing").error(), FileFault::not_found);
  write("file", "abc");
  const auto file = tree_->open_file("file");
  ASSERT_TRUE(file);
  EXPECT_EQ(file->stamp.octets, 3U);
  Octets octets(5);
  EXPECT_EQ(read_at(file->fd.get(), 1, octets).value(), 2U);
  EXPECT_EQ(octets[0], 'b');
}

}  // namespace
}  // namespace srfs::cfdp
