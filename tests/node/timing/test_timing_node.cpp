// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// TimingNode over real DDS, without a receiver: time set by command, and time across a restart.

#include <gtest/gtest.h>

#include <srfs_msgs/msg/time_tick.hpp>
#include <srfs_msgs/srv/set_time.hpp>

#include "base/file.hpp"
#include "nodes/timing/timing_node.hpp"
#include "ros/client.hpp"
#include "suite/mission_time.hpp"
#include "tests/dds_domain.hpp"
#include "tests/var_folder.hpp"

namespace srfs {
namespace {

using srfs_msgs::msg::TimeTick;
using srfs_msgs::srv::SetTime;

constexpr std::int64_t commanded_s = 1'795'248'000;
constexpr std::int64_t second_ns = 1'000'000'000;

/// The timing node in one participant, the listener in another; both on one work thread.
class TimingNodeTest : public testing::Test {
 protected:
  void SetUp() override {
    here_ = ros::Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
    there_ = ros::Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
    ticks_ = std::make_unique<ros::Subscription<TimeTick>>(
        executor_, *there_, suite::topics::time_tick,
        [this](const TimeTick& tick, const ros::MessageInfo&) { received_.push_back(tick); });
    client_ = std::make_unique<ros::Client<SetTime>>(executor_, *there_, "/timing/set_time", ros::Qos{},
                                                     ros::Priority::normal);
  }
  void TearDown() override {
    end();
    std::filesystem::remove_all(suite::VarPaths{folder_}.memory());
  }
  void end() {
    if (node_) {
      node_->go_to(ros::State::unconfigured);
      node_->go_to(ros::State::finalized);
    }
    node_.reset();
  }
  void activate(const std::string& parameters = "") {
    const std::string yaml =
        "deployment: t\n"
        "devices: { gps_pulse: \"sim:pulse.sock\", gps_serial: \"serial:gps\", watchdog: "
        "\"sim:watchdog.sock\" }\n"
        "link: { spacecraft_id: 0xAB, tc_channels: [{ vc: 1, security: none }] }\n"
        "nodes: [{ name: timing, executable: timing_node, parameters: { tick_period_ms: 20" +
        parameters + " } }]\n";
    ASSERT_TRUE(write_file_atomically(folder_ / "d.yaml", yaml));
    deployment_ = std::make_unique<suite::Deployment>(suite::Deployment::load(folder_ / "d.yaml"));
    context_ = std::make_unique<suite::NodeContext>(
        suite::NodeContext{"timing", *deployment_, suite::VarPaths{folder_}, 1, executor_, *here_});
    node_ = std::make_unique<TimingNode>(*context_);
    ASSERT_TRUE(node_->go_to(ros::State::active)) << node_->failure_reason();
  }
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(20));
  }
  SetTime::Response set_time(std::int64_t utc_ns, bool allow_jump, std::uint64_t monotonic_ns = 0) {
    SetTime::Request request;
    request.utc_ns = utc_ns;
    request.monotonic_ns = monotonic_ns;
    request.accuracy_ns = 5'000'000;
    request.allow_jump = allow_jump;
    std::optional<SetTime::Response> answer;
    client_->call(request, seconds(20), 1, [&](Result<SetTime::Response, ros::CallError> outcome) {
      if (outcome) answer = *outcome;
    });
    EXPECT_TRUE(wait([&] { return answer.has_value(); }));
    return answer.value_or(SetTime::Response{});
  }
  /// The first tick that is due after this call.
  TimeTick next_tick() {
    const auto now = static_cast<std::uint64_t>(monotonic_now().ns());
    EXPECT_TRUE(wait([&] { return !received_.empty() && received_.back().monotonic_ns > now; }));
    return received_.empty() ? TimeTick{} : received_.back();
  }
  /// UTC minus monotonic time, which is the same in all ticks unless the time is being slewed.
  static std::int64_t offset(const TimeTick& tick) {
    return ros::from_message(tick.utc).ns() - static_cast<std::int64_t>(tick.monotonic_ns);
  }
  void expect_even_ticks() const {
    for (std::size_t i = 1; i < received_.size(); ++i) {
      if (received_[i].cycle != received_[i - 1].cycle + 1) continue;
      const auto interval =
          static_cast<std::int64_t>(received_[i].monotonic_ns - received_[i - 1].monotonic_ns);
      EXPECT_GE(interval, 19'800'000);
      EXPECT_LE(interval, 20'200'000);
    }
  }

  testing_support::VarFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  ros::Executor executor_;
  std::unique_ptr<ros::Participant> here_;
  std::unique_ptr<ros::Participant> there_;
  std::unique_ptr<suite::Deployment> deployment_;
  std::unique_ptr<suite::NodeContext> context_;
  std::unique_ptr<TimingNode> node_;
  std::vector<TimeTick> received_;
  std::unique_ptr<ros::Subscription<TimeTick>> ticks_;
  std::unique_ptr<ros::Client<SetTime>> client_;
};

