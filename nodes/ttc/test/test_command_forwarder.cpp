// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/command_forwarder.hpp"

#include <algorithm>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include <mission/structures.hpp>

namespace srfs {
namespace {

constexpr auto at_most_once = mission::RepeatClass::at_most_once;

class Forwarding : public testing::Test {
 protected:
  [[nodiscard]] static MonotonicTime at(int ms) { return MonotonicTime(milliseconds(ms)); }
  std::uint64_t submit(const std::string& target, int ms, int lifetime_ms = 10'000) {
    Telecommand telecommand = telecommand_to(target);
    telecommand.expiry = at(ms + lifetime_ms);
    return forwarder_.submit(std::move(telecommand), at(ms)) ? next_id_++ : 0;
  }
  /// Restores a telecommand of an earlier process, which expires at 10 s.
  std::uint64_t restore(const TelecommandProgress& progress, int ms,
                        mission::RepeatClass repeat_class = mission::RepeatClass::by_id) {
    Telecommand telecommand = telecommand_to("payload_eps", repeat_class);
    telecommand.expiry = at(10'000);
    forwarder_.restore(std::move(telecommand), progress, at(ms));
    forwarder_.on_time(at(ms));
    return next_id_++;
  }
  Telecommand telecommand_to(const std::string& target,
                             mission::RepeatClass repeat_class = mission::RepeatClass::by_id) {
    mission::Command& command = commands_[{target, repeat_class}];
    command.node = target;
    command.repeat_class = repeat_class;
    return {.origin = {.request = {0x1811, static_cast<std::uint16_t>(0xC000 + sequence_++)},
                       .apid = 17,
                       .ack_flags = wire::ack::all,
                       .id = next_id_},
            .command = &command};
  }
  void report(std::uint64_t id, Stage stage, int ms, bool success = true, std::uint16_t code = 0,
              const std::string& node = "payload_eps") {
    forwarder_.on_report(node, {.id = id, .stage = stage, .success = success, .failure_code = code}, at(ms));
  }
  [[nodiscard]] std::vector<int> subtypes() {
    std::vector<int> found;
    for (const Report& report : report_queue_.take()) found.push_back(report.subtype);
    return found;
  }
  std::map<std::pair<std::string, mission::RepeatClass>, mission::Command> commands_;
  ReportQueue report_queue_;
  CommandForwarder forwarder_{report_queue_};
  std::uint64_t next_id_ = 7;
  int sequence_ = 0;
};

TEST(TelecommandIds, NeverRepeatOverRestartsAndTheirLow32BitsDiffer) {
  const UtcTime utc(seconds(1'600'000'000));
  std::uint64_t stored = 0xFFFF'FFFF - 500;  // the low half wraps during the test
  std::vector<std::uint64_t> ids;
  for (int start = 0; start < 40; ++start) {
    std::uint64_t next = first_telecommand_id(stored, 0, utc);
    for (int i = 0; i < 35; ++i) {
      stored = next + reserved_telecommand_ids;  // the value in the stored link state
      ids.push_back(next++);
    }
  }

  EXPECT_EQ(std::set<std::uint64_t>(ids.begin(), ids.end()).size(), ids.size());
  EXPECT_TRUE(std::is_sorted(ids.begin(), ids.end()));
  std::set<std::uint32_t> low;
  for (auto id = ids.end() - 1000; id != ids.end(); ++id) low.insert(static_cast<std::uint32_t>(*id));
  EXPECT_EQ(low.size(), 1000U);
}

TEST(TelecommandIds, GoUpByTheClockWhenTheStateIsLost) {
  const UtcTime in_2026(seconds(1'795'000'000));
  const std::uint64_t before = first_telecommand_id(0, 0, in_2026);
  EXPECT_GT(first_telecommand_id(0, 0, in_2026 + seconds(60)), before + 900);
  EXPECT_EQ(first_telecommand_id(before + 5, before + 9, in_2026), before + 9);
  EXPECT_EQ(first_telecommand_id(0, 0, UtcTime{}), 1U);
}

TEST_F(Forwarding, AFailedStepAlsoEndsTheCommand) {
  const std::uint64_t id = submit("payload_eps", 0);
  report(id, Stage::start, 10);
  report(id, Stage::progress, 20, false, 33);
  EXPECT_EQ(subtypes(), (std::vector<int>{3, 6, 8}));
  EXPECT_EQ(forwarder_.under_way(), 0U);
}

TEST_F(Forwarding, BelievesOnlyTheTargetOfTheCommand) {
  const std::uint64_t id = submit("payload_eps", 0);
  report(id, Stage::completion, 10, true, 0, "payload_adcs");
  EXPECT_TRUE(subtypes().empty());
  EXPECT_EQ(forwarder_.counters().stray_reports, 1U);
}

TEST_F(Forwarding, PublishesAgainEvery500MsUntilTheNodeHasAccepted) {
  const std::uint64_t id = submit("payload_eps", 0);
  EXPECT_EQ(forwarder_.take_publications().size(), 1U);

  forwarder_.on_time(at(499));
  EXPECT_TRUE(forwarder_.take_publications().empty());
  forwarder_.on_time(at(500));
  EXPECT_EQ(forwarder_.take_publications().size(), 1U);

  report(id, Stage::acceptance, 600);
  EXPECT_EQ(forwarder_.take_taken(), std::vector<std::uint64_t>{id});
  forwarder_.on_time(at(2599));
  EXPECT_TRUE(forwarder_.take_publications().empty());
}

TEST_F(Forwarding, AsksTheNodeOfAnAcceptedCommandNowAndThenUntilItHasSaidTheEnd) {
  const std::uint64_t id = submit("payload_eps", 0);
  report(id, Stage::acceptance, 0);
  (void)forwarder_.take_publications();
  for (const int ms : {2000, 4000}) {
    EXPECT_EQ(forwarder_.next_due(), at(ms));
    forwarder_.on_time(at(ms));
    const auto asked = forwarder_.take_publications();
    ASSERT_EQ(asked.size(), 1U);
    EXPECT_EQ(asked[0].origin.id, id);
    EXPECT_EQ(asked[0].expiry, at(10'000));
    report(id, Stage::acceptance, ms);
  }
  report(id, Stage::completion, 4100);  // repeats the report whose first copy was lost
  EXPECT_EQ(subtypes(), (std::vector<int>{3, 7}));
  forwarder_.on_time(at(9000));
  EXPECT_TRUE(forwarder_.take_publications().empty());
}

TEST_F(Forwarding, AfterARestartPublishesWhatNoNodeIsKnownToHaveWithTheSameId) {
  const std::uint64_t id = restore({}, 1000);
  const auto published = forwarder_.take_publications();
  ASSERT_EQ(published.size(), 1U);
  EXPECT_EQ(published[0].origin.id, id);
  EXPECT_EQ(published[0].expiry, at(10'000));
  for (int i = 0; i < 20; ++i) restore({}, 1000);
  EXPECT_EQ(forwarder_.take_publications().size(), 7U) << "eight unacknowledged";
}

TEST_F(Forwarding, AfterARestartANodeSaysWhatBecameOfACommandEvenPastItsExpiry) {
  const std::uint64_t id = restore({}, 20'000);
  EXPECT_EQ(forwarder_.take_publications().size(), 1U);
  forwarder_.on_time(at(45'000));
  EXPECT_TRUE(subtypes().empty());
  report(id, Stage::acceptance, 45'000);
  report(id, Stage::completion, 45'000);
  EXPECT_EQ(subtypes(), (std::vector<int>{3, 7}));

  restore({}, 50'000);
  forwarder_.on_time(at(80'000));
  EXPECT_EQ(subtypes(), std::vector<int>{4});
}

TEST_F(Forwarding, ACommandThatMayHaveBegunIsNotBegunByANodeThatForgotIt) {
  restore({.taken = true}, 0, at_most_once);
  EXPECT_EQ(forwarder_.take_publications().at(0).expiry, MonotonicTime(nanoseconds(1)));
  restore({.taken = true}, 0);
  EXPECT_EQ(forwarder_.take_publications().at(0).expiry, at(10'000)) << "its peripheral drops a repeat";
  restore({.other_boot = true}, 0);
  EXPECT_EQ(forwarder_.take_publications().at(0).expiry, MonotonicTime(nanoseconds(1)));
}

TEST_F(Forwarding, ANodeThatForgotWhatItHadAcceptedLeavesTheOutcomeUnknown) {
  const std::uint64_t id = restore({.taken = true, .started = true}, 0, at_most_once);
  report(id, Stage::acceptance, 10, false, 20);
  const auto reports = report_queue_.take();
  ASSERT_EQ(reports.size(), 1U);
  EXPECT_EQ(reports[0].subtype, 8);
  EXPECT_EQ(reports[0].data.back(), mission::failure::interrupted);
  EXPECT_EQ(forwarder_.under_way(), 0U);
}

TEST_F(Forwarding, ReportsEachStageOnceHoweverOftenTheNodeRepeatsIt) {
  const std::uint64_t id = submit("payload_eps", 0);
  for (const Stage stage : {Stage::acceptance, Stage::acceptance, Stage::start, Stage::start,
                            Stage::completion, Stage::completion, Stage::completion}) {
    report(id, stage, 10);
  }

  EXPECT_EQ(subtypes(), (std::vector<int>{3, 7}));
  EXPECT_EQ(forwarder_.counters().duplicate_reports, 2U);
  EXPECT_EQ(forwarder_.counters().stray_reports, 2U);
}

TEST_F(Forwarding, ACompletionImpliesTheStartThatWasLost) {
  const std::uint64_t id = submit("payload_eps", 0);

  report(id, Stage::completion, 10);

  EXPECT_EQ(subtypes(), (std::vector<int>{3, 7}));
}

TEST_F(Forwarding, ReportsFailuresWithTheNodesCode) {
  const std::uint64_t id = submit("payload_eps", 0);
  report(id, Stage::start, 10);
  report(id, Stage::completion, 20, false, 33);

  const auto reports = report_queue_.take();

  ASSERT_EQ(reports.size(), 2U);
  EXPECT_EQ(reports[1].subtype, 8);
  EXPECT_EQ(reports[1].data, (Octets{0x18, 0x11, 0xC0, 0x00, 0, 33}));
}

TEST_F(Forwarding, HasAtMostEightUnacknowledgedAndThirtyTwoQueuedPerNode) {
  for (int i = 0; i < 40; ++i) EXPECT_NE(submit("payload_eps", 0), 0U);
  EXPECT_EQ(forwarder_.take_publications().size(), 8U);

  EXPECT_EQ(submit("payload_eps", 0), 0U);
  EXPECT_NE(submit("payload_adcs", 0), 0U) << "a silent node costs only its own commands";
  EXPECT_EQ(forwarder_.counters().refused, 1U);
}

TEST_F(Forwarding, AnAcceptedCommandMakesRoomForTheNextQueuedOne) {
  std::vector<std::uint64_t> ids;
  ids.reserve(9);
  for (int i = 0; i < 9; ++i) ids.push_back(submit("payload_eps", 0));
  (void)forwarder_.take_publications();

  report(ids[0], Stage::acceptance, 10);

  const auto published = forwarder_.take_publications();
  ASSERT_EQ(published.size(), 1U);
  EXPECT_EQ(published[0].origin.id, ids[8]);
}

TEST_F(Forwarding, ANodeThatIsNotThereMeansAFailedStartAfterExpiry) {
  submit("image_acquisition", 0, 3000);
  forwarder_.on_time(at(2999));
  EXPECT_TRUE(subtypes().empty());

  forwarder_.on_time(at(3000));

  const auto reports = report_queue_.take();
  ASSERT_EQ(reports.size(), 1U);
  EXPECT_EQ(reports[0].subtype, 4);
  EXPECT_EQ(reports[0].data.back(), mission::failure::node_unavailable);
  const auto expired = forwarder_.take_expired();
  ASSERT_EQ(expired.size(), 1U);
  EXPECT_EQ(expired[0].node, "image_acquisition");
  EXPECT_EQ(forwarder_.under_way(), 0U);
}

TEST_F(Forwarding, ACommandWhoseCompletionIsNeverReportedEndsToo) {
  const std::uint64_t id = submit("payload_eps", 0, 3000);
  report(id, Stage::start, 100);
  (void)report_queue_.take();

  forwarder_.on_time(at(3000 + 30'000));

  EXPECT_EQ(subtypes(), std::vector<int>{8});
  EXPECT_EQ(forwarder_.under_way(), 0U);
}

TEST_F(Forwarding, SaysWhenTheLastOneUnderWayHasEndedAtTheLatest) {
  EXPECT_FALSE(forwarder_.latest_end());
  const std::uint64_t id = restore({.taken = true}, 0);
  EXPECT_EQ(forwarder_.latest_end(), at(10'000) + CommandForwarder::completion_grace);
  submit("payload_adcs", 1000, 86'400'000);
  EXPECT_EQ(forwarder_.latest_end(), at(86'401'000) + CommandForwarder::completion_grace)
      << "taken at the last instant";
  report(id, Stage::completion, 2000);
  forwarder_.on_time(at(86'402'000) + CommandForwarder::completion_grace);
  EXPECT_FALSE(forwarder_.latest_end());
}

}  // namespace
}  // namespace srfs
