// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// ImageProcessingNode with stored frames on disk and a client of its action over real DDS.

#include <algorithm>
#include <filesystem>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <mission/structures.hpp>
#include <srfs_msgs/srv/check_alive.hpp>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "image/file/frame_file.hpp"
#include "image/file/frame_mark.hpp"
#include "lib/image/test/skies.hpp"
#include "nodes/image_processing/image_processing_node.hpp"
#include "tests/dds_domain.hpp"
#include "tests/var_folder.hpp"

namespace srfs {
namespace {

using Process = srfs_msgs::action::ProcessImage;
using srfs_msgs::msg::Event;
using srfs_msgs::msg::ImageDetections;
using srfs_msgs::msg::PayloadTelemetry;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class ImageProcessingNodeTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    here_ = ros::Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
    there_ = ros::Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
  }
  static void TearDownTestSuite() {
    here_.reset();
    there_.reset();
  }
  void SetUp() override {
    ASSERT_TRUE(write_file_atomically(folder_ / "d.yaml",
                                      "deployment: t\nnodes: [{name: image_processing, executable: x, "
                                      "parameters: {product_quota_mib: 1}}]\n"));
    deployment_ = std::make_unique<suite::Deployment>(suite::Deployment::load(folder_ / "d.yaml"));
    context_ = std::make_unique<suite::NodeContext>(
        suite::NodeContext{"image_processing", *deployment_, suite::VarPaths{folder_}, 1, executor_, *here_});
    node_ = std::make_unique<ImageProcessingNode>(*context_);
    node_->finish_declarations();
    ASSERT_TRUE(node_->go_to(ros::State::active)) << node_->failure_reason();
    client_ = std::make_unique<ros::ActionClient<Process>>(executor_, *there_, "/image/process");
    detections_reader_ = std::make_unique<ros::Subscription<ImageDetections>>(
        executor_, *there_, suite::topics::image_detections,
        [this](const ImageDetections& m, const ros::MessageInfo&) { detections_.push_back(m); });
    events_reader_ = std::make_unique<ros::Subscription<Event>>(
        executor_, *there_, suite::topics::event,
        [this](const Event& m, const ros::MessageInfo&) { events_.push_back(m); });
    ASSERT_TRUE(wait([&] {
      return client_->is_ready() && detections_reader_->publisher_count() == 1 &&
             events_reader_->publisher_count() == 1;
    }));
    // A match at the reader does not imply one at the writer. The event about a first, refused goal shows
    // that events arrive.
    ASSERT_TRUE(wait([&] {
      if (!probe_ || probe_->is_over()) probe_ = client_->send_goal(goal({"frames/none.fits"}), {});
      return !events_.empty();
    }));
    ASSERT_TRUE(wait([&] { return probe_->is_over(); }));
    events_.clear();
  }
  void TearDown() override {
    events_reader_.reset();
    detections_reader_.reset();
    client_.reset();
    if (node_) {
      node_->go_to(ros::State::unconfigured);
      node_->go_to(ros::State::finalized);
    }
    node_.reset();
  }
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(30));
  }

  std::string store_frame(int number, bool with_streak) {
    const hw_sim::SkyScene scene = image::small_scene(2.4, static_cast<std::uint64_t>(number));
    std::vector<hw_sim::SkyStreak> streaks;
    if (with_streak) {
      hw_sim::SkyStreak streak{60.3, 80.1, 190.4, 150.2, 1};
      streak.flux_e = 60 / hw_sim::streak_snr(scene, streak);
      streaks.push_back(streak);
    }
    const std::string name = "frames/0000000017/000" + std::to_string(number) + ".fits";
    std::filesystem::create_directories((images_ / name).parent_path());
    EXPECT_TRUE(
        image::write_fits(images_ / name, image::frame_of(scene, image::lattice(scene, 60), streaks).pixels));
    return name;
  }
  static Process::Goal goal(std::vector<std::string> files, std::string method = "streak") {
    Process::Goal goal;
    goal.task = 17;
    goal.files = std::move(files);
    goal.method = std::move(method);
    goal.budget_octets = 200'000;
    return goal;
  }

  struct Sent {
    std::shared_ptr<ros::ClientGoal<Process>> goal;
    std::vector<Process::Feedback> feedback;
    std::optional<ros::GoalOutcome<Process>> outcome;
    bool accepted = false;
  };
  void send(Sent& sent, const Process::Goal& goal) {
    ros::GoalCallbacks<Process> callbacks;
    callbacks.accepted = [&](UtcTime) { sent.accepted = true; };
    callbacks.feedback = [&](const Process::Feedback& f) { sent.feedback.push_back(f); };
    callbacks.ended = [&](const ros::GoalOutcome<Process>& outcome) { sent.outcome = outcome; };
    sent.goal = client_->send_goal(goal, std::move(callbacks), {.response = seconds(15)});
  }
  Process::Result end_of(Sent& sent, ros::GoalState state) {
    EXPECT_TRUE(wait([&] { return sent.outcome.has_value(); }));
    if (!sent.outcome || !*sent.outcome) {
      ADD_FAILURE() << (sent.outcome ? to_text(sent.outcome->error()) : "no end");
      return {};
    }
    EXPECT_EQ((*sent.outcome)->state, state);
    return (*sent.outcome)->result;
  }
  [[nodiscard]] std::ptrdiff_t count(std::uint16_t event) const {
    return std::count_if(events_.begin(), events_.end(), [&](const Event& e) { return e.event_id == event; });
  }

  static inline std::unique_ptr<ros::Participant> here_;
  static inline std::unique_ptr<ros::Participant> there_;
  ros::Executor executor_;
  const testing_support::VarFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  const std::filesystem::path images_ = folder_ / "images";
  std::unique_ptr<suite::Deployment> deployment_;
  std::unique_ptr<suite::NodeContext> context_;
  std::unique_ptr<ImageProcessingNode> node_;
  std::unique_ptr<ros::ActionClient<Process>> client_;
  std::shared_ptr<ros::ClientGoal<Process>> probe_;
  std::unique_ptr<ros::Subscription<ImageDetections>> detections_reader_;
  std::unique_ptr<ros::Subscription<Event>> events_reader_;
  std::vector<ImageDetections> detections_;
  std::vector<Event> events_;
};

