// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/imaging/imaging_scheduler.hpp"

#include <algorithm>
#include <map>
#include <random>

#include <gmock/gmock.h>

#include "tests/build_kind.hpp"
#include "tests/mission_dictionary.hpp"

namespace srfs {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using How = ImageGoalEnd::How;
using Server = ImageServer;

constexpr MonotonicTime start(seconds(100));
constexpr UtcTime morning(seconds(1'795'000'000));

class ImagingSchedulerTest : public testing::Test {
 public:
  /// Sends a telecommand given as text. @return its id
  std::uint64_t send(const std::string& name, const std::vector<std::string>& arguments) {
    const auto [origin, encoded] = telecommand(name, arguments);
    scheduler_.execute({.origin = origin, .command = encoded.command, .arguments = arguments_of(encoded)},
                       now_);
    return origin.id;
  }
  std::uint64_t restore(const std::string& name, const std::vector<std::string>& arguments,
                        std::uint8_t last_step) {
    const auto [origin, encoded] = telecommand(name, arguments);
    EXPECT_TRUE(scheduler_.restore(
        {.origin = origin, .command = encoded.command, .arguments = arguments_of(encoded), .repeated = true},
        {.started = true, .last_step = last_step}, now_));
    return origin.id;
  }
  std::pair<TelecommandOrigin, mission::EncodedCommand> telecommand(
      const std::string& name, const std::vector<std::string>& arguments) {
    const auto encoded = dictionary_.encode(name, arguments);
    EXPECT_TRUE(encoded) << (encoded ? "" : encoded.error().message);
    TelecommandOrigin origin{.apid = 1, .ack_flags = wire::ack::all, .source_id = 7};
    origin.id = ++last_id_;
    origin.request.packet_sequence_control = static_cast<std::uint16_t>(last_id_);
    return {origin, *encoded};
  }
  static Octets arguments_of(const mission::EncodedCommand& encoded) {
    return {encoded.data.begin() + 2, encoded.data.end()};  // without the function id
  }
  /// The reports since the last call, each as "3:1,5=100": telecommand, service, subtype, step or code.
  std::vector<std::string> reports() {
    std::vector<std::string> texts;
    for (const Report& report : report_queue_.take()) {
      OctetReader in(report.data);
      static_cast<void>(in.u16());
      std::string text = std::to_string(in.u16()) + ":1," + std::to_string(report.subtype);
      if (report.subtype == 5) text += "=" + std::to_string(in.u8());
      if (report.subtype % 2 == 0) text += "=" + std::to_string(in.u16());
      texts.push_back(text);
    }
    return texts;
  }
  /// The orders that are due now, each with its id: "capture 1".
  std::vector<std::string> orders() {
    static const std::map<ImagingAction, std::string> names{
        {ImagingAction::capture, "capture"},    {ImagingAction::process, "process"},
        {ImagingAction::cancel_goal, "cancel"}, {ImagingAction::list_frames, "list"},
        {ImagingAction::cancel_all, "clear"},   {ImagingAction::queue_products, "queue"},
        {ImagingAction::stop_sending, "stop"}};
    scheduler_.on_time(time(), nominal_);
    std::vector<std::string> texts;
    for (ImagingOrder& order : scheduler_.take_orders()) {
      texts.push_back(names.at(order.action) + " " + std::to_string(order.id));
      last_ = std::move(order);
    }
    return texts;
  }
  [[nodiscard]] ImagingTime time() const {
    return {.now = now_, .utc = morning + (now_ - start), .utc_valid = valid_};
  }
  void end(std::uint64_t id, Server server, ImageGoalEnd how) {
    scheduler_.on_goal_end(id, server, std::move(how), now_);
  }
  static ImageGoalEnd frames(std::size_t count) {
    ImageGoalEnd end;
    for (std::size_t i = 1; i <= count; ++i) end.files.push_back("frames/0000000005/" + std::to_string(i));
    return end;
  }
  static ImageGoalEnd products() { return {.files = {"products/0000000005/findings.json"}, .detections = 2}; }
  static std::string at(nanoseconds from_morning) { return "start=" + to_iso8601(morning + from_morning); }

  const mission::Dictionary& dictionary_ = testing_support::dictionary();
  ReportQueue report_queue_;
  ImagingScheduler scheduler_{report_queue_};
  MonotonicTime now_ = start;
  bool valid_ = true;
  bool nominal_ = true;
  std::uint64_t last_id_ = 0;
  ImagingOrder last_;
};

TEST_F(ImagingSchedulerTest, TelecommandsForNodesThatTheDeploymentDoesNotHaveAreRefused) {
  const auto refusal = [this](ImageLane lane, std::string_view name) -> std::uint16_t {
    Telecommand telecommand;
    telecommand.command = dictionary_.command(name);
    const auto why = ImagingScheduler(report_queue_, lane).why_refused(telecommand);
    return why ? why->code : mission::failure::none;
  };
  const ImageLane none{.acquisition = false, .processing = false};
  EXPECT_EQ(refusal(none, "image.capture"), mission::failure::unknown_node);
  EXPECT_EQ(refusal(none, "image.process"), mission::failure::unknown_node);
  EXPECT_EQ(refusal(none, "image.cancel"), mission::failure::none) << "tasks of an earlier deployment";
  EXPECT_EQ(refusal({.acquisition = false}, "image.process"), mission::failure::none);
  EXPECT_EQ(refusal({}, "image.capture"), mission::failure::none);
}

TEST_F(ImagingSchedulerTest, ATaskIsCapturedProcessedAndSentWithProgressAtEachStage) {
  send("image.capture", {"task=5", "exposure_us=20000", "gain_db=3", "frames=8", "method=tracklet",
                         "parameters=threshold=4", "budget_octets=9000"});
  EXPECT_THAT(orders(), ElementsAre("capture 1"));
  EXPECT_EQ(last_.task, 5U);
  EXPECT_FALSE(last_.start);
  EXPECT_EQ(last_.capture.exposure_us, 20000U);
  EXPECT_EQ(last_.capture.frames, 8);
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "1:1,5=1"));

  scheduler_.on_accepted(1, now_);
  for (std::uint16_t done = 1; done <= 8; ++done) scheduler_.on_feedback(1, done, now_);
  EXPECT_THAT(reports(), ElementsAre("1:1,5=25", "1:1,5=50", "1:1,5=75"));
  end(1, Server::acquisition, frames(8));
  EXPECT_THAT(orders(), ElementsAre("process 1"));
  EXPECT_EQ(last_.files.size(), 8U);
  EXPECT_EQ(last_.method, "tracklet");
  EXPECT_EQ(last_.parameters, "threshold=4");
  EXPECT_EQ(last_.budget_octets, 9000U);
  EXPECT_FALSE(last_.full_frames);
  EXPECT_THAT(reports(), ElementsAre("1:1,5=100", "1:1,5=101"));

  scheduler_.on_accepted(1, now_);
  scheduler_.on_feedback(1, 4, now_);
  end(1, Server::processing, products());
  EXPECT_THAT(reports(), ElementsAre("1:1,5=125", "1:1,5=150", "1:1,5=200"));
  EXPECT_THAT(orders(), ElementsAre("queue 1"));
  EXPECT_THAT(last_.files, ElementsAre("products/0000000005/findings.json"));
  scheduler_.on_products_queued(1, 0, "", 1);
  EXPECT_THAT(reports(), ElementsAre("1:1,7"));
  EXPECT_EQ(scheduler_.tasks(), 0U);

  const auto h = scheduler_.housekeeping();
  EXPECT_EQ(h.taken, 1U);
  EXPECT_EQ(h.completed, 1U);
  EXPECT_EQ(h.frames, 8U);
  EXPECT_EQ(h.detections, 2U);
  EXPECT_EQ(h.products_queued, 1U);
}

TEST_F(ImagingSchedulerTest, ProductsAreOfTheirRunWhereTheyTellWhatItFound) {
  for (const char* product : {"products/0000000005/findings.json", "products/0000000005/thumbnail.png"}) {
    send("image.capture", {"task=5"});
    static_cast<void>(orders());
    end(last_id_, Server::acquisition, frames(1));
    static_cast<void>(orders());
    end(last_id_, Server::processing, {.files = {product}, .run = 0xA1});
    static_cast<void>(orders());
    EXPECT_EQ(last_.action, ImagingAction::queue_products);
    EXPECT_EQ(last_.run, std::string(product).ends_with(".json") ? 0xA1U : 0U);
    scheduler_.on_products_queued(last_id_, 0, "", 1);
  }
}

TEST_F(ImagingSchedulerTest, WithoutAMethodATaskEndsWithItsFrames) {
  send("image.capture", {"task=5", "method="});
  static_cast<void>(orders());
  end(1, Server::acquisition, frames(1));
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "1:1,5=1", "1:1,5=100", "1:1,7"));
  EXPECT_THAT(orders(), IsEmpty());
}

