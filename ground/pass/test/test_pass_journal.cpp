// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.hpp"
#include "ground/pass/pass_journal.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::ground::pass {
namespace {

using testing_support::TemporaryFolder;

PassJournal some_journal() {
  PassJournal journal{.plan = "evening", .suspended = true, .left_out = 3};
  Item sent{.kind = ItemKind::telecommand,
            .key = "0123456789abcdef",
            .state = ItemState::ordered,
            .token = "evening-1"};
  sent.changed = UtcTime(seconds(1'800'000'000));
  Item found = item_of_file("images/a \"b\".fits", 123'456, 7);
  found.state = ItemState::failed;
  found.operation = 42;
  found.failures = 3;
  found.detail = "no such file";
  journal.items = {sent, found};
  journal.flown = {{.began = UtcTime(seconds(5)),
                    .ended = UtcTime(seconds(9)),
                    .end = "set",
                    .down_octets = 7,
                    .items_done = 2},
                   {.began = UtcTime(seconds(50))}};
  return journal;
}

TEST(PassJournal, IsReadAsItWasWritten) {
  const PassJournal written = some_journal();
  const auto read = decode_journal(encode_journal(written));
  ASSERT_TRUE(read);
  EXPECT_EQ(encode_journal(*read), encode_journal(written));
  EXPECT_EQ(read->items[1].path, "images/a \"b\".fits");
  EXPECT_EQ(read->items[1].kind, ItemKind::down);
  EXPECT_FALSE(read->flown[1].ended);
}

TEST(PassJournal, IsDamagedWithAnyOctetChangedOrCut) {
  const std::string text = encode_journal(some_journal());
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string changed = text;
    changed[i] = static_cast<char>(changed[i] ^ 1);
    EXPECT_FALSE(decode_journal(changed)) << i;
    EXPECT_FALSE(decode_journal(text.substr(0, i))) << i;
  }
}

TEST(PassJournal, OfAnotherProgramIsNone) {
  EXPECT_FALSE(decode_journal("{} 62cd61d5\n"));
}

TEST(JournalFile, SurvivesTheLossOfOneCopyButNotOfBoth) {
  const TemporaryFolder folder;
  JournalFile file(folder.path(), "evening");
  ASSERT_TRUE(file.load());
  PassJournal journal = some_journal();
  ASSERT_TRUE(file.store(journal));
  ASSERT_TRUE(file.store(journal));

  std::ofstream(folder.path() / "evening.a") << "rotten";
  const auto one = JournalFile(folder.path(), "evening").load();
  ASSERT_TRUE(one);
  EXPECT_EQ(one->revision, 2U);
  EXPECT_EQ(one->items.size(), 2U);

  std::ofstream(folder.path() / "evening.b") << "rotten";
  const auto none = JournalFile(folder.path(), "evening").load();
  ASSERT_FALSE(none) << "what was sent would be sent again";
  EXPECT_THAT(none.error(), ::testing::HasSubstr("damaged"));
}

TEST(JournalFile, IsNotWrittenBeyondItsBound) {
  const TemporaryFolder folder;
  JournalFile file(folder.path(), "evening");
  PassJournal journal = some_journal();
  ASSERT_TRUE(file.store(journal));
  for (int i = 0; i < 400; ++i)
    journal.items.push_back(item_of_file(std::string(200, 'x') + std::to_string(i), 1, 1));
  EXPECT_FALSE(file.store(journal));
  EXPECT_EQ(JournalFile(folder.path(), "evening").load()->items.size(), 2U);
}

TEST(Items, TakeTheirStatesFromTheJournalAndGiveThemBack) {
  PassPlan plan;
  ScriptStep step;
  step.text = "ping";
  plan.script = {step, step};
  PassJournal journal;
  auto items = with_journal(items_of(plan), journal);
  EXPECT_FALSE(take_items(journal, items)) << "nothing happened yet";
  items[1].state = ItemState::done;
  items.push_back(item_of_file("a.fits", 5, 1));
  EXPECT_TRUE(take_items(journal, items));
  EXPECT_FALSE(take_items(journal, items));

  const auto again = with_journal(items_of(plan), journal);
  ASSERT_EQ(again.size(), 3U);
  EXPECT_EQ(again[0].state, ItemState::waiting);
  EXPECT_EQ(again[1].state, ItemState::done);
  EXPECT_EQ(again[2].path, "a.fits");

  plan.script.clear();
  EXPECT_EQ(with_journal(items_of(plan), journal).size(), 1U) << "what the plan does not say any more";
}

}  // namespace
}  // namespace srfs::ground::pass
