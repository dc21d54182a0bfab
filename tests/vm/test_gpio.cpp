// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The GPIO back-end on a chip behind the kernel's GPIO character device.

#include <array>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hw/open.hpp"
#include "tests/temporary_folder.hpp"
#include "tests/vm/virtual_gpio.hpp"

namespace srfs::hw {
namespace {

using vm::VirtualGpio;

/// The three power switches, and input 8 on the last line.
constexpr const char* plan = "?0=0&1=1&2=2&8=3";

/// Plugged in before the first test, so that the chips are ready in time: `lasting` for all tests, `passing`
/// for the test that unplugs it.
class Chips : public testing::Environment {
 public:
  void SetUp() override {
    if (!VirtualGpio::kernel_has_it()) return;
    if (!lasting) lasting.emplace();
    passing.emplace();
  }
  void TearDown() override { passing.reset(); }
  std::optional<VirtualGpio> lasting;
  std::optional<VirtualGpio> passing;
};
Chips& chips() {
  static auto* const the = static_cast<Chips*>(testing::AddGlobalTestEnvironment(new Chips));
  return *the;
}
[[maybe_unused]] const Chips& registered = chips();

class GpioChipOfTheKernel : public testing::Test {
 protected:
  void SetUp() override {
    if (!chips().lasting) GTEST_SKIP() << "this kernel has no uhid or no hid-mcp2221 (Debian's has)";
  }
};

std::unique_ptr<GpioLines> open(const std::filesystem::path& device, const std::string& map = plan) {
  return open_gpio("gpiochip:" + device.string() + map, "/").value();
}

TEST_F(GpioChipOfTheKernel, SwitchesPowerLinesAndReadsThemBackAsDriven) {
  VirtualGpio& chip = *chips().lasting;
  const auto gpio = open(chip.device());
  for (const std::uint8_t line : std::array<std::uint8_t, 3>{0, 1, 2}) {
    for (const bool on : {true, false, true}) {
      ASSERT_TRUE(gpio->set_line(line, on));
      EXPECT_EQ(chip.driven(line), on);
      EXPECT_EQ(gpio->read_line(line), on);
    }
  }
  EXPECT_EQ(gpio->counters().writes, 9U);
  EXPECT_EQ(gpio->counters().errors, 0U);
}

TEST_F(GpioChipOfTheKernel, ReadsInputsAsTheyAre) {
  VirtualGpio& chip = *chips().lasting;
  const auto gpio = open(chip.device(), "?8=0&9=1&10=2&11=3");
  for (const unsigned levels : {0b0000U, 0b1010U, 0b0101U, 0b1111U}) {
    for (std::size_t n = 0; n < VirtualGpio::line_count; ++n) chip.apply(n, (levels >> n & 1U) != 0);
    EXPECT_EQ(gpio->read_bank(), levels);
    EXPECT_EQ(gpio->read_line(9), (levels >> 1U & 1U) != 0);
  }
  for (std::size_t n = 0; n < VirtualGpio::line_count; ++n) EXPECT_FALSE(chip.driven(n)) << "an input now";
}

TEST_F(GpioChipOfTheKernel, KeepsAPowerLineAsItStandsWhenItsOwnerIsReplaced) {
  VirtualGpio& chip = *chips().lasting;
  ASSERT_TRUE(open(chip.device())->set_line(1, true));  // the handle is closed again
  const std::size_t changes = chip.changes(1);

  const auto successor = open(chip.device());
  EXPECT_EQ(successor->read_line(1), true);
  EXPECT_EQ(chip.driven(1), true);
  EXPECT_EQ(chip.changes(1), changes) << "neither the end nor the reading switched it";

  ASSERT_TRUE(successor->set_line(1, false));
  EXPECT_EQ(chip.driven(1), false);
}

TEST_F(GpioChipOfTheKernel, SharesTheChipButNotALine) {
  VirtualGpio& chip = *chips().lasting;
  const auto adcs = open(chip.device());
  const auto eps = open(chip.device());
  ASSERT_TRUE(adcs->set_line(0, true));
  ASSERT_TRUE(eps->set_line(1, true));
  EXPECT_EQ(eps->set_line(0, false).error(), GpioError::not_ours);
  EXPECT_EQ(eps->read_line(0).error(), GpioError::not_ours);
  EXPECT_EQ(chip.driven(0), true);
}

TEST_F(GpioChipOfTheKernel, SaysThatALineIsNotThere) {
  VirtualGpio& chip = *chips().lasting;
  const auto gpio = open(chip.device());
  EXPECT_EQ(gpio->read_line(9).error(), GpioError::no_line) << "of no line 9 the chip knows";
  EXPECT_EQ(gpio->read_bank().error(), GpioError::no_line);
  EXPECT_EQ(gpio->set_line(8, true).error(), GpioError::no_line) << "an input is not driven";
}

TEST_F(GpioChipOfTheKernel, OutlivesTheLossOfTheChip) {
  const testing_support::TemporaryFolder folder;
  const std::filesystem::path link = folder.path() / "chip";  // like a lasting chip name from udev
  std::filesystem::create_symlink(chips().passing->device(), link);
  const auto gpio = open(link);
  ASSERT_TRUE(gpio->set_line(2, true));

  chips().passing.reset();
  EXPECT_EQ(gpio->set_line(2, true).error(), GpioError::gone);
  EXPECT_EQ(gpio->read_line(2).error(), GpioError::gone);

  VirtualGpio& next = *chips().lasting;
  std::filesystem::remove(link);
  std::filesystem::create_symlink(next.device(), link);
  const MonotonicTime end = monotonic_now() + vm::patience;
  while (!gpio->set_line(2, true) && monotonic_now() < end) ::usleep(10'000);
  EXPECT_EQ(next.driven(2), true);
  EXPECT_EQ(gpio->counters().reopened, 1U);
  chips().passing.emplace();  // for the next repetition
}

}  // namespace
}  // namespace srfs::hw