TEST_F(ImagingSchedulerTest, CapturesProcessesAndSendsDifferentTasksAtOnce) {
  for (const char* task : {"task=1", "task=2", "task=3"}) send("image.capture", {task});
  EXPECT_THAT(orders(), ElementsAre("capture 1")) << "the camera does one at a time";
  end(1, Server::acquisition, frames(1));
  EXPECT_THAT(orders(), ElementsAre("capture 2", "process 1"));
  end(1, Server::processing, products());
  end(2, Server::acquisition, frames(1));
  EXPECT_THAT(orders(), ElementsAre("queue 1", "capture 3", "process 2"));
}

TEST_F(ImagingSchedulerTest, ACaptureFarAheadDoesNotHoldUpOneThatIsDueBefore) {
  send("image.capture", {"task=1", at(seconds(3600))});
  send("image.capture", {"task=2", at(seconds(600))});
  send("image.capture", {"task=3"});
  EXPECT_THAT(orders(), ElementsAre("capture 3"));
  end(3, Server::acquisition, {.failure_code = mission::failure::camera_failed, .reason = "torn"});
  EXPECT_THAT(orders(), IsEmpty());
  EXPECT_EQ(scheduler_.next_due(time()), now_ + seconds(590));
  now_ += seconds(590);
  EXPECT_THAT(orders(), ElementsAre("capture 2"));
  EXPECT_EQ(last_.start, morning + seconds(600));
}

