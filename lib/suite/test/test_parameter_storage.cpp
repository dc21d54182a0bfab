// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <csignal>
#include <memory>
#include <random>

#include <sys/wait.h>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.hpp"
#include "suite/parameter_storage.hpp"
#include "tests/build_kind.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::suite {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Operation = ParameterStorage::Operation;
using Kind = ParameterNews::Kind;

constexpr seconds trial_time{300};

/// A node's parameters: a and b are ordinary, g and h are guarded, `fixed` applies only at the next start. A
/// string stands in for the disk.
class Node {
 public:
  explicit Node(std::string& disk)
      : disk_(disk),
        set_(ConfigSection::parse("a: 10\ng: 100\n", "x.yaml")),
        storage_(set_, "eps", disk.empty() ? ParameterHistory{} : read_stored(disk)->history) {
    set_.guard("g");
    set_.guard("h");
    set_.set_stored(storage_.history().values());
    set_.declare("a", {std::int64_t{1}, ros::ParameterRange{0, 1000}, ""});
    set_.declare("b", {2.0, std::nullopt, ""});
    set_.declare("g", {std::int64_t{1}, ros::ParameterRange{0, 1000}, ""});
    set_.declare("h", {std::string("up"), std::nullopt, "", false, {"up", "down"}});
    set_.declare("fixed", {true, std::nullopt, "", true, {}});
    set_.finish();
    storage_.begin("start");
    set_.set_applied(
        [this](const std::vector<std::string>& names) { storage_.on_changed(names, now, trial_time); });
    write();
  }

  std::string set(const std::string& name, ros::ParameterValue value) {
    return set_.set_atomically({{name, std::move(value)}})[0];
  }
  Result<void, std::string> submit(ParameterStorage::Request request) {
    return storage_.submit(request, now, trial_time, "now");
  }
  /// @return the reason for refusal; empty: done and stored on disk
  std::string ask(ParameterStorage::Request request) {
    const auto done = submit(std::move(request));
    write();
    return done ? "" : done.error();
  }
  void write(bool ok = true) {
    while (storage_.to_write()) {
      if (ok) disk_ = *storage_.to_write();
      storage_.on_written(ok);
      storage_.poll(now);
    }
  }
  void wait(nanoseconds time) {
    now = now + time;
    storage_.poll(now);
  }
  [[nodiscard]] std::int64_t a() const { return std::get<std::int64_t>(*set_.find("a")); }
  [[nodiscard]] double b() const { return std::get<double>(*set_.find("b")); }
  [[nodiscard]] std::int64_t g() const { return std::get<std::int64_t>(*set_.find("g")); }
  [[nodiscard]] std::string h() const { return std::get<std::string>(*set_.find("h")); }
  [[nodiscard]] std::string stored() const { return to_text(set_.stored()); }
  std::vector<Kind> news() {
    std::vector<Kind> kinds;
    for (const auto& n : storage_.take_news()) kinds.push_back(n.kind);
    return kinds;
  }
  ParameterStorage& storage() { return storage_; }
  ros::ParameterSet& parameters() { return set_; }

  MonotonicTime now{seconds(1000)};

 private:
  std::string& disk_;
  ros::ParameterSet set_;
  ParameterStorage storage_;
};

class Keeping : public testing::Test {
 protected:
  void restart() { node = std::make_unique<Node>(disk); }
  std::string disk;
  std::unique_ptr<Node> node = std::make_unique<Node>(disk);
};

TEST_F(Keeping, WithoutNamesKeepsWhatDiffersFromTheDeployment) {
  ASSERT_EQ(node->set("a", std::int64_t{4}), "");
  EXPECT_EQ(node->ask({.origin = "test"}), "");
  EXPECT_EQ(node->stored(), "a=4");
  EXPECT_THAT(node->news(), ElementsAre(Kind::kept));
  restart();
  EXPECT_EQ(node->a(), 4);
  EXPECT_EQ(node->storage().history().generations.back().origin, "keep (test)");

  ASSERT_EQ(node->set("a", std::int64_t{10}), "");
  ASSERT_EQ(node->set("b", 3.0), "");
  EXPECT_EQ(node->ask({}), "");
  EXPECT_EQ(node->stored(), "b=3") << "a is as deployed again";
}

