// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/boot_recorder.hpp"

#include <algorithm>
#include <random>
#include <variant>

#include <gtest/gtest.h>

namespace srfs {
namespace {

using mission::ResetCause;

constexpr BootRecorder::Settings settings{.healthy_after = seconds(60), .withheld_after = seconds(5)};

BootRecorder boot(const std::optional<wire::BootRecord>& before, const std::string& id,
                  std::optional<bool> by_watchdog = std::nullopt) {
  return {before, {id, by_watchdog}, settings};
}

/// The record that is to be written; nullopt: none is.
std::optional<wire::BootRecord> saved(const BootActions& actions) {
  for (const BootAction& action : actions) {
    if (const auto* const save = std::get_if<SaveBootRecord>(&action)) return save->record;
  }
  return std::nullopt;
}
bool is_new_boot(const BootActions& actions) {
  return !actions.empty() && std::holds_alternative<ReportBoot>(actions.front());
}

wire::BootRecord running(std::uint32_t count = 3) {
  return {.count = count, .boot_id = "a"};
}

/// Feeds each second from @p from for @p length. @return whether the record was to be written
bool feed(BootRecorder& recorder, seconds from, seconds length, std::optional<UtcTime> utc = std::nullopt) {
  bool is_saved = false;
  for (seconds t{0}; t <= length; ++t) {
    const auto at = utc ? std::optional(*utc + t) : std::nullopt;
    if (saved(recorder.on_feeding(true, MonotonicTime(from + t), at))) is_saved = true;
  }
  return is_saved;
}

TEST(BootRecord, ReadsWhatItWrites) {
  const wire::BootRecord record{.count = 7,
                                .boot_id = "4f1c/12.1",
                                .reset_cause = 1,
                                .healthy = true,
                                .healthy_since = UtcTime(seconds(1795248000)),
                                .unhealthy_boots = 2,
                                .withheld = true,
                                .ended = true,
                                .revision = 41};
  const auto read = wire::decode_boot_record(wire::encode_boot_record(record));
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(*read, record);
}

TEST(BootRecord, NoticesAnyChangedOctet) {
  const std::string good = wire::encode_boot_record(running());
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 0x04);
    EXPECT_FALSE(wire::decode_boot_record(bad).has_value()) << i;
    EXPECT_FALSE(wire::decode_boot_record(good.substr(0, i)).has_value()) << i;
  }
}

TEST(BootRecorder, CountsBootsAndNotStartsOfTheNode) {
  BootRecorder first = boot(std::nullopt, "a");
  const BootActions began = first.begin();
  EXPECT_TRUE(is_new_boot(began));
  EXPECT_EQ(std::get<ReportBoot>(began[0]).cause, ResetCause::power_on);
  EXPECT_EQ(first.record().count, 1U);
  EXPECT_EQ(first.cause(), ResetCause::power_on);

  BootRecorder restarted = boot(saved(began), "a", true);
  EXPECT_TRUE(restarted.begin().empty()) << "no new boot, and nothing to write";
  EXPECT_EQ(restarted.record().count, 1U);
  EXPECT_EQ(restarted.cause(), ResetCause::power_on)
      << "the cause is that of the boot, not of the node's start";

  EXPECT_EQ(boot(restarted.record(), "b").record().count, 2U);
}

TEST(BootRecorder, FindsTheCauseInWhatTheWatchdogAndTheLastBootSay) {
  wire::BootRecord withheld = running();
  withheld.withheld = true;
  wire::BootRecord ended = running();
  ended.ended = true;
  const std::optional<bool> cannot_tell;
  const struct {
    const char* why;
    wire::BootRecord before;
    std::optional<bool> by_watchdog;
    ResetCause cause;
  } cases[] = {
      {"the watchdog says so", running(), true, ResetCause::watchdog},
      {"the watchdog says so, whatever was asked for", ended, true, ResetCause::watchdog},
      {"it was not fed and cannot tell", withheld, cannot_tell, ResetCause::watchdog},
      {"it was not fed, and something else was faster", withheld, false, ResetCause::power_on},
      {"ended in order", ended, cannot_tell, ResetCause::commanded},
      {"ended in order, and not by the watchdog", ended, false, ResetCause::commanded},
      {"out of the blue, and not by the watchdog", running(), false, ResetCause::power_on},
      {"out of the blue, and nobody can tell", running(), cannot_tell, ResetCause::unknown},
  };
  for (const auto& c : cases) EXPECT_EQ(boot(c.before, "b", c.by_watchdog).cause(), c.cause) << c.why;
}

TEST(BootRecorder, CallsABootHealthyAfterItsTimeWithoutAGap) {
  const UtcTime noon(seconds(1795248000));
  BootRecorder recorder = boot(running(), "b", false);
  ASSERT_TRUE(saved(recorder.begin()));
  EXPECT_FALSE(feed(recorder, seconds(100), seconds(59), noon));
  EXPECT_FALSE(recorder.record().healthy);
  EXPECT_TRUE(recorder.on_feeding(false, MonotonicTime(seconds(160)), noon).empty());
  EXPECT_FALSE(feed(recorder, seconds(161), seconds(59), noon + seconds(61)));
  EXPECT_FALSE(recorder.record().healthy) << "it begins anew after a gap";

  EXPECT_TRUE(feed(recorder, seconds(221), seconds(0), noon + seconds(121)));
  EXPECT_TRUE(recorder.record().healthy);
  EXPECT_EQ(recorder.record().healthy_since, noon + seconds(61));
}

