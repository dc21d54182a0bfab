// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_acquisition/capture_scheduler.hpp"

#include <algorithm>
#include <deque>
#include <functional>
#include <map>
#include <random>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace srfs {
namespace {

using Kind = hw::CameraFault::Kind;
namespace failure = mission::failure;

hw::CameraFault fault(Kind kind, const std::string& reason = "it says so") {
  return {kind, reason};
}

/// A camera and a disk whose answers come when a test lets them. It checks what must hold of every order.
class World {
 public:
  explicit World(std::uint32_t seed = 1) : random_(seed) {
    scheduler_.configure("");
    carry_out_all(scheduler_.activate(now));
  }

  CaptureGoal ask(std::uint32_t task, std::uint16_t frames = 1, milliseconds interval = milliseconds(0),
                  std::optional<nanoseconds> in = {}) {
    CaptureRequest request;
    request.task = task;
    request.exposure = milliseconds(100);
    request.frames = frames;
    request.interval = interval;
    if (in) request.start = utc() + *in;
    const CaptureGoal goal = ++last_goal_;
    tasks_[goal] = request;
    if (in) earliest_[goal] = now + *in;
    carry_out_all(scheduler_.on_goal(goal, request, time()));
    return goal;
  }
  void cancel(CaptureGoal goal) {
    scheduler_.on_cancel(goal);
    soon_ = true;
  }
  void rest(bool rests) { carry_out_all(scheduler_.rest(rests)); }
  void deactivate() { carry_out_all(scheduler_.deactivate("the node was deactivated")); }
  void activate() { carry_out_all(scheduler_.activate(now)); }

  /// Lets one thing happen: an answer of the camera or of the disk, or the time comes. @return false: nothing
  /// is left to happen
  bool step() {
    std::vector<std::function<void()>> possible;
    if (!camera_.empty()) possible.emplace_back([this] { answer(camera_); });
    if (!disk_.empty() && !disk_hangs) possible.emplace_back([this] { answer(disk_); });
    if (soon_)
      possible.emplace_back([this] {
        soon_ = false;
        carry_out_all(scheduler_.drive(time()));
      });
    if (possible.empty() && !wake_) return false;
    if (possible.empty()) {
      now = std::max(now, *wake_);
      wake_.reset();
      carry_out_all(scheduler_.drive(time()));
      return true;
    }
    now += milliseconds(1 + random_() % 20);
    possible[random_() % possible.size()]();
    return true;
  }
  void run(int most = 20000) {
    // A camera that is away is looked for for ever; a test without tasks has an end all the same.
    while ((!scheduler_.is_idle() || scheduler_.has_waiting() || !scheduler_.is_at_rest() || soon_) &&
           step()) {
      ASSERT_GT(--most, 0) << "it does not come to an end";
    }
  }
  bool run_until(const std::function<bool()>& condition) {
    for (int i = 0; i < 5000; ++i) {
      if (condition()) return true;
      if (!step()) return condition();
    }
    return false;
  }

  MonotonicTime now{seconds(1000)};
  bool has_utc = true, disk_hangs = false;
  std::function<Result<std::string, hw::CameraFault>()> open = [] { return "a camera"; };
  std::function<Result<void, hw::CameraFault>()> prepare = [] { return Result<void, hw::CameraFault>(); };
  std::function<Result<void, hw::CameraFault>()> begin = [] { return Result<void, hw::CameraFault>(); };
  /// Of a frame begun
  std::function<Result<std::optional<hw::CameraFrame>, hw::CameraFault>()> take = [this] {
    return std::optional(frame());
  };
  std::function<Result<std::string, CaptureFailure>(const CapturedFrame&)> store =
      [this](const CapturedFrame& c) {
        return fmt::format("frames/{:010}/{:04}.fits", c.task, ++numbers_[c.task]);
      };
  std::map<CaptureGoal, CaptureEnd> ends;
  std::map<CaptureGoal, CaptureFailure> refused;
  std::vector<std::string> log;  ///< names of the actions on the camera, in order

  [[nodiscard]] hw::CameraFrame frame() {
    hw::CameraFrame f;
    f.pixels = image::Grid<std::uint16_t>(2, 1);
    f.pixels.cells()[0] = static_cast<std::uint16_t>(sequence_);
    f.sequence = sequence_++;
    f.begin = begun_;
    return f;
  }
  [[nodiscard]] const CaptureScheduler& scheduler() const { return scheduler_; }
  [[nodiscard]] std::size_t writing() const { return disk_.size(); }
  [[nodiscard]] const CaptureEnd& end_of(CaptureGoal goal) {
    EXPECT_TRUE(ends.contains(goal));
    return ends[goal];
  }
  [[nodiscard]] int count(const std::string& what) const {
    return static_cast<int>(std::count(log.begin(), log.end(), what));
  }

