// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/command_keys.hpp"

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include <sys/stat.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "base/file.hpp"
#include "suite/commanding/command_authority.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::suite {
namespace {

class CommandKeys : public testing::Test {
 protected:
  ~CommandKeys() override { forget_command_keys(var_); }
  [[nodiscard]] CommandKey of_suite() const { return suite_command_key(var_).value(); }
  [[nodiscard]] CommandKey of(const std::string& node) const { return command_key(var_, node).value(); }

  const testing_support::TemporaryFolder folder_;
  const VarPaths var_ = VarPaths::at(folder_.path());
};

TEST_F(CommandKeys, TheKeyOfANodeIsWhatTtcMakesOfTheSuitesAndDiffersFromAllOthers) {
  ASSERT_TRUE(hand_out_command_key(var_, "payload_eps"));
  EXPECT_EQ(of("payload_eps"), command_key_of(of_suite(), "payload_eps"));
  EXPECT_NE(of("payload_eps"), of("payload_adcs"));
  EXPECT_NE(of("payload_eps"), of_suite());
}

TEST_F(CommandKeys, ARestartFindsTheSameKeyAndTheNextStartOfTheSuiteAnother) {
  const CommandKey before = of("payload_eps");
  ASSERT_TRUE(hand_out_command_key(var_, "payload_eps"));
  EXPECT_EQ(of("payload_eps"), before);

  forget_command_keys(var_);
  EXPECT_NE(of("payload_eps"), before);
}

TEST_F(CommandKeys, TheSuitesAloneWhenItIsLostComesBackFromTtcAndChangesNoNodes) {
  const CommandKey suite_key = of_suite();
  const CommandKey before = of("payload_eps");
  ASSERT_TRUE(std::filesystem::remove(order_keys(var_) / "command_key"));
  EXPECT_EQ(of("payload_eps"), before);
  ASSERT_TRUE(hand_out_command_key(var_, "payload_eps"));
  EXPECT_FALSE(std::filesystem::exists(order_keys(var_) / "command_key")) << "a restart of a node makes none";

  EXPECT_EQ(suite_command_key(var_, suite_key).value(), suite_key);
  EXPECT_EQ(of_suite(), suite_key);
  EXPECT_EQ(of("payload_eps"), before);
}

TEST_F(CommandKeys, ANodeFollowsASuitesKeyThatWasMadeAnew) {
  const CommandKey before = of("payload_eps");
  ASSERT_TRUE(std::filesystem::remove(order_keys(var_) / "command_key"));
  const CommandKey suite_key = of_suite();  // of a ttc that has just started
  EXPECT_NE(of("payload_eps"), before);
  EXPECT_EQ(of("payload_eps"), command_key_of(suite_key, "payload_eps"));
  EXPECT_EQ(suite_command_key(var_, CommandKey{1}).value(), suite_key) << "what is there holds";
}

TEST_F(CommandKeys, AStartingTtcGivesEachNodeTheKeyThatFollowsFromItsOwn) {
  (void)of("payload_eps");
  ASSERT_TRUE(std::filesystem::remove(order_keys(var_) / "command_key"));
  const CommandSigner signer(var_, false, [] { return std::vector<std::string>{"payload_eps", "timing"}; });
  const CommandKey suite_key = of_suite();
  for (const char* node : {"payload_eps", "timing"}) {
    // As a confined node reads it, for which the suite's does not exist.
    const auto file = read_file(order_keys(var_) / ("of_" + std::string(node)) / "command_key", 64);
    ASSERT_TRUE(file) << node;
    const CommandKey key = command_key_of(suite_key, node);
    EXPECT_TRUE(std::equal(file->begin(), file->end(), key.begin(), key.end(), [](char a, std::uint8_t b) {
      return static_cast<std::uint8_t>(a) == b;
    })) << node;
  }
}

TEST_F(CommandKeys, TtcWritesTheSuitesKeysAgainWhenTheWholeFolderWasRemoved) {
  const ros::SealKey seal = suite_seal_key(var_).value();
  ros::seal_datagrams({seal}, [] { return std::nullopt; });
  CommandSigner signer(var_, false, [] { return std::vector<std::string>{"payload_eps"}; });
  const CommandKey suite_key = of_suite();
  std::filesystem::remove_all(order_keys(var_));
  signer.keep_keys();
  EXPECT_EQ(of_suite(), suite_key);
  EXPECT_EQ(find_seal_key(var_), seal);
  EXPECT_EQ(of("payload_eps"), command_key_of(suite_key, "payload_eps"));
}

TEST_F(CommandKeys, AFileThatIsCutShortIsMadeAnew) {
  for (const std::string& content : {std::string(), std::string("short"), std::string(200, 'x')}) {
    (void)of_suite();
    ASSERT_TRUE(write_file_atomically(order_keys(var_) / "command_key", content));
    const CommandKey made = of_suite();
    EXPECT_EQ(of_suite(), made) << content.size();
    EXPECT_EQ(std::filesystem::file_size(order_keys(var_) / "command_key"), made.size());
  }
}

TEST_F(CommandKeys, AFileThatCannotBeReadNowIsNotMadeAnew) {
  if (geteuid() == 0) GTEST_SKIP() << "root reads everything";
  const ros::SealKey seal = suite_seal_key(var_).value();
  const CommandKey suite_key = of_suite();
  for (const char* name : {"seal/seal_key", "command_key"})
    ASSERT_EQ(chmod((order_keys(var_) / name).c_str(), 0), 0);
  EXPECT_FALSE(suite_seal_key(var_));
  EXPECT_FALSE(suite_command_key(var_));
  EXPECT_FALSE(seal_keys(var_, "payload_eps"));
  EXPECT_FALSE(hand_out_seal_key(var_, "payload_eps", true));
  for (const char* name : {"seal/seal_key", "command_key"})
    ASSERT_EQ(chmod((order_keys(var_) / name).c_str(), 0600), 0);
  EXPECT_EQ(suite_seal_key(var_).value(), seal);
  EXPECT_EQ(of_suite(), suite_key);
}

/// As above, for root too: in the place of the file lies what no process can read as one.
TEST_F(CommandKeys, WhatIsNoFileIsNotReplaced) {
  (void)suite_seal_key(var_).value();
  const auto file = order_keys(var_) / "seal/seal_key";
  std::filesystem::rename(file, file.string() + ".good");
  std::filesystem::create_directory(file);
  EXPECT_FALSE(suite_seal_key(var_));
  EXPECT_TRUE(std::filesystem::is_directory(file));
  std::filesystem::remove(file);
  std::filesystem::rename(file.string() + ".good", file);
  EXPECT_TRUE(suite_seal_key(var_));
}

TEST_F(CommandKeys, AnUplinkedNodeSealsByAKeyOfItsOwn) {
  const ros::SealKey suite_key = suite_seal_key(var_).value();
  ASSERT_TRUE(hand_out_seal_key(var_, "payload_eps", true));
  ASSERT_TRUE(hand_out_seal_key(var_, "payload_adcs", false));
  EXPECT_EQ(seal_keys(var_, "payload_adcs"), (Result<ros::SealKeys, std::string>(ros::SealKeys{suite_key})));
  // As one reads it to which the suite's is closed.
  const auto seal = order_keys(var_) / "seal/seal_key";
  std::filesystem::rename(seal, seal.string() + ".hidden");
  std::filesystem::create_directory(seal);
  const ros::SealKeys own{ros::limited_seal_key(suite_key, "payload_eps"), "payload_eps",
                          ros::seal_key_among_limited(suite_key)};
  EXPECT_EQ(seal_keys(var_, "payload_eps"), (Result<ros::SealKeys, std::string>(own)));
  EXPECT_FALSE(seal_keys(var_, "payload_adcs")) << "which is not uplinked waits for the suite's";
}

/// All that ran before have the key that was lost: with another one they would be foreign to each other.
TEST_F(CommandKeys, ANodeThatRunsFillsNoFolderThatWasRemoved) {
  const ros::SealKeys suite{suite_seal_key(var_).value()};
  EXPECT_EQ(find_seal_keys(var_, "timing"), std::optional(suite));
  std::filesystem::remove_all(order_keys(var_));
  EXPECT_EQ(find_seal_keys(var_, "timing"), std::nullopt);
  EXPECT_FALSE(std::filesystem::exists(order_keys(var_)));
  EXPECT_EQ(suite_seal_key(var_, suite.key).value(), suite.key) << "ttc writes it again";
  EXPECT_EQ(find_seal_keys(var_, "timing"), std::optional(suite));
}

TEST_F(CommandKeys, ANodeThatIsUplinkedNoMoreLosesItsOwnSeal) {
  ASSERT_TRUE(hand_out_seal_key(var_, "payload_eps", true));
  EXPECT_TRUE(std::filesystem::exists(order_keys(var_) / "of_payload_eps/seal_key"));
  ASSERT_TRUE(hand_out_seal_key(var_, "payload_eps", false));
  EXPECT_FALSE(std::filesystem::exists(order_keys(var_) / "of_payload_eps/seal_key"));
}

TEST_F(CommandKeys, WhenTheSealIsMadeAnewUplinkedNodesGetTheirsOfIt) {
  ASSERT_TRUE(hand_out_seal_key(var_, "payload_eps", true));
  const auto own = order_keys(var_) / "of_payload_eps/seal_key";
  const std::string before = read_file(own, 64).value();
  ASSERT_TRUE(std::filesystem::remove(order_keys(var_) / "seal/seal_key"));
  ASSERT_TRUE(hand_out_seal_key(var_, "timing", false));
  const std::string after = read_file(own, 64).value();
  EXPECT_NE(after, before);
  const auto key = ros::limited_seal_key(suite_seal_key(var_).value(), "payload_eps");
  EXPECT_TRUE(std::equal(key.begin(), key.end(), after.begin(),
                         [](std::uint8_t a, char b) { return a == static_cast<std::uint8_t>(b); }));
}

TEST_F(CommandKeys, TheSealThatSomebodyStillKnowsComesBack) {
  const ros::SealKey seal = suite_seal_key(var_).value();
  std::filesystem::remove_all(order_keys(var_));
  EXPECT_EQ(suite_seal_key(var_, seal).value(), seal);
  EXPECT_EQ(suite_seal_key(var_).value(), seal);
}

TEST_F(CommandKeys, OtherUsersCannotReadThem) {
  (void)of("payload_eps");
  for (const char* name : {"command_key", "of_payload_eps/command_key"}) {
    struct stat status {};
    ASSERT_EQ(stat((order_keys(var_) / name).c_str(), &status), 0) << name;
    EXPECT_EQ(status.st_mode & 07777U, 0600U) << name;
  }
}

TEST_F(CommandKeys, ANodesFileThatWasExchangedIsMadeAnewAtItsNextStart) {
  const CommandKey before = of("payload_eps");
  ASSERT_TRUE(write_file_atomically(order_keys(var_) / "of_payload_eps/command_key", std::string(32, 'x')));
  ASSERT_TRUE(hand_out_command_key(var_, "payload_eps"));
  EXPECT_EQ(of("payload_eps"), before);
}

TEST_F(CommandKeys, LieWhereAConfinedNodeMayReadItsOwnAlone) {
  (void)of("payload_eps");
  (void)of("payload_adcs");
  (void)suite_seal_key(var_).value();
  ASSERT_TRUE(hand_out_seal_key(var_, "payload_eps", true));
  const auto is_below = [](const std::filesystem::path& file, const std::filesystem::path& folder) {
    return file.string().starts_with(folder.string() + "/");
  };
  for (const bool uplinked : {false, true}) {
    std::set<std::string> readable;
    for (const auto& file : std::filesystem::recursive_directory_iterator(order_keys(var_))) {
      for (const auto& shared : {var_.memory(), var_.run(), var_.boot()})
        EXPECT_FALSE(is_below(file.path(), shared)) << file.path();
      for (const auto& folder : order_keys_for(var_, "payload_eps", uplinked)) {
        if (is_below(file.path(), folder))
          readable.insert(std::filesystem::relative(file.path(), order_keys(var_)));
      }
    }
    std::set<std::string> expected{"of_payload_eps/command_key", "of_payload_eps/seal_key"};
    if (!uplinked) expected.insert("seal/seal_key");
    EXPECT_EQ(readable, expected);
  }

  forget_command_keys(var_);
  EXPECT_FALSE(std::filesystem::exists(order_keys(var_)));
}

TEST_F(CommandKeys, AnotherUsersFolderInMemoryCostsNoCommand) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root";
  std::filesystem::create_directories(order_keys(var_));
  ASSERT_EQ(chown(order_keys(var_).c_str(), 65534, 65534), 0);
  const CommandKey key = of("payload_eps");
  EXPECT_TRUE(std::filesystem::exists(var_.root / "keys/orders/of_payload_eps/command_key"));
  EXPECT_EQ(key, command_key_of(of_suite(), "payload_eps"));

  forget_command_keys(var_);
  EXPECT_NE(of("payload_eps"), key);
}

}  // namespace
}  // namespace srfs::suite
