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
  void damage(const char* copy) {
    ASSERT_TRUE(write_file_atomically(path_.string() + copy, "2 0:a 3:a 00000000\n"));
  }
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

TEST_F(StoredKeySelection, IsSetAWhereNothingWasStored) {
  const FoundKeySelection found = load_key_selection(path_);
  EXPECT_EQ(found.selection, KeySelection{});
  EXPECT_FALSE(found.existed);
  EXPECT_EQ(found.damaged_copies, 0U);
}

TEST_F(StoredKeySelection, OneDamagedCopyLeavesTheOther) {
  ASSERT_TRUE(store_key_selection(path_, second));
  for (const char* copy : {".0", ".1"}) {
    damage(copy);
    const FoundKeySelection found = load_key_selection(path_);
    EXPECT_EQ(found.selection, second) << copy;
    EXPECT_EQ(found.damaged_copies, 1U);
    ASSERT_TRUE(store_key_selection(path_, found.selection));
    EXPECT_EQ(load_key_selection(path_).damaged_copies, 0U);
  }
}

TEST_F(StoredKeySelection, OfTwoCopiesTheNewerOneIsTrue) {
  ASSERT_TRUE(write_file_atomically(path_.string() + ".1", encode_key_selection(second)));
  ASSERT_TRUE(write_file_atomically(path_.string() + ".0",
                                    encode_key_selection({.generation = 1, .sets = {{0, KeySet::a}}})));
  EXPECT_EQ(load_key_selection(path_).selection, second);
}

TEST_F(StoredKeySelection, BothDamagedIsSetAAndSaidSo) {
  ASSERT_TRUE(store_key_selection(path_, second));
  damage(".0");
  damage(".1");
  const FoundKeySelection found = load_key_selection(path_);
  EXPECT_EQ(found.selection, KeySelection{});
  EXPECT_EQ(found.damaged_copies, 2U);
}

TEST_F(StoredKeySelection, IsDurableWhenOneCopyIs) {
  std::filesystem::create_directories(path_.string() + ".0");  // cannot be replaced by a file
  EXPECT_TRUE(store_key_selection(path_, second));
  EXPECT_EQ(load_key_selection(path_).selection, second);
}

}  // namespace
}  // namespace srfs