TEST_F(ImagingSchedulerTest, ACaptureWhoseTimePassesWhileTheCameraIsBusyFails) {
  send("image.capture", {"task=1", "exposure_us=60000000"});
  send("image.capture", {"task=2", at(seconds(20))});
  EXPECT_THAT(orders(), ElementsAre("capture 1"));
  static_cast<void>(reports());
  now_ += seconds(20);
  EXPECT_THAT(orders(), IsEmpty()) << "it may be free in this instant";
  now_ += milliseconds(1);
  EXPECT_THAT(orders(), IsEmpty());
  EXPECT_THAT(reports(), ElementsAre("2:1,8=112"));
}

TEST_F(ImagingSchedulerTest, ATimedCaptureWaitsUntilTheTimeIsValid) {
  valid_ = false;
  send("image.capture", {"task=1", at(seconds(5))});
  send("image.capture", {"task=2", "method="});
  EXPECT_THAT(orders(), ElementsAre("capture 2"));
  end(2, Server::acquisition, frames(1));
  EXPECT_THAT(orders(), IsEmpty());
  valid_ = true;
  EXPECT_THAT(orders(), ElementsAre("capture 1"));
}

TEST_F(ImagingSchedulerTest, NoCaptureBeginsInAModeThatDoesNotAllowIt) {
  send("image.capture", {"task=1", at(seconds(60))});
  nominal_ = false;
  EXPECT_THAT(orders(), IsEmpty());
  EXPECT_THAT(reports(), ElementsAre("1:1,3"));
  now_ += seconds(50);
  EXPECT_THAT(orders(), IsEmpty());
  EXPECT_THAT(reports(), ElementsAre("1:1,8=8"));
}