TEST(BootRecorder, SaysOnceInEachProcessThatTheSuiteIsHealthyAlsoInABootThatWas) {
  const auto said = [](BootRecorder& recorder, int at_s) {
    const BootActions actions = recorder.on_feeding(true, MonotonicTime(seconds(at_s)), std::nullopt);
    return std::any_of(actions.begin(), actions.end(), [](const BootAction& action) {
      return std::holds_alternative<NoteHealthySuite>(action);
    });
  };
  for (int process = 0; process < 2; ++process) {
    BootRecorder recorder = boot(running(), "a");
    int times = 0;
    for (int at_s = 100; at_s < 300; ++at_s) times += said(recorder, at_s) ? 1 : 0;
    EXPECT_EQ(times, 1);
  }
  BootRecorder interrupted = boot(running(), "a");
  for (int at_s = 100; at_s < 159; ++at_s) EXPECT_FALSE(said(interrupted, at_s));
  (void)interrupted.on_feeding(false, MonotonicTime(seconds(159)), std::nullopt);
  EXPECT_FALSE(said(interrupted, 160));
}

TEST(BootRecorder, DoesNotTakeTheTimeInWhichTheSuiteWasStoppedForHealthy) {
  BootRecorder recorder = boot(running(), "b");
  feed(recorder, seconds(100), seconds(1));
  feed(recorder, seconds(5000), seconds(1));
  EXPECT_FALSE(recorder.record().healthy);
}

TEST(BootRecorder, CountsBootsInARowThatNeverBecameHealthy) {
  BootRecorder first = boot(std::nullopt, "a");
  BootRecorder second = boot(first.record(), "b");
  BootRecorder third = boot(second.record(), "c");
  EXPECT_EQ(third.record().unhealthy_boots, 2U);
  feed(third, seconds(100), seconds(60));
  ASSERT_TRUE(third.record().healthy);
  EXPECT_EQ(boot(third.record(), "d").record().unhealthy_boots, 0U);
}

TEST(BootRecorder, NotesThatTheWatchdogIsNotFedBeforeItBites) {
  BootRecorder recorder = boot(running(), "b");
  const auto withhold = [&](int at_s) {
    return saved(recorder.on_feeding(false, MonotonicTime(seconds(at_s)), std::nullopt)).has_value();
  };
  ASSERT_TRUE(saved(recorder.begin()));
  EXPECT_FALSE(withhold(10));
  EXPECT_FALSE(withhold(14)) << "a start takes its time";
  EXPECT_TRUE(withhold(15));
  ASSERT_TRUE(recorder.record().withheld);
  EXPECT_FALSE(withhold(16));

  recorder.on_write_failed();
  EXPECT_TRUE(withhold(17)) << "once more";
  feed(recorder, seconds(18), seconds(0));
  EXPECT_FALSE(recorder.record().withheld);
}

TEST(BootRecorder, ForgetsTheEndOfTheNodeWhenItIsBackInTheSameBoot) {
  BootRecorder recorder = boot(running(), "b");
  EXPECT_TRUE(saved(recorder.on_feeding_ended()));
  EXPECT_TRUE(saved(recorder.on_end()));
  const BootRecorder again = boot(recorder.record(), "b");
  EXPECT_FALSE(again.record().ended);
  EXPECT_FALSE(again.record().withheld);
}

TEST(BootRecorderProperties, KilledBeforeOrAfterAnyWriteEachBootIsCountedOnceWhileTheDiskWorks) {
  std::mt19937 random(13);
  for (int mission = 0; mission < 300; ++mission) {
    std::optional<wire::BootRecord> disk;
    std::uint32_t boots = 0;
    for (int process = 0; process < 30; ++process) {
      const bool new_boot = process == 0 || random() % 3 == 0;
      if (new_boot) ++boots;
      BootRecorder recorder = boot(disk, std::to_string(boots));
      std::uint32_t reported = 0;
      const auto carry_out = [&](const BootActions& actions, bool may_fail) {
        for (const BootAction& action : actions) {
          if (const auto* const report = std::get_if<ReportBoot>(&action)) reported = report->count;
          const auto* const save = std::get_if<SaveBootRecord>(&action);
          if (save == nullptr) continue;
          if (may_fail && random() % 3 == 0) {
            recorder.on_write_failed();
          } else {
            if (disk) {
              ASSERT_GT(save->record.revision, disk->revision);
            }
            disk = save->record;
          }
        }
      };
      carry_out(recorder.begin(), false);
      ASSERT_EQ(reported, new_boot ? boots : 0) << "reported once, by the first process of the boot";
      ASSERT_EQ(recorder.record().count, boots);
      const auto steps = random() % 100;
      for (unsigned i = 0; i < steps; ++i)
        carry_out(recorder.on_feeding(random() % 9 != 0, MonotonicTime(seconds(i)), std::nullopt), true);
      if (random() % 2 == 0) carry_out(recorder.on_feeding_ended(), true);
      if (random() % 4 == 0) carry_out(recorder.on_end(), true);
    }
  }
}

}  // namespace
}  // namespace srfs
