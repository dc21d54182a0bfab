// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/set_aside.hpp"

#include <filesystem>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.hpp"
#include "suite/boot_store.hpp"
#include "suite/parameter_store.hpp"
#include "suite/ring/node_record.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::suite {
namespace {

wire::BootRecord boot(std::uint32_t count, bool healthy) {
  wire::BootRecord record;
  record.count = count;
  record.healthy = healthy;
  return record;
}

TEST(StartCounts, GoUpWithEachStartAndBeginAnewBehindAHealthyBoot) {
  StartCount count;
  for (std::uint32_t i = 1; i <= 5; ++i) {
    count = next_start(count, boot(i, false));
    EXPECT_EQ(count.starts, i);
  }
  count = next_start(count, boot(6, true));
  EXPECT_EQ(count.starts, 1U);
  count = next_start(count, boot(6, true));
  EXPECT_EQ(count.starts, 2U) << "timing did not come up since: its record says nothing of this boot";
  EXPECT_EQ(next_start(count, std::nullopt).starts, 3U);
  EXPECT_EQ(next_start(count, boot(7, true)).starts, 1U);
}

TEST(StartCounts, AreReadAsTheyWereWrittenAndNoDamageIsBelieved) {
  const StartCount count{7, 4};
  const std::string text = encode(count);
  EXPECT_EQ(decode_start_count(text), count);
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string damaged = text;
    damaged[i] = static_cast<char>(damaged[i] ^ 4);
    EXPECT_NE(decode_start_count(damaged), count) << i;
    EXPECT_FALSE(decode_start_count(text.substr(0, i))) << i;
  }
}

TEST(StartCountProperties, OnlyUnhealthyStartsInARowAreCounted) {
  std::mt19937 random(1);
  for (int flight = 0; flight < 200; ++flight) {
    StartCount count;
    std::uint32_t in_a_row = 0;
    std::uint32_t boots = 0;
    std::optional<wire::BootRecord> last;
    for (int start = 0; start < 100; ++start) {
      count = next_start(count, last);
      ++in_a_row;
      EXPECT_EQ(count.starts, in_a_row);
      if (random() % 3 == 0) continue;  // timing does not come up: the record stays
      const bool healthy = random() % 4 == 0;
      last = boot(++boots, healthy);
      if (healthy) in_a_row = 0;
      // Starts behind it whose timing does not come up count from this one on.
    }
  }
}

class SetAside : public testing::Test {
 protected:
  SetAside() {
    const auto file = folder_.path() / "d.yaml";
    EXPECT_TRUE(write_file_atomically(file,
                                      "deployment: t\n"
                                      "ring: {unhealthy_starts: 2}\n"
                                      "nodes:\n"
                                      "  - {name: radio, executable: ttc_node}\n"
                                      "  - {name: eps, executable: payload_eps_node}\n"));
    plan_ = Deployment::load(file);
  }
  void leave_behind() {
    ASSERT_TRUE(hold(var_, plan_, "eps", "it disturbs", {}));
    ASSERT_TRUE(set_desired_state(var_, plan_, "eps", ros::State::inactive, {}));
    keep("radio", 7);
    keep("eps", 8);
  }
  void keep(const std::string& name, std::int64_t value) const {
    ParameterHistory history = read(name);
    history.add({{"beacon_period_ms", ros::ParameterValue(value), "2026-11-26T00:00:00Z"}}, "keep",
                "2026-11-26T00:00:00Z");
    const auto text = write_stored(name, history);
    ASSERT_TRUE(text);
    ASSERT_TRUE(write_file_atomically(var_.state(name) / "parameters.yaml", *text));
  }
  [[nodiscard]] ParameterHistory read(const std::string& name) const {
    const auto text = read_file(var_.state(name) / "parameters.yaml");
    if (!text) return {};
    const auto stored = read_stored(*text);
    EXPECT_TRUE(stored);
    return stored ? stored->history : ParameterHistory{};
  }
  void expect_all_set_aside() const {
    EXPECT_TRUE(find_leftovers(var_, plan_).empty());
    EXPECT_FALSE(held_because(var_, plan_, "eps", {}));
    EXPECT_EQ(desired_state(var_, plan_, "eps", {}).state, ros::State::active);
    for (const auto& [name, value] : {std::pair("radio", 7), std::pair("eps", 8)}) {
      const auto history = read(name);
      EXPECT_TRUE(history.values().empty());
      const auto* kept = history.find(1);
      ASSERT_NE(kept, nullptr) << "for parameters.restore";
      EXPECT_EQ(std::get<std::int64_t>(kept->values.at(0).value), value);
    }
  }

