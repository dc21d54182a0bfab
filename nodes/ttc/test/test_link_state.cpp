// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/link_state.hpp"

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "nodes/ttc/link/link_state_file.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

namespace fs = std::filesystem;

LinkState state_of(std::uint64_t generation) {
  LinkState state;
  state.generation = generation;
  state.next_telecommand_id = 100 * generation;
  state.channels.push_back({.vc = 0, .farm = {.mode = wire::FarmMode::lockout, .vr = 9, .lockout = true}});
  state.associations.push_back({.spi = 1, .counter = 1000 + generation});
  return state;
}

class LinkStateOnDisk : public testing::Test {
 protected:
  void damage(std::streamoff offset) const {
    std::fstream f(path_, std::ios::in | std::ios::out | std::ios::binary);
    f.seekp(offset);
    f.put('\x5A');
  }
  const testing_support::TemporaryFolder folder_;
  const fs::path path_ = folder_.path() / "state" / "link_state";
};

TEST(LinkStateCopy, ComesBackAsItWas) {
  const auto copy = decode_link_state(encode_link_state(state_of(3)));
  ASSERT_TRUE(copy);
  EXPECT_EQ(*copy, state_of(3));
}

TEST(LinkStateCopy, IsRefusedWithAnySingleOctetChanged) {
  const Octets good = encode_link_state(state_of(3));
  for (std::size_t i = 0; i < good.size(); ++i) {
    Octets bad = good;
    bad[i] ^= 0x01;
    EXPECT_FALSE(decode_link_state(bad)) << i;
  }
}

TEST_F(LinkStateOnDisk, IsEmptyAtTheFirstStart) {
  const auto found = LinkStateFile(path_).load();
  EXPECT_FALSE(found.existed);
  EXPECT_EQ(found.state, LinkState{});
}

TEST_F(LinkStateOnDisk, TheNewestCopyCounts) {
  LinkStateFile file(path_);
  for (std::uint64_t generation = 1; generation <= 5; ++generation)
    ASSERT_TRUE(file.store(state_of(generation)));
  EXPECT_EQ(LinkStateFile(path_).load().state, state_of(5));
}

TEST_F(LinkStateOnDisk, OneDamagedCopyLeavesTheOther) {
  LinkStateFile file(path_);
  ASSERT_TRUE(file.store(state_of(4)));
  ASSERT_TRUE(file.store(state_of(5)));
  damage(4096 + 20);  // generation 5

  const auto found = LinkStateFile(path_).load();

  EXPECT_EQ(found.state, state_of(4));
  EXPECT_EQ(found.damaged_copies, 1U);
}

TEST_F(LinkStateOnDisk, ATornNewestCopyLeavesTheOneBeforeWhateverTheGenerations) {
  LinkStateFile file(path_);
  for (const std::uint64_t generation : {2U, 4U, 6U}) ASSERT_TRUE(file.store(state_of(generation)));
  damage(20);  // the third write went to the first copy

  EXPECT_EQ(LinkStateFile(path_).load().state, state_of(4));
}

TEST_F(LinkStateOnDisk, AfterARestartTheNewestValidCopyIsNotWrittenOver) {
  {
    LinkStateFile file(path_);
    for (const std::uint64_t generation : {2U, 4U, 6U}) ASSERT_TRUE(file.store(state_of(generation)));
  }
  LinkStateFile file(path_);
  ASSERT_EQ(file.load().state, state_of(6));
  ASSERT_TRUE(file.store(state_of(8)));
  damage(4096 + 20);  // generation 8

  EXPECT_EQ(LinkStateFile(path_).load().state, state_of(6));
}

TEST_F(LinkStateOnDisk, TwoDamagedCopiesAreNoLockOut) {
  LinkStateFile file(path_);
  ASSERT_TRUE(file.store(state_of(4)));
  ASSERT_TRUE(file.store(state_of(5)));
  damage(20);
  damage(4096 + 20);

  const auto found = LinkStateFile(path_).load();

  EXPECT_TRUE(found.existed);
  EXPECT_EQ(found.damaged_copies, 2U);
  EXPECT_EQ(found.state, LinkState{});
}

}  // namespace
}  // namespace srfs
