// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/rescue/recovery_files.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "base/file.hpp"
#include "base/sha256.hpp"
#include "base/text.hpp"
#include "tests/temporary_folder.hpp"
#include "update/golden_manifest.hpp"
#include "update/version_store.hpp"

namespace srfs::rescue {
namespace {

using mission::RescuePart;
using RoomFor = RecoveryFiles::RoomFor;
namespace failure = mission::failure;

class RecoveryFilesTest : public ::testing::Test {
 protected:
  RecoveryFilesTest() {
    settings_.var = (folder_.path() / "var").string();
    settings_.program = (folder_.path() / "opt/bin/srfs").string();
    settings_.deployment = (folder_.path() / "etc/deployment.yaml").string();
  }
  [[nodiscard]] std::filesystem::path at(const std::string& path) const { return folder_.path() / path; }
  void put(const std::string& path, const std::string& content) const {
    ASSERT_TRUE(write_file_atomically(at(path), content));
  }
  [[nodiscard]] std::string content(const std::string& path) const {
    return read_file(at(path)).value_or("(none)");
  }
  [[nodiscard]] bool exists(const std::string& path) const { return std::filesystem::exists(at(path)); }
  [[nodiscard]] RecoveryFiles files() const { return RecoveryFiles(settings_); }
  [[nodiscard]] FilesResult<std::uint32_t> set_aside(RescuePart part, std::uint32_t number) const {
    LinkStore link(at("var/state/ttc"));
    (void)link.load(MonotonicTime());
    return files().set_aside(part, number, link);
  }
  [[nodiscard]] std::string take_measures(suite::BootStep step, std::uint32_t number) const {
    LinkStore link(at("var/state/ttc"));
    (void)link.load(MonotonicTime());
    return files().take_measures(step, number, link);
  }
  /// A golden copy of a file as it is.
  void make_golden(const std::vector<std::string>& paths) const {
    update::GoldenManifest manifest;
    for (const std::string& path : paths) {
      const std::string text = content(path);
      struct stat info {};
      ASSERT_EQ(stat(at(path).c_str(), &info), 0);
      manifest.put({.path = at(path).string(),
                    .sha256 = to_digits(sha256_of(as_octets(text))),
                    .octets = text.size(),
                    .modified_ns = info.st_mtim.tv_sec * 1'000'000'000 + info.st_mtim.tv_nsec,
                    .mode = 0755,
                    .build_id = ""});
      put("var/golden/" + to_digits(sha256_of(as_octets(text))), text);
    }
    put("var/golden/manifest_a", encode(manifest));
  }