  const testing_support::TemporaryFolder folder_;
  const VarPaths var_{folder_.path()};
  Deployment plan_;
};

TEST_F(SetAside, WhatOperatorsLeftBehindIsUsedUntilTheSuiteDidNotBecomeHealthyTooOften) {
  leave_behind();
  for (int i = 0; i < 2; ++i) {
    begin_suite_start(var_, plan_);
    EXPECT_EQ(find_leftovers(var_, plan_).size(), 4U);
    EXPECT_FALSE(read_set_aside_note(var_));
  }
  begin_suite_start(var_, plan_);
  expect_all_set_aside();
  const auto note = read_set_aside_note(var_);
  ASSERT_TRUE(note);
  EXPECT_EQ(note->starts, 2U);
  EXPECT_EQ(note->what, "radio (kept values), eps (hold, desired state, kept values)");
  ASSERT_TRUE(remove_set_aside_note(var_));
  begin_suite_start(var_, plan_);
  EXPECT_FALSE(read_set_aside_note(var_)) << "nothing is left";
}

TEST_F(SetAside, AnOrderlyEndAndAHealthyBootBeginTheCountAnew) {
  leave_behind();
  for (int i = 0; i < 5; ++i) {
    begin_suite_start(var_, plan_);
    begin_suite_start(var_, plan_);
    if (i % 2 == 0) {
      forget_suite_starts(var_);
    } else {
      wire::BootRecord record = boot(static_cast<std::uint32_t>(i), true);
      record.revision = static_cast<std::uint32_t>(i);
      EXPECT_TRUE(BootStore(var_.boot()).store(record).problem.empty());
    }
  }
  EXPECT_EQ(find_leftovers(var_, plan_).size(), 4U);
}

TEST_F(SetAside, WhereverThePowerIsLostTheNextStartEndsItAndTheNoteNamesAll) {
  for (std::size_t done = 0; done <= 4; ++done) {
    SCOPED_TRACE(done);
    std::filesystem::remove_all(var_.root / "state");
    leave_behind();
    begin_suite_start(var_, plan_);
    begin_suite_start(var_, plan_);
    const auto leftovers = find_leftovers(var_, plan_);
    ASSERT_EQ(leftovers.size(), 4U);
    ASSERT_TRUE(write_file_atomically(var_.boot() / "set_aside", "2 all of it\n"));
    for (std::size_t i = 0; i < done; ++i) ASSERT_TRUE(set_aside(var_, leftovers[i], "now"));
    for (std::size_t i = 0; i < done; ++i) ASSERT_TRUE(set_aside(var_, leftovers[i], "now")) << "once more";
    begin_suite_start(var_, plan_);
    expect_all_set_aside();
    const auto note = read_set_aside_note(var_);
    ASSERT_TRUE(note);
    EXPECT_THAT(note->what, testing::StartsWith("all of it")) << "what the start before was at";
  }
}

TEST_F(SetAside, ANewerOrderIsNotReplacedByOneThatWasSetAside) {
  leave_behind();
  for (const Leftover& leftover : find_leftovers(var_, plan_)) ASSERT_TRUE(set_aside(var_, leftover, "now"));
  ASSERT_TRUE(hold(var_, plan_, "eps", "newer", {}));
  EXPECT_TRUE(*restore_orders(var_, "eps")) << "the desired state";
  EXPECT_EQ(held_because(var_, plan_, "eps", {}), "newer");
}

TEST_F(SetAside, OrdersComeBackOnRequest) {
  leave_behind();
  for (const Leftover& leftover : find_leftovers(var_, plan_)) ASSERT_TRUE(set_aside(var_, leftover, "now"));
  const auto restored = restore_orders(var_, "eps");
  ASSERT_TRUE(restored);
  EXPECT_TRUE(*restored);
  EXPECT_EQ(held_because(var_, plan_, "eps", {}), "it disturbs");
  EXPECT_EQ(desired_state(var_, plan_, "eps", {}).state, ros::State::inactive);
  EXPECT_FALSE(*restore_orders(var_, "eps")) << "there is none any more";
  EXPECT_FALSE(*restore_orders(var_, "radio"));
}

}  // namespace
}  // namespace srfs::suite
