// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/command_keys.hpp"

#include <sys/stat.h>

#include <gtest/gtest.h>

#include "base/file.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::suite {
namespace {

class CommandKeys : public testing::Test {
 protected:
  ~CommandKeys() override { std::filesystem::remove_all(var_.memory()); }
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
  ASSERT_TRUE(std::filesystem::remove(var_.memory() / "command_key"));
  EXPECT_EQ(of("payload_eps"), before);
  ASSERT_TRUE(hand_out_command_key(var_, "payload_eps"));
  EXPECT_FALSE(std::filesystem::exists(var_.memory() / "command_key")) << "a restart of a node makes none";

  EXPECT_EQ(suite_command_key(var_, suite_key).value(), suite_key);
  EXPECT_EQ(of_suite(), suite_key);
  EXPECT_EQ(of("payload_eps"), before);
}

TEST_F(CommandKeys, ANodeFollowsASuitesKeyThatWasMadeAnew) {
  const CommandKey before = of("payload_eps");
  ASSERT_TRUE(std::filesystem::remove(var_.memory() / "command_key"));
  const CommandKey suite_key = of_suite();  // of a ttc that has just started
  EXPECT_NE(of("payload_eps"), before);
  EXPECT_EQ(of("payload_eps"), command_key_of(suite_key, "payload_eps"));
  EXPECT_EQ(suite_command_key(var_, CommandKey{1}).value(), suite_key) << "what is there holds";
}

TEST_F(CommandKeys, OtherUsersCannotReadThem) {
  (void)of("payload_eps");
  for (const char* name : {"command_key", "payload_eps.command_key"}) {
    struct stat status {};
    ASSERT_EQ(stat((var_.memory() / name).c_str(), &status), 0) << name;
    EXPECT_EQ(status.st_mode & 07777U, 0600U) << name;
  }
}

TEST_F(CommandKeys, ANodesFileThatWasExchangedIsMadeAnewAtItsNextStart) {
  const CommandKey before = of("payload_eps");
  ASSERT_TRUE(write_file_atomically(var_.memory() / "payload_eps.command_key", std::string(32, 'x')));
  ASSERT_TRUE(hand_out_command_key(var_, "payload_eps"));
  EXPECT_EQ(of("payload_eps"), before);
}

TEST_F(CommandKeys, AnotherUsersFolderInMemoryCostsNoCommand) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root";
  std::filesystem::create_directories(var_.memory());
  ASSERT_EQ(chown(var_.memory().c_str(), 65534, 65534), 0);
  const CommandKey key = of("payload_eps");
  EXPECT_TRUE(std::filesystem::exists(var_.run() / "payload_eps.command_key"));
  EXPECT_EQ(key, command_key_of(of_suite(), "payload_eps"));

  forget_command_keys(var_);
  EXPECT_NE(of("payload_eps"), key);
}

}  // namespace
}  // namespace srfs::suite
