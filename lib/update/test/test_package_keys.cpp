// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/package_keys.hpp"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "tests/temporary_folder.hpp"

namespace srfs::update {
namespace {

using testing::HasSubstr;
using testing::Not;

unsigned mode_of(const std::filesystem::path& file) {
  return static_cast<unsigned>(std::filesystem::status(file).permissions());
}

struct PackageKeysTest : testing::Test {
  testing_support::TemporaryFolder folder;
  std::filesystem::path seed_file = folder.path() / "team.seed";
  std::filesystem::path public_file = folder.path() / "package.pub";
};

TEST_F(PackageKeysTest, ComeBackFromTheirFilesWhichOthersCannotRead) {
  const SigningSeed seed = new_seed();
  EXPECT_NE(seed, new_seed());
  ASSERT_TRUE(save_new_seed(seed_file, seed));
  ASSERT_TRUE(save_new_public_key(public_file, public_key_of(seed)));
  EXPECT_EQ(mode_of(seed_file), 0600U);
  EXPECT_EQ(mode_of(public_file), 0644U);
  EXPECT_EQ(load_seed(seed_file), seed);
  EXPECT_EQ(load_public_key(public_file), public_key_of(seed));
  EXPECT_EQ(*read_file(public_file), to_hex(public_key_of(seed)) + "\n");
}

TEST_F(PackageKeysTest, NeverTakeTheirPlaceFromWhatIsThere) {
  ASSERT_TRUE(save_new_seed(seed_file, SigningSeed{1}));
  const auto again = save_new_seed(seed_file, SigningSeed{2});
  ASSERT_FALSE(again);
  EXPECT_THAT(again.error().message, HasSubstr("exists already"));
  EXPECT_EQ(load_seed(seed_file), SigningSeed{1});
  std::filesystem::create_symlink(folder.path() / "elsewhere", public_file);
  EXPECT_FALSE(save_new_public_key(public_file, PublicKey{1}));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "elsewhere"));
}

TEST_F(PackageKeysTest, AreRefusedWhenOthersMayReadTheSeedOrTheyAreNoKeys) {
  ASSERT_TRUE(save_new_seed(seed_file, SigningSeed{1}));
  ASSERT_EQ(chmod(seed_file.c_str(), 0640), 0);
  EXPECT_THAT(load_seed(seed_file).error().message, HasSubstr("expected mode 0600"));

  EXPECT_THAT(load_public_key(public_file).error().message, HasSubstr("package.pub"));
  const std::string secret = std::string(63, 'a');
  for (const std::string& text : {std::string(), secret, secret + "aa", secret + "x"}) {
    std::ofstream(public_file) << text;
    const auto loaded = load_public_key(public_file);
    ASSERT_FALSE(loaded) << text;
    EXPECT_THAT(loaded.error().message, HasSubstr("64 hexadecimal digits"));
    EXPECT_THAT(loaded.error().message, Not(HasSubstr("aaa")));
  }
  EXPECT_FALSE(load_seed(folder.path()));
}

}  // namespace
}  // namespace srfs::update
