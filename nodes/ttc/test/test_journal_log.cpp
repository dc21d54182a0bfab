// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/journal_log.hpp"

#include <filesystem>

#include <gtest/gtest.h>

#include "nodes/ttc/command/journal_file.hpp"
#include "nodes/ttc/test/simulated_medium.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

using testing_support::SimulatedMedium;

JournalRecord change(std::uint8_t n) {
  return {.kind = 1, .payload = Octets(20, n)};
}

/// The first octet of each payload after the last snapshot.
std::vector<int> changes(const JournalLog::Found& found) {
  std::vector<int> payloads;
  for (const JournalRecord& record : found.records) {
    if (record.kind == journal_snapshot_kind) payloads.clear();
    if (record.kind != journal_snapshot_kind) payloads.push_back(record.payload.front());
  }
  return payloads;
}

TEST(JournalLog, GivesBackItsRecordsInOrder) {
  SimulatedMedium medium(1);
  JournalLog log(medium);
  EXPECT_FALSE(log.load().existed);
  ASSERT_TRUE(log.snapshot({7, 7}));
  ASSERT_TRUE(log.append({change(1), change(2)}, true));
  ASSERT_TRUE(log.append({change(3)}, true));

  const auto found = JournalLog(medium).load();

  ASSERT_EQ(found.records.size(), 4U);
  EXPECT_EQ(found.records[0], (JournalRecord{.kind = journal_snapshot_kind, .payload = {7, 7}}));
  EXPECT_EQ(changes(found), (std::vector<int>{1, 2, 3}));
  EXPECT_EQ(found.damaged_octets, 0U);
}

TEST(JournalLog, ANewSnapshotStandsInTheOtherSegmentAndReplacesWhatCameBefore) {
  SimulatedMedium medium(1);
  JournalLog log(medium);
  for (std::uint8_t round = 1; round <= 5; ++round) {
    ASSERT_TRUE(log.snapshot({round}));
    ASSERT_TRUE(log.append({change(round)}, true));
    EXPECT_EQ(changes(JournalLog(medium).load()), std::vector<int>{round});
  }
}

TEST(JournalLog, SkipsADamagedRecordAndCountsItsOctets) {
  SimulatedMedium medium(1);
  JournalLog log(medium);
  ASSERT_TRUE(log.snapshot({}));
  ASSERT_TRUE(log.append({change(1), change(2), change(3)}, true));
  const std::size_t second = 18 + 38 + 5;
  medium.flip(0, second);

  const auto found = JournalLog(medium).load();

  EXPECT_EQ(changes(found), (std::vector<int>{1, 3}));
  EXPECT_EQ(found.damaged_octets, 38U);
}

TEST(JournalLog, ADamagedSnapshotIsReplacedByTheSegmentBeforeAndItsChanges) {
  SimulatedMedium medium(1);
  JournalLog log(medium);
  ASSERT_TRUE(log.snapshot({1}));
  ASSERT_TRUE(log.append({change(1)}, true));
  ASSERT_TRUE(log.snapshot({2}));
  ASSERT_TRUE(log.append({change(2)}, true));
  medium.flip(1, 14);

  auto found = JournalLog(medium).load();

  EXPECT_EQ(changes(found), (std::vector<int>{1, 2}));
  EXPECT_EQ(found.damaged_octets, 19U);

  medium.flip(1, 14 + 19);
  found = JournalLog(medium).load();
  EXPECT_EQ(changes(found), std::vector<int>{1}) << "the newer segment has nothing valid left";
}

TEST(JournalLog, AfterAFailedWriteTheOlderSegmentCounts) {
  SimulatedMedium medium(1);
  JournalLog log(medium);
  ASSERT_TRUE(log.snapshot({1}));
  ASSERT_TRUE(log.append({change(1)}, true));
  medium.failing = true;
  EXPECT_FALSE(log.append({change(2)}, true));
  EXPECT_FALSE(log.snapshot({2}));
  medium.failing = false;
  EXPECT_EQ(changes(JournalLog(medium).load()), std::vector<int>{1});

  ASSERT_TRUE(log.snapshot({3}));
  ASSERT_TRUE(log.append({change(3)}, true));
  EXPECT_EQ(changes(JournalLog(medium).load()), std::vector<int>{3});
}

TEST(JournalLog, RefusesWhatDoesNotFitItsSegment) {
  SimulatedMedium medium(1);
  JournalLog log(medium);
  ASSERT_TRUE(log.snapshot({}));
  EXPECT_FALSE(log.append({{.kind = 1, .payload = Octets(journal_segment_octets)}}, true));
  EXPECT_FALSE(log.snapshot(Octets(journal_segment_octets)));
}

TEST(JournalFile, KeepsTheJournalInFilesOfFixedSize) {
  const testing_support::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "state" / "telecommands";
  {
    JournalFile file(path);
    JournalLog log(file);
    EXPECT_FALSE(log.load().existed);
    ASSERT_TRUE(log.snapshot({1}));
    ASSERT_TRUE(log.append({change(1)}, true));
    ASSERT_TRUE(log.snapshot({2}));
    ASSERT_TRUE(log.append({change(2)}, false));
  }
  JournalFile file(path);
  EXPECT_EQ(changes(JournalLog(file).load()), std::vector<int>{2});
  EXPECT_EQ(std::filesystem::file_size(path.string() + ".0"), journal_segment_octets);
  EXPECT_EQ(std::filesystem::file_size(path.string() + ".1"), journal_segment_octets);
}

TEST(JournalFile, SaysWhyItCannotWriteAndGoesOnWhenItCan) {
  const testing_support::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "state" / "telecommands";
  std::filesystem::create_directories(path.string() + ".0");  // a folder where the file should be
  JournalFile file(path);
  JournalLog log(file);
  const auto failed = log.snapshot({1});
  ASSERT_FALSE(failed);
  EXPECT_NE(failed.error().message.find("telecommands.0: cannot be opened"), std::string::npos);

  std::filesystem::remove(path.string() + ".0");
  EXPECT_TRUE(log.snapshot({1}));
}

}  // namespace
}  // namespace srfs
