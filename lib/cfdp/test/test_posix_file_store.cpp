// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <fstream>

#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cfdp/entity.hpp"
#include "cfdp/posix_file_store.hpp"

namespace srfs::cfdp {
namespace {

namespace fs = std::filesystem;

class PosixFiles : public testing::Test {
 protected:
  fs::path folder_ = make_folder();
  fs::path root_ = folder_ / "files";
  std::unique_ptr<PosixFileStore> store_ = PosixFileStore::open(root_, folder_ / "checkpoint").value();
  const TransactionId id_{.source = 1, .sequence = 7};

  ~PosixFiles() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  static fs::path make_folder() {
    std::string name = (fs::temp_directory_path() / "srfs_cfdp_XXXXXX").string();
    return mkdtemp(name.data());
  }
  static void write(const fs::path& path, const std::string& content) { std::ofstream(path) << content; }
  static std::string content_of(const fs::path& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  static OctetView view(std::string_view text) {
    return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
  }
};

TEST_F(PosixFiles, NoNameLeavesTheRoot) {
  write(folder_ / "secret", "secret");
  fs::create_directory(root_ / "sub");
  fs::create_symlink(folder_ / "secret", root_ / "link");
  fs::create_symlink(folder_, root_ / "folder_link");
  fs::create_symlink("..", root_ / "sub" / "up");
  for (const std::string name : {"", "/", "../secret", "sub/../../secret", "..", ".", "./x", "sub//x", "sub/",
                                 "link", "folder_link/secret", "sub/up/x", ".cfdp/1-7.part", ".hidden"}) {
    EXPECT_EQ(store_->stamp(name).error(), FileFault::bad_name) << name;
    EXPECT_EQ(store_->check_destination(name).error(), FileFault::bad_name) << name;
    std::uint8_t octet = 0;
    EXPECT_FALSE(store_->read(name, 0, {&octet, 1})) << name;
    ASSERT_TRUE(store_->create_temporary(id_));
    EXPECT_EQ(store_->commit(id_, 0, name).error(), FileFault::bad_name) << name;
  }
  EXPECT_EQ(store_->stamp((folder_ / "secret").string()).error(), FileFault::bad_name);
  EXPECT_EQ(store_->stamp(std::string_view("a\0b", 3)).error(), FileFault::bad_name);
  EXPECT_EQ(content_of(folder_ / "secret"), "secret");
}

TEST_F(PosixFiles, WhatIsNoFileIsRefused) {
  fs::create_directory(root_ / "sub");
  ASSERT_EQ(mkfifo((root_ / "fifo").c_str(), 0600), 0);
  EXPECT_EQ(store_->stamp("sub").error(), FileFault::not_a_file);
  EXPECT_EQ(store_->stamp("fifo").error(), FileFault::not_a_file);
  EXPECT_EQ(store_->check_destination("sub").error(), FileFault::not_a_file);
  EXPECT_EQ(store_->stamp("missing").error(), FileFault::not_found);
  EXPECT_EQ(store_->check_destination("missing/b").error(), FileFault::not_found);
}

TEST_F(PosixFiles, ATemporaryFileGetsItsNameWithExactlyItsOctets) {
  fs::create_directory(root_ / "sub");
  write(root_ / "sub" / "b", "old content");
  ASSERT_TRUE(store_->create_temporary(id_));
  ASSERT_TRUE(store_->check_room(100));
  ASSERT_TRUE(store_->write_temporary(id_, 3, view("def")));
  ASSERT_TRUE(store_->write_temporary(id_, 0, view("abc")));
  ASSERT_TRUE(store_->sync_temporary(id_));
  std::uint8_t octets[4] = {};
  EXPECT_EQ(store_->read_temporary(id_, 1, octets).value(), 4U);
  EXPECT_EQ(content_of(root_ / "sub" / "b"), "old content");
  ASSERT_TRUE(store_->commit(id_, 6, "sub/b"));
  EXPECT_EQ(content_of(root_ / "sub" / "b"), "abcdef");
  EXPECT_EQ(store_->read_temporary(id_, 0, octets).error(), FileFault::not_found);
}

TEST_F(PosixFiles, AReplacedOrWrittenFileHasAnotherStampAndItsNewContentIsRead) {
  write(root_ / "a", "first");
  const auto first = store_->stamp("a").value();
  std::uint8_t octets[6] = {};
  ASSERT_EQ(store_->read("a", 0, octets).value(), 5U);
  write(folder_ / "other", "second");
  fs::rename(folder_ / "other", root_ / "a");
  EXPECT_NE(store_->stamp("a").value(), first);
  ASSERT_EQ(store_->read("a", 0, octets).value(), 6U);
  EXPECT_EQ(std::string(octets, octets + 6), "second");
}

TEST_F(PosixFiles, TemporariesOfNobodyAreRemoved) {
  const TransactionId other{.source = 1, .sequence = 8};
  ASSERT_TRUE(store_->create_temporary(id_));
  ASSERT_TRUE(store_->create_temporary(other));
  store_->discard_temporaries_except(std::vector{id_});
  std::uint8_t octet = 0;
  EXPECT_TRUE(store_->read_temporary(id_, 0, {&octet, 1}));
  EXPECT_FALSE(store_->read_temporary(other, 0, {&octet, 1}));
}

TEST_F(PosixFiles, ADiskThatTakesNoMoreIsNoSpace) {
  ASSERT_TRUE(store_->create_temporary(id_));
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{.rlim_cur = 4096, .rlim_max = before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const auto written = store_->write_temporary(id_, 4096, view("x"));
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, old_handler);
  EXPECT_EQ(written.error(), FileFault::no_space);
}

TEST_F(PosixFiles, WhatIsReceivedLeavesTheFloorOfTheDiskFree) {
  constexpr std::uint64_t more_than_any_disk = std::uint64_t{1} << 60;
  const auto full = PosixFileStore::open(root_, folder_ / "checkpoint", more_than_any_disk).value();
  EXPECT_EQ(full->check_room(1).error(), FileFault::no_space);
  ASSERT_TRUE(full->create_temporary(id_));
  EXPECT_EQ(full->write_temporary(id_, 0, view("x")).error(), FileFault::no_space);
  EXPECT_TRUE(full->save_checkpoint(view("goes on")));
  EXPECT_EQ(store_->check_room(more_than_any_disk).error(), FileFault::no_space);
}

TEST_F(PosixFiles, AnAnnouncedFileTakesNoRoomBeforeItsOctetsCome) {
  const Settings settings{.own_entity = 2, .peer_entity = 1};
  Entity entity(settings, *store_, 1);
  for (std::uint64_t i = 1; i <= 16; ++i) {
    const CfdpHeader of_one{.source_entity = 1, .sequence_number = i, .destination_entity = 2};
    const wire::CfdpMetadata metadata{
        .file_size = 200U << 20, .source_file = "a", .destination_file = "b", .options = {}};
    entity.on_pdu(wire::encode_cfdp_pdu(of_one, metadata), MonotonicTime(seconds(1)));
  }
  EXPECT_EQ(entity.transactions().size(), settings.receiving_max);
  EXPECT_EQ(entity.counts().no_room, 16 - settings.receiving_max);
  std::uintmax_t blocks = 0;
  for (const auto& entry : fs::directory_iterator(root_ / ".cfdp")) {
    struct stat s {};
    ASSERT_EQ(stat(entry.path().c_str(), &s), 0);
    blocks += static_cast<std::uintmax_t>(s.st_blocks);
  }
  EXPECT_EQ(blocks, 0U);
}

TEST_F(PosixFiles, CheckpointsAreReplacedAndReadBack) {
  EXPECT_TRUE(store_->load_checkpoint()->empty());
  ASSERT_TRUE(store_->save_checkpoint(view("one")));
  ASSERT_TRUE(store_->save_checkpoint(view("two")));
  const Octets read = store_->load_checkpoint().value();
  EXPECT_EQ(std::string(read.begin(), read.end()), "two");
}

TEST_F(PosixFiles, CarryATransferOverRestartsOfBothEnds) {
  const fs::path ground_root = folder_ / "ground";
  const auto ground_store = PosixFileStore::open(ground_root, folder_ / "ground_checkpoint").value();
  std::string image(60'000, '\0');
  for (std::size_t i = 0; i < image.size(); ++i) image[i] = static_cast<char>(i * i >> 7);
  write(ground_root / "image", image);
  Settings up;
  Settings down;
  down.own_entity = 2;
  down.peer_entity = 1;
  MonotonicTime now{seconds(1)};
  std::optional<TransactionId> id;
  for (int restart = 0; restart < 100; ++restart) {
    Entity ground(up, *ground_store, 1);
    Entity satellite(down, *store_, 1);
    ASSERT_TRUE(ground.restore(ground_store->load_checkpoint().value(), now));
    ASSERT_TRUE(satellite.restore(store_->load_checkpoint().value(), now));
    if (!id) id = ground.put("image", "image.fits").value();
    for (int pdus = 0; pdus < 20; ++pdus) {
      if (const auto pdu = ground.next_pdu(980, now)) satellite.on_pdu(*pdu, now);
      if (const auto pdu = satellite.next_pdu(980, now)) ground.on_pdu(*pdu, now);
      now += milliseconds(100);
    }
    if (ground.outcome_of(*id) && satellite.outcome_of(*id)) break;
  }
  EXPECT_EQ(content_of(root_ / "image.fits"), image);
  EXPECT_TRUE(fs::is_empty(root_ / ".cfdp"));
}

}  // namespace
}  // namespace srfs::cfdp