TEST_F(ImageProcessingNodeTest, ProcessesTheFramesOfAGoalAndTellsWhatTheyHold) {
  const auto with = store_frame(1, true);
  const auto without = store_frame(2, false);
  Sent sent;

  send(sent, goal({with, "frames/0000000017/none.fits", without}));
  const Process::Result result = end_of(sent, ros::GoalState::succeeded);

  EXPECT_EQ(result.failure_code, 0);
  EXPECT_EQ(result.streaks, 1U);
  EXPECT_THAT(result.products, SizeIs(3));
  EXPECT_EQ(result.products.at(0), "products/0000000017/findings.json");
  std::uint64_t octets = 0;
  for (const auto& product : result.products) octets += std::filesystem::file_size(images_ / product);
  EXPECT_EQ(octets, result.octets);
  EXPECT_TRUE(image::has_mark(images_ / with, image::FrameMark::detected));
  EXPECT_TRUE(image::has_mark(images_ / without, image::FrameMark::nothing));
  EXPECT_TRUE(wait([&] { return detections_.size() == 2 && count(331) == 1 && count(333) == 1; }));
  EXPECT_EQ(detections_.at(0).file, with);
  EXPECT_THAT(detections_.at(0).streaks, SizeIs(1));
  EXPECT_EQ(detections_.at(0).task, 17U);
  EXPECT_THAT(detections_.at(1).streaks, IsEmpty());
  ASSERT_FALSE(sent.feedback.empty());
  EXPECT_EQ(sent.feedback.back().frames_done, 3);
}

TEST_F(ImageProcessingNodeTest, SaysWhyAGoalCannotBeDone) {
  const auto frame = store_frame(1, false);
  Sent method;
  send(method, goal({frame}, "comets"));
  EXPECT_EQ(end_of(method, ros::GoalState::aborted).failure_code, mission::failure::unknown_method);

  Process::Goal odd = goal({frame});
  odd.parameters = "threshold=-3";
  Sent parameter;
  send(parameter, odd);
  const Process::Result refused = end_of(parameter, ros::GoalState::aborted);
  EXPECT_EQ(refused.failure_code, mission::failure::bad_method_parameter);
  EXPECT_THAT(refused.reason, HasSubstr("threshold"));

  Sent nothing;
  send(nothing, goal({"../../etc/passwd"}));
  EXPECT_EQ(end_of(nothing, ros::GoalState::aborted).failure_code, mission::failure::no_usable_frame);
  EXPECT_TRUE(wait([&] { return count(333) == 1; }));
}

TEST_F(ImageProcessingNodeTest, CancelsBetweenFramesAndGoalsThatWaitAtOnce) {
  const auto frame = store_frame(1, true);
  const std::vector<std::string> many(200, frame);
  Sent running;
  Sent waiting;
  Sent last;
  send(running, goal(many));
  ASSERT_TRUE(wait([&] { return !running.feedback.empty(); }));
  send(waiting, goal({frame}));
  send(last, goal({frame}));
  ASSERT_TRUE(wait([&] { return waiting.accepted && last.accepted; }));

  waiting.goal->cancel();
  const Process::Result before = end_of(waiting, ros::GoalState::canceled);
  EXPECT_EQ(before.failure_code, mission::failure::aborted);
  EXPECT_FALSE(running.outcome.has_value());

  running.goal->cancel();
  const Process::Result cancelled = end_of(running, ros::GoalState::canceled);
  EXPECT_EQ(cancelled.failure_code, mission::failure::aborted);
  EXPECT_LT(running.feedback.back().frames_done, 200);
  EXPECT_EQ(end_of(last, ros::GoalState::succeeded).streaks, 1U);
}