TEST_F(Keeping, OfNamedOnesKeepsThemAsTheyAreAndLeavesTheOthers) {
  ASSERT_EQ(node->set("b", 3.0), "");
  EXPECT_EQ(node->ask({.names = {"a"}}), "");
  EXPECT_EQ(node->stored(), "a=10") << "also where it is the deployment's value";
  EXPECT_EQ(node->ask({.names = {"b", "none"}}), "parameter 'none' has not been declared");
  EXPECT_EQ(node->stored(), "a=10");
}

TEST_F(Keeping, TakesAValueForTheNextStartOfAReadOnlyParameterButOfNoGuardedOne) {
  EXPECT_EQ(node->ask({.values = {{"fixed", false}}}), "");
  EXPECT_EQ(std::get<bool>(*node->parameters().find("fixed")), true) << "unchanged now";
  EXPECT_EQ(node->ask({}), "");
  EXPECT_EQ(node->stored(), "fixed=false") << "still for the next start";
  restart();
  EXPECT_EQ(std::get<bool>(*node->parameters().find("fixed")), false);
  EXPECT_THAT(node->ask({.values = {{"g", std::int64_t{5}}}}), HasSubstr("guarded"));
  EXPECT_EQ(node->ask({.values = {{"b", 1.0}, {"a", std::int64_t{1001}}}}),
            "parameter 'a': 1001 is outside 0..1000");
  EXPECT_EQ(node->stored(), "fixed=false") << "all or nothing";
}

TEST_F(Keeping, TheSameAgainIsNoNewGeneration) {
  ASSERT_EQ(node->set("a", std::int64_t{4}), "");
  EXPECT_EQ(node->ask({}), "");
  const std::string before = disk;
  EXPECT_EQ(node->ask({}), "");
  EXPECT_EQ(disk, before);
}

TEST_F(Keeping, ForgetsOnDemand) {
  ASSERT_EQ(node->set("a", std::int64_t{4}), "");
  ASSERT_EQ(node->set("b", 3.0), "");
  EXPECT_EQ(node->ask({}), "");
  EXPECT_EQ(node->ask({.operation = Operation::forget, .names = {"a"}}), "");
  EXPECT_EQ(node->stored(), "b=3");
  EXPECT_EQ(node->ask({.operation = Operation::forget, .names = {"a"}}), "parameter 'a' is not stored");
  EXPECT_EQ(node->ask({.operation = Operation::forget}), "");
  EXPECT_EQ(node->stored(), "");
  EXPECT_EQ(node->a(), 4) << "until the next start";
}

TEST_F(Keeping, OneAtATime) {
  ASSERT_EQ(node->set("a", std::int64_t{4}), "");
  ASSERT_TRUE(node->submit({}));
  ASSERT_TRUE(node->storage().to_write());
  EXPECT_EQ(node->submit({}).error(), "another save is in progress");
  EXPECT_TRUE(node->submit({.operation = Operation::report}));
}

TEST_F(Keeping, AFailedWriteKeepsNothing) {
  ASSERT_EQ(node->set("a", std::int64_t{4}), "");
  ASSERT_TRUE(node->submit({}));
  node->write(false);
  EXPECT_EQ(node->stored(), "");
  EXPECT_TRUE(node->storage().history().generations.empty());
  EXPECT_EQ(node->ask({}), "");
  EXPECT_EQ(node->stored(), "a=4");
}

TEST_F(Keeping, AGuardedValueGoesBackWhenItsTimeIsOver) {
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  EXPECT_THAT(node->news(), ElementsAre(Kind::on_trial));
  node->wait(trial_time - seconds(1));
  EXPECT_EQ(node->g(), 200);
  node->wait(seconds(1));
  EXPECT_EQ(node->g(), 100);
  EXPECT_THAT(node->news(), ElementsAre(Kind::reverted));
  EXPECT_FALSE(node->storage().deadline());
  EXPECT_EQ(disk, "") << "nothing was to be kept";
}

