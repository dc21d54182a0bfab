// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/update_transaction.hpp"

#include <algorithm>
#include <deque>
#include <random>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <mission/structures.hpp>

namespace srfs {
namespace {

using update::UpdateStep;
using update::VersionState;

const std::string node = "payload_eps";
const std::string file = "packages/eps.pkg";
const std::string program_hash(64, 'b');
const std::string package_hash(64, 'a');

/// What the world around the transaction does.
struct Scenario {
  enum class Lane : std::uint8_t { good, compiler_failed, test_failed, other_program, hung, not_started };
  enum class Swap : std::uint8_t { starts, does_not_run, another_version, refused, own_node };
  enum class Look : std::uint8_t { active, falls, never };
  update::PackageKind kind = update::PackageKind::replace;
  bool activate = true;
  bool is_sound = true;          ///< the package
  bool journal_writable = true;  ///< when it begins, and until the next process
  Lane lane = Lane::good;
  Swap swap = Swap::starts;
  Look look = Look::active;
};

Intake intake_of(const Scenario& s) {
  Intake intake;
  intake.update.file = file;
  intake.update.sha256 = package_hash;
  intake.update.node = node;
  intake.update.kind = s.kind;
  intake.update.counter = 5;
  intake.update.probation = seconds(300);
  intake.manifest.node = node;
  intake.manifest.kind = s.kind;
  intake.manifest.binary_sha256 =
      s.lane == Scenario::Lane::other_program ? std::string(64, 'c') : program_hash;
  return intake;
}

/// The disk, the node's versions and the processes around maintenance. Jobs of its worker run in order, at
/// any moment after they were posted; each may be the last thing that happens before a crash.
class World {
 public:
  World(const Scenario& scenario, std::uint32_t seed) : scenario_(scenario), random_(seed) {}

  void begin() {
    transaction_.emplace(journal_, own_node());
    apply(transaction_->install(file, scenario_.activate));
  }
  /// The process, or the computer, ends between two instructions; a new process goes on.
  void crash() {
    crashed_ = true;
    actions_.clear();
    worker_.clear();
    awaited_.reset();
    lane_runs_ = false;
    transaction_.emplace(journal_, own_node());
    apply(transaction_->resume(table_, in_suite_ || scenario_.kind == update::PackageKind::replace));
  }
  void cancel() { apply(transaction_->cancel()); }
  void stop() { transaction_->stop(); }
  void rest() { apply(transaction_->rest(true)); }

  /// Lets one thing happen. @return false: nothing is left to happen
  bool step() {
    std::vector<void (World::*)()> possible;
    if (!actions_.empty()) possible.push_back(&World::carry_out_next);
    if (!worker_.empty()) possible.push_back(&World::work);
    if (actions_.empty() && lane_runs_) possible.push_back(&World::end_lane);
    if (actions_.empty() && awaited_) possible.push_back(&World::look);
    if (possible.empty()) return false;
    (this->*possible[random_() % possible.size()])();
    return true;
  }

  [[nodiscard]] const UpdateTransaction& transaction() const { return *transaction_; }
  [[nodiscard]] const update::VersionTable& table() const { return table_; }
  [[nodiscard]] const update::UpdateJournal& journal() const { return journal_; }
  [[nodiscard]] bool in_suite() const { return in_suite_; }
  [[nodiscard]] update::VersionNumber running() const { return running_; }
  [[nodiscard]] bool must_end_itself() const { return must_end_itself_; }

  std::vector<FailureCode> answers;
  std::vector<UpdateStep> reports;
  std::vector<UpdateStep> lane_logs;
  int refusals = 0, builds = 0, swaps = 0;

 private:
  [[nodiscard]] std::string own_node() const {
    return scenario_.swap == Scenario::Swap::own_node ? node : "maintenance";
  }
  void apply(UpdateTransaction::Actions actions) {
    for (UpdateAction& action : actions) actions_.push_back(std::move(action));
  }
  void carry_out_next() {
    const UpdateAction action = std::move(actions_.front());
    actions_.pop_front();
    std::visit([this](const auto& a) { carry_out(a); }, action);
  }
  void work() {
    const auto job = std::move(worker_.front());
    worker_.pop_front();
    job();
  }
  void post(std::function<void()> job) { worker_.push_back(std::move(job)); }

