// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/files/file_manager.hpp"

#include <fstream>

#include <gmock/gmock.h>

#include <mission/structures.hpp>

#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

namespace fs = std::filesystem;
using mission::FileCopyState;
using testing::ElementsAre;
using testing::SizeIs;

constexpr MonotonicTime start(seconds(100));

/// A manager with a real folder and the spacecraft's transfer_folders.
class FileManagerTest : public testing::Test {
 protected:
  void SetUp() override { open(); }
  void open() {
    transfer_folders_.reset();
    auto opened = cfdp::TransferFolders::open(root_, folder_.path() / "checkpoint",
                                              {.own_entity = 2, .peer_entity = 1}, 100, start);
    ASSERT_TRUE(opened) << opened.error().message;
    transfer_folders_ = std::move(*opened);
  }
  void write(const std::string& name, const std::string& content) const {
    std::ofstream(root_ / name, std::ios::binary) << content;
  }
  FileOutcome serve(FileOrder order) {
    order.number = ++number_;
    FileOutcome outcome = manager_.serve(*transfer_folders_, order, start);
    while (outcome.unfinished) {
      ++parts_;
      outcome = manager_.serve(*transfer_folders_, order, start);
    }
    return outcome;
  }
  std::uint16_t code(FileOrder order) { return serve(std::move(order)).failure; }
  std::uint16_t copy(std::uint64_t operation, const std::string& name, const std::string& target = "") {
    return code({.action = FileAction::copy,
                 .name = name,
                 .target_repository = "ground:",
                 .target_name = target,
                 .operations = {operation}});
  }
  std::vector<mission::FileCopyStatus> copies() {
    std::vector<mission::FileCopyStatus> all;
    for (const Octets& data : serve({.action = FileAction::report_copies}).reports)
      all.push_back(mission::FileCopyStatus::decode(data).value());
    return all;
  }
  /// Delivers the first PDU of a file from the ground.
  void come_up(const std::string& name, std::uint64_t sequence) {
    const wire::CfdpHeader header{.source_entity = 1, .sequence_number = sequence, .destination_entity = 2};
    transfer_folders_->on_pdu(wire::encode_cfdp_pdu(header, wire::CfdpMetadata{.file_size = 5000,
                                                                               .source_file = name,
                                                                               .destination_file = name,
                                                                               .options = {}}),
                              start);
  }

  testing_support::TemporaryFolder folder_;
  fs::path root_ = folder_.path() / "files";
  std::unique_ptr<cfdp::TransferFolders> transfer_folders_;
  FileManager manager_{root_};
  std::uint64_t number_ = 0;
  int parts_ = 0;
};

TEST_F(FileManagerTest, ReportsSizeChecksumAndHashOfAFileInParts) {
  write("abc", "abc");
  const auto outcome = serve({.action = FileAction::report_attributes, .name = "abc"});
  ASSERT_EQ(outcome.failure, 0);
  EXPECT_EQ(outcome.report_subtype, 4);
  ASSERT_THAT(outcome.reports, SizeIs(1));
  const auto report = mission::FileAttributes::decode(outcome.reports.front()).value();
  EXPECT_EQ(report.octets, 3U);
  EXPECT_EQ(report.checksum, 0x61626300U);
  // FIPS 180-4, the hash of "abc".
  EXPECT_THAT(report.sha256, ElementsAre(0xba7816bf, 0x8f01cfea, 0x414140de, 0x5dae2223, 0xb00361a3,
                                         0x96177a9c, 0xb410ff61, 0xf20015ad));
  EXPECT_EQ(parts_, 0);

  write("large", std::string(2 * FileManager::octets_per_part + 1, 'x'));
  EXPECT_EQ(code({.action = FileAction::report_attributes, .name = "large"}), 0);
  EXPECT_EQ(parts_, 2);
  write("empty", "");
  EXPECT_EQ(code({.action = FileAction::report_attributes, .name = "empty"}), 0);
}

TEST_F(FileManagerTest, AFileThatChangesWhileItIsReadHasNoChecksum) {
  const FileOrder order{.number = 99, .action = FileAction::report_attributes, .name = "log"};
  for (const bool longer : {true, false}) {
    write("log", std::string(FileManager::octets_per_part + 5, 'x'));
    ASSERT_TRUE(manager_.serve(*transfer_folders_, order, start).unfinished);
    write("log", std::string(FileManager::octets_per_part + (longer ? 6 : 1), 'x'));
    EXPECT_EQ(manager_.serve(*transfer_folders_, order, start).failure, mission::failure::file_changed);
  }
}