TEST_F(ImagingSchedulerTest, ProcessesStoredFramesAgain) {
  send("image.process", {"task=5", "method=plate_solve"});
  EXPECT_THAT(orders(), ElementsAre("list 1"));
  scheduler_.on_frames_listed(1, {{"a", "b"}});
  EXPECT_THAT(orders(), ElementsAre("process 1"));
  EXPECT_THAT(last_.files, ElementsAre("a", "b"));
  EXPECT_EQ(last_.method, "plate_solve");
  end(1, Server::processing, {});
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "1:1,5=101", "1:1,5=200", "1:1,7")) << "nothing was found";
}

TEST_F(ImagingSchedulerTest, SendsOneFrameWithoutLossAndWithoutAMethod) {
  send("image.send_frame", {"task=5", "frame=9999"});
  EXPECT_THAT(orders(), ElementsAre("list 1"));
  EXPECT_EQ(last_.frame, 9999) << "as many as the store gives numbers";
  scheduler_.on_frames_listed(1, {{"frames/0000000005/9999.fits"}});
  EXPECT_THAT(orders(), ElementsAre("process 1"));
  EXPECT_TRUE(last_.full_frames);
  EXPECT_EQ(last_.method, "");
  end(1, Server::processing, products());
  EXPECT_THAT(orders(), ElementsAre("queue 1"));
  EXPECT_EQ(last_.frame, 9999);
}

TEST_F(ImagingSchedulerTest, ATaskWithoutFramesIsUnknown) {
  send("image.process", {"task=5"});
  static_cast<void>(orders());
  scheduler_.on_frames_listed(1, std::vector<std::string>{});
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "1:1,8=116"));
  const auto failures = scheduler_.take_failures();
  ASSERT_EQ(failures.size(), 1U);
  EXPECT_EQ(failures.front().task, 5U);
}

TEST_F(ImagingSchedulerTest, ANumberNamesOneTaskAtATimeAndItsFramesMayBeAskedForBesides) {
  send("image.capture", {"task=5"});
  send("image.capture", {"task=5"});
  send("image.process", {"task=5"});
  send("image.send_frame", {"task=5", "frame=1"});
  send("image.send_frame", {"task=5", "frame=2"});
  send("image.send_frame", {"task=5", "frame=2"});
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "2:1,4=117", "3:1,4=117", "4:1,3", "5:1,3", "6:1,4=117"));
}

TEST_F(ImagingSchedulerTest, TasksBeyondTheTableAreRefused) {
  for (std::size_t i = 1; i <= ImagingScheduler::max_tasks; ++i)
    send("image.capture", {"task=" + std::to_string(i)});
  static_cast<void>(reports());
  send("image.capture", {"task=99"});
  EXPECT_THAT(reports(), ElementsAre("17:1,4=118"));
}

TEST_F(ImagingSchedulerTest, TheServersFailureCodeIsThatOfTheTelecommandAndItsReasonAnEvent) {
  send("image.capture", {"task=5"});
  static_cast<void>(orders());
  end(1, Server::acquisition, {.failure_code = mission::failure::camera_absent, .reason = "no /dev/video0"});
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "1:1,5=1", "1:1,8=110"));
  const auto failures = scheduler_.take_failures();
  ASSERT_EQ(failures.size(), 1U);
  EXPECT_THAT(failures.front().why, testing::EndsWith(": no /dev/video0"));
  EXPECT_THAT(scheduler_.take_failures(), IsEmpty());
}

TEST_F(ImagingSchedulerTest, ARejectedGoalIsSentAgainSomeTimes) {
  send("image.capture", {"task=5"});
  for (int i = 0; i <= ImagingScheduler::max_rejections; ++i) {
    EXPECT_THAT(orders(), ElementsAre("capture 1"));
    end(1, Server::acquisition, {.how = How::rejected});
    EXPECT_THAT(orders(), IsEmpty());
    now_ += ImagingScheduler::reject_pause;
  }
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "1:1,5=1", "1:1,8=23"));
}

// ---- cancelling

TEST_F(ImagingSchedulerTest, AWaitingTaskIsCancelledAtOnce) {
  send("image.capture", {"task=5", at(seconds(600))});
  send("image.cancel", {"task=5"});
  EXPECT_THAT(orders(), ElementsAre("stop 2"));
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "2:1,3", "1:1,8=39"));
  scheduler_.on_sending_stopped(2, 0, 0);
  EXPECT_THAT(reports(), ElementsAre("2:1,7"));
}