  void carry_out(const AnswerTelecommand& a) { answers.push_back(a.code); }
  void carry_out(const TakeInPackage& a) {
    post([this, a] {
      EXPECT_EQ(a.file, file);
      if (scenario_.is_sound) {
        apply(transaction_->on_taken_in(intake_of(scenario_)));
      } else {
        apply(transaction_->on_taken_in(
            Err(IntakeFailure{mission::failure::package_refused, "bad signature"})));
      }
    });
  }
  void carry_out(const WriteUpdateJournal& a) {
    post([this, a] {
      if (!scenario_.journal_writable && !crashed_) {
        if (random_() % 2 == 0) journal_ = a.journal;  // one of the two copies
        if (a.answer) apply(transaction_->on_begun(Err(std::string("no space left"))));
        return;
      }
      journal_ = a.journal;
      if (a.answer) apply(transaction_->on_begun({}));
    });
  }
  void carry_out(const ReportRefusal& /*a*/) { ++refusals; }
  void carry_out(const ReportUpdate& a) { reports.push_back(a.update.step); }
  void carry_out(const BuildProgram& a) {
    ++builds;
    EXPECT_EQ(a.manifest.node, node) << "the manifest is there after a restart, too";
    start_lane();
  }
  void carry_out(const TestProgram& a) {
    EXPECT_EQ(a.manifest.node, node);
    start_lane();
  }
  void start_lane() {
    EXPECT_FALSE(lane_runs_);
    if (scenario_.lane == Scenario::Lane::not_started) {
      apply(transaction_->on_lane_ended({LaneEnd::How::not_started, {}, "no memory"}));
    } else {
      lane_runs_ = true;
    }
  }
  void end_lane() {
    lane_runs_ = false;
    LaneEnd end;
    end.report.good = true;
    end.report.program_sha256 = program_hash;
    const bool is_test = transaction_->update().step == UpdateStep::self_test;
    if (scenario_.lane == Scenario::Lane::hung) end.how = LaneEnd::How::hung;
    if (scenario_.lane == Scenario::Lane::compiler_failed ||
        (scenario_.lane == Scenario::Lane::test_failed && is_test)) {
      end.report.good = false;
      end.report.reason = is_test ? "self_test_failed" : "compiler_failed: 1 error";
    }
    apply(transaction_->on_lane_ended(end));
  }
  void carry_out(const StopLane& /*a*/) {}
  void carry_out(const SendLaneLog& a) { lane_logs.push_back(a.update.step); }
  void carry_out(const StoreProgram& a) {
    post([this, a] {
      const auto number = table_.add(program_hash, 1000, origin_of(a.update), UtcTime(nanoseconds(0)));
      post([this, number] { apply(transaction_->on_stored(StoredProgram{number, 1000})); });
    });
  }
  void carry_out(const SwapProgram& a) {
    post([this, a] { swap(a.update); });
  }
  void carry_out(const AddProgram& a) {
    post([this, a] {
      EXPECT_EQ(a.manifest.node, node);
      EXPECT_TRUE(table_.use(a.update.version, a.update.probation, "replaced"));
      post([this, a] {
        in_suite_ = true;
        post([this, a] { started(a.update.version); });
      });
    });
  }
  void swap(const update::Update& u) {
    ++swaps;
    if (scenario_.swap == Scenario::Swap::refused) {
      apply(transaction_->on_swapped(Err(std::string("its program is damaged")), now_));
      return;
    }
    EXPECT_TRUE(table_.use(u.version, u.probation, "replaced"));
    post([this, u] {
      if (scenario_.swap == Scenario::Swap::another_version) {
        EXPECT_TRUE(table_.fail(u.version, "does not start"));
        started(update::golden);
      } else if (scenario_.swap == Scenario::Swap::does_not_run ||
                 scenario_.swap == Scenario::Swap::own_node) {
        apply(transaction_->on_swapped(std::optional<StartedProgram>(), now_));
      } else {
        started(u.version);
      }
    });
  }
  void started(update::VersionNumber version) {
    running_ = version;
    apply(transaction_->on_swapped(std::optional(StartedProgram{42, version, {}, now_}), now_));
  }
  void carry_out(const AwaitActive& a) { awaited_ = a; }
  void look() {
    now_ = now_ + seconds(3);
    ProgramLook seen;
    seen.is_active = scenario_.look == Scenario::Look::active;
    if (scenario_.look == Scenario::Look::falls && table_.active() == awaited_->update.version) {
      EXPECT_TRUE(table_.fail(awaited_->update.version, "died in its probation"));
    }
    if (const update::Version* v = table_.find(awaited_->update.version)) {
      seen.version = v->state;
      seen.reason = v->reason;
    }
    apply(transaction_->on_look(seen, now_));
    if (!transaction_->is_looking()) awaited_.reset();
  }
  void carry_out(const EndOwnProcess& /*a*/) { must_end_itself_ = true; }
  void carry_out(const RemoveWorkFolder& /*a*/) {}