TEST_F(FileManagerTest, AnOrderThatWasGivenUpIsNotTakenForTheNext) {
  write("one", std::string(FileManager::octets_per_part + 5, 'x'));
  write("two", "abc");
  ASSERT_TRUE(manager_
                  .serve(*transfer_folders_,
                         {.number = 50, .action = FileAction::report_attributes, .name = "one"}, start)
                  .unfinished);
  const auto outcome = manager_.serve(
      *transfer_folders_, {.number = 51, .action = FileAction::report_attributes, .name = "two"}, start);
  ASSERT_THAT(outcome.reports, SizeIs(1));
  EXPECT_EQ(mission::FileAttributes::decode(outcome.reports.front())->octets, 3U);
}

TEST_F(FileManagerTest, DeletesAFileAndSaysWhyWhenItDoesNot) {
  write("old", "x");
  EXPECT_EQ(code({.action = FileAction::delete_file, .name = "old"}), 0);
  EXPECT_FALSE(fs::exists(root_ / "old"));
  EXPECT_EQ(code({.action = FileAction::delete_file, .name = "old"}), mission::failure::file_not_found);
  EXPECT_EQ(code({.action = FileAction::delete_file, .name = "old", .repeated = true}), 0)
      << "done before a restart";
  EXPECT_EQ(code({.action = FileAction::delete_file, .name = "outbox"}), mission::failure::not_a_file);
  EXPECT_EQ(code({.action = FileAction::delete_file, .repository = "missing", .name = "x"}),
            mission::failure::file_not_found);
}

TEST_F(FileManagerTest, NamesThatLeadElsewhereAreRefusedByEveryOrder) {
  std::ofstream(folder_.path() / "secret") << "secret";
  for (const FileAction action : {FileAction::delete_file, FileAction::report_attributes,
                                  FileAction::make_folder, FileAction::remove_folder, FileAction::copy}) {
    for (const auto& [repository, name] : std::vector<std::pair<std::string, std::string>>{{"", "../secret"},
                                                                                           {"..", "secret"},
                                                                                           {"", ".."},
                                                                                           {"", ".cfdp"},
                                                                                           {"", ""},
                                                                                           {"", "a/b"},
                                                                                           {"/", "etc"}}) {
      EXPECT_EQ(code({.action = action,
                      .repository = repository,
                      .name = name,
                      .target_repository = "ground:",
                      .operations = {1}}),
                mission::failure::bad_file_name)
          << repository << " " << name;
    }
  }
  EXPECT_EQ(code({.action = FileAction::list, .repository = "..", .most = 5}),
            mission::failure::bad_file_name);
  EXPECT_TRUE(fs::exists(folder_.path() / "secret"));
}

TEST_F(FileManagerTest, TheFoldersOfTheLinkStay) {
  for (const char* name : {"outbox", "unsent"})
    EXPECT_EQ(code({.action = FileAction::remove_folder, .name = name}), mission::failure::file_denied);
  EXPECT_EQ(code({.action = FileAction::make_folder, .name = "images"}), 0);
  EXPECT_EQ(code({.action = FileAction::remove_folder, .name = "images"}), 0);
  EXPECT_EQ(code({.action = FileAction::remove_folder, .name = "images"}), mission::failure::file_not_found);
}

TEST_F(FileManagerTest, ListsWithTheNumberOfWhatIsLeft) {
  for (const char* name : {"a", "b", "c"}) write(name, name);
  std::vector<std::string> told;
  for (const Octets& data : serve({.action = FileAction::list, .most = 4}).reports) {
    const auto report = mission::RepositorySummary::decode(data).value();
    told.push_back(report.object_name + " " + std::to_string(report.left) + " of " +
                   std::to_string(report.total));
  }
  EXPECT_THAT(told, ElementsAre("a 4 of 5", "b 3 of 5", "c 2 of 5", "outbox 1 of 5"));
  const auto end = serve({.action = FileAction::list, .name = "z", .most = 4}).reports;
  ASSERT_THAT(end, SizeIs(1));
  EXPECT_EQ(mission::RepositorySummary::decode(end.front())->objects, 0);
}

TEST_F(FileManagerTest, ACopyIsUnderWayUnderItsIdAlsoAfterARestart) {
  write("image", std::string(5000, 'x'));
  EXPECT_EQ(copy(7, "image"), 0);
  open();
  const auto all = copies();
  ASSERT_THAT(all, SizeIs(1));
  EXPECT_EQ(all[0].operation, 7U);
  EXPECT_EQ(all[0].direction, mission::FileDirection::down);
  EXPECT_EQ(all[0].file, "image");
  EXPECT_EQ(all[0].state, FileCopyState::under_way);
  EXPECT_EQ(copy(7, "image"), 0) << "it is under way";
  EXPECT_THAT(copies(), SizeIs(1));
  EXPECT_EQ(copy(7, "image", "other_name"), mission::failure::operation_exists);
  EXPECT_EQ(copy(8, "image", "other_name"), 0);
  EXPECT_EQ(code({.action = FileAction::delete_file, .name = "image"}), mission::failure::file_in_use);
}

