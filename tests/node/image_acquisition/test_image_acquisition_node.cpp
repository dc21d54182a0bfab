// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// ImageAcquisitionNode over real DDS, with a camera that the test controls.

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.hpp"
#include "image/file/frame_file.hpp"
#include "image/file/frame_mark.hpp"
#include "nodes/image_acquisition/image_acquisition_node.hpp"
#include "tests/dds_domain.hpp"
#include "tests/node/image_acquisition/scripted_camera.hpp"
#include "tests/var_folder.hpp"

namespace srfs {
namespace {

using Capture = srfs_msgs::action::CaptureImage;
using ros::GoalState;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing_support::CameraScript;
using testing_support::ScriptedCamera;
using testing_support::Shot;
namespace failure = mission::failure;

const UtcTime utc_at_start(seconds(1'795'248'000));

/// The node in one participant, its client in another; both on one work thread.
class ImageAcquisitionNodeTest : public testing::Test {
 protected:
  static ros::Participant& participant(std::size_t side) {
    static const std::array<std::unique_ptr<ros::Participant>, 2> both{
        ros::Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value(),
        ros::Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value()};
    return *both.at(side);
  }
  void SetUp() override {
    ticks_ =
        std::make_unique<ros::Publisher<srfs_msgs::msg::TimeTick>>(participant(1), suite::topics::time_tick);
    images_ = std::make_unique<ros::Subscription<sensor_msgs::msg::Image>>(
        executor_, participant(1), suite::topics::image_raw,
        [this](const sensor_msgs::msg::Image& image, const ros::MessageInfo&) {
          received_.push_back(image);
        });
    events_ = std::make_unique<ros::Subscription<srfs_msgs::msg::Event>>(
        executor_, participant(1), suite::topics::event,
        [this](const srfs_msgs::msg::Event& event, const ros::MessageInfo&) {
          event_ids_.push_back(event.event_id);
        });
    client_ = std::make_unique<ros::ActionClient<Capture>>(executor_, participant(1), "/image/capture");
  }
  void TearDown() override {
    if (node_) {
      node_->go_to(ros::State::unconfigured);
      node_->go_to(ros::State::finalized);
    }
    client_.reset();
    node_.reset();
  }
  void configure(const std::string& parameters = "frame_patience_ms: 200",
                 const std::string& devices = "camera: \"sim:x\"") {
    ASSERT_TRUE(write_file_atomically(
        folder_ / "d.yaml", "deployment: t\ndevices: { " + devices +
                                " }\nnodes: [{ name: image_acquisition, executable: x, parameters: { " +
                                parameters + " } }]\n"));
    deployment_ = std::make_unique<suite::Deployment>(suite::Deployment::load(folder_ / "d.yaml"));
    context_ = std::make_unique<suite::NodeContext>(suite::NodeContext{
        "image_acquisition", *deployment_, suite::VarPaths{folder_}, 1, executor_, participant(0)});
    node_ = std::make_unique<ImageAcquisitionNode>(
        *context_, [this](std::string_view, const std::filesystem::path&) {
          return Result<std::unique_ptr<hw::Camera>, hw::HwError>(std::make_unique<ScriptedCamera>(script_));
        });
    ASSERT_TRUE(node_->go_to(ros::State::inactive)) << node_->failure_reason();
  }
  void activate(const std::string& parameters = "frame_patience_ms: 200") {
    configure(parameters);
    ASSERT_TRUE(node_->go_to(ros::State::active));
    ASSERT_TRUE(wait([&] { return ticks_->subscription_count() == 1 && images_->publisher_count() == 1; }));
  }
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(20));
  }
  void tick(bool valid = true) {
    srfs_msgs::msg::TimeTick m;
    const MonotonicTime t = monotonic_now();
    m.utc = ros::to_message(utc_at_start + (t - start_));
    m.time_valid = valid;
    m.monotonic_ns = static_cast<std::uint64_t>(t.ns());
    ticks_->publish(m);
  }
  UtcTime utc_now() const { return utc_at_start + (monotonic_now() - start_); }

  struct Sent {
    std::shared_ptr<ros::ClientGoal<Capture>> goal;
    std::vector<Capture::Feedback> feedback;
    std::optional<ros::GoalOutcome<Capture>> outcome;
    bool accepted = false;
  };
  static Capture::Goal task(std::uint32_t number, std::uint16_t frames = 1, std::uint32_t interval_ms = 0) {
    Capture::Goal goal;
    goal.task = number;
    goal.exposure_us = 10'000;
    goal.frames = frames;
    goal.interval_ms = interval_ms;
    return goal;
  }
  void send(Sent& sent, const Capture::Goal& goal) {
    ros::GoalCallbacks<Capture> callbacks;
    callbacks.accepted = [&](UtcTime) { sent.accepted = true; };
    callbacks.feedback = [&](const Capture::Feedback& f) { sent.feedback.push_back(f); };
    callbacks.ended = [&](const ros::GoalOutcome<Capture>& outcome) { sent.outcome = outcome; };
    sent.goal = client_->send_goal(goal, std::move(callbacks), {.response = seconds(15)});
  }
  Capture::Result expect_end(Sent& sent, GoalState state) {
    EXPECT_TRUE(wait([&] { return sent.outcome.has_value(); }));
    if (!sent.outcome || !*sent.outcome) {
      ADD_FAILURE() << "no result";
      return {};
    }
    EXPECT_EQ((*sent.outcome)->state, state) << (*sent.outcome)->result.reason;
    return (*sent.outcome)->result;
  }
  Capture::Result capture(const Capture::Goal& goal, GoalState state = GoalState::succeeded) {
    Sent sent;
    send(sent, goal);
    return expect_end(sent, state);
  }
  std::filesystem::path images() const { return folder_ / "images"; }

  testing_support::VarFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  const MonotonicTime start_ = monotonic_now();
  ros::Executor executor_;
  std::shared_ptr<CameraScript> script_ = std::make_shared<CameraScript>();
  std::unique_ptr<suite::Deployment> deployment_;
  std::unique_ptr<suite::NodeContext> context_;
  std::unique_ptr<ImageAcquisitionNode> node_;
  std::unique_ptr<ros::Publisher<srfs_msgs::msg::TimeTick>> ticks_;
  std::unique_ptr<ros::Subscription<sensor_msgs::msg::Image>> images_;
  std::unique_ptr<ros::Subscription<srfs_msgs::msg::Event>> events_;
  std::unique_ptr<ros::ActionClient<Capture>> client_;
  std::vector<sensor_msgs::msg::Image> received_;
  std::vector<std::uint16_t> event_ids_;
};

TEST_F(ImageAcquisitionNodeTest, TakesStoresAndPublishesTheFramesOfATask) {
  activate();
  Sent sent;
  send(sent, task(17, 3));
  const auto result = expect_end(sent, GoalState::succeeded);
  EXPECT_EQ(result.failure_code, 0);
  EXPECT_THAT(result.files, ElementsAre("frames/0000000017/0001.fits", "frames/0000000017/0002.fits",
                                        "frames/0000000017/0003.fits"));
  const auto frame = image::read_frame(images() / result.files.at(1));
  ASSERT_TRUE(frame) << frame.error().reason;
  EXPECT_EQ(frame->pixels.at(5, 7), 1002.0F);
  EXPECT_EQ(frame->saturation_adu, 4095.0F);
  EXPECT_FALSE(frame->time_s) << "nobody knows the time";

  ASSERT_TRUE(wait([&] { return received_.size() == 3; }));
  const auto& image = received_.at(1);
  EXPECT_EQ(image.header.frame_id, "0000000017/0002");
  EXPECT_EQ(image.encoding, "mono16");
  EXPECT_EQ(image.width, 64U);
  EXPECT_EQ(image.height, 48U);
  EXPECT_EQ(image.step, 128U);
  ASSERT_EQ(image.data.size(), 128U * 48U);
  EXPECT_EQ(image.data[7 * 128 + 5 * 2] | image.data[7 * 128 + 5 * 2 + 1] << 8, 1002);
}

TEST_F(ImageAcquisitionNodeTest, BeginsAtTheCommandedTimeAndSaysHowFarOff) {
  activate();
  tick();
  Capture::Goal goal = task(18, 3, 100);
  const UtcTime start = utc_now() + milliseconds(1200);
  goal.start = ros::to_message(start);
  Sent sent;
  send(sent, goal);
  ASSERT_TRUE(wait([&] { return sent.accepted; }));
  tick();
  const auto result = expect_end(sent, GoalState::succeeded);
  ASSERT_EQ(result.files.size(), 3U);
  EXPECT_GE(result.start_error_us, 0);  // no upper limit, because the machine may be busy
  double latest_s = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto frame = image::read_frame(images() / result.files.at(i));
    ASSERT_TRUE(frame && frame->time_s);
    const double due_s = static_cast<double>((start + static_cast<int>(i) * milliseconds(100)).ns()) * 1e-9;
    EXPECT_GE(*frame->time_s - due_s, -0.001);
    latest_s = std::max(latest_s, *frame->time_s - due_s);
  }
  EXPECT_NEAR(latest_s, result.start_error_us * 1e-6, 0.11) << "as the frames say";
}

TEST_F(ImageAcquisitionNodeTest, RefusesWhatIsPastOutOfRangeOrUnderWay) {
  activate();
  tick();
  ASSERT_TRUE(wait([&] { return !script_->calls().empty(); }));
  Capture::Goal past = task(19);
  past.start = ros::to_message(utc_now() - seconds(2));
  // The node knows the time after it has received a tick.
  executor_.spin_until([] { return false; }, monotonic_now() + milliseconds(200));
  const auto refused = capture(past, GoalState::aborted);
  EXPECT_EQ(refused.failure_code, failure::capture_time_past);
  EXPECT_THAT(refused.reason, HasSubstr("ago"));

  EXPECT_EQ(capture(task(19, 0), GoalState::aborted).failure_code, failure::bad_argument);
  Capture::Goal loud = task(19);
  loud.gain_db = 55;
  const auto bad = capture(loud, GoalState::aborted);
  EXPECT_EQ(bad.failure_code, failure::bad_camera_setting);
  EXPECT_EQ(bad.reason, "gain 50 dB at most");

  Capture::Goal later = task(20);
  later.start = ros::to_message(utc_now() + seconds(600));
  Sent waiting;
  send(waiting, later);
  EXPECT_EQ(capture(task(20), GoalState::aborted).failure_code, failure::task_exists);
  EXPECT_EQ(capture(task(21)).files.size(), 1U) << "another task goes before the one that waits";
  waiting.goal->cancel();
  EXPECT_THAT(expect_end(waiting, GoalState::canceled).files, IsEmpty());
}

TEST_F(ImageAcquisitionNodeTest, TriesAgainWhatCameShortTwiceOrNotAtAll) {
  activate();
  script_->next({Shot::good, Shot::repeated, Shot::unsound, Shot::good, Shot::silent});
  const auto result = capture(task(22, 4));
  EXPECT_EQ(result.files.size(), 4U);
}

TEST_F(ImageAcquisitionNodeTest, GivesUpAFrameAfterThreeTriesAndKeepsTheOthers) {
  activate();
  script_->next({Shot::good, Shot::unsound, Shot::unsound, Shot::unsound});
  const auto result = capture(task(23, 3), GoalState::aborted);
  EXPECT_EQ(result.failure_code, failure::camera_failed);
  EXPECT_EQ(result.reason, "frame 2: short: 7 octets");
  EXPECT_THAT(result.files, ElementsAre("frames/0000000023/0001.fits"));
  EXPECT_THAT(capture(task(23)).files, ElementsAre("frames/0000000023/0002.fits"))
      << "nothing is written over";
}

TEST_F(ImageAcquisitionNodeTest, GoesOnWhenTheCameraComesBack) {
  activate();
  script_->next({Shot::good, Shot::unplugged});
  Sent sent;
  send(sent, task(24, 3));
  ASSERT_TRUE(
      wait([&] { return testing::Value(event_ids_, Contains(mission::ImageCameraLostEvent::event_id)); }));
  script_->plug_in(true);
  EXPECT_EQ(expect_end(sent, GoalState::succeeded).files.size(), 3U);
}

TEST_F(ImageAcquisitionNodeTest, LetsTheCameraRestBetweenFramesThatAreFarApart) {
  activate();
  Sent sent;
  send(sent, task(33, 2, 6000));
  ASSERT_TRUE(wait([&] { return sent.feedback.size() == 1; }));
  ASSERT_TRUE(wait([&] { return testing::Value(script_->calls(), Contains("abandon")); }));
  const auto result = expect_end(sent, GoalState::succeeded);
  EXPECT_EQ(result.files.size(), 2U);
  EXPECT_LT(std::abs(result.start_error_us), 5'000'000) << "not since the first frame was due";
}

TEST_F(ImageAcquisitionNodeTest, SaysWhenThereIsNoCamera) {
  script_->plug_in(false);
  activate();
  const auto result = capture(task(25), GoalState::aborted);
  EXPECT_EQ(result.failure_code, failure::camera_absent);
  EXPECT_EQ(result.reason, "unplugged");
}

TEST_F(ImageAcquisitionNodeTest, CanBeCancelledDuringAnExposureAndKeepsWhatItHas) {
  activate("frame_patience_ms: 20000");
  script_->next({Shot::good, Shot::silent});
  Sent sent;
  Capture::Goal goal = task(26, 5);
  send(sent, goal);
  ASSERT_TRUE(wait([&] { return sent.feedback.size() == 1; }));
  sent.goal->cancel();
  const auto result = expect_end(sent, GoalState::canceled);
  EXPECT_GE(result.files.size(), 1U);
  EXPECT_LT(result.files.size(), 5U);
  EXPECT_THAT(script_->calls(), Contains("abandon"));
}

TEST_F(ImageAcquisitionNodeTest, FailsWithTheStoreFullAndRemovesNoDetection) {
  const std::string content(1U << 20, 'x');
  const auto old = images() / "frames/0000000001/0001.fits";
  ASSERT_TRUE(write_file_atomically(old, content));
  ASSERT_TRUE(image::mark_frame(old, image::FrameMark::detected));
  configure("store_quota_mib: 1");
  ASSERT_TRUE(node_->go_to(ros::State::active));
  const auto result = capture(task(27), GoalState::aborted);
  EXPECT_EQ(result.failure_code, failure::frame_store_full);
  EXPECT_THAT(result.reason, HasSubstr("1 of 1 frames have detections not sent"));
  EXPECT_TRUE(std::filesystem::exists(old));
  EXPECT_TRUE(
      wait([&] { return testing::Value(event_ids_, Contains(mission::ImageStoreFullEvent::event_id)); }));
  ASSERT_TRUE(image::mark_frame(old, image::FrameMark::sent));
  EXPECT_EQ(capture(task(28)).files.size(), 1U);
  EXPECT_FALSE(std::filesystem::exists(old));
}

TEST_F(ImageAcquisitionNodeTest, RefusesTasksWhileTheStoreCannotBeReadAndGoesOnWhenItIsMended) {
  ASSERT_TRUE(write_file_atomically(images() / "frames", "a file where a folder is due"));
  activate();
  const auto refused = capture(task(29), GoalState::aborted);
  EXPECT_EQ(refused.failure_code, failure::disk_failed);
  EXPECT_THAT(refused.reason, HasSubstr("images/frames"));

  std::filesystem::remove(images() / "frames");
  const auto is_taken = [&](std::uint32_t number) {
    Sent sent;
    send(sent, task(number));
    return wait([&] { return sent.outcome.has_value(); }) && *sent.outcome &&
           (*sent.outcome)->state == GoalState::succeeded;
  };
  const MonotonicTime deadline = monotonic_now() + seconds(20);
  for (std::uint32_t number = 30; !is_taken(number); ++number) ASSERT_LT(monotonic_now(), deadline);
}

TEST_F(ImageAcquisitionNodeTest, ClosesTheCameraWhenInactiveAndEndsItsTasksThen) {
  activate();
  script_->next({Shot::silent});
  Sent sent;
  send(sent, task(29, 2));
  ASSERT_TRUE(wait([&] { return sent.accepted; }));
  ASSERT_TRUE(node_->go_to(ros::State::inactive));
  const auto result = expect_end(sent, GoalState::aborted);
  EXPECT_EQ(result.failure_code, failure::camera_absent);
  EXPECT_THAT(result.reason, HasSubstr("deactivated"));
  ASSERT_TRUE(wait([&] { return node_->is_at_rest(); }));
  EXPECT_EQ(script_->calls().back(), "close");
  EXPECT_EQ(capture(task(30), GoalState::aborted).reason, "the node is not active");
  ASSERT_TRUE(node_->go_to(ros::State::active));
  EXPECT_EQ(capture(task(31)).files.size(), 1U);
}

TEST_F(ImageAcquisitionNodeTest, WithoutACameraInTheDeploymentItSaysSo) {
  configure("instrument: none", "");
  ASSERT_TRUE(node_->go_to(ros::State::active));
  const auto result = capture(task(32), GoalState::aborted);
  EXPECT_EQ(result.failure_code, failure::camera_absent);
  EXPECT_EQ(result.reason, "the deployment has no camera");
}

}  // namespace
}  // namespace srfs
