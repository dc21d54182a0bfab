// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/report_downlink.hpp"

#include <chrono>
#include <fstream>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

using suite::CrashReport;
using ::testing::UnorderedElementsAre;

std::filesystem::file_time_type at(int second) {
  return std::filesystem::file_time_type(std::chrono::seconds(second));
}

std::vector<std::uint32_t> incarnations(std::vector<CrashReport> reports) {
  suite::sort_by_age(reports);
  std::vector<std::uint32_t> sorted;
  sorted.reserve(reports.size());
  for (const CrashReport& report : reports) sorted.push_back(report.incarnation);
  return sorted;
}

TEST(CrashReports, AreOrderedByIncarnationWhateverTheClockSaid) {
  EXPECT_EQ(incarnations({{10, "", at(5)}, {9, "", at(900)}, {11, "", at(1)}}),
            (std::vector<std::uint32_t>{9, 10, 11}));
  EXPECT_EQ(incarnations({}), std::vector<std::uint32_t>{});
}

TEST(CrashReports, WithoutIncarnationStandWhereTheyWereWritten) {
  EXPECT_EQ(incarnations({{3, "", at(30)}, {0, "", at(10)}, {4, "", at(40)}}),
            (std::vector<std::uint32_t>{0, 3, 4}));
  EXPECT_EQ(incarnations({{3, "", at(30)}, {0, "", at(50)}, {4, "", at(40)}}),
            (std::vector<std::uint32_t>{3, 4, 0}));
  EXPECT_EQ(incarnations({{0, "", at(50)}}), std::vector<std::uint32_t>{0});
}

TEST(ChooseReport, TakesTheNewestUnlessOneIsNamed) {
  const std::vector<CrashReport> reports{{3, "3", {}}, {5, "5", {}}};
  EXPECT_EQ(choose_report(reports, std::nullopt), &reports[1]);
  EXPECT_EQ(choose_report(reports, 3), &reports[0]);
  EXPECT_EQ(choose_report(reports, 4), nullptr);
  EXPECT_EQ(choose_report({}, std::nullopt), nullptr);
}

struct QueueReport : ::testing::Test {
  testing_support::TemporaryFolder folder;
  std::filesystem::path outbox = folder.path() / "files" / "outbox";

  /// A crash report of payload_eps, as stored on board.
  CrashReport report(std::uint32_t incarnation, const std::string& content = "backtrace and log") const {
    const auto file = folder.path() / "reports" / (std::to_string(incarnation) + ".report");
    EXPECT_TRUE(write_file_atomically(file, content));
    return {incarnation, file, {}};
  }
  auto queue(const CrashReport& report) const {
    return queue_report(outbox, "payload_eps_" + std::to_string(report.incarnation), report.file);
  }
  std::set<std::string> waiting() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(outbox))
      names.insert(entry.path().filename().string());
    return names;
  }
};

TEST_F(QueueReport, PutsItIntoTheOutboxUnderItsNodesNameAndNothingElse) {
  const auto queued = queue(report(7));
  ASSERT_TRUE(queued) << queued.error().text;
  EXPECT_EQ(queued->name, "payload_eps_7.report");
  EXPECT_EQ(queued->octets, 17U);
  EXPECT_THAT(waiting(), UnorderedElementsAre("payload_eps_7.report"));
  EXPECT_EQ(read_file(outbox / queued->name).value(), "backtrace and log");
}

TEST_F(QueueReport, LeavesOneThatWaitsAsItIsAndSendsAgainWhatTheGroundHas) {
  ASSERT_TRUE(queue(report(7, "first")));
  ASSERT_TRUE(queue(report(7, "another of the same number")));
  EXPECT_EQ(read_file(outbox / "payload_eps_7.report").value(), "first") << "a file that changes is not sent";

  std::filesystem::remove(outbox / "payload_eps_7.report");
  ASSERT_TRUE(queue(report(7, "another of the same number")));
  EXPECT_EQ(read_file(outbox / "payload_eps_7.report").value(), "another of the same number");
}

TEST_F(QueueReport, OutlivesTheOriginal) {
  const CrashReport original = report(7);
  ASSERT_TRUE(queue(original));
  std::filesystem::remove(original.file);
  EXPECT_EQ(read_file(outbox / "payload_eps_7.report").value(), "backtrace and log");
}

TEST_F(QueueReport, RefusesTheSeventeenthButNotForOtherFiles) {
  std::filesystem::create_directories(outbox);
  for (int i = 0; i < 30; ++i) std::ofstream(outbox / ("image_" + std::to_string(i) + ".fits"));
  for (std::uint32_t i = 1; i <= queued_reports_max; ++i) ASSERT_TRUE(queue(report(i)));
  const auto refused = queue(report(99));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().error, QueueError::full);
  EXPECT_TRUE(queue(report(1))) << "it waits there already";
  std::filesystem::remove(outbox / "payload_eps_1.report");
  EXPECT_TRUE(queue(report(99)));
}

TEST_F(QueueReport, SaysThatTheReportIsGoneOrWhyTheDiskRefusedIt) {
  const auto gone = queue({7, folder.path() / "nowhere", {}});
  ASSERT_FALSE(gone);
  EXPECT_EQ(gone.error().error, QueueError::gone);

  std::filesystem::remove_all(outbox);
  std::ofstream(outbox) << "a file where a folder should be";
  const auto refused = queue(report(7));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().error, QueueError::disk);
  EXPECT_THAT(refused.error().text, ::testing::HasSubstr(outbox.string()));
}

TEST_F(QueueReport, CopiesAcrossFileSystemsAndRemovesWhatAnEarlierCopyLeft) {
  outbox = std::filesystem::path("/dev/shm") / folder.path().filename() / "outbox";
  std::error_code ec;
  std::filesystem::create_directories(outbox, ec);
  struct Remove {
    std::filesystem::path path;
    ~Remove() {
      std::error_code ignored;
      std::filesystem::remove_all(path, ignored);
    }
  } remove{outbox.parent_path()};
  const CrashReport original = report(7);
  std::filesystem::create_hard_link(original.file, outbox / "probe", ec);
  if (ec != std::errc::cross_device_link)
    GTEST_SKIP() << "/dev/shm is no other file system: " << ec.message();
  std::ofstream(outbox / ".report.123.tmp") << "half a cop";

  const auto queued = queue(original);
  ASSERT_TRUE(queued) << queued.error().text;
  EXPECT_EQ(queued->octets, 17U);
  EXPECT_THAT(waiting(), UnorderedElementsAre("payload_eps_7.report"));
  EXPECT_EQ(read_file(outbox / queued->name).value(), "backtrace and log");
}

}  // namespace
}  // namespace srfs
