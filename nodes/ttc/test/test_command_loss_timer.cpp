// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/command_loss_timer.hpp"

#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace srfs::command_loss {
namespace {

using Steps = std::vector<CommandLossStep>;
constexpr auto safe_mode = CommandLossStep::safe_mode;
constexpr auto line = CommandLossStep::line;
constexpr auto keys = CommandLossStep::keys;
constexpr auto restart = CommandLossStep::restart;

constexpr seconds patience{3 * 86'400};
constexpr seconds hour{3600};
constexpr seconds day{86'400};
constexpr MonotonicTime start{seconds(1000)};

CommandLossTimer fresh() {
  return {"boot-1", "", patience, start};
}

/// What is due until @p end, with the times of silence.
Steps run(CommandLossTimer& timer, MonotonicTime& now, MonotonicTime end) {
  Steps taken;
  while (now + timer.until_next(now) <= end) {
    now = now + timer.until_next(now);
    const auto step = timer.take_step(now);
    if (!step) break;
    taken.push_back(step->what);
  }
  now = end;
  return taken;
}

TEST(CommandLossTimers, ActWhenNoTelecommandCameForTheTime) {
  CommandLossTimer timer = fresh();
  EXPECT_EQ(timer.until_next(start), nanoseconds(patience));
  EXPECT_FALSE(timer.take_step(start + patience - nanoseconds(1)));
  EXPECT_FALSE(timer.lost());
  const auto step = timer.take_step(start + patience);
  ASSERT_TRUE(step);
  EXPECT_EQ(step->what, safe_mode);
  EXPECT_EQ(step->number, 1U);
  EXPECT_EQ(step->silent, nanoseconds(patience));
  EXPECT_EQ(step->until_next, nanoseconds(hour));
  EXPECT_TRUE(timer.lost());
  EXPECT_FALSE(timer.take_step(start + patience)) << "each once";
}

TEST(CommandLossTimers, TakeTheStepsInTheirOrderAndRestartTheComputerEachDayForEver) {
  CommandLossTimer timer = fresh();
  MonotonicTime now = start;
  EXPECT_EQ(run(timer, now, start + patience + 4 * hour), (Steps{safe_mode, line, keys, restart}));
  EXPECT_EQ(run(timer, now, start + patience + 3 * hour + day), (Steps{line, keys, restart}));
  for (int i = 0; i < 400; ++i) EXPECT_EQ(run(timer, now, now + day), (Steps{line, keys, restart})) << i;
}

TEST(CommandLossTimers, BeginAnewWithEachTelecommand) {
  CommandLossTimer timer = fresh();
  EXPECT_FALSE(timer.on_contact(start + patience - nanoseconds(1)));
  EXPECT_FALSE(timer.take_step(start + 2 * patience - nanoseconds(2)));
  MonotonicTime now = start + patience;
  (void)run(timer, now, start + 2 * patience + 2 * hour);
  const auto loss = timer.on_contact(now);
  ASSERT_TRUE(loss);
  EXPECT_EQ(loss->steps, 3U);
  EXPECT_EQ(loss->silent, now - (start + patience - nanoseconds(1)));
  EXPECT_FALSE(timer.lost());
  EXPECT_FALSE(timer.on_contact(now)) << "said once";
  EXPECT_EQ(run(timer, now, now + patience), Steps{safe_mode});
}

TEST(CommandLossTimers, GoOnInAnotherProcessOfTheSameBootAsIfItHadNotEnded) {
  CommandLossTimer timer = fresh();
  const CommandLossTimer next("boot-1", timer.stored_text(start + hour), patience, start + 2 * hour);
  EXPECT_EQ(next.until_next(start + 2 * hour), nanoseconds(patience - 2 * hour));
}

TEST(CommandLossTimers, GoOnInAnotherBootFromTheLastRecord) {
  CommandLossTimer timer = fresh();
  const CommandLossTimer next("boot-2", timer.stored_text(start + hour), patience, start);
  EXPECT_EQ(next.until_next(start), nanoseconds(patience - hour));
}

TEST(CommandLossTimers, BeginAnewWithoutAReadableRecord) {
  CommandLossTimer timer = fresh();
  const std::string text = timer.stored_text(start + hour);
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string damaged = text;
    damaged[i] = static_cast<char>(damaged[i] ^ 1);
    const CommandLossTimer next("boot-2", damaged, patience, start);
    EXPECT_EQ(next.until_next(start), nanoseconds(patience)) << i;
    const CommandLossTimer cut("boot-2", text.substr(0, i), patience, start);
    EXPECT_EQ(cut.until_next(start), nanoseconds(patience)) << i;
  }
}

TEST(CommandLossTimers, CountARestartOfTheComputerThatCameByItself) {
  CommandLossTimer timer = fresh();
  MonotonicTime now = start;
  (void)run(timer, now, start + patience + 2 * hour);
  const std::string text = timer.stored_text(now);  // behind the step of the keys
  CommandLossTimer same("boot-1", text, patience, now + hour);
  EXPECT_EQ(same.take_step(now + hour)->what, restart);
  CommandLossTimer other("boot-2", text, patience, start);
  EXPECT_FALSE(other.take_step(start)) << "no loop of restarts when the disk does not take the record";
  now = start;
  EXPECT_EQ(run(other, now, start + day), (Steps{line, keys, restart}));
}

TEST(CommandLossTimers, AreSavedOftenAtFirstAndThenEachMinute) {
  CommandLossTimer timer = fresh();
  std::vector<int> saves;
  for (int s = 0; s <= 300; ++s) {
    if (timer.take_save(start + seconds(s))) saves.push_back(s);
  }
  EXPECT_EQ(saves, (std::vector<int>{5, 10, 20, 40, 80, 140, 200, 260}));
}

TEST(CommandLossTimers, AreSavedAtOnceWhenATelecommandMakesARecordWrong) {
  CommandLossTimer timer = fresh();
  MonotonicTime now = start + hour;
  EXPECT_TRUE(timer.take_save(now));
  (void)timer.on_contact(now + seconds(1));
  EXPECT_TRUE(timer.take_save(now + seconds(1)));
  (void)timer.on_contact(now + seconds(2));
  EXPECT_FALSE(timer.take_save(now + seconds(2))) << "the record is good enough";
}

TEST(CommandLossTimers, FollowAPatienceThatIsChanged) {
  CommandLossTimer timer = fresh();
  timer.set_patience(seconds(8));
  MonotonicTime now = start;
  EXPECT_EQ(run(timer, now, start + seconds(8)), Steps{safe_mode});
  EXPECT_EQ(run(timer, now, start + seconds(14)), (Steps{line, keys, restart})) << "each 2 s";
  EXPECT_EQ(run(timer, now, start + seconds(22)), (Steps{line, keys, restart})) << "each 8 s";
  timer.set_patience(patience);
  EXPECT_EQ(run(timer, now, now + hour), Steps{});
}

/// A computer whose ttc is killed and which is reset, at any time.
class Flight {
 public:
  explicit Flight(std::uint64_t seed) : random_(seed) { begin(); }

  std::size_t below(std::size_t n) { return random_() % n; }
  void live(nanoseconds time) {
    const MonotonicTime end = now_ + time;
    while (true) {
      const MonotonicTime due = std::max(timer_->next_due(now_), now_);
      if (due > end) break;
      pass(due - now_);
      if (const auto step = timer_->take_step(now_)) {
        take(*step);
        if (below(20) == 0) return kill();  // before its record
        disk_ = timer_->stored_text(now_);
      } else if (timer_->take_save(now_)) {
        if (below(20) == 0) return kill();
        disk_ = timer_->stored_text(now_);
      }
    }
    pass(end - now_);
  }
  void contact() {
    (void)timer_->on_contact(now_);
    if (timer_->take_save(now_)) disk_ = timer_->stored_text(now_);
    silent_ = since_restart_ = nanoseconds(0);
    last_number_ = 0;
  }
  void kill() {
    pass(milliseconds(below(5000)));  // its successor comes
    begin();
  }
  void reset() {
    ++boot_;
    now_ = MonotonicTime(seconds(below(100)));
    begin();
  }
  [[nodiscard]] std::uint32_t steps() const { return last_number_; }
  [[nodiscard]] int restarts() const { return restarts_; }

 private:
  void begin() { timer_.emplace("boot-" + std::to_string(boot_), disk_, patience, now_); }
  void pass(nanoseconds time) {
    now_ = now_ + time;
    silent_ += time;
    since_restart_ += time;
  }
  void take(const CommandLossTimer::Step& step) {
    constexpr seconds tolerance{61};
    EXPECT_GE(silent_ + tolerance, nanoseconds(patience)) << "too early";
    EXPECT_LE(step.number, last_number_ + 2) << "none is left out, but for a restart that came by itself";
    if (step.number == last_number_ + 2) {
      EXPECT_EQ(step.what, line);
    }
    if (step.what == restart) {
      if (last_number_ != step.number) {
        EXPECT_GE(since_restart_, nanoseconds(hour));
      }
      since_restart_ = nanoseconds(0);
      ++restarts_;
    }
    last_number_ = std::max(last_number_, step.number);
  }

  std::mt19937_64 random_;
  int boot_ = 1;
  MonotonicTime now_{seconds(50)};
  std::string disk_;
  std::optional<CommandLossTimer> timer_;
  nanoseconds silent_{0};         ///< since the last telecommand, as time passed
  nanoseconds since_restart_{0};  ///< that was ordered
  std::uint32_t last_number_ = 0;
  int restarts_ = 0;
};

TEST(CommandLossTimerProperties, WheneverItIsKilledOrResetItIsNeverEarlyAndLeavesNoStepOut) {
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Flight flight(seed);
    for (int i = 0; i < 300; ++i) {
      flight.live(seconds(flight.below(20'000)));
      const std::size_t what = flight.below(40);
      if (what == 0) flight.contact();
      if (what == 1) flight.kill();
      if (what == 2) flight.reset();
    }
    if (testing::Test::HasFailure()) return;
  }
}

TEST(CommandLossTimerProperties, ALoopOfShortBootsDoesNotKeepItFromActing) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Flight flight(seed);
    constexpr seconds shortest{10};
    constexpr seconds most_life = 2 * patience + 2 * hour;  // at least about half of each boot counts
    for (seconds lived{0}; lived < most_life;) {
      const seconds life = shortest + seconds(flight.below(60));
      flight.live(life);
      flight.reset();
      lived += life;
    }
    EXPECT_GE(flight.steps(), 1U);
    if (testing::Test::HasFailure()) return;
  }
}

}  // namespace
}  // namespace srfs::command_loss