TEST_F(ImagingSchedulerTest, AGoalIsCancelledAndItsTaskEndsWithIt) {
  for (const Server server : {Server::acquisition, Server::processing}) {
    SCOPED_TRACE(static_cast<int>(server));
    const auto id = send("image.capture", {"task=5"});
    static_cast<void>(orders());
    if (server == Server::processing) {
      end(id, Server::acquisition, frames(1));
      static_cast<void>(orders());
    }
    static_cast<void>(reports());
    const auto cancel = send("image.cancel", {"task=5"});
    EXPECT_THAT(orders(), ElementsAre("cancel " + std::to_string(id), "stop " + std::to_string(cancel)));
    EXPECT_EQ(scheduler_.tasks(), 1U);
    scheduler_.on_sending_stopped(cancel, 0, 0);
    end(id, server, {.how = How::canceled});
    EXPECT_THAT(reports(), ElementsAre(std::to_string(cancel) + ":1,3", std::to_string(cancel) + ":1,7",
                                       std::to_string(id) + ":1,8=39"));
  }
}

TEST_F(ImagingSchedulerTest, AGoalThatSucceedsInSpiteOfACancelIsAbortedAllTheSame) {
  send("image.capture", {"task=5"});
  static_cast<void>(orders());
  send("image.cancel", {"task=5"});
  end(1, Server::acquisition, frames(1));
  EXPECT_THAT(orders(), ElementsAre("cancel 1", "stop 2"));
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "1:1,5=1", "2:1,3", "1:1,8=39"));
}

TEST_F(ImagingSchedulerTest, AGoalThatWasNotSentYetIsNotSent) {
  send("image.capture", {"task=5"});
  scheduler_.on_time(time(), true);  // the order waits for the journal
  send("image.cancel", {"task=5"});
  EXPECT_THAT(orders(), ElementsAre("stop 2"));
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "1:1,5=1", "2:1,3", "1:1,8=39"));
}

TEST_F(ImagingSchedulerTest, ProductsOnTheirWayToTheOutboxAreTakenOutOfItAgain) {
  send("image.process", {"task=5"});
  static_cast<void>(orders());
  scheduler_.on_frames_listed(1, {{"a"}});
  static_cast<void>(orders());
  end(1, Server::processing, products());
  EXPECT_THAT(orders(), ElementsAre("queue 1"));
  send("image.cancel", {"task=5"});
  EXPECT_THAT(orders(), ElementsAre("stop 2")) << "behind the other one";
  static_cast<void>(reports());
  scheduler_.on_products_queued(1, 0, "", 1);
  scheduler_.on_sending_stopped(2, 1, 0);
  EXPECT_THAT(reports(), ElementsAre("1:1,8=39", "2:1,7"));
}

TEST_F(ImagingSchedulerTest, CancellingWhatIsNotThereSaysSoUnlessItIsARepetition) {
  send("image.cancel", {"task=5"});
  scheduler_.on_sending_stopped(1, 0, 0);
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "1:1,8=116"));
  restore("image.cancel", {"task=5"}, 0);
  scheduler_.on_sending_stopped(2, 0, 0);
  EXPECT_THAT(reports(), ElementsAre("2:1,3", "2:1,7"));
  send("image.cancel", {"task=5"});
  scheduler_.on_sending_stopped(3, 4, 0);
  EXPECT_THAT(reports(), ElementsAre("3:1,3", "3:1,7")) << "it was being sent";
}

// ---- faults

