// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <charconv>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/state_file.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

constexpr StateCodec<int> numbers{
    .encode = [](const int& number) { return std::to_string(number); },
    .decode = [](std::string_view text) -> std::optional<int> {
      int number = 0;
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
      if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
      return number;
    },
    .is_newer = [](const int& state, const int& than) { return state > than; },
};

class StateFileTest : public testing::Test {
 protected:
  StateFile<int> file(StateFile<int>::Writes writes = StateFile<int>::Writes::both) const {
    return {first_, second_, numbers, writes};
  }
  const testing_support::TemporaryFolder temporary_;
  const std::filesystem::path first_ = temporary_.path() / "state" / "a";
  const std::filesystem::path second_ = temporary_.path() / "state" / "b";
};

TEST_F(StateFileTest, HasNothingBeforeTheFirstWrite) {
  const auto found = file().load();
  EXPECT_FALSE(found.state);
  EXPECT_FALSE(found.existed());
}

TEST_F(StateFileTest, SurvivesTheLossOrDamageOfEitherCopy) {
  for (const auto& lost : {first_, second_}) {
    ASSERT_EQ(file().store(7).problem, "");
    std::filesystem::remove(lost);
    EXPECT_EQ(file().load().state, 7);

    ASSERT_EQ(file().store(8).problem, "");
    ASSERT_TRUE(write_file_atomically(lost, "8x"));
    const auto found = file().load();
    EXPECT_EQ(found.state, 8);
    EXPECT_THAT(found.damaged, testing::ElementsAre(lost));
  }
}

TEST_F(StateFileTest, TakesTheNewerCopyOfAWriteThatWasCutShort) {
  ASSERT_EQ(file().store(3).problem, "");
  ASSERT_TRUE(write_file_atomically(first_, "4"));
  EXPECT_EQ(file().load().state, 4);
  ASSERT_TRUE(write_file_atomically(second_, "5"));
  EXPECT_EQ(file().load().state, 5);
}

TEST_F(StateFileTest, SaysThatThereWasOneWhenBothAreDamaged) {
  ASSERT_TRUE(write_file_atomically(first_, "x"));
  ASSERT_TRUE(write_file_atomically(second_, std::string(StateFile<int>::largest_octets + 1, '1')));
  const auto found = file().load();
  EXPECT_FALSE(found.state);
  EXPECT_TRUE(found.existed());
  EXPECT_EQ(found.damaged.size(), 2U);
}

TEST_F(StateFileTest, SaysWhichCopyIsNotOnTheMediumAndTriesTheOther) {
  std::filesystem::create_directories(first_);  // a folder is in the way
  const auto stored = file().store(9);
  EXPECT_EQ(stored.copies, 1U);
  EXPECT_THAT(stored.problem, testing::HasSubstr(first_.string()));
  EXPECT_TRUE(stored.durable());
  EXPECT_EQ(file().load().state, 9);
  std::filesystem::remove(second_);
  std::filesystem::create_directories(second_);
  EXPECT_FALSE(file().store(10).durable());
}

TEST_F(StateFileTest, TakesACopyThatCannotBeExaminedForDamaged) {
  ASSERT_EQ(file().store(5).copies, 2U);
  std::filesystem::remove(first_);
  std::filesystem::create_symlink(first_, first_);  // a loop: neither there nor not
  const auto found = file().load();
  EXPECT_EQ(found.state, 5);
  EXPECT_THAT(found.damaged, testing::ElementsAre(first_));
}

TEST_F(StateFileTest, WritesTheOlderCopyWhereTheCopiesTakeTurns) {
  auto turns = file(StateFile<int>::Writes::in_turn);
  ASSERT_EQ(turns.store(1).problem, "");
  ASSERT_EQ(turns.store(2).problem, "");
  EXPECT_EQ(*read_file(first_), "1");
  EXPECT_EQ(*read_file(second_), "2");

  auto later = file(StateFile<int>::Writes::in_turn);
  EXPECT_EQ(later.load().state, 2);
  ASSERT_EQ(later.store(3).problem, "");
  EXPECT_EQ(*read_file(first_), "3") << "a new process spares the newest copy, too";
  EXPECT_EQ(*read_file(second_), "2");
}

TEST_F(StateFileTest, TakesTheNewestCopyWhereTheOlderOneCannotBeWritten) {
  auto turns = file(StateFile<int>::Writes::in_turn);
  ASSERT_EQ(turns.store(1).problem, "");
  ASSERT_EQ(turns.store(2).problem, "");
  std::filesystem::remove(first_);
  std::filesystem::create_directories(first_);
  for (const int number : {3, 4}) {
    const auto stored = turns.store(number);
    EXPECT_TRUE(stored.durable());
    EXPECT_NE(stored.problem, "");
    EXPECT_EQ(turns.load().state, number);
  }
}

}  // namespace
}  // namespace srfs
