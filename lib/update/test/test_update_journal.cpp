// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/update_journal.hpp"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/temporary_folder.hpp"

namespace srfs::update {
namespace {

using testing::HasSubstr;

const std::string one = std::string(64, '1');
const std::string two = std::string(64, '2');

Update update_of(std::uint64_t counter, const std::string& sha256, const std::string& node = "payload_eps") {
  Update u;
  u.file = "packages/eps.pkg";
  u.sha256 = sha256;
  u.node = node;
  u.counter = counter;
  u.probation = seconds(300);
  u.octets = 4711;
  return u;
}

UpdateJournal begun(bool activate = true) {
  UpdateJournal journal;
  Update u = update_of(5, one);
  u.activate = activate;
  EXPECT_TRUE(journal.begin(u));
  journal.set(UpdateStep::build);
  return journal;
}

VersionNumber store(VersionTable& table, const UpdateJournal& journal) {
  return table.add(two, 1000, origin_of(journal.update()), UtcTime(nanoseconds(0)));
}

TEST(UpdateJournalTest, a_counter_is_used_up_by_the_package_that_had_it_and_by_no_other_node) {
  UpdateJournal journal = begun();
  EXPECT_EQ(journal.last_counter("payload_eps", two), 5U);
  EXPECT_EQ(journal.last_counter("payload_eps", one), 4U);  // the same package again
  EXPECT_EQ(journal.last_counter("ttc", one), 0U);
  journal.end(UpdateStep::failed, "compiler_failed");
  EXPECT_EQ(journal.last_counter("payload_eps", two), 5U);
  ASSERT_TRUE(journal.begin(update_of(6, two)));
  EXPECT_EQ(journal.last_counter("payload_eps", one), 6U);
}

TEST(UpdateJournalTest, there_is_room_for_a_stated_number_of_nodes) {
  UpdateJournal journal;
  for (std::size_t i = 0; i < UpdateJournal::most_nodes; ++i)
    ASSERT_TRUE(journal.begin(update_of(1, one, "node_" + std::to_string(i))));
  EXPECT_FALSE(journal.begin(update_of(1, one, "one_more")));
  EXPECT_TRUE(journal.begin(update_of(2, two, "node_7")));
}

TEST(UpdateJournalTest, an_interrupted_build_begins_anew_and_is_given_up_at_the_third_time) {
  UpdateJournal journal = begun();
  const VersionTable table;
  for (std::uint32_t start = 2; start <= UpdateJournal::most_starts; ++start) {
    journal.set(UpdateStep::self_test);
    journal.resume(table);
    EXPECT_EQ(journal.update().step, UpdateStep::build);
    EXPECT_EQ(journal.update().starts, start);
  }
  journal.resume(table);
  EXPECT_EQ(journal.update().step, UpdateStep::failed);
  EXPECT_EQ(journal.update().ended_in, UpdateStep::build);
  EXPECT_THAT(journal.update().reason, HasSubstr("interrupted"));
  EXPECT_FALSE(journal.is_under_way());
}

TEST(UpdateJournalTest, one_that_was_not_accepted_for_certain_ends_with_the_next_process) {
  UpdateJournal journal;
  ASSERT_TRUE(journal.begin(update_of(5, one)));
  EXPECT_TRUE(journal.is_under_way());
  journal.resume(VersionTable());
  EXPECT_EQ(journal.update().step, UpdateStep::failed);
  EXPECT_EQ(journal.update().ended_in, UpdateStep::verify);
  EXPECT_EQ(journal.update().reason, "interrupted before it began");
  EXPECT_EQ(journal.last_counter("payload_eps", one), 4U) << "it may come again";
}

TEST(UpdateJournalTest, what_the_table_of_versions_has_is_not_built_again) {
  UpdateJournal journal = begun();
  VersionTable table;
  const VersionNumber version = store(table, journal);
  journal.set(UpdateStep::store);
  journal.resume(table);
  EXPECT_EQ(journal.update().step, UpdateStep::swap);
  EXPECT_EQ(journal.update().version, version);

  UpdateJournal candidate = begun(false);
  candidate.resume(table);
  EXPECT_EQ(candidate.update().step, UpdateStep::candidate);
}

TEST(UpdateJournalTest, a_swap_that_the_table_knows_of_is_over_whoever_died_in_it) {
  UpdateJournal journal = begun();
  VersionTable table;
  const VersionNumber version = store(table, journal);
  journal.set(UpdateStep::swap);
  ASSERT_TRUE(table.use(version, seconds(300), ""));
  UpdateJournal running = journal;
  running.resume(table);
  EXPECT_EQ(running.update().step, UpdateStep::installed);

  ASSERT_TRUE(table.fail(version, "exit code 3"));
  journal.resume(table);
  EXPECT_EQ(journal.update().step, UpdateStep::failed);
  EXPECT_EQ(journal.update().reason, "exit code 3");
}

TEST(UpdateJournalTest, what_is_over_stays_as_it_is) {
  UpdateJournal journal = begun();
  journal.end(UpdateStep::cancelled, "by telecommand");
  const UpdateJournal before = journal;
  journal.resume(VersionTable());
  EXPECT_EQ(journal, before);
}

TEST(UpdateJournalTest, it_comes_back_from_its_text_and_damage_at_any_octet_is_found) {
  UpdateJournal journal = begun();
  journal.built(milliseconds(1234));
  journal.stored(3, 99);
  journal.installed(milliseconds(140));
  const std::string text = encode(journal);
  ASSERT_TRUE(decode_update_journal(text));
  EXPECT_EQ(*decode_update_journal(text), journal);
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string damaged = text;
    damaged[i] = static_cast<char>(damaged[i] ^ 1);
    EXPECT_FALSE(decode_update_journal(damaged)) << i;
    EXPECT_FALSE(decode_update_journal(text.substr(0, i))) << i;
  }
}

TEST(UpdateJournalTest, of_two_copies_the_newer_sound_one_counts) {
  const testing_support::TemporaryFolder folder;
  EXPECT_FALSE(update_journal_file(folder.path()).load().existed());
  UpdateJournal journal = begun();
  ASSERT_EQ(update_journal_file(folder.path()).store(journal).copies, 2U);
  UpdateJournal later = journal;
  later.set(UpdateStep::self_test);
  ASSERT_TRUE(write_file_atomically(folder.path() / "updates_a", encode(later)));  // then the power was lost
  EXPECT_EQ(update_journal_file(folder.path()).load().state, later);
  ASSERT_TRUE(write_file_atomically(folder.path() / "updates_a", "damage"));
  const auto found = update_journal_file(folder.path()).load();
  EXPECT_EQ(found.state, journal);
  EXPECT_EQ(found.damaged.size(), 1U);
}

}  // namespace
}  // namespace srfs::update