TEST_F(TimingNodeTest, WithoutAReceiverAnOrderSetsTheTimeAndOnlyAnAllowedJumpStepsIt) {
  activate();
  const TimeTick before = next_tick();
  EXPECT_FALSE(before.time_valid);
  EXPECT_EQ(before.sync_state, TimeTick::UNLOCKED);
  EXPECT_DOUBLE_EQ(before.estimated_error_s, 1000);

  const auto at = static_cast<std::uint64_t>(monotonic_now().ns());
  const SetTime::Response first = set_time(commanded_s * second_ns, false, at);
  EXPECT_EQ(first.outcome, SetTime::Response::STEPPED) << "an invalid time is set without further ado";
  const TimeTick set = next_tick();
  EXPECT_TRUE(set.time_valid);
  EXPECT_EQ(offset(set), commanded_s * second_ns - static_cast<std::int64_t>(at));
  EXPECT_GE(set.estimated_error_s, 0.005);
  EXPECT_LT(set.estimated_error_s, 0.1);

  const auto now_ns = [&] { return monotonic_now().ns() + offset(set); };
  const SetTime::Response far = set_time(now_ns() + 3600 * second_ns, false);
  EXPECT_EQ(far.outcome, SetTime::Response::JUMP_REFUSED);
  EXPECT_GT(far.difference_ns, 3500 * second_ns);
  EXPECT_EQ(offset(next_tick()), offset(set));

  EXPECT_EQ(set_time(0, true).outcome, SetTime::Response::IMPLAUSIBLE);
  EXPECT_EQ(set_time(now_ns(), true, 1).outcome, SetTime::Response::IMPLAUSIBLE);
  EXPECT_EQ(offset(next_tick()), offset(set));

  const SetTime::Response jumped = set_time(now_ns() - 3600 * second_ns, true);
  EXPECT_EQ(jumped.outcome, SetTime::Response::STEPPED);
  EXPECT_LT(offset(next_tick()), offset(set) - 3500 * second_ns);
  expect_even_ticks();
}

TEST_F(TimingNodeTest, ASmallOrderedDifferenceIsSlewed) {
  activate();
  const auto at = static_cast<std::uint64_t>(monotonic_now().ns());
  set_time(commanded_s * second_ns, false, at);
  const TimeTick set = next_tick();
  const SetTime::Response slewed = set_time(commanded_s * second_ns + second_ns / 2, false, at);
  EXPECT_EQ(slewed.outcome, SetTime::Response::SLEWED);
  EXPECT_EQ(slewed.difference_ns, second_ns / 2);
  const TimeTick first = next_tick();
  ASSERT_TRUE(wait([&] { return received_.back().monotonic_ns > first.monotonic_ns + 500'000'000; }));
  EXPECT_GT(offset(received_.back()), offset(first)) << "on its way";
  EXPECT_LT(offset(received_.back()), offset(set) + second_ns / 2);
  EXPECT_GT(received_.back().estimated_error_s, 0.1) << "and says how far it still is";
  std::optional<TimeTick> previous;
  for (const TimeTick& tick : received_) {
    if (tick.monotonic_ns < set.monotonic_ns) continue;
    if (previous) {
      const auto elapsed = static_cast<double>(tick.monotonic_ns - previous->monotonic_ns);
      const auto shown =
          static_cast<double>((ros::from_message(tick.utc) - ros::from_message(previous->utc)).count());
      EXPECT_GE(shown, elapsed * 0.994 - 2);
      EXPECT_LE(shown, elapsed * 1.006 + 2);
    }
    previous = tick;
  }
  expect_even_ticks();
}

TEST_F(TimingNodeTest, ARestartCarriesTheTimeOn) {
  activate();
  const auto at = static_cast<std::uint64_t>(monotonic_now().ns());
  set_time(commanded_s * second_ns, false, at);
  const TimeTick before = next_tick();
  end();
  received_.clear();
  activate();
  const TimeTick after = next_tick();
  EXPECT_TRUE(after.time_valid);
  EXPECT_GT(after.cycle, before.cycle);
  EXPECT_NEAR(static_cast<double>(offset(after) - offset(before)), 0, 1000);
}

TEST_F(TimingNodeTest, RefusesToConfigureWithANotBeforeThatIsNoDate) {
  const std::string yaml =
      "deployment: t\n"
      "devices: { gps_pulse: \"sim:pulse.sock\", gps_serial: \"serial:gps\", watchdog: \"sim:watchdog.sock\" "
      "}\n"
      "link: { spacecraft_id: 0xAB, tc_channels: [{ vc: 1, security: none }] }\n"
      "nodes: [{ name: timing, executable: timing_node, parameters: { not_before: yesterday } }]\n";
  ASSERT_TRUE(write_file_atomically(folder_ / "d.yaml", yaml));
  deployment_ = std::make_unique<suite::Deployment>(suite::Deployment::load(folder_ / "d.yaml"));
  context_ = std::make_unique<suite::NodeContext>(
      suite::NodeContext{"timing", *deployment_, suite::VarPaths{folder_}, 1, executor_, *here_});
  node_ = std::make_unique<TimingNode>(*context_);
  EXPECT_FALSE(node_->go_to(ros::State::inactive));
  EXPECT_NE(node_->failure_reason().find("not_before"), std::string::npos) << node_->failure_reason();
}

}  // namespace
}  // namespace srfs
