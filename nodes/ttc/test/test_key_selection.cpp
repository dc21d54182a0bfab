// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/key_selection.hpp"

#include <gtest/gtest.h>

#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

const KeySelection second{.generation = 2, .sets = {{0, KeySet::b}, {3, KeySet::a}}};

class StoredKeySelection : public testing::Test {
 protected:
  const testing_support::TemporaryFolder temporary_;
  const std::filesystem::path path_ = temporary_.path() / "key_selection";
};

TEST(KeySelectionText, IsReadAsItWasWritten) {
  EXPECT_EQ(decode_key_selection(encode_key_selection(second)), second);
  EXPECT_EQ(decode_key_selection(encode_key_selection({})), KeySelection{});
}

TEST(KeySelectionText, IsRefusedWithAnyOctetChangedOrMissing) {
  const std::string text = encode_key_selection(second);
  for (std::size_t i = 0; i < text.size(); ++i) {
    EXPECT_FALSE(decode_key_selection(text.substr(0, i))) << i;
    for (const char other : {'0', '9', 'b', ' ', '\n', '\0'}) {
      std::string changed = text;
      changed[i] = other;
      if (changed == text) continue;
      EXPECT_FALSE(decode_key_selection(changed)) << i;
    }
  }
}

TEST_F(StoredKeySelection, LiesInTwoCopiesOfWhichTheOneWithMoreChangesIsTrue) {
  EXPECT_FALSE(key_selection_file(path_).load().existed());
  ASSERT_EQ(key_selection_file(path_).store(second).copies, 2U);
  ASSERT_TRUE(write_file_atomically(path_.string() + ".0",
                                    encode_key_selection({.generation = 1, .sets = {{0, KeySet::a}}})));
  EXPECT_EQ(key_selection_file(path_).load().state, second);
  ASSERT_TRUE(write_file_atomically(path_.string() + ".1", "damage"));
  EXPECT_EQ(key_selection_file(path_).load().state->generation, 1U);
}

}  // namespace
}  // namespace srfs