TEST_F(ImagingSchedulerTest, ARestartedNodeLosesItsTaskAndNoOther) {
  send("image.capture", {"task=1"});
  send("image.capture", {"task=2"});
  static_cast<void>(orders());
  end(1, Server::acquisition, frames(1));
  static_cast<void>(orders());
  for (const std::uint64_t id : {1, 2}) scheduler_.on_accepted(id, now_);
  static_cast<void>(reports());
  now_ += seconds(1);
  scheduler_.on_instance(Server::processing, 7, now_);
  scheduler_.on_instance(Server::acquisition, 3, now_);
  EXPECT_THAT(reports(), IsEmpty());
  now_ += seconds(1);
  scheduler_.on_instance(Server::processing, 8, now_);
  scheduler_.on_instance(Server::acquisition, 3, now_);
  EXPECT_THAT(reports(), ElementsAre("1:1,8=121"));
  EXPECT_THAT(orders(), ElementsAre("cancel 1", "clear 0"));
  end(2, Server::acquisition, frames(1));
  EXPECT_THAT(orders(), IsEmpty()) << "what it may still do ends first";
  scheduler_.on_cleared(Server::processing);
  EXPECT_THAT(orders(), ElementsAre("process 2"));
}

TEST_F(ImagingSchedulerTest, WhatWasSeenBeforeTheGoalWasTakenSaysNothing) {
  send("image.capture", {"task=1"});
  static_cast<void>(orders());
  const MonotonicTime looked = now_;
  now_ += milliseconds(1);
  scheduler_.on_accepted(1, now_);
  scheduler_.on_instance(Server::acquisition, 3, looked);
  scheduler_.on_instance(Server::acquisition, 4, now_ + seconds(2));
  EXPECT_EQ(scheduler_.tasks(), 1U);
  scheduler_.on_instance(Server::acquisition, 0, now_ + seconds(4));
  EXPECT_EQ(scheduler_.tasks(), 0U) << "gone";
}

TEST_F(ImagingSchedulerTest, ASilentNodeLosesItsTaskAndFeedbackIsASignOfLife) {
  send("image.capture", {"task=1", "frames=100", "exposure_us=1000000", "interval_ms=60000"});
  static_cast<void>(orders());
  scheduler_.on_accepted(1, now_);
  for (std::uint16_t done = 1; done < 20; ++done) {
    scheduler_.on_feedback(1, done, now_);
    now_ += seconds(60);
    scheduler_.on_time(time(), true);
  }
  EXPECT_EQ(scheduler_.tasks(), 1U);
  const auto due = scheduler_.next_due(time());
  ASSERT_TRUE(due);
  now_ = *due;
  EXPECT_THAT(orders(), ElementsAre("cancel 1", "clear 0"));
  EXPECT_THAT(reports().back(), "1:1,8=121");
}

TEST_F(ImagingSchedulerTest, ADiskThatDoesNotAnswerFailsWhatWaitsForIt) {
  send("image.process", {"task=5"});
  send("image.cancel", {"task=9"});
  static_cast<void>(orders());
  now_ += seconds(60);
  EXPECT_THAT(orders(), IsEmpty());
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "2:1,3", "1:1,8=56", "2:1,8=40"));
  scheduler_.on_frames_listed(1, {{"a"}});
  scheduler_.on_sending_stopped(2, 1, 0);
  EXPECT_THAT(reports(), IsEmpty());
}

TEST_F(ImagingSchedulerTest, ProductsThatCannotBeQueuedFailTheTask) {
  send("image.process", {"task=5"});
  static_cast<void>(orders());
  scheduler_.on_frames_listed(1, {{"a"}});
  static_cast<void>(orders());
  end(1, Server::processing, products());
  scheduler_.on_products_queued(1, mission::failure::no_space, "products/x", 0);
  EXPECT_THAT(reports().back(), "1:1,8=95");
}

// ---- across a restart of ttc

TEST_F(ImagingSchedulerTest, ACaptureThatMayHaveBegunIsNotTakenAgainAfterARestart) {
  for (const std::uint8_t step : std::vector<std::uint8_t>{1, 25, 50, 75}) {
    SCOPED_TRACE(static_cast<int>(step));
    const auto id = restore("image.capture", {"task=5"}, step);
    EXPECT_THAT(reports(), ElementsAre(std::to_string(id) + ":1,8=36"));
    EXPECT_THAT(orders(), ElementsAre("clear 0"));
    scheduler_.on_cleared(Server::acquisition);
  }
}