TEST_F(Keeping, ConfirmedInTimeItHoldsUntilTheNextStartAndKeptBeyondIt) {
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  EXPECT_EQ(node->ask({.operation = Operation::confirm}), "");
  node->wait(trial_time * 2);
  EXPECT_EQ(node->g(), 200);
  EXPECT_EQ(disk, "");
  EXPECT_EQ(node->ask({}), "") << "it was confirmed: kept at once";
  EXPECT_EQ(node->stored(), "g=200");
  restart();
  EXPECT_EQ(node->g(), 200);
}

TEST_F(Keeping, OfOrdinaryAndGuardedValuesTheOrdinaryOnesAreKeptAtOnce) {
  ASSERT_EQ(node->set("a", std::int64_t{4}), "");
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  node->wait(trial_time / 2);
  EXPECT_EQ(node->ask({}), "");
  EXPECT_EQ(node->stored(), "a=4");
  node->wait(trial_time / 2);
  EXPECT_EQ(node->g(), 200) << "keeping begins the time anew";
  EXPECT_EQ(node->ask({.operation = Operation::confirm}), "");
  EXPECT_EQ(node->stored(), "a=4, g=200");
  EXPECT_EQ(node->ask({.operation = Operation::confirm}), "") << "a repeat";
  node->wait(trial_time * 2);
  restart();
  EXPECT_EQ(node->a(), 4);
  EXPECT_EQ(node->g(), 200);
  EXPECT_THAT(node->news(), IsEmpty());
}

TEST_F(Keeping, AProcessThatDiesInATrialStartsWithoutItAndSaysSo) {
  ASSERT_EQ(node->set("a", std::int64_t{4}), "");
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  EXPECT_EQ(node->ask({}), "");
  restart();
  EXPECT_EQ(node->a(), 4);
  EXPECT_EQ(node->g(), 100);
  const auto news = node->storage().take_news();
  ASSERT_EQ(news.size(), 1U);
  EXPECT_EQ(news[0].kind, Kind::reverted);
  EXPECT_EQ(to_text(news[0].values), "g=100");
  EXPECT_EQ(node->ask({.operation = Operation::confirm}), "nothing is on trial");
  restart();
  EXPECT_THAT(node->news(), IsEmpty()) << "told once";
}

TEST_F(Keeping, WhatIsOnTrialGoesBackTogetherToWhatWasConfirmedLast) {
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  EXPECT_EQ(node->ask({.operation = Operation::confirm}), "");
  ASSERT_EQ(node->set("g", std::int64_t{300}), "");
  node->wait(trial_time / 2);
  ASSERT_EQ(node->set("h", std::string("down")), "");
  ASSERT_EQ(node->set("g", std::int64_t{400}), "");
  node->wait(trial_time / 2);
  EXPECT_EQ(node->g(), 400) << "each change begins the time anew";
  node->wait(trial_time / 2);
  EXPECT_EQ(node->g(), 200);
  EXPECT_EQ(node->h(), "up");
}

TEST_F(Keeping, SetBackByHandIsNoTrialAnyMore) {
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  EXPECT_EQ(node->ask({}), "");
  ASSERT_EQ(node->set("g", std::int64_t{100}), "");
  EXPECT_FALSE(node->storage().deadline());
  EXPECT_EQ(node->ask({.operation = Operation::confirm}), "nothing is on trial");
  node->wait(seconds(0));
  node->write();
  restart();
  EXPECT_THAT(node->news(), IsEmpty());
}

TEST_F(Keeping, AnOrdinaryChangeDoesNotProlongATrial) {
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  node->wait(trial_time / 2);
  ASSERT_EQ(node->set("a", std::int64_t{4}), "");
  node->wait(trial_time / 2);
  EXPECT_EQ(node->g(), 100);
  EXPECT_EQ(node->a(), 4);
}

