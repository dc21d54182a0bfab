// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/rescue/link_store.hpp"

#include <random>

#include <gtest/gtest.h>

#include "base/file.hpp"
#include "nodes/ttc/command/journal_file.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::rescue {
namespace {

constexpr MonotonicTime now{};

LinkState with_counter(std::uint64_t generation, std::uint64_t counter) {
  LinkState link;
  link.generation = generation;
  link.associations.push_back({.spi = 1, .counter = counter});
  return link;
}

/// The journal as ttc writes it, with an activity in its schedule.
void write_as_ttc(const std::filesystem::path& folder, const LinkState& link) {
  AcceptanceJournal journal("boot", milliseconds(0));
  journal.begin({}, 100, now);
  journal.on_link(link);
  ScheduledActivity activity;
  activity.id = 1;
  activity.packet = {1, 2, 3};
  ScheduleChange change;
  change.inserted.push_back(activity);
  (void)journal.change_schedule(change);
  JournalFile file(folder / "telecommands");
  JournalLog log(file);
  (void)log.load();
  const auto batch = journal.take_batch(true);
  ASSERT_TRUE(log.snapshot(*batch.snapshot));
}

AcceptanceJournal read_as_ttc(const std::filesystem::path& folder) {
  JournalFile file(folder / "telecommands");
  AcceptanceJournal journal("boot", milliseconds(0));
  for (const auto& record : JournalLog(file).load().records) EXPECT_TRUE(journal.apply(record));
  const LinkState copy = LinkStateFile(folder / "link_state").load().state;
  journal.begin(copy, copy.next_telecommand_id, now);
  return journal;
}

TEST(RescueLinkStore, GoesOnWithTheCountersOfTtcAndTtcWithItsOwn) {
  const testing_support::TemporaryFolder folder;
  write_as_ttc(folder.path(), with_counter(7, 1000));

  LinkStore store(folder.path());
  ASSERT_EQ(store.load(now).associations, with_counter(7, 1000).associations);
  ASSERT_TRUE(store.store(with_counter(8, 1001)));

  const auto journal = read_as_ttc(folder.path());
  EXPECT_EQ(journal.link().associations, with_counter(8, 1001).associations);
  EXPECT_EQ(journal.schedule().activities().size(), 1U) << "what is not rescue's stays";
}

TEST(RescueLinkStore, OneOfBothPlacesIsEnough) {
  for (const bool without_journal : {true, false}) {
    const testing_support::TemporaryFolder folder;
    write_as_ttc(folder.path(), with_counter(7, 1000));
    {
      LinkStore store(folder.path());
      (void)store.load(now);
      ASSERT_TRUE(store.store(with_counter(8, 1001)));
    }
    if (without_journal) {
      std::filesystem::remove(folder.path() / "telecommands.0");
      std::filesystem::remove(folder.path() / "telecommands.1");
    } else {
      std::filesystem::remove(folder.path() / "link_state");
    }
    EXPECT_EQ(LinkStore(folder.path()).load(now).associations, with_counter(8, 1001).associations);
  }
}

TEST(RescueLinkStore, ThatTheCountersAreLostIsNotedForTtc) {
  const testing_support::TemporaryFolder folder;
  ASSERT_TRUE(write_file_atomically(folder.path() / "telecommands.0", "rubbish"));

  EXPECT_EQ(LinkStore(folder.path()).load(now).generation, 0U);

  EXPECT_EQ(read_file(folder.path() / "counters_lost").value_or("none"), "");
}

TEST(RescueLinkStore, CountersOutliveTheJournalThatIsSetAside) {
  const testing_support::TemporaryFolder folder;
  write_as_ttc(folder.path(), with_counter(7, 1000));

  ASSERT_EQ(LinkStore(folder.path()).carry_counters_over(), "");
  for (const char* segment : {"telecommands.0", "telecommands.1"})
    std::filesystem::remove(folder.path() / segment);

  const auto journal = read_as_ttc(folder.path());
  EXPECT_EQ(journal.link().associations, with_counter(7, 1000).associations);
  EXPECT_TRUE(journal.schedule().activities().empty());
  EXPECT_GE(journal.next_id(), 100U) << "no id is used twice";
}

TEST(RescueLinkStore, NoCounterGoesBackWhateverDamageOnePlaceHas) {
  std::mt19937 random(5);
  for (int run = 0; run < 200; ++run) {
    const testing_support::TemporaryFolder folder;
    write_as_ttc(folder.path(), with_counter(7, 1000));
    {
      LinkStore store(folder.path());
      (void)store.load(now);
      ASSERT_TRUE(store.store(with_counter(8, 1001)));
      ASSERT_TRUE(store.store(with_counter(9, 1002)));
    }
    const char* const names[] = {"telecommands.0", "telecommands.1", "link_state"};
    const auto victim = folder.path() / names[random() % 3];
    auto text = read_file(victim).value_or("");
    for (int i = 0; i < 20 && !text.empty(); ++i) text[random() % text.size()] = static_cast<char>(random());
    ASSERT_TRUE(write_file_atomically(victim, text));

    const auto link = LinkStore(folder.path()).load(now);
    ASSERT_EQ(link.associations, with_counter(9, 1002).associations) << victim;
  }
}

}  // namespace
}  // namespace srfs::rescue