TEST_F(ImagingSchedulerTest, TheNextCaptureWaitsUntilTheOneOfTheEarlierProcessIsCancelled) {
  restore("image.capture", {"task=5"}, 1);
  send("image.capture", {"task=6"});
  EXPECT_THAT(orders(), ElementsAre("clear 0"));
  EXPECT_EQ(last_.server, Server::acquisition);
  EXPECT_THAT(orders(), IsEmpty());
  scheduler_.on_cleared(Server::acquisition);
  EXPECT_THAT(orders(), ElementsAre("capture 2"));
}

TEST_F(ImagingSchedulerTest, AServerThatIsNotThereHoldsNothingUpForLong) {
  restore("image.capture", {"task=5"}, 1);
  send("image.capture", {"task=6"});
  EXPECT_THAT(orders(), ElementsAre("clear 0"));
  EXPECT_EQ(scheduler_.next_due(time()), now_ + ImagingScheduler::clear_patience);
  now_ += ImagingScheduler::clear_patience;
  EXPECT_THAT(orders(), ElementsAre("capture 2"));
}

TEST_F(ImagingSchedulerTest, ACaptureThatWasNotAskedForIsTakenAfterARestart) {
  restore("image.capture", {"task=5", at(seconds(60))}, 0);
  EXPECT_THAT(orders(), IsEmpty());
  now_ += seconds(50);
  EXPECT_THAT(orders(), ElementsAre("capture 1"));
}

TEST_F(ImagingSchedulerTest, StoredFramesAreProcessedAfterARestart) {
  for (const std::uint8_t step : std::vector<std::uint8_t>{100, 101, 150, 200}) {
    SCOPED_TRACE(static_cast<int>(step));
    const auto id = restore("image.capture", {"task=5"}, step);
    const std::string list = "list " + std::to_string(id);
    if (step == 100) {
      EXPECT_THAT(orders(), ElementsAre(list));
    } else {
      EXPECT_THAT(orders(), ElementsAre("clear 0", list));
    }
    scheduler_.on_cleared(Server::processing);
    scheduler_.on_frames_listed(id, {{"a"}});
    EXPECT_THAT(orders(), ElementsAre("process " + std::to_string(id)));
    end(id, Server::processing, {});
  }
}

// ---- random sequences of events

/// Random telecommands and random answers, including wrong and late ones.
class RandomRun {
 public:
  /// @param telecommands  makes them
  RandomRun(std::uint32_t seed, ImagingSchedulerTest& telecommands)
      : random_(seed), telecommands_(telecommands) {}

  void step() {
    now_ += milliseconds(any(4000));
    const ImagingTime time{.now = now_, .utc = morning + (now_ - start), .utc_valid = any(10) != 0};
    do_anything();
    scheduler_.on_time(time, any(20) != 0);
    note_ends();
    if (any(3) != 0) carry_out();
  }
  /// Only time passes until nothing is due.
  void let_time_pass() {
    const auto time = [&] { return ImagingTime{now_, morning + (now_ - start), true}; };
    for (int i = 0; i < 200 && scheduler_.next_due(time()); ++i) {
      now_ = std::max(now_, *scheduler_.next_due(time())) + milliseconds(1);
      scheduler_.on_time(time(), true);
      carry_out();
    }
    note_ends();
  }
  [[nodiscard]] std::size_t tasks() const { return scheduler_.tasks(); }
  /// How often each telecommand has ended.
  [[nodiscard]] const std::map<std::uint64_t, int>& ends() const { return ends_; }

