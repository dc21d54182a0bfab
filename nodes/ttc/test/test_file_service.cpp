// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/files/file_service.hpp"
#include "tests/mission_dictionary.hpp"

#include <gmock/gmock.h>

#include <mission/structures.hpp>

namespace srfs {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr MonotonicTime start(seconds(100));

class FileServiceTest : public testing::Test {
 protected:
  /// Sends a telecommand given as text. @return its number, the sequence count of its reports
  std::uint16_t send(const std::string& name, const std::vector<std::string>& arguments,
                     MonotonicTime now = start, bool repeated = false) {
    const auto encoded = dictionary_.encode(name, arguments);
    EXPECT_TRUE(encoded) << (encoded ? "" : encoded.error().message);
    EXPECT_TRUE(dictionary_.check_arguments(*encoded->command, encoded->data));
    TelecommandOrigin origin{.apid = 1, .ack_flags = wire::ack::all, .source_id = 7};
    origin.request.packet_sequence_control = ++number_;
    service_.execute(
        {.origin = origin, .command = encoded->command, .arguments = encoded->data, .repeated = repeated},
        now);
    return number_;
  }
  /// The reports since the last call, each as "3:1,7": number of the telecommand, service, subtype. A failure
  /// also has its code.
  std::vector<std::string> reports() {
    std::vector<std::string> texts;
    for (const Report& report : report_queue_.take()) {
      OctetReader in(report.data);
      static_cast<void>(in.u16());
      const unsigned number = report.service == 1 ? in.u16() : 0U;
      std::string text = std::to_string(number) + ":" + std::to_string(report.service) + "," +
                         std::to_string(report.subtype);
      if (report.service == 1 && report.subtype % 2 == 0) text += "=" + std::to_string(in.u16());
      texts.push_back(text);
      if (report.service == 23) {
        EXPECT_EQ(report.destination_id, 7);
      }
    }
    return texts;
  }
  void finish(const FileOutcome& outcome = {}, MonotonicTime now = start) {
    ASSERT_TRUE(service_.next_order(now));
    service_.on_outcome(outcome, now);
  }

  const mission::Dictionary& dictionary_ = testing_support::dictionary();
  ReportQueue report_queue_;
  FileService service_{report_queue_, mission::apid::ttc};
  std::uint16_t number_ = 0;
};

TEST_F(FileServiceTest, GivesTheDiskOneOrderAtATimeInTheOrderOfTheTelecommands) {
  send("file.delete", {"repository=images", "file=a.fits"});
  send("file.list", {"repository=images", "after=k", "most=9"});
  const auto first = service_.next_order(start);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->action, FileAction::delete_file);
  EXPECT_EQ(first->repository, "images");
  EXPECT_EQ(first->name, "a.fits");
  EXPECT_FALSE(service_.next_order(start)) << "the disk is at work";
  service_.on_outcome({}, start);
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "1:1,7"));
  const auto second = service_.next_order(start);
  ASSERT_TRUE(second);
  EXPECT_EQ(second->action, FileAction::list);
  EXPECT_EQ(second->name, "k");
  EXPECT_EQ(second->most, 9);
  EXPECT_NE(second->number, first->number);
}

TEST_F(FileServiceTest, EveryRequestOfTheDictionaryIsAnOrder) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> all{
      {"file.delete", {"file=a"}},
      {"file.report", {"file=a"}},
      {"file.make_folder", {"folder=a"}},
      {"file.remove_folder", {"folder=a"}},
      {"file.list", {}},
      {"file.copy", {"operation=5", "source_file=a"}},
      {"file.suspend", {"operation=5"}},
      {"file.resume", {"operation=5"}},
      {"file.abort", {"operation=5"}},
      {"file.suspend_all", {}},
      {"file.resume_all", {}},
      {"file.abort_all", {}},
      {"file.report_copies", {}}};
  std::size_t known = 1;  // starts at 1: file.stop_reports needs no disk access
  for (const auto& [name, arguments] : all) {
    send(name, arguments);
    const auto order = service_.next_order(start);
    ASSERT_TRUE(order) << name;
    if (name.ends_with("_all")) {
      EXPECT_TRUE(order->all_in_repository) << name;
    } else if (order->action >= FileAction::copy && order->action <= FileAction::abort) {
      EXPECT_THAT(order->operations, ElementsAre(5U)) << name;
    }
    service_.on_outcome({}, start);
    ++known;
  }
  const auto commands = std::count_if(dictionary_.commands().begin(), dictionary_.commands().end(),
                                      [](const mission::Command& c) { return c.service == 23; });
  EXPECT_EQ(static_cast<std::size_t>(commands), known);
}

TEST_F(FileServiceTest, AFailureBeforeAnythingWasDoneIsOneOfTheStart) {
  send("file.suspend", {"operation=9"});
  finish({.failure = mission::failure::unknown_operation, .failure_parameter = {1, 2}});
  EXPECT_THAT(reports(), ElementsAre("1:1,4=99"));
}

