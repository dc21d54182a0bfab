// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "hw/fake/fake_devices.hpp"
#include "nodes/can_switcher/power_lines.hpp"
#include "nodes/can_switcher/test/placed_peripherals.hpp"

namespace srfs {
namespace {

class PowerLinesTest : public testing::Test {
 protected:
  std::optional<Result<void, hw::GpioError>> cut(const suite::Peripheral& peripheral) {
    return cut_power(peripheral, lines_,
                     {[this](std::string_view) { return attended_; },
                      [this]() -> Result<std::unique_ptr<hw::GpioLines>, std::string> {
                        if (!chip_) return Err(std::string("no chip"));
                        auto opened = std::make_unique<hw::FakeGpioLines>();
                        opened->fail_with = fail_with_;
                        fake_ = opened.get();
                        return opened;
                      }});
  }

  bool attended_ = false;
  bool chip_ = true;
  std::optional<hw::GpioError> fail_with_;
  std::unique_ptr<hw::GpioLines> lines_;
  hw::FakeGpioLines* fake_ = nullptr;
};

TEST_F(PowerLinesTest, SwitchesTheRightLineOffAndHoldsIt) {
  const auto outcome = cut(eps);
  ASSERT_TRUE(outcome);
  EXPECT_TRUE(*outcome);
  ASSERT_NE(lines_, nullptr) << "the line falls back when it is given back";
  EXPECT_EQ(fake_->history, (std::vector<std::pair<std::uint8_t, bool>>{{eps.power_line, false}}));
}

TEST_F(PowerLinesTest, LeavesThePeripheralToAPayloadThatCameBackMeanwhile) {
  attended_ = true;
  EXPECT_FALSE(cut(eps));
  EXPECT_EQ(lines_, nullptr) << "the payload must be able to take its line";
}

TEST_F(PowerLinesTest, SayWhyItFailedAndKeepTheChipForTheNextTry) {
  fail_with_ = hw::GpioError::not_ours;
  EXPECT_EQ(cut(eps)->error(), hw::GpioError::not_ours);
  ASSERT_NE(lines_, nullptr);
  fake_->fail_with.reset();
  const hw::FakeGpioLines* held = fake_;
  EXPECT_TRUE(*cut(eps));
  EXPECT_EQ(fake_, held);
}

TEST_F(PowerLinesTest, FailWithoutAChip) {
  chip_ = false;
  EXPECT_EQ(cut(adcs)->error(), hw::GpioError::gone);
}

}  // namespace
}  // namespace srfs
