// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/rescue/link_store.hpp"

#include <random>
#include <utility>

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

std::string remove_it(const std::filesystem::path& segment) {
  std::filesystem::remove(segment);
  return "";
}

TEST(RescueLinkStore, CountersOutliveTheJournalThatIsSetAside) {
  const testing_support::TemporaryFolder folder;
  write_as_ttc(folder.path(), with_counter(7, 1000));
  LinkStore store(folder.path());
  (void)store.load(now);

  ASSERT_EQ(store.set_journal_aside(remove_it), "");

  const auto journal = read_as_ttc(folder.path());
  EXPECT_EQ(journal.link().associations, with_counter(7, 1000).associations);
  EXPECT_TRUE(journal.schedule().activities().empty());
  EXPECT_GE(journal.next_id(), 100U) << "no id is used twice";
}

TEST(RescueLinkStore, FramesBehindAJournalThatWasSetAsideAreNotTakenAgain) {
  const testing_support::TemporaryFolder folder;
  write_as_ttc(folder.path(), with_counter(7, 1000));
  LinkStore store(folder.path());
  (void)store.load(now);
  ASSERT_TRUE(store.store(with_counter(8, 1001)));
  ASSERT_EQ(store.set_journal_aside(remove_it), "");

  for (std::uint64_t next = 1; next < 5; ++next) {
    ASSERT_TRUE(store.store(with_counter(8 + next, 1001 + next)));
    EXPECT_EQ(LinkStore(folder.path()).load(now).associations,
              with_counter(8 + next, 1001 + next).associations);
    EXPECT_EQ(read_as_ttc(folder.path()).link().associations,
              with_counter(8 + next, 1001 + next).associations);
  }
}

TEST(RescueLinkStore, OfAJournalThatIsCutApartTheNewestStateIsLeft) {
  const testing_support::TemporaryFolder folder;
  write_as_ttc(folder.path(), with_counter(7, 1000));
  {  // ttc goes on: the activity leaves the schedule
    AcceptanceJournal journal("boot", milliseconds(0));
    JournalFile file(folder.path() / "telecommands");
    JournalLog log(file);
    for (const auto& record : log.load().records) (void)journal.apply(record);
    journal.begin({}, 1, now);
    ScheduleChange change;
    change.removed.push_back(1);
    (void)journal.change_schedule(change);
    ASSERT_TRUE(log.snapshot(*journal.take_batch(true).snapshot));
  }
  LinkStore store(folder.path());
  (void)store.load(now);
  bool cut = false;

  EXPECT_NE(store.set_journal_aside([&](const std::filesystem::path& segment) -> std::string {
    if (std::exchange(cut, true)) return "cut";
    return remove_it(segment);
  }),
            "");

  EXPECT_TRUE(read_as_ttc(folder.path()).schedule().activities().empty()) << "it was released before";
  ASSERT_TRUE(store.store(with_counter(8, 1001)));
  EXPECT_EQ(read_as_ttc(folder.path()).link().associations, with_counter(8, 1001).associations);
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