TEST_F(FileServiceTest, ALongOrderGoesOnInPartsAndItsFailureIsOneOfTheExecution) {
  send("file.report", {"file=large"});
  send("file.list", {});
  const auto part = service_.next_order(start);
  service_.on_outcome({.unfinished = true}, start);
  EXPECT_THAT(reports(), ElementsAre("1:1,3"));
  EXPECT_EQ(service_.next_order(start)->number, part->number) << "the same one";
  service_.on_outcome({.failure = mission::failure::file_changed}, start);
  EXPECT_THAT(reports(), ElementsAre("1:1,8=98"));
}

TEST_F(FileServiceTest, AnswersComeBeforeTheCompletionAndToTheOneWhoAsked) {
  send("file.list", {});
  finish({.report_subtype = 13, .reports = {{1}, {2}}});
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "0:23,13", "0:23,13", "1:1,7"));
}

TEST_F(FileServiceTest, RequestsBeyondTheQueueAreRefused) {
  for (std::size_t i = 0; i < FileService::max_waiting; ++i) send("file.list", {});
  EXPECT_THAT(reports(), IsEmpty());
  send("file.list", {});
  EXPECT_THAT(reports(), ElementsAre("17:1,4=23"));
}

TEST_F(FileServiceTest, ADiskThatHangsCostsEachRequestItsTimeAndNoMore) {
  send("file.delete", {"file=a"});
  send("file.list", {});
  ASSERT_TRUE(service_.next_order(start));
  const auto due = service_.next_due();
  ASSERT_TRUE(due);
  EXPECT_EQ(*due, start + milliseconds(10000));
  service_.on_time(*due - milliseconds(1));
  EXPECT_THAT(reports(), IsEmpty());
  service_.on_time(*due);
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "1:1,8=40", "2:1,4=20"))
      << "the first may still be done; the other never began";
  EXPECT_FALSE(service_.next_order(*due)) << "the disk still has the first";

  // The late outcome belongs to no request; the next request continues.
  service_.on_outcome({}, *due);
  EXPECT_THAT(reports(), IsEmpty());
  send("file.list", {}, *due);
  finish({}, *due);
  EXPECT_THAT(reports(), ElementsAre("3:1,3", "3:1,7"));
}

TEST_F(FileServiceTest, AWorkerWithoutRoomIsAskedAgainLater) {
  send("file.list", {});
  const auto order = service_.next_order(start);
  service_.on_refused(start);
  EXPECT_FALSE(service_.next_order(start + FileService::retry_period - milliseconds(1)));
  EXPECT_EQ(service_.next_due(), start + FileService::retry_period);
  const auto again = service_.next_order(start + FileService::retry_period);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->number, order->number);
}

TEST_F(FileServiceTest, AnOrderThatMayHaveBeenDoneBeforeARestartSaysSo) {
  send("file.delete", {"file=a"}, start, true);
  EXPECT_TRUE(service_.next_order(start)->repeated);
}

TEST_F(FileServiceTest, TheStatusOfCopiesIsReportedPeriodicallyUntilItIsStopped) {
  send("file.report_copies", {"interval_ms=5000"});
  finish({.report_subtype = 23, .reports = {{1}}});
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "0:23,23", "1:1,7"));
  EXPECT_EQ(service_.next_due(), start + seconds(5));
  EXPECT_FALSE(service_.next_order(start + milliseconds(4999)));

  const auto order = service_.next_order(start + seconds(5));
  ASSERT_TRUE(order);
  EXPECT_EQ(order->action, FileAction::report_copies);
  service_.on_outcome({.report_subtype = 23, .reports = {{1}, {2}}}, start + seconds(5));
  EXPECT_THAT(reports(), ElementsAre("0:23,23", "0:23,23"));

  send("file.stop_reports", {}, start + seconds(6));
  EXPECT_THAT(reports(), ElementsAre("2:1,3", "2:1,7"));
  EXPECT_FALSE(service_.next_due());
  EXPECT_FALSE(service_.next_order(start + seconds(100)));
}

TEST_F(FileServiceTest, AShortPeriodIsMadeASecondAndZeroIsOnce) {
  send("file.report_copies", {"interval_ms=1"});
  finish();
  EXPECT_EQ(service_.next_due(), start + seconds(1));
  send("file.report_copies", {"interval_ms=0"});
  finish();
  EXPECT_FALSE(service_.next_due());
}

TEST_F(FileServiceTest, AFailedPeriodicStatusIsNobodysFailure) {
  send("file.report_copies", {"interval_ms=5000"});
  finish();
  static_cast<void>(reports());
  ASSERT_TRUE(service_.next_order(start + seconds(5)));
  service_.on_outcome({.failure = mission::failure::disk_failed}, start + seconds(5));
  EXPECT_THAT(reports(), IsEmpty());
  EXPECT_EQ(service_.next_due(), start + seconds(10));
}

}  // namespace
}  // namespace srfs