  const Scenario scenario_;
  std::mt19937 random_;
  std::optional<UpdateTransaction> transaction_;
  std::deque<UpdateAction> actions_;
  std::deque<std::function<void()>> worker_;
  bool lane_runs_ = false;
  bool crashed_ = false;
  std::optional<AwaitActive> awaited_;
  MonotonicTime now_{seconds(100)};
  // what outlives a crash
  update::UpdateJournal journal_;
  update::VersionTable table_;
  bool in_suite_ = false;
  update::VersionNumber running_ = update::golden;
  bool must_end_itself_ = false;
};

std::vector<Scenario> all_scenarios() {
  std::vector<Scenario> all;
  for (const auto kind : {update::PackageKind::replace, update::PackageKind::add}) {
    for (const bool activate : {true, false}) {
      for (const auto lane :
           {Scenario::Lane::good, Scenario::Lane::compiler_failed, Scenario::Lane::test_failed,
            Scenario::Lane::other_program, Scenario::Lane::hung, Scenario::Lane::not_started}) {
        all.push_back({kind, activate, true, true, lane, Scenario::Swap::starts, Scenario::Look::active});
      }
      all.push_back({kind, activate, false, true, {}, {}, {}});
      all.push_back({kind, activate, true, false, {}, {}, {}});
    }
    for (const auto look : {Scenario::Look::falls, Scenario::Look::never})
      all.push_back({kind, true, true, true, Scenario::Lane::good, Scenario::Swap::starts, look});
  }
  for (const auto swap : {Scenario::Swap::does_not_run, Scenario::Swap::another_version,
                          Scenario::Swap::refused, Scenario::Swap::own_node})
    all.push_back({update::PackageKind::replace, true, true, true, Scenario::Lane::good, swap, {}});
  return all;
}

void run_until_nothing_happens(World& world) {
  for (int steps = 0; world.step(); ++steps) ASSERT_LT(steps, 1000) << "it does not come to an end";
}

/// A process that ends itself is followed by the next one.
void run_to_its_end(World& world) {
  run_until_nothing_happens(world);
  if (!world.must_end_itself()) return;
  world.crash();
  run_until_nothing_happens(world);
}

int versions_of_the_package(const World& world) {
  update::Update u;
  u.counter = 5;
  u.sha256 = package_hash;
  const auto& all = world.table().versions();
  return static_cast<int>(
      std::count_if(all.begin(), all.end(), [&](const auto& v) { return v.origin == origin_of(u); }));
}

/// What always holds, however often and wherever it was killed.
void expect_a_sound_end(const Scenario& s, const World& world) {
  EXPECT_FALSE(world.transaction().is_busy());
  EXPECT_LE(versions_of_the_package(world), 1);
  EXPECT_LE(world.builds, static_cast<int>(update::UpdateJournal::most_starts));
  const update::Update& u = world.transaction().update();
  const bool accepted =
      std::find(world.answers.begin(), world.answers.end(), mission::failure::none) != world.answers.end();
  if (accepted) {
    EXPECT_THAT(world.reports, testing::Contains(u.step)) << "its end is reported";
    EXPECT_TRUE(update::is_over(u.step));
  }
  if (!s.is_sound || !s.journal_writable) {
    EXPECT_FALSE(accepted);
    EXPECT_EQ(world.builds, 0) << "what was refused is never built";
  }
  if (!s.activate) {
    EXPECT_EQ(world.table().active(), update::golden);
    EXPECT_FALSE(world.in_suite());
  }
  if (u.step == UpdateStep::installed) {
    EXPECT_EQ(world.table().active(), u.version);
    EXPECT_EQ(world.in_suite(), s.kind == update::PackageKind::add);
  }
  if (u.step == UpdateStep::failed || u.step == UpdateStep::cancelled) {
    EXPECT_NE(u.reason, "");
    EXPECT_TRUE(world.table().active() == update::golden || s.swap == Scenario::Swap::refused);
  }
  if (s.lane != Scenario::Lane::good) {
    EXPECT_EQ(versions_of_the_package(world), 0) << "what did not pass is not stored";
  }
}

TEST(UpdateTransactionTest, a_good_package_is_built_tested_stored_and_started_and_each_step_is_reported) {
  World world({}, 1);
  world.begin();
  run_to_its_end(world);
  EXPECT_THAT(world.answers, testing::ElementsAre(mission::failure::none));
  EXPECT_THAT(world.reports, testing::ElementsAre(UpdateStep::build, UpdateStep::self_test, UpdateStep::store,
                                                  UpdateStep::swap, UpdateStep::installed));
  EXPECT_EQ(world.table().active(), 1U);
  EXPECT_EQ(world.transaction().update().outage, milliseconds(3000));
  EXPECT_EQ(world.journal().update(), world.transaction().update()) << "the record is on the disk";
}

TEST(UpdateTransactionTest, each_way_to_fail_has_its_reason) {
  const auto reason_of = [](const Scenario& s) {
    World world(s, 1);
    world.begin();
    run_to_its_end(world);
    EXPECT_EQ(world.transaction().update().step, UpdateStep::failed);
    return fmt::format("{}: {}", to_text(world.transaction().update().ended_in),
                       world.transaction().update().reason);
  };
  Scenario s;
  s.lane = Scenario::Lane::compiler_failed;
  EXPECT_EQ(reason_of(s), "build: compiler_failed: 1 error");
  s.lane = Scenario::Lane::hung;
  EXPECT_EQ(reason_of(s), "build: the build lane hung and was killed");
  s.lane = Scenario::Lane::not_started;
  EXPECT_EQ(reason_of(s), "build: no memory");
  s.lane = Scenario::Lane::other_program;
  EXPECT_EQ(reason_of(s), "build: the program differs from the ground build");
  s.lane = Scenario::Lane::test_failed;
  EXPECT_EQ(reason_of(s), "self_test: self_test_failed");
  s = {};
  s.swap = Scenario::Swap::another_version;
  EXPECT_EQ(reason_of(s), "swap: another version was started");
  s.swap = Scenario::Swap::refused;
  EXPECT_EQ(reason_of(s), "swap: its program is damaged");
  s = {};
  s.look = Scenario::Look::falls;
  EXPECT_EQ(reason_of(s), "swap: died in its probation");
}

TEST(UpdateTransactionTest, the_lanes_log_goes_down_after_each_build_and_a_failed_self_test_under_that_name) {
  Scenario s;
  s.lane = Scenario::Lane::test_failed;
  World world(s, 1);
  world.begin();
  run_to_its_end(world);
  EXPECT_THAT(world.lane_logs, testing::ElementsAre(UpdateStep::build, UpdateStep::self_test));
}

TEST(UpdateTransactionTest, wherever_it_is_killed_it_comes_to_the_end_that_it_promises) {
  int crashes = 0;
  for (const Scenario& scenario : all_scenarios()) {
    for (std::uint32_t seed = 0; seed < 20; ++seed) {
      for (int at = 0;; ++at) {
        SCOPED_TRACE(
            fmt::format("kind {}, activate {}, lane {}, swap {}, look {}, seed {}, killed at step {}",
                        static_cast<int>(scenario.kind), scenario.activate, static_cast<int>(scenario.lane),
                        static_cast<int>(scenario.swap), static_cast<int>(scenario.look), seed, at));
        World world(scenario, seed);
        world.begin();
        bool is_over = false;
        for (int i = 0; i < at && !is_over; ++i) is_over = !world.step();
        world.crash();
        run_to_its_end(world);
        expect_a_sound_end(scenario, world);
        // A node that was added is started by the ring.
        const bool runs = scenario.kind == update::PackageKind::replace &&
                          scenario.swap == Scenario::Swap::starts &&
                          world.journal().update().step == UpdateStep::installed;
        if (runs) {
          EXPECT_EQ(world.running(), world.journal().update().version) << "the old process runs on";
        }
        if (testing::Test::HasFailure()) return;
        ++crashes;
        if (is_over) break;
      }
    }
  }
  EXPECT_GT(crashes, 3000);
}

TEST(UpdateTransactionTest, killed_again_and_again_it_gives_up_and_says_so) {
  std::mt19937 random(7);
  int gave_up = 0;
  for (const Scenario& scenario : all_scenarios()) {
    for (std::uint32_t seed = 0; seed < 50; ++seed) {
      SCOPED_TRACE(fmt::format("lane {}, swap {}, seed {}", static_cast<int>(scenario.lane),
                               static_cast<int>(scenario.swap), seed));
      World world(scenario, seed);
      world.begin();
      for (int crash = 0; crash < 6; ++crash) {
        for (auto left = random() % 12; left > 0 && world.step(); --left) {
        }
        world.crash();
      }
      run_to_its_end(world);
      expect_a_sound_end(scenario, world);
      if (testing::Test::HasFailure()) return;
      gave_up += world.transaction().update().reason.starts_with("interrupted") ? 1 : 0;
    }
  }
  EXPECT_GT(gave_up, 0);
}

TEST(UpdateTransactionTest, a_cancelled_one_ends_as_cancelled_and_only_while_the_lane_runs) {
  int cancelled = 0;
  for (const Scenario& scenario : all_scenarios()) {
    for (int at = 0; at < 40; ++at) {
      World world(scenario, 3);
      world.begin();
      for (int i = 0; i < at; ++i) (void)world.step();
      const auto before = world.answers.size();
      world.cancel();
      run_to_its_end(world);
      const UpdateStep end = world.transaction().update().step;
      if (end == UpdateStep::cancelled) {
        ++cancelled;
        EXPECT_EQ(world.transaction().update().reason, "by telecommand");
        EXPECT_EQ(versions_of_the_package(world), 0);
      } else {
        EXPECT_TRUE(std::find(world.answers.begin() + static_cast<std::ptrdiff_t>(before),
                              world.answers.end(), mission::failure::no_update) != world.answers.end());
      }
    }
  }
  EXPECT_GT(cancelled, 50);
}

TEST(UpdateTransactionTest, in_a_mode_that_allows_none_nothing_begins_and_what_has_not_begun_to_swap_ends) {
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    World world({}, seed);
    world.begin();
    for (std::uint32_t i = 0; i < seed % 30; ++i) (void)world.step();
    const bool swaps = world.transaction().update().step >= update::UpdateStep::swap;
    world.rest();
    while (world.step()) {
    }
    const auto& update = world.transaction().update();
    if (swaps) {
      EXPECT_EQ(update.step, update::UpdateStep::installed) << seed;
    } else if (update.step != update::UpdateStep::installed) {
      EXPECT_EQ(update.step, update::UpdateStep::cancelled) << seed;
      EXPECT_EQ(update.reason, "not in this mode") << seed;
    }
  }
  UpdateTransaction transaction({}, "maintenance");
  EXPECT_TRUE(transaction.rest(true).empty());
  const auto actions = transaction.install(file, true);
  ASSERT_EQ(actions.size(), 1U);
  EXPECT_EQ(std::get<AnswerTelecommand>(actions.front()).code, mission::failure::wrong_mode);
}

TEST(UpdateTransactionTest, a_candidate_that_is_stored_when_the_mode_changes_is_no_cancelled_one) {
  bool rested_while_it_was_stored = false;
  for (std::uint32_t seed = 0; seed < 50; ++seed) {
    for (int at = 0; at < 30; ++at) {
      World world({.activate = false}, seed);
      world.begin();
      for (int i = 0; i < at; ++i) (void)world.step();
      const update::UpdateStep rested_in = world.transaction().update().step;
      world.rest();
      while (world.step()) {
      }
      if (rested_in < update::UpdateStep::store) continue;
      EXPECT_EQ(world.transaction().update().step, update::UpdateStep::candidate) << seed << ' ' << at;
      rested_while_it_was_stored |= rested_in == update::UpdateStep::store;
    }
  }
  EXPECT_TRUE(rested_while_it_was_stored);
}

TEST(UpdateTransactionTest, a_swap_of_the_process_before_goes_on_in_a_mode_that_allows_none) {
  for (const auto kind : {update::PackageKind::replace, update::PackageKind::add}) {
    for (std::uint32_t seed = 0; seed < 50; ++seed) {
      World world({.kind = kind}, seed);
      world.begin();
      while (world.journal().update().step != update::UpdateStep::swap && world.step()) {
      }
      ASSERT_EQ(world.journal().update().step, update::UpdateStep::swap) << seed;
      world.crash();
      world.rest();
      while (world.step()) {
      }
      EXPECT_EQ(world.transaction().update().step, update::UpdateStep::installed) << seed;
    }
  }
}

TEST(UpdateTransactionTest, one_package_at_a_time_and_the_same_again_is_no_failure) {
  UpdateTransaction transaction({}, "maintenance");
  const auto answer_of = [](const UpdateTransaction::Actions& actions) {
    const auto* const answer = actions.size() == 1 ? std::get_if<AnswerTelecommand>(&actions[0]) : nullptr;
    return answer == nullptr ? std::nullopt : std::optional(answer->code);
  };
  EXPECT_EQ(answer_of(transaction.cancel()), mission::failure::no_update);
  EXPECT_EQ(answer_of(transaction.install(file, true)), std::nullopt);
  EXPECT_EQ(answer_of(transaction.install(file, true)), mission::failure::update_under_way)
      << "not verified yet";
  (void)transaction.on_taken_in(intake_of({}));
  (void)transaction.on_begun({});
  EXPECT_EQ(answer_of(transaction.install(file, true)), mission::failure::none);
  EXPECT_EQ(answer_of(transaction.install("packages/ttc.pkg", true)), mission::failure::update_under_way);
}

TEST(UpdateTransactionTest, once_stopped_it_answers_what_it_accepted_and_begins_nothing) {
  for (int at = 0; at < 40; ++at) {
    World world({}, 5);
    world.begin();
    for (int i = 0; i < at; ++i) (void)world.step();
    const int builds = world.builds, swaps = world.swaps;
    const bool in_lane = world.transaction().update().step <= UpdateStep::self_test;
    world.stop();
    while (world.step()) {
    }
    EXPECT_THAT(world.answers, testing::ElementsAre(mission::failure::none));
    EXPECT_LE(world.builds, builds + 1) << "an action that waited";
    if (in_lane) {
      EXPECT_EQ(world.swaps, swaps);
    }
  }
}

TEST(UpdateTransactionTest, answers_that_nobody_waits_for_change_nothing) {
  UpdateTransaction transaction({}, "maintenance");
  EXPECT_TRUE(transaction.on_taken_in(intake_of({})).empty());
  EXPECT_TRUE(transaction.on_begun({}).empty());
  EXPECT_TRUE(transaction.on_lane_ended({}).empty());
  EXPECT_TRUE(transaction.on_stored(StoredProgram{1, 2}).empty());
  EXPECT_TRUE(transaction.on_swapped(std::optional<StartedProgram>(), MonotonicTime()).empty());
  EXPECT_TRUE(transaction.on_look({}, MonotonicTime()).empty());
  EXPECT_FALSE(transaction.is_busy());
}

}  // namespace
}  // namespace srfs