TEST_F(ImageProcessingNodeTest, AnswersLivenessWhileItComputes) {
  const auto frame = store_frame(1, true);
  Sent running;
  send(running, goal(std::vector<std::string>(100, frame)));
  ASSERT_TRUE(wait([&] { return !running.feedback.empty(); }));

  ros::Client<srfs_msgs::srv::CheckAlive> alive(executor_, *there_, "/image_processing/check_alive",
                                                ros::Qos{}, ros::Priority::liveness);
  int answered = 0;
  for (int i = 0; i < 10; ++i) {
    bool done = false;
    alive.call({}, seconds(5), 1, [&](const auto& answer) {
      done = true;
      answered += answer ? 1 : 0;
    });
    ASSERT_TRUE(wait([&] { return done; }));
  }
  EXPECT_EQ(answered, 10);
  EXPECT_FALSE(running.outcome.has_value());
  running.goal->cancel();
  end_of(running, ros::GoalState::canceled);
}

/// A file whose reader waits until let_go(), like on a disk that does not answer.
class HangingFile {
 public:
  explicit HangingFile(std::filesystem::path path) : path_(std::move(path)) {
    EXPECT_EQ(::mkfifo(path_.c_str(), 0600), 0) << errno_text(errno);
  }
  ~HangingFile() {
    const Fd writer = open();
    std::filesystem::remove(path_);  // later readers do not hang
  }
  HangingFile(const HangingFile&) = delete;
  HangingFile& operator=(const HangingFile&) = delete;
  /// Releases the current reader.
  void let_go() const { const Fd writer = open(); }

 private:
  [[nodiscard]] Fd open() const { return Fd(::open(path_.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK)); }
  std::filesystem::path path_;
};

TEST_F(ImageProcessingNodeTest, ACleanupDoesNotWaitForTheStepThatRunsAndWhatComesNextDoes) {
  const auto slow = store_frame(1, true);
  const auto next = store_frame(2, false);
  const HangingFile mark(image::mark_path(images_ / slow, image::FrameMark::sent));
  Sent hanging;
  send(hanging, goal({slow}));
  ASSERT_TRUE(wait([&] { return !node_->is_at_rest(); }));

  ASSERT_TRUE(node_->go_to(ros::State::unconfigured));
  EXPECT_FALSE(node_->is_at_rest()) << "the step has not ended";
  ros::Client<srfs_msgs::srv::CheckAlive> alive(executor_, *there_, "/image_processing/check_alive",
                                                ros::Qos{}, ros::Priority::liveness);
  bool answered = false;
  alive.call({}, seconds(15), 1, [&](const auto& answer) { answered = answer.has_value(); });
  EXPECT_TRUE(wait([&] { return answered; }));
  ASSERT_TRUE(wait([&] { return !client_->is_ready(); })) << "its action is gone";

  ASSERT_TRUE(node_->go_to(ros::State::active)) << node_->failure_reason();
  ASSERT_TRUE(wait([&] { return client_->is_ready(); }));
  Sent later;
  send(later, goal({next}));
  ASSERT_TRUE(wait([&] { return later.accepted; }));
  EXPECT_FALSE(later.outcome) << "two steps at once would write over each other";
  ASSERT_TRUE(wait([&] {
    mark.let_go();  // the step may not have reached the file before
    return later.outcome.has_value();
  }));
  EXPECT_EQ(end_of(later, ros::GoalState::succeeded).failure_code, 0);
  EXPECT_TRUE(wait([&] { return node_->is_at_rest(); }));
}

TEST_F(ImageProcessingNodeTest, AbortsItsGoalsWhenItIsDeactivatedAndTakesNewOnesLater) {
  const auto frame = store_frame(1, true);
  Sent running;
  send(running, goal(std::vector<std::string>(100, frame)));
  ASSERT_TRUE(wait([&] { return !running.feedback.empty(); }));

  ASSERT_TRUE(node_->go_to(ros::State::inactive));
  EXPECT_EQ(end_of(running, ros::GoalState::aborted).failure_code, mission::failure::node_not_active);
  Sent refused;
  send(refused, goal({frame}));
  ASSERT_TRUE(wait([&] { return refused.outcome.has_value(); }));
  EXPECT_FALSE(refused.outcome->has_value());

  ASSERT_TRUE(node_->go_to(ros::State::active));
  Sent again;
  send(again, goal({frame}));
  EXPECT_EQ(end_of(again, ros::GoalState::succeeded).streaks, 1U);
}

}  // namespace
}  // namespace srfs