 private:
  std::uint32_t any(std::uint32_t below) { return static_cast<std::uint32_t>(random_() % below); }
  void note_ends() {
    static_cast<void>(report_queue_.take());
    for (const StageReached& stage : report_queue_.take_stages()) {
      if (stage.stage == Stage::completion || !stage.success) ++ends_[stage.id];
    }
  }
  void carry_out() {
    for (const ImagingOrder& order : scheduler_.take_orders()) {
      if (order.action == ImagingAction::capture) {
        EXPECT_LE(++captures_[order.id], 1 + rejected_[order.id]);
      }
      if (order.action == ImagingAction::capture) goals_[order.id] = Server::acquisition;
      if (order.action == ImagingAction::process) goals_[order.id] = Server::processing;
      EXPECT_LE(scheduler_.tasks(), ImagingScheduler::max_tasks);
    }
  }
  std::pair<TelecommandOrigin, mission::EncodedCommand> any_telecommand() {
    const std::string number = "task=" + std::to_string(1 + any(20));
    switch (any(6)) {
      case 0:
        return telecommands_.telecommand("image.cancel", {number});
      case 1:
        return telecommands_.telecommand("image.process", {number});
      case 2:
        return telecommands_.telecommand("image.send_frame", {number, "frame=1"});
      case 3:
        return telecommands_.telecommand(
            "image.capture", {number, ImagingSchedulerTest::at(now_ - start + seconds(any(100)))});
      default:
        return telecommands_.telecommand("image.capture",
                                         {number, any(4) == 0 ? "method=" : "method=streak"});
    }
  }
  void execute_any() {
    const auto [origin, encoded] = any_telecommand();
    scheduler_.execute({.origin = origin,
                        .command = encoded.command,
                        .arguments = ImagingSchedulerTest::arguments_of(encoded),
                        .repeated = any(2) == 0},
                       now_);
  }
  void end_any_goal(std::uint64_t about) {
    const auto goal = goals_.find(about);
    const Server server = goal != goals_.end() && any(8) != 0 ? goal->second : Server::processing;
    const auto how = static_cast<How>(any(4));
    const bool fits = scheduler_.knows(about) && goal != goals_.end() && goal->second == server;
    if (fits && how == How::rejected && server == Server::acquisition) ++rejected_[about];
    scheduler_.on_goal_end(about, server,
                           {.how = how,
                            .failure_code = static_cast<std::uint16_t>(any(3) == 0 ? 110 : 0),
                            .files = std::vector<std::string>(any(3), "x")},
                           now_);
  }
  void do_anything() {
    const std::uint64_t id = telecommands_.last_id_;
    const std::uint64_t about =
        id == 0 ? 1 : id - any(static_cast<std::uint32_t>(std::min<std::uint64_t>(id, 20)));
    switch (any(10)) {
      case 0:
      case 1:
        return execute_any();
      case 2:
        return scheduler_.on_accepted(about, now_);
      case 3:
        return scheduler_.on_feedback(about, static_cast<std::uint16_t>(any(300)), now_);
      case 4:
      case 5:
        return end_any_goal(about);
      case 6:
        return scheduler_.on_frames_listed(
            about, any(4) == 0 ? std::nullopt : std::optional(std::vector<std::string>(any(3), "x")));
      case 7:
        return scheduler_.on_products_queued(about, static_cast<std::uint16_t>(any(4) == 0 ? 95 : 0), "",
                                             any(3));
      case 8:
        return scheduler_.on_sending_stopped(about, any(3), static_cast<std::uint16_t>(any(4) == 0 ? 56 : 0));
      default:
        return scheduler_.on_instance(static_cast<Server>(any(2)), any(3), now_);
    }
  }

  std::mt19937 random_;
  ImagingSchedulerTest& telecommands_;
  ReportQueue report_queue_;
  ImagingScheduler scheduler_{report_queue_};
  MonotonicTime now_ = start;
  std::map<std::uint64_t, int> ends_;
  std::map<std::uint64_t, int> rejected_;
  std::map<std::uint64_t, int> captures_;
  std::map<std::uint64_t, Server> goals_;
};

/// Every accepted telecommand ends exactly once, each server has one goal at a time, and no capture is
/// ordered twice.
TEST_F(ImagingSchedulerTest, EveryTelecommandEndsExactlyOnceWhateverHappens) {
  for (std::uint32_t seed = 0; seed < (testing_support::slow ? 60 : 300); ++seed) {
    SCOPED_TRACE(seed);
    last_id_ = 0;
    RandomRun run(seed, *this);
    for (int step = 0; step < 400; ++step) run.step();
    run.let_time_pass();
    EXPECT_EQ(run.tasks(), 0U);
    EXPECT_EQ(run.ends().size(), last_id_);
    for (const auto& [each, count] : run.ends()) EXPECT_EQ(count, 1) << "telecommand " << each;
  }
}

}  // namespace
}  // namespace srfs