 private:
  [[nodiscard]] UtcTime utc() const { return UtcTime(now - MonotonicTime() + seconds(1'700'000'000)); }
  [[nodiscard]] CaptureTime time() const { return {now, has_utc ? std::optional(utc()) : std::nullopt}; }

  void carry_out_all(CaptureScheduler::Actions actions) {
    for (const CaptureAction& action : actions) std::visit([this](const auto& a) { carry_out(a); }, action);
  }
  static void answer(std::deque<std::function<void()>>& jobs) {
    const auto job = std::move(jobs.front());
    jobs.pop_front();
    job();
  }
  void on_camera(const char* name, std::function<void()> job, bool alone = true) {
    log.emplace_back(name);
    if (alone) {
      EXPECT_TRUE(camera_.empty()) << name << " while the camera does something else";
    }
    camera_.push_back(std::move(job));
  }

  void carry_out(const RefuseGoal& a) {
    EXPECT_TRUE(refused.emplace(a.goal, a.why).second && !ends.contains(a.goal));
  }
  void carry_out(const ExecuteGoal& a) { EXPECT_FALSE(ends.contains(a.goal)); }
  void carry_out(const EndGoal& a) {
    EXPECT_TRUE(ends.emplace(a.goal, a.end).second && !refused.contains(a.goal)) << "each goal ends once";
  }
  void carry_out(const OpenCamera&) {
    on_camera("open", [this] {
      auto result = open();
      is_open_ = result.has_value();
      carry_out_all(scheduler_.on_opened(result, time()));
    });
  }
  void carry_out(const CloseCamera&) {
    on_camera(
        "close",
        [this] {
          is_open_ = is_prepared_ = is_begun_ = false;
          carry_out_all(scheduler_.on_camera_done(time()));
        },
        false);
  }
  void carry_out(const AbandonFrame&) {
    on_camera(
        "abandon",
        [this] {
          is_prepared_ = is_begun_ = false;
          carry_out_all(scheduler_.on_camera_done(time()));
        },
        false);
  }
  void carry_out(const PrepareCamera&) {
    EXPECT_TRUE(is_open_);
    on_camera("prepare", [this] {
      auto result = prepare();
      is_prepared_ = result.has_value();
      carry_out_all(scheduler_.on_prepared(result, time()));
    });
  }
  void carry_out(const BeginExposure& a) {
    EXPECT_TRUE(is_prepared_);
    EXPECT_LE(a.at - now, CaptureScheduler::lead) << "the worker is held for no longer";
    on_camera("begin", [this, a] {
      now = std::max(now, a.at);
      begun_ = now;
      auto result = begin();
      is_begun_ = result.has_value();
      carry_out_all(scheduler_.on_begun(begun_, result, time()));
    });
  }
  void carry_out(const TakeFrame&) {
    EXPECT_TRUE(is_begun_);
    on_camera("take", [this] {
      auto result = take();
      if (!result || *result) is_prepared_ = is_begun_ = false;
      if (result && !*result) now += milliseconds(100);
      carry_out_all(scheduler_.on_taken(std::move(result), time()));
    });
  }
  void carry_out(const StoreFrame& a) {
    EXPECT_LT(std::count(writing_.begin(), writing_.end(), a.captured->goal),
              static_cast<std::ptrdiff_t>(CaptureScheduler::storing_max));
    if (earliest_.contains(a.captured->goal)) {
      EXPECT_GE(a.captured->frame.begin, earliest_[a.captured->goal]) << "no exposure before its time";
    }
    writing_.push_back(a.captured->goal);
    disk_.push_back([this, captured = a.captured] {
      writing_.pop_front();
      carry_out_all(scheduler_.on_stored(*captured, store(*captured), time()));
    });
  }
  void carry_out(const ReportProgress& a) {
    EXPECT_FALSE(ends.contains(a.goal));
    EXPECT_EQ(a.frames_done, ++progress_[a.goal]);
  }
  void carry_out(const ReportCameraReady&) { log.emplace_back("ready"); }
  void carry_out(const ReportCameraLost&) { log.emplace_back("lost"); }
  void carry_out(const ReportLostFrame& a) {
    EXPECT_LE(a.attempt, CaptureSequence::tries_max);
    log.emplace_back("lost frame");
  }
  void carry_out(const WakeAt& a) { wake_ = a.at; }
  void carry_out(const DriveSoon&) { soon_ = true; }

  CaptureScheduler scheduler_;
  std::mt19937 random_;
  CaptureGoal last_goal_ = 0;
  std::map<CaptureGoal, CaptureRequest> tasks_;
  std::map<CaptureGoal, MonotonicTime> earliest_;
  std::map<CaptureGoal, std::uint16_t> progress_;
  std::map<std::uint32_t, int> numbers_;
  std::deque<std::function<void()>> camera_, disk_;
  std::deque<CaptureGoal> writing_;
  std::optional<MonotonicTime> wake_;
  bool soon_ = false;
  bool is_open_ = false, is_prepared_ = false, is_begun_ = false;
  MonotonicTime begun_;
  std::uint32_t sequence_ = 1;
};

TEST(CaptureSchedulerTest, OpensTheCameraPreparesExposesTakesAndStores) {
  World world;
  const auto goal = world.ask(17);
  world.run();
  EXPECT_THAT(world.log, testing::ElementsAre("open", "ready", "prepare", "begin", "take", "abandon"));
  EXPECT_THAT(world.end_of(goal).files, testing::ElementsAre("frames/0000000017/0001.fits"));
  EXPECT_FALSE(world.end_of(goal).failure || world.end_of(goal).canceled);
  EXPECT_EQ(world.scheduler().counters().frames, 1U);
}

TEST(CaptureSchedulerTest, ExposesAtTheCommandedTimeThoughTheCameraIsPreparedBefore) {
  World world;
  const auto begin = world.now + seconds(20);
  const auto goal = world.ask(17, 3, milliseconds(500), seconds(20));
  ASSERT_TRUE(world.run_until([&] { return world.count("prepare") == 1; }));
  EXPECT_LT(world.now, begin);
  EXPECT_GE(world.now, begin - CaptureScheduler::prelude);
  world.run();
  EXPECT_EQ(world.end_of(goal).files.size(), 3U);
  EXPECT_EQ(world.end_of(goal).start_error_us, 0);
  EXPECT_GE(world.now, begin + seconds(1));
}

TEST(CaptureSchedulerTest, BetweenFramesThatAreFarApartTheCameraNeedNotStream) {
  World world;
  const auto goal = world.ask(17, 2, seconds(60));
  world.run();
  EXPECT_EQ(world.end_of(goal).files.size(), 2U);
  EXPECT_THAT(world.log, testing::ElementsAre("open", "ready", "prepare", "begin", "take", "abandon",
                                              "prepare", "begin", "take", "abandon"));
}

TEST(CaptureSchedulerTest, TheEarliestTaskIsTheFirst) {
  World world;
  const auto late = world.ask(1, 1, milliseconds(0), seconds(30));
  const auto early = world.ask(2, 1, milliseconds(0), seconds(10));
  ASSERT_TRUE(world.run_until([&] { return !world.ends.empty(); }));
  EXPECT_TRUE(world.ends.contains(early));
  world.run();
  EXPECT_FALSE(world.end_of(late).failure);
}

TEST(CaptureSchedulerTest, InAModeThatAllowsNoneTasksEndInOrderAndNoneBegins) {
  World world;
  const CaptureGoal running = world.ask(1, 100);
  const CaptureGoal waiting = world.ask(2);
  ASSERT_TRUE(world.run_until([&] { return world.log.size() > 6; }));
  world.rest(true);
  world.run();
  ASSERT_TRUE(world.ends.contains(running) && world.ends.contains(waiting));
  EXPECT_EQ(world.end_of(running).failure->code, mission::failure::wrong_mode);
  EXPECT_EQ(world.end_of(waiting).failure->code, mission::failure::wrong_mode);
  EXPECT_LT(world.end_of(running).files.size(), 100U);
  const CaptureGoal refused = world.ask(3);
  EXPECT_EQ(world.refused[refused].code, mission::failure::wrong_mode);
  world.rest(false);
  const CaptureGoal later = world.ask(4);
  world.run();
  EXPECT_FALSE(world.end_of(later).failure);
}

TEST(CaptureSchedulerTest, ATaskWithATimeWaitsUntilMissionTimeIsValid) {
  World world;
  const auto goal = world.ask(1, 1, milliseconds(0), seconds(10));
  world.has_utc = false;
  for (int i = 0; i < 50; ++i) (void)world.step();
  EXPECT_TRUE(world.ends.empty());
  EXPECT_EQ(world.count("prepare"), 0);
  world.has_utc = true;
  world.cancel(goal);  // wakes it
  world.run();
  EXPECT_TRUE(world.end_of(goal).canceled);
}

TEST(CaptureSchedulerTest, WhatCannotBeTakenIsRefusedWithTheReason) {
  World world;
  const auto goal = world.ask(17, 1, milliseconds(0), seconds(10));
  EXPECT_EQ(world.refused[world.ask(17)].code, failure::task_exists);
  EXPECT_EQ(world.refused[world.ask(18, 0)].code, failure::bad_argument);
  EXPECT_EQ(world.refused[world.ask(19, 1, milliseconds(0), seconds(-1))].code, failure::capture_time_past);
  world.deactivate();
  EXPECT_EQ(world.refused[world.ask(20)].reason, "the node is not active");
  EXPECT_EQ(world.end_of(goal).failure->reason, "the node was deactivated");
}

TEST(CaptureSchedulerTest, ACameraThatIsAwayIsLookedForAndTheTaskFailsAfterItsPatience) {
  World world;
  world.open = [] { return Err(fault(Kind::absent, "no such device")); };
  const auto goal = world.ask(17);
  const auto asked = world.now;
  world.run();
  EXPECT_EQ(world.end_of(goal).failure->code, failure::camera_absent);
  EXPECT_EQ(world.end_of(goal).failure->reason, "no such device");
  EXPECT_GE(world.now, asked + CaptureScheduler::camera_patience);
  EXPECT_GE(world.count("open"), 8);
  EXPECT_LE(world.count("open"), 12);
  EXPECT_EQ(world.count("lost"), 1) << "reported once";
}

TEST(CaptureSchedulerTest, ATaskGoesOnWithTheCameraThatCameBack) {
  World world;
  int begun = 0;
  world.begin = [&]() -> Result<void, hw::CameraFault> {
    if (++begun == 2) return Err(fault(Kind::absent, "unplugged"));
    return {};
  };
  const auto goal = world.ask(17, 3);
  world.run();
  EXPECT_EQ(world.end_of(goal).files.size(), 3U);
  EXPECT_EQ(world.scheduler().counters().camera_reopened, 1U);
  EXPECT_EQ(world.scheduler().counters().frames_lost, 1U);
}

TEST(CaptureSchedulerTest, AFrameIsTriedThreeTimes) {
  World world;
  world.take = [] { return Err(fault(Kind::unsound, "torn")); };
  const auto goal = world.ask(17, 2);
  world.run();
  EXPECT_EQ(world.end_of(goal).failure->code, failure::camera_failed);
  EXPECT_EQ(world.end_of(goal).failure->reason, "frame 1: torn");
  EXPECT_EQ(world.count("lost frame"), CaptureSequence::tries_max);
}

TEST(CaptureSchedulerTest, AFrameThatDoesNotComeIsLostAfterItsPatience) {
  World world;
  int taken = 0;
  world.take = [&]() -> Result<std::optional<hw::CameraFrame>, hw::CameraFault> {
    if (++taken < 40) return std::optional<hw::CameraFrame>();
    return std::optional(world.frame());
  };
  const auto goal = world.ask(17);
  world.run();
  EXPECT_FALSE(world.end_of(goal).failure);
  EXPECT_EQ(world.count("lost frame"), 1);
}

TEST(CaptureSchedulerTest, ABadSettingEndsTheTaskAtOnce) {
  World world;
  world.prepare = [] { return Err(fault(Kind::bad_setting, "gain 60 dB")); };
  const auto goal = world.ask(17);
  world.run();
  EXPECT_EQ(world.end_of(goal).failure->code, failure::bad_camera_setting);
  EXPECT_EQ(world.count("prepare"), 1);
}

TEST(CaptureSchedulerTest, TheCameraWaitsForASlowDisk) {
  World world;
  world.disk_hangs = true;
  const auto goal = world.ask(17, 5);
  for (int i = 0; i < 200; ++i) (void)world.step();
  EXPECT_EQ(world.writing(), CaptureScheduler::storing_max);
  EXPECT_EQ(world.count("begin"), 2);
  world.disk_hangs = false;
  world.run();
  EXPECT_EQ(world.end_of(goal).files.size(), 5U);
}

TEST(CaptureSchedulerTest, AFrameThatCannotBeStoredEndsTheTaskWithWhatWasStored) {
  World world;
  int stored = 0;
  world.store = [&](const CapturedFrame&) -> Result<std::string, CaptureFailure> {
    if (++stored == 2) return Err(CaptureFailure{failure::frame_store_full, "no room"});
    return "frames/x.fits";
  };
  const auto goal = world.ask(17, 5);
  world.run();
  EXPECT_EQ(world.end_of(goal).failure->code, failure::frame_store_full);
  EXPECT_GE(world.end_of(goal).files.size(), 1U);
  EXPECT_EQ(world.scheduler().counters().store_failures, 1U);
}

TEST(CaptureSchedulerTest, ACancelledTaskGivesTheCameraBackAndNamesWhatIsStored) {
  World world;
  const auto goal = world.ask(17, 256);
  ASSERT_TRUE(world.run_until([&] { return world.scheduler().counters().frames == 3; }));
  world.cancel(goal);
  world.run();
  EXPECT_TRUE(world.end_of(goal).canceled);
  EXPECT_GE(world.end_of(goal).files.size(), 3U);
  EXPECT_LT(world.end_of(goal).files.size(), 8U);
  EXPECT_EQ(world.log.back(), "abandon");
}

TEST(CaptureSchedulerTest, ACameraThatWasOpenedBeforeADeactivationIsOpenedAgain) {
  World world;  // asks for it
  (void)world.step();
  world.deactivate();
  world.activate();
  const auto goal = world.ask(17);
  world.run();
  EXPECT_EQ(world.end_of(goal).files.size(), 1U);
  EXPECT_EQ(world.count("open"), 2);
}

/// Anything at any moment: every goal is refused or ended once, and the next ones are served.
TEST(CaptureSchedulerTest, WhateverHappensInWhateverOrderEachGoalEndsOnceAndTheCameraIsFreeAgain) {
  for (std::uint32_t seed = 0; seed < 400; ++seed) {
    SCOPED_TRACE(fmt::format("seed {}", seed));
    World world(seed);
    std::mt19937 random(seed + 1000);
    const auto sometimes = [&](unsigned one_in) { return random() % one_in == 0; };
    const auto any_fault = [&]() {
      constexpr std::array kinds{Kind::absent, Kind::bad_setting, Kind::unsound};
      return Err(fault(kinds[random() % kinds.size()]));
    };
    using Answer = Result<void, hw::CameraFault>;
    using Taken = Result<std::optional<hw::CameraFrame>, hw::CameraFault>;
    world.open = [&]() -> Result<std::string, hw::CameraFault> {
      if (sometimes(4)) return Err(fault(Kind::absent));
      return "a camera";
    };
    world.prepare = [&]() -> Answer { return sometimes(12) ? Answer(any_fault()) : Answer(); };
    world.begin = [&]() -> Answer { return sometimes(12) ? Answer(any_fault()) : Answer(); };
    world.take = [&]() -> Taken {
      if (sometimes(10)) return any_fault();
      if (sometimes(3)) return std::optional<hw::CameraFrame>();
      return std::optional(world.frame());
    };
    const auto good = world.store;
    world.store = [&](const CapturedFrame& c) -> Result<std::string, CaptureFailure> {
      if (sometimes(20)) return Err(CaptureFailure{failure::disk_failed, "EIO"});
      return good(c);
    };
    std::vector<CaptureGoal> goals;
    for (int i = 0; i < 300; ++i) {
      if (sometimes(8)) {
        const bool timed = sometimes(2);
        goals.push_back(
            world.ask(static_cast<std::uint32_t>(1 + random() % 6),
                      static_cast<std::uint16_t>(1 + random() % 6), milliseconds(random() % 4 * 900),
                      timed ? std::optional<nanoseconds>(milliseconds(random() % 8000)) : std::nullopt));
      }
      if (sometimes(25) && !goals.empty()) world.cancel(goals[random() % goals.size()]);
      if (sometimes(60)) world.has_utc = !world.has_utc;
      if (sometimes(60)) world.deactivate();
      if (sometimes(20)) world.activate();
      (void)world.step();
    }
    world.has_utc = true;
    world.activate();
    world.run();
    EXPECT_EQ(world.ends.size() + world.refused.size(), goals.size());
    EXPECT_TRUE(world.scheduler().is_at_rest() && world.scheduler().is_idle());
    for (const auto& [goal, end] : world.ends) {
      EXPECT_TRUE(std::is_sorted(end.files.begin(), end.files.end())) << "in the order they were taken";
    }
    world.open = [] { return "a camera"; };
    world.prepare = [] { return Answer(); };
    world.begin = [] { return Answer(); };
    world.take = [&world] { return std::optional(world.frame()); };
    world.store = good;
    const auto last = world.ask(99, 2);
    world.run();
    EXPECT_FALSE(world.end_of(last).failure);
    EXPECT_EQ(world.end_of(last).files.size(), 2U);
    if (testing::Test::HasFailure()) return;
  }
}

}  // namespace
}  // namespace srfs