TEST_F(Keeping, AConfirmationUnderWayIsNotOvertakenByTheEndOfItsTime) {
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  EXPECT_EQ(node->ask({}), "");
  ASSERT_TRUE(node->submit({.operation = Operation::confirm}));
  node->wait(trial_time * 2);
  EXPECT_EQ(node->g(), 200);
  node->write();
  EXPECT_EQ(node->g(), 200);
  EXPECT_EQ(node->stored(), "g=200");
}

TEST_F(Keeping, AConfirmationThatCannotBeWrittenIsNone) {
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  EXPECT_EQ(node->ask({}), "");
  ASSERT_TRUE(node->submit({.operation = Operation::confirm}));
  node->write(false);
  EXPECT_EQ(node->g(), 200);
  node->wait(trial_time);
  EXPECT_EQ(node->g(), 100);
}

TEST_F(Keeping, AValueChangedWhileAnotherIsConfirmedStaysOnTrial) {
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  EXPECT_EQ(node->ask({}), "");
  ASSERT_TRUE(node->submit({.operation = Operation::confirm}));
  ASSERT_EQ(node->set("g", std::int64_t{300}), "");
  node->write();
  EXPECT_EQ(node->stored(), "g=200");
  node->wait(trial_time);
  EXPECT_EQ(node->g(), 200);
}

TEST_F(Keeping, AValueSetBackByHandWhileItIsConfirmedIsOnNoTrial) {
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  EXPECT_EQ(node->ask({}), "");
  ASSERT_TRUE(node->submit({.operation = Operation::confirm}));
  ASSERT_EQ(node->set("g", std::int64_t{100}), "");
  node->write();
  EXPECT_EQ(node->stored(), "g=200") << "both were confirmed";
  EXPECT_FALSE(node->storage().deadline());
  node->wait(trial_time * 2);
  EXPECT_EQ(node->g(), 100);
}

TEST_F(Keeping, RestoresAnEarlierSetNowAndForTheNextStartsGuardedOnesOnTrial) {
  ASSERT_EQ(node->set("a", std::int64_t{4}), "");
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  EXPECT_EQ(node->ask({.operation = Operation::confirm}), "");
  EXPECT_EQ(node->ask({}), "");  // 1: a=4, g=200
  EXPECT_EQ(node->ask({.operation = Operation::reset}), "");
  EXPECT_EQ(node->stored(), "");
  EXPECT_EQ(node->a(), 10);
  EXPECT_EQ(node->g(), 100);
  ASSERT_EQ(node->set("b", 7.0), "");

  EXPECT_EQ(node->ask({.operation = Operation::restore, .generation = 1}), "");
  EXPECT_EQ(node->a(), 4);
  EXPECT_EQ(node->b(), 2.0) << "not in the set: the deployment's";
  EXPECT_EQ(node->g(), 200);
  EXPECT_EQ(node->stored(), "a=4") << "g is on trial";
  EXPECT_EQ(node->ask({.operation = Operation::confirm}), "");
  EXPECT_EQ(node->stored(), "a=4, g=200");
  EXPECT_EQ(node->ask({.operation = Operation::restore, .generation = 77}), "there is no generation 77");
}

TEST_F(Keeping, ARestoredSetWhoseGuardedValueIsTheDeploymentsLosesTheKeptOneOnceConfirmed) {
  ASSERT_EQ(node->set("a", std::int64_t{4}), "");
  EXPECT_EQ(node->ask({}), "");  // 1: a=4
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  EXPECT_EQ(node->ask({}), "");
  EXPECT_EQ(node->ask({.operation = Operation::confirm}), "");  // a=4, g=200
  EXPECT_EQ(node->ask({.operation = Operation::restore, .generation = 1}), "");
  EXPECT_EQ(node->g(), 100);
  EXPECT_EQ(node->stored(), "a=4, g=200") << "until it is confirmed";
  EXPECT_EQ(node->ask({.operation = Operation::confirm}), "");
  EXPECT_EQ(node->stored(), "a=4");
}