TEST_F(FileManagerTest, OnlyCopiesToTheGroundAreMade) {
  write("image", "x");
  const auto to = [&](const std::string& source, const std::string& target) {
    return code({.action = FileAction::copy,
                 .repository = source,
                 .name = "image",
                 .target_repository = target,
                 .operations = {1}});
  };
  EXPECT_EQ(to("", ""), mission::failure::copy_not_supported);
  EXPECT_EQ(to("", "images"), mission::failure::copy_not_supported);
  EXPECT_EQ(to("ground:", "ground:"), mission::failure::copy_not_supported);
  EXPECT_EQ(to("", "ground:"), 0);
  EXPECT_EQ(copy(2, "missing"), mission::failure::file_not_found);
}

TEST_F(FileManagerTest, CopiesOfBothDirectionsAreSuspendedResumedAndCancelledById) {
  write("image", std::string(5000, 'x'));
  ASSERT_EQ(copy(7, "image"), 0);
  come_up("upload", 55);
  const std::uint64_t upload = (std::uint64_t{1} << 32) + 55;
  ASSERT_THAT(copies(), SizeIs(2));
  EXPECT_EQ(copies()[1].operation, upload);
  EXPECT_EQ(copies()[1].file, "upload");
  EXPECT_EQ(copies()[1].direction, mission::FileDirection::up);

  const auto states = [&] {
    std::vector<FileCopyState> all;
    for (const auto& one : copies()) all.push_back(one.state);
    return all;
  };
  EXPECT_EQ(code({.action = FileAction::suspend, .operations = {7, 8}}), mission::failure::unknown_operation);
  EXPECT_THAT(states(), ElementsAre(FileCopyState::under_way, FileCopyState::under_way)) << "all or none";
  EXPECT_EQ(code({.action = FileAction::suspend, .operations = {7, upload}}), 0);
  EXPECT_THAT(states(), ElementsAre(FileCopyState::suspended, FileCopyState::suspended));
  EXPECT_EQ(code({.action = FileAction::suspend, .operations = {7}}), 0) << "again";
  EXPECT_EQ(code({.action = FileAction::resume, .operations = {7}}), 0);
  EXPECT_THAT(states(), ElementsAre(FileCopyState::under_way, FileCopyState::suspended));
  EXPECT_EQ(code({.action = FileAction::abort, .operations = {7, upload}}), 0);
  const auto left = copies();
  ASSERT_FALSE(left.empty());
  for (const auto& one : left) {
    if (one.operations > 0) {
      EXPECT_EQ(one.state, FileCopyState::cancelled);
    }
  }
}

TEST_F(FileManagerTest, CopiesOfAFolderAreThoseOfItsFilesAndOfTheFoldersBelow) {
  fs::create_directories(root_ / "images/raw");
  fs::create_directories(root_ / "images2");
  write("images/raw/a", "a");
  write("images2/b", "b");
  const auto from = [&](std::uint64_t id, const std::string& folder, const std::string& name) {
    return code({.action = FileAction::copy,
                 .repository = folder,
                 .name = name,
                 .target_repository = "ground:",
                 .operations = {id}});
  };
  ASSERT_EQ(from(1, "images/raw", "a"), 0);
  ASSERT_EQ(from(2, "images2", "b"), 0);
  EXPECT_EQ(code({.action = FileAction::suspend, .repository = "images", .all_in_repository = true}), 0);
  EXPECT_EQ(copies()[0].state, FileCopyState::suspended);
  EXPECT_EQ(copies()[1].state, FileCopyState::under_way);
  EXPECT_EQ(code({.action = FileAction::suspend, .all_in_repository = true}), 0);
  EXPECT_EQ(copies()[1].state, FileCopyState::suspended);
}

TEST_F(FileManagerTest, WithoutACopyTheStatusSaysSo) {
  const auto all = copies();
  ASSERT_THAT(all, SizeIs(1));
  EXPECT_EQ(all[0].operations, 0);
  EXPECT_EQ(all[0].state, FileCopyState::none);
}

TEST_F(FileManagerTest, AFolderOfFilesThatIsGoneFailsEveryOrder) {
  FileManager nowhere(folder_.path() / "missing");
  EXPECT_EQ(nowhere.serve(*transfer_folders_, {.action = FileAction::list, .most = 1}, start).failure,
            mission::failure::disk_failed);
}

}  // namespace
}  // namespace srfs