  testing_support::TemporaryFolder folder_;
  suite::RescueSettings settings_;
};

TEST_F(RecoveryFilesTest, WhatIsSetAsideIsMovedAndNothingElse) {
  put("var/state/ttc/parameters.yaml", "values");
  put("var/state/ttc/mode", "nominal");
  put("var/state/payload_eps/hold", "held");
  put("var/store/housekeeping/1", "packets");

  const auto moved = set_aside(RescuePart::parameters, 4);

  ASSERT_TRUE(moved) << moved.error().text;
  EXPECT_EQ(*moved, 2U);
  EXPECT_EQ(content("var/set_aside/4/state/ttc/parameters.yaml"), "values");
  EXPECT_EQ(content("var/set_aside/4/state/payload_eps/hold"), "held");
  EXPECT_EQ(content("var/state/ttc/mode"), "nominal");
  EXPECT_TRUE(exists("var/store/housekeeping/1"));
  EXPECT_EQ(set_aside(RescuePart::parameters, 5).value_or(99), 0U) << "again: nothing is left";
}

TEST_F(RecoveryFilesTest, ASecondSetInOneFolderCoversNothing) {
  put("var/state/ttc/mode", "first");
  ASSERT_TRUE(set_aside(RescuePart::state, 1));
  put("var/state/ttc/mode", "second");
  ASSERT_TRUE(set_aside(RescuePart::state, 1));

  EXPECT_EQ(content("var/set_aside/1/state/ttc/mode"), "first");
  EXPECT_EQ(content("var/set_aside/1/state/ttc/mode.2"), "second");
}

TEST_F(RecoveryFilesTest, TheStateIsSetAsideWithoutCountersAndKeys) {
  for (const char* name :
       {"telecommands.0", "link_state", "key_selection.a", "frame_counts", "transmitter", "mode", "stores"})
    put(std::string("var/state/ttc/") + name, name);
  put("var/state/ring/faults.log", "ledger");
  put("var/state/ring/membership", "without maintenance");
  put("var/state/boot/record_a", "boot");
  put("var/state/timing/incarnation", "7");

  ASSERT_TRUE(set_aside(RescuePart::state, 1));

  for (const char* name : {"ttc/telecommands.0", "ttc/link_state", "ttc/key_selection.a", "ttc/frame_counts",
                           "ttc/transmitter", "ring/faults.log", "boot/record_a", "timing/incarnation"})
    EXPECT_TRUE(exists(std::string("var/state/") + name)) << name;
  EXPECT_FALSE(exists("var/state/ttc/mode")) << "without it ttc starts in safe mode";
  EXPECT_FALSE(exists("var/state/ttc/stores"));
  EXPECT_FALSE(exists("var/state/ring/membership"));
}

TEST_F(RecoveryFilesTest, GoldenIsOneStepForAllAndMayBeCutAnywhere) {
  put("var/versions/ttc/table_a", "rubbish");
  put("var/store/events/1", "packets");
  put("var/state/ttc/mode", "nominal");
  put("var/state/ttc/telecommands.0", "rubbish");

  EXPECT_NE(take_measures(suite::BootStep::golden, 2), "") << "no golden copies: said";

  EXPECT_FALSE(exists("var/versions"));
  EXPECT_FALSE(exists("var/store"));
  EXPECT_FALSE(exists("var/state/ttc/mode"));
  EXPECT_EQ(content("var/set_aside/2/versions/ttc/table_a"), "rubbish");
  EXPECT_EQ(content("var/set_aside/2/state/ttc/telecommands.0"), "rubbish");
}

TEST_F(RecoveryFilesTest, LastGoodLeavesAVersionOnProbation) {
  put("program", "#!/bin/sh\n");
  update::PosixVersionFiles version_files(at("var/versions/ttc"));
  ASSERT_TRUE(version_files.lock(milliseconds(100)));
  update::VersionStore store(version_files, "ttc");
  const auto number = store.add(at("program"), "test", UtcTime{});
  ASSERT_TRUE(number) << number.error();
  ASSERT_TRUE(store.use(*number, milliseconds(1000), "test"));

  EXPECT_EQ(take_measures(suite::BootStep::last_good, 1), "");

  EXPECT_EQ(store.read().table.active(), update::golden);
  EXPECT_EQ(store.read().table.find(*number)->state, update::VersionState::failed);
}

TEST_F(RecoveryFilesTest, DamagedAndLostFilesComeBackFromTheirGoldenCopies) {
  put("opt/bin/ttc_node", "the program");
  put("opt/bin/timing_node", "another");
  make_golden({"opt/bin/ttc_node", "opt/bin/timing_node"});
  std::filesystem::remove(at("opt/bin/timing_node"));
  put("opt/bin/ttc_node", "the pr");

  const auto count = files().mend(Mend::everything);

  ASSERT_TRUE(count) << count.error().text;
  EXPECT_EQ(count->mended, 2U);
  EXPECT_EQ(content("opt/bin/ttc_node"), "the program");
  struct stat info {};
  ASSERT_EQ(stat(at("opt/bin/timing_node").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 07777U, 0755U);
}

TEST_F(RecoveryFilesTest, ADamagedCopyReplacesNothing) {
  put("opt/bin/ttc_node", "the program");
  make_golden({"opt/bin/ttc_node"});
  put("var/golden/" + to_digits(sha256_of(as_octets("the program"))), "rubbish");
  put("opt/bin/ttc_node", "changed");

  const auto count = files().mend(Mend::everything);

  ASSERT_TRUE(count);
  EXPECT_EQ(count->left, 1U);
  EXPECT_EQ(content("opt/bin/ttc_node"), "changed");
}

TEST_F(RecoveryFilesTest, AStepDownLeavesWhatWasChangedOnPurpose) {
  put("etc/deployment.yaml", "old");
  make_golden({"etc/deployment.yaml"});
  std::filesystem::remove(at("etc/deployment.yaml"));
  put("etc/deployment.yaml", "new, by hand");

  ASSERT_TRUE(files().mend(Mend::damage));
  EXPECT_EQ(content("etc/deployment.yaml"), "new, by hand");
  ASSERT_TRUE(files().mend(Mend::everything));
  EXPECT_EQ(content("etc/deployment.yaml"), "old");
}

TEST_F(RecoveryFilesTest, AFileOfTheGroundTakesThePlaceAndTheOldOneIsKept) {
  put("var/files/new_deployment", "from the ground");
  put("etc/deployment.yaml", "damaged");

  const auto restored = files().restore("new_deployment", at("etc/deployment.yaml").string(), 3);

  ASSERT_TRUE(restored) << restored.error().text;
  EXPECT_EQ(content("etc/deployment.yaml"), "from the ground");
  EXPECT_EQ(read_file(at("var/set_aside/3") / at("etc/deployment.yaml").relative_path()).value_or(""),
            "damaged");
  put("var/files/node", "a program");
  ASSERT_TRUE(files().restore("node", at("opt/bin/lost_node").string(), 4));
  struct stat info {};
  ASSERT_EQ(stat(at("opt/bin/lost_node").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 07777U, 0755U) << "a program";
}

TEST_F(RecoveryFilesTest, NothingIsRestoredOutsideTheSuiteOrInThePlaceOfACounter) {
  put("var/files/f", "x");
  for (const std::string target :
       {"/etc/passwd", "../outside", "keys/tc_uplink.key", "state/ttc/link_state", "state/boot/step_a",
        "state/ttc/../ttc/link_state", "set_aside/1/x", "", "state/./ttc/telecommands.0", "golden/manifest_a",
        "run/stopping", "state", "state/ttc/transmitter"})
    EXPECT_EQ(files().restore("f", target, 1).error().code, failure::not_restorable) << target;
  EXPECT_EQ(files().restore("../x", "log/x", 1).error().code, failure::file_not_found);
  EXPECT_TRUE(files().restore("f", "state/ttc/parameters.yaml", 1));
}

TEST_F(RecoveryFilesTest, NoAbsoluteTargetReachesAKeyOrWhatIsNotTheSuites) {
  put("var/files/f", "x");
  put("etc/keys/tc.key", "secret");
  put("etc/tc_ad.yaml", "secret");
  put("etc/passwd", "root");
  put("opt/data", "x");
  put("var/keys/tc.key", "secret");
  put("rescue_a/settings", "keys");
  settings_.associations = {{.spi = 1, .key_file = at("etc/keys/tc.key").string()},
                            {.spi = 2, .key_file = at("etc/tc_ad.yaml").string()}};
  make_golden({"etc/keys/tc.key"});
  std::filesystem::create_directories(at("opt/lib"));
  std::filesystem::create_directory_symlink(at("etc/keys"), at("opt/lib/innocent"));
  std::filesystem::create_directory_symlink(at("etc"), at("var/log"));
  std::filesystem::create_hard_link(at("etc/keys/tc.key"), at("etc/copy.yaml"));

  for (const std::string target :
       {"etc/keys/tc.key", "etc/tc_ad.yaml", "etc/passwd", "opt/data", "var/keys/tc.key", "rescue_a/settings",
        "opt/lib/innocent/tc.key", "etc/copy.yaml", "var/golden/manifest_a", "var/state/ttc/link_state"})
    EXPECT_EQ(files().restore("f", at(target).string(), 1).error().code, failure::not_restorable) << target;
  EXPECT_FALSE(files().restore("f", "log/passwd", 1)) << "no link leads out of VAR";
  EXPECT_EQ(content("etc/keys/tc.key"), "secret");

  for (const std::string target : {"etc/deployment.yaml", "etc/base.yaml", "opt/bin/ttc_node",
                                   "opt/lib/libsrfs_base.so.0", "opt/share/srfs/core/core.yaml"})
    EXPECT_TRUE(files().restore("f", at(target).string(), 1)) << target;
  EXPECT_TRUE(files().restore("f", at("var/state/ttc/parameters.yaml").string(), 1)) << "as the relative one";
}

TEST_F(RecoveryFilesTest, InAPrefixThatOthersShareAGoldenCopyMustTell) {
  settings_.program = "/usr/bin/srfs";
  put("var/files/f", "x");
  put("lib/of_the_suite", "good");
  make_golden({"lib/of_the_suite"});

  EXPECT_EQ(files().restore("f", "/usr/bin/no_such_program", 1).error().code, failure::not_restorable);
  EXPECT_TRUE(files().restore("f", at("lib/of_the_suite").string(), 1));
}

TEST_F(RecoveryFilesTest, OfWhatIsSetAsideTheOldestGoesAndTheNewestStays) {
  for (int number = 1; number <= 12; ++number)
    put("var/set_aside/" + std::to_string(number) + "/state/ttc/mode", "x");
  put("var/set_aside/notes", "of an operator");

  EXPECT_EQ(files().make_room(RoomFor::measures), 12U - (RecoveryFiles::most_set_aside - 1));

  EXPECT_FALSE(exists("var/set_aside/5"));
  EXPECT_TRUE(exists("var/set_aside/6"));
  EXPECT_TRUE(exists("var/set_aside/12"));
  EXPECT_TRUE(exists("var/set_aside/notes"));
  EXPECT_EQ(files().make_room(RoomFor::measures), 0U);
}

TEST_F(RecoveryFilesTest, TheNewestStaysAlsoWhenTheRecordOfItsNumberIsLost) {
  for (int number = 5; number <= 12; ++number)
    put("var/set_aside/" + std::to_string(number) + "/state/ttc/mode", "old");
  put("var/set_aside/4000000000/x", "of an operator");
  put("var/set_aside/013/x", "of an operator");

  (void)files().make_room(RoomFor::measures);
  const std::uint32_t number = files().next_number(0);
  put("var/state/ttc/mode", "newest");
  ASSERT_TRUE(set_aside(RescuePart::state, number));
  (void)files().make_room(RoomFor::measures);

  EXPECT_EQ(number, 13U);
  EXPECT_EQ(content("var/set_aside/13/state/ttc/mode"), "newest");
  EXPECT_FALSE(exists("var/set_aside/5"));
  EXPECT_TRUE(exists("var/set_aside/4000000000"));
  EXPECT_TRUE(exists("var/set_aside/013"));
  EXPECT_EQ(files().next_number(40), 41U) << "one that was recorded and not made";
}

TEST_F(RecoveryFilesTest, LongWorkReportsItsProgressFileByFile) {
  int steps = 0;
  const RecoveryFiles files(settings_, [&steps] { ++steps; });
  for (int number = 1; number <= 8; ++number)
    for (const char* name : {"/store/events/1", "/store/events/2", "/store/housekeeping/1"})
      put("var/set_aside/" + std::to_string(number) + name, "packets");
  std::filesystem::create_directory_symlink(at("var/set_aside/8"), at("var/set_aside/1/store/link"));

  EXPECT_EQ(files.make_room(RoomFor::measures), 1U);
  EXPECT_GE(steps, 3);
  EXPECT_FALSE(exists("var/set_aside/1"));
  EXPECT_EQ(content("var/set_aside/8/store/events/1"), "packets") << "no link is followed";

  put("opt/bin/ttc_node", "the program");
  put("opt/bin/timing_node", "another");
  make_golden({"opt/bin/ttc_node", "opt/bin/timing_node"});
  steps = 0;
  ASSERT_TRUE(files.mend(Mend::everything));
  EXPECT_EQ(steps, 2) << "both are whole";
}

TEST_F(RecoveryFilesTest, AReserveOfTheDiskIsKeptOnce) {
  files().keep_reserve();
  files().keep_reserve();

  struct stat info {};
  ASSERT_EQ(stat(at("var/set_aside/reserve").c_str(), &info), 0);
  EXPECT_EQ(info.st_size, RecoveryFiles::reserve_octets);
  EXPECT_GE(info.st_blocks * 512, RecoveryFiles::reserve_octets) << "allocated";
}

TEST_F(RecoveryFilesTest, AHundredResetsLeaveABoundedNumberOfFolders) {
  for (std::uint32_t number = 1; number <= 100; ++number) {
    put("var/state/ttc/mode", std::to_string(number));
    (void)files().make_room(RoomFor::measures);
    ASSERT_TRUE(set_aside(RescuePart::state, number));
  }
  std::size_t folders = 0;
  for (const auto& entry : std::filesystem::directory_iterator(at("var/set_aside")))
    folders += entry.is_directory() ? 1 : 0;
  EXPECT_EQ(folders, RecoveryFiles::most_set_aside);
  EXPECT_EQ(content("var/set_aside/100/state/ttc/mode"), "100");
}

TEST_F(RecoveryFilesTest, ALogGoesIntoTheOutboxAndAKeyDoesNot) {
  put("var/log/ttc.log", "lines");
  put("var/keys/tc_uplink.key", "secret");
  put("var/keys/session/session_keys.1", "secret");
  std::filesystem::create_symlink(at("var/keys"), at("var/log/innocent"));

  EXPECT_EQ(files().fetch("log/ttc.log").value_or(""), "log_ttc.log");
  EXPECT_EQ(content("var/files/outbox/log_ttc.log"), "lines");
  EXPECT_EQ(files().fetch("keys/tc_uplink.key").error().code, failure::not_restorable);
  EXPECT_EQ(files().fetch("keys/session/session_keys.1").error().code, failure::not_restorable);
  EXPECT_FALSE(files().fetch("log/innocent/tc_uplink.key")) << "no link is followed";
  EXPECT_FALSE(files().fetch("log/../keys/tc_uplink.key"));
  EXPECT_FALSE(files().fetch("./keys/tc_uplink.key"));
  EXPECT_FALSE(files().fetch("golden/manifest_a")) << "copies of keys lie there, too";
}

}  // namespace
}  // namespace srfs::rescue