TEST_F(Keeping, WhatTheNodeRefusesIsNotRestored) {
  ASSERT_EQ(node->set("a", std::int64_t{4}), "");
  EXPECT_EQ(node->ask({}), "");
  EXPECT_EQ(node->ask({.operation = Operation::reset}), "");
  node->parameters().set_check(
      [](const std::string& name, const ros::ParameterValue& value) -> Result<void, std::string> {
        if (name == "a" && std::get<std::int64_t>(value) == 4) return Err(std::string("four is taken"));
        return {};
      });
  EXPECT_EQ(node->ask({.operation = Operation::restore, .generation = 1}), "four is taken");
  EXPECT_EQ(node->a(), 10);
}

TEST_F(Keeping, AFactoryResetEndsATrialAndCanBeUndone) {
  ASSERT_EQ(node->set("a", std::int64_t{4}), "");
  EXPECT_EQ(node->ask({}), "");
  ASSERT_EQ(node->set("g", std::int64_t{200}), "");
  EXPECT_EQ(node->ask({.operation = Operation::reset}), "");
  EXPECT_FALSE(node->storage().deadline());
  EXPECT_EQ(node->g(), 100);
  EXPECT_EQ(node->a(), 10);
  restart();
  EXPECT_EQ(node->a(), 10);
  EXPECT_EQ(node->storage().history().generations.size(), 2U);
  EXPECT_EQ(node->ask({.operation = Operation::restore, .generation = 1}), "");
  EXPECT_EQ(node->a(), 4);
}

/// A model of the storage's confirmed and stored values. It goes through random requests, waits, failed
/// writes and kills at any time, including during a write.
class ParameterStorageModel {
 public:
  explicit ParameterStorageModel(unsigned seed) : random_(seed) {}

  void run(int steps) {
    for (int i = 0; i < steps && !testing::Test::HasFailure(); ++i) {
      step();
      check();
    }
  }

 private:
  unsigned pick(unsigned count) { return std::uniform_int_distribution<unsigned>(0, count - 1)(random_); }

