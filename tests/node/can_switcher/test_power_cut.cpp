// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <set>

#include <gtest/gtest.h>

#include "hw/fake/fake_devices.hpp"
#include "nodes/can_switcher/power_cut.hpp"
#include "ros/executor.hpp"

namespace srfs {
namespace {

/// Lines that notify the test when their owner releases them.
class WatchedLines : public hw::FakeGpioLines {
 public:
  explicit WatchedLines(WatchedLines*& owned) : owned_(owned) { owned_ = this; }
  ~WatchedLines() override { owned_ = nullptr; }
  WatchedLines(const WatchedLines&) = delete;
  WatchedLines& operator=(const WatchedLines&) = delete;

 private:
  WatchedLines*& owned_;
};

class PowerCutTest : public ::testing::Test {
 protected:
  PowerCutTest() {
    cut_.emplace(
        worker_,
        PowerCut::Hooks{.open = [this]() -> std::unique_ptr<hw::GpioLines> {
                          if (!chip_) return nullptr;
                          auto lines = std::make_unique<WatchedLines>(lines_);
                          lines->fail_with = fail_with_;
                          return lines;
                        },
                        .attended = [this](std::string_view payload) { return running_.contains(payload); },
                        .done =
                            [this](const hw::Peripheral& p, std::optional<hw::GpioError> problem) {
                              done_.emplace_back(p.payload, problem);
                            }});
  }
  /// Finishes the worker's job and its continuation on the work thread.
  void finish() { worker_.drain(); }

  ros::Executor executor_;
  ros::Worker worker_{executor_, "gpio", 6, seconds(3)};
  std::set<std::string_view> running_;
  bool chip_ = true;
  std::optional<hw::GpioError> fail_with_;
  WatchedLines* lines_ = nullptr;
  std::vector<std::pair<std::string_view, std::optional<hw::GpioError>>> done_;
  std::optional<PowerCut> cut_;
};

TEST_F(PowerCutTest, SwitchesThePowerOffAndHoldsTheLineUntilThePayloadHasAProcess) {
  cut_->cut(hw::eps);
  finish();
  ASSERT_EQ(done_.size(), 1U);
  EXPECT_EQ(done_.front().first, "payload_eps");
  EXPECT_FALSE(done_.front().second);
  ASSERT_NE(lines_, nullptr);
  EXPECT_EQ(lines_->history, (std::vector<std::pair<std::uint8_t, bool>>{{hw::gpio_power_eps, false}}));

  cut_->give_back();
  finish();
  EXPECT_NE(lines_, nullptr) << "its payload is still away";
  running_.insert("payload_eps");
  cut_->give_back();
  finish();
  EXPECT_EQ(lines_, nullptr) << "the payload must be able to take its line";
}

TEST_F(PowerCutTest, LeavesThePeripheralToAPayloadThatCameBackMeanwhile) {
  running_.insert("payload_eps");
  cut_->cut(hw::eps);
  finish();
  EXPECT_TRUE(done_.empty());
  EXPECT_EQ(lines_, nullptr);
}

TEST_F(PowerCutTest, SaysWhyItFailedAndTriesAgainWhenAsked) {
  fail_with_ = hw::GpioError::not_ours;
  cut_->cut(hw::eps);
  finish();
  ASSERT_EQ(done_.size(), 1U);
  EXPECT_EQ(done_.back().second, hw::GpioError::not_ours);
  lines_->fail_with.reset();
  cut_->cut(hw::eps);
  finish();
  ASSERT_EQ(done_.size(), 2U);
  EXPECT_FALSE(done_.back().second);
}

TEST_F(PowerCutTest, FailsWithoutAChip) {
  chip_ = false;
  cut_->cut(hw::adcs);
  finish();
  ASSERT_EQ(done_.size(), 1U);
  EXPECT_EQ(done_.back().second, hw::GpioError::gone);
}

}  // namespace
}  // namespace srfs