  void step() {
    switch (pick(10)) {
      case 0:
        EXPECT_EQ(node_->set("a", std::int64_t{pick(20)}), "");
        break;
      case 1:
      case 2:
        EXPECT_EQ(node_->set("g", std::int64_t{100 + pick(3)}), "");
        break;
      case 3:
        EXPECT_EQ(node_->set("h", std::string(pick(2) == 0 ? "up" : "down")), "");
        break;
      case 4:
        request({});
        break;
      case 5:
        if (node_->storage().to_write()) break;
        allowed_g_.insert(node_->g());
        allowed_h_.insert(node_->h());
        request({.operation = Operation::confirm});
        break;
      case 6: {
        const auto& generations = node_->storage().history().generations;
        if (generations.empty()) break;
        const auto number = generations[pick(static_cast<unsigned>(generations.size()))].number;
        request({.operation = Operation::restore, .generation = number});
        break;
      }
      case 7:
        if (pick(8) == 0) request({.operation = Operation::reset});
        break;
      case 8:
        wait(milliseconds(pick(200'000)));
        break;
      default:
        die();
    }
  }

  void request(ParameterStorage::Request request) {
    const bool busy = node_->storage().to_write().has_value();
    const auto done = node_->submit(std::move(request));
    EXPECT_FALSE(busy && done);
    if (!node_->storage().to_write() || busy) return;
    switch (pick(4)) {
      case 0:  // the write is still in progress
        break;
      case 1:
        node_->write(false);
        break;
      default:
        node_->write();
    }
  }

  void wait(nanoseconds time) {
    const bool free = !node_->storage().to_write();
    const auto deadline = node_->storage().deadline();
    node_->wait(time);
    if (free && deadline && node_->now >= *deadline) {
      EXPECT_FALSE(node_->storage().deadline());
      EXPECT_THAT(node_->storage().on_trial(), IsEmpty());
      EXPECT_TRUE(allowed_g_.contains(node_->g())) << node_->g() << " was never confirmed";
      EXPECT_TRUE(allowed_h_.contains(node_->h()));
    }
    if (pick(2) == 0) node_->write();
  }

  /// Kills the process. After a kill during a write the file holds either the old or the new text.
  void die() {
    if (node_->storage().to_write() && pick(2) == 0) disk_ = *node_->storage().to_write();
    const auto read = disk_.empty() ? StoredFile{} : read_stored(disk_).value();
    node_ = std::make_unique<Node>(disk_);
    std::int64_t a = 10;
    std::int64_t g = 100;
    for (const ros::StoredParameter& p : read.history.values()) {
      if (p.name == "a") a = std::get<std::int64_t>(p.value);
      if (p.name == "g") g = std::get<std::int64_t>(p.value);
    }
    EXPECT_EQ(node_->a(), a);
    EXPECT_EQ(node_->g(), g);
    EXPECT_THAT(node_->storage().on_trial(), IsEmpty());
  }

  void check() {
    const ParameterHistory& history = node_->storage().history();
    EXPECT_LE(history.generations.size(), ParameterHistory::most_generations);
    for (const ParameterGeneration& generation : history.generations) {
      for (const ros::StoredParameter& p : generation.values) {
        const bool allowed = p.name == "g"   ? allowed_g_.contains(std::get<std::int64_t>(p.value))
                             : p.name == "h" ? allowed_h_.contains(std::get<std::string>(p.value))
                                             : true;
        EXPECT_TRUE(allowed) << to_text(generation.values);
      }
    }
    EXPECT_EQ(node_->storage().on_trial().empty(), !node_->storage().deadline());
    const auto on_disk = disk_.empty() ? StoredFile{} : read_stored(disk_).value();
    EXPECT_EQ(on_disk.history, history);
  }

  std::mt19937 random_;
  std::string disk_;
  std::unique_ptr<Node> node_ = std::make_unique<Node>(disk_);
  std::set<std::int64_t> allowed_g_{100};
  std::set<std::string> allowed_h_{"up"};
};

TEST(ParameterStorageProperties, WhatNobodyConfirmedNeitherOutlivesItsTimeNorAnyDeath) {
  for (unsigned seed = 0; seed < (testing_support::slow ? 20 : 80) && !testing::Test::HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    ParameterStorageModel(seed).run(150);
  }
}

/// Runs in the child: stores a = 1, 2, 3... and reports each value that is on disk.
[[noreturn]] void keep_on(const std::filesystem::path& file, int say) {
  std::string disk;
  Node node(disk);
  for (std::int64_t a = 1;; ++a) {
    if (!node.set("a", a % 1000).empty() || !node.submit({})) _exit(1);
    if (!write_file_atomically(file, node.storage().to_write().value_or(""))) _exit(2);
    node.write();
    if (write(say, &a, sizeof(a)) != sizeof(a)) _exit(3);
  }
}

TEST(KeptFile, AProcessKilledInTheMiddleOfAWriteLeavesTheOldOrTheNewSet) {
  const testing_support::TemporaryFolder folder;
  std::mt19937 random(1);
  for (int round = 0; round < 40; ++round) {
    const auto file = folder.path() / std::to_string(round) / "parameters.yaml";
    std::array<int, 2> ends{};
    ASSERT_EQ(pipe(ends.data()), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) keep_on(file, ends[1]);
    close(ends[1]);
    std::int64_t said = 0;
    const auto enough = std::uniform_int_distribution<std::int64_t>(1, 12)(random);
    while (said < enough && read(ends[0], &said, sizeof(said)) == sizeof(said)) {
    }
    kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status)) << status;
    while (read(ends[0], &said, sizeof(said)) == sizeof(said)) {
    }
    close(ends[0]);
    std::string disk = read_file(file).value();
    ASSERT_TRUE(read_stored(disk)) << disk;
    const std::int64_t a = Node(disk).a();
    EXPECT_TRUE(a == said || a == said + 1) << a << " after " << said;
  }
}

}  // namespace
}  // namespace srfs::suite
