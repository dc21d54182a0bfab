// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/simulation/disk.hpp"
#include "tests/simulation/faults.hpp"
#include "tests/simulation/topics.hpp"
#include "tests/simulation/ttc.hpp"

namespace srfs::simulation {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::unique_ptr<Program> nothing(Host& /*host*/) {
  return nullptr;
}

TEST(SimulationKernel, RunsEventsInTheOrderOfTheirTimeAndThenOfTheirMaking) {
  Kernel kernel(1);
  std::vector<int> order;
  kernel.later(milliseconds(2), [&] { order.push_back(3); });
  kernel.later(milliseconds(1), [&] {
    order.push_back(1);
    kernel.later(nanoseconds(0), [&] { order.push_back(2); });
  });
  kernel.later(milliseconds(2), [&] { order.push_back(4); });

  kernel.run_until(kernel.now() + milliseconds(2));

  EXPECT_THAT(order, ElementsAre(1, 2, 3, 4));
}

TEST(SimulationKernel, AnotherPurposeDrawsOtherNumbersAndDisturbsNone) {
  const Kernel kernel(7);
  Random disk = kernel.random("disk");
  Random network = kernel.random("network");
  const std::uint64_t first = disk.next();
  EXPECT_NE(first, network.next());
  EXPECT_EQ(first, Kernel(7).random("disk").next());
  EXPECT_NE(first, Kernel(8).random("disk").next());
}

TEST(SimulationKernel, TheDiagramShowsTheLastHundredStepsWithWhoActedOnWhom) {
  Kernel kernel(1);
  for (std::uint64_t i = 0; i < 150; ++i) kernel.trace(Lane::timing, Lane::payload_adcs, "tick", i);
  const std::string diagram = kernel.diagram();
  EXPECT_EQ(std::count(diagram.begin(), diagram.end(), '\n'), 101);
  EXPECT_THAT(diagram, HasSubstr("o------------->"));
  EXPECT_THAT(diagram, HasSubstr("tick 149 0"));
  EXPECT_THAT(diagram, testing::Not(HasSubstr("tick 49 0")));
}

TEST(SimulationKernel, EveryStepChangesTheHash) {
  Kernel one(1);
  Kernel other(1);
  one.trace(Lane::timing, Lane::ttc, "tick", 1);
  other.trace(Lane::timing, Lane::ttc, "tick", 2);
  EXPECT_NE(one.hash(), other.hash());
}

TEST(SimulationKernel, ViolationsAreAlikeWhereTheSameCheckFailed) {
  const Violation twice{"L4", "executed twice: eps.switch_load"};
  EXPECT_TRUE(twice.is_like({"L4", "executed twice: adcs.reset_peripheral"}));
  EXPECT_FALSE(twice.is_like({"L4", "it was accepted and has no end: eps.switch_load"}));
  EXPECT_FALSE(twice.is_like({"L4a", "executed twice: eps.switch_load"}));
}

struct SimulationProcess : testing::Test {
  void begin(Host& host) {
    host.set_observer([this](Host& h) { h.runs() ? network.on_begin(h) : disk.on_end(h); });
    host.begin(milliseconds(1));
  }
  void run_for(nanoseconds time) { kernel.run_until(kernel.now() + time); }
  Kernel kernel{1};
  Network network{kernel};
  Disk disk{kernel};
  Host writer{kernel, Lane::ttc, nothing};
  Host reader{kernel, Lane::payload_eps, nothing};
  Topic<int> topic{kernel, network, "number", 4};
  std::vector<int> heard;
};

TEST(SimulationDeadline, ThatComesWithoutEndIsAViolation) {
  Kernel kernel(1);
  int times = 0;
  std::optional<Deadline> deadline;
  const Deadline::Guard guard = [&kernel](nanoseconds delay, Kernel::Event event) {
    kernel.later(delay, std::move(event));
  };
  deadline.emplace(kernel, guard, [&] {
    if (++times < 40'000) deadline->arm(kernel.now() + milliseconds(1));
  });
  deadline->arm(kernel.now());
  EXPECT_NO_THROW(kernel.run_until(kernel.now() + seconds(60)));
  EXPECT_EQ(times, 40'000);
  deadline.emplace(kernel, guard, [&] { deadline->arm(kernel.now()); });
  deadline->arm(kernel.now());
  EXPECT_THROW(kernel.run_until(kernel.now() + seconds(1)), Violation);
}

TEST_F(SimulationProcess, MessagesComeInOrderFromTheDiscoveryOn) {
  begin(writer);
  begin(reader);
  run_for(milliseconds(2));
  topic.subscribe(reader, [this](int n, Host&) { heard.push_back(n); });
  topic.publish(writer, 1);  // nobody is known yet
  run_for(seconds(1));
  network.set_longest_delay(milliseconds(300));
  for (int n = 2; n < 6; ++n) topic.publish(writer, n);
  run_for(seconds(1));
  EXPECT_THAT(heard, ElementsAre(2, 3, 4, 5));
}

TEST_F(SimulationProcess, AStoppedReaderFindsTheNewestOfItsHistory) {
  begin(writer);
  begin(reader);
  run_for(seconds(1));
  topic.subscribe(reader, [this](int n, Host&) { heard.push_back(n); });
  reader.stop(false);
  for (int n = 0; n < 9; ++n) topic.publish(writer, n);
  run_for(seconds(1));
  EXPECT_TRUE(heard.empty());
  reader.go_on();
  EXPECT_THAT(heard, ElementsAre(5, 6, 7, 8));
}

TEST_F(SimulationProcess, WhatAStoppedProcessHadDecidedLeavesItWhenItGoesOnOrNever) {
  begin(writer);
  run_for(seconds(1));
  int left = 0;
  writer.stop_at_action(0, milliseconds(50));
  writer.give([&] {
    writer.action_point();
    writer.output([&left] { ++left; });
  });
  EXPECT_EQ(left, 0);
  run_for(milliseconds(60));
  EXPECT_EQ(left, 1);

  writer.stop(false);
  writer.output([&left] { ++left; });
  writer.end("SIGKILL");
  run_for(seconds(1));
  EXPECT_EQ(left, 1);
}

TEST_F(SimulationProcess, AKillBetweenTwoActionsEndsTheHandlerThere) {
  begin(writer);
  run_for(seconds(1));
  int actions = 0;
  writer.kill_at_action(2);
  writer.give([&] {
    for (int i = 0; i < 5; ++i) {
      writer.action_point();
      ++actions;
    }
  });
  EXPECT_EQ(actions, 2);
  EXPECT_EQ(writer.state(), Host::State::down);
}

TEST_F(SimulationProcess, AProcessThatIsKilledWhileItStartsLeavesNothing) {
  struct Started final : Program {
    Started(Host& host, int& alive) : host_(host), alive_(alive) { ++alive_; }
    ~Started() override { --alive_; }
    void start() override { host_.action_point(); }
    Host& host_;
    int& alive_;
  };
  int alive = 0;
  Host host{kernel, Lane::ttc, [&alive](Host& h) { return std::make_unique<Started>(h, alive); }};
  host.kill_at_action(0);  // there is no process yet
  begin(host);
  run_for(seconds(1));
  EXPECT_TRUE(host.runs());
  EXPECT_EQ(alive, 1);
  host.end("SIGKILL");
  EXPECT_EQ(alive, 0);

  begin(host);
  host.kill_at_action(0);
  run_for(seconds(1));
  EXPECT_EQ(host.state(), Host::State::down);
  EXPECT_EQ(alive, 0);
}

TEST_F(SimulationProcess, TwoProcessesOfOneNodeAreAViolation) {
  begin(writer);
  EXPECT_THROW(writer.begin(milliseconds(1)), Violation);
}

TEST_F(SimulationProcess, AKilledWriterLeavesTheOldFileOrTheNewOne) {
  int old = 0;
  for (int i = 0; i < 40; ++i) {
    begin(writer);
    run_for(milliseconds(2));
    ASSERT_TRUE(disk.write_now("file", {1}));
    disk.write(writer, "file", {2}, [](bool) { FAIL() << "it has ended"; });
    writer.end("SIGKILL");
    run_for(seconds(1));
    const auto content = disk.read("file");
    ASSERT_TRUE(content == Octets{1} || content == Octets{2});
    old += content == Octets{1} ? 1 : 0;
  }
  EXPECT_GT(old, 5);
  EXPECT_LT(old, 35);
}

TEST(SimulationJournal, AWriteInWhichTheProcessEndsIsNotDoneOrUnsyncedOrDone) {
  for (const unsigned calls : {0U, 1U, 2U}) {
    Kernel kernel(1);
    TtcFlash flash(kernel, mission::Dictionary::load(mission::Dictionary::default_folder()));
    EndingMedium medium(flash.journal);
    JournalLog log(medium);
    (void)log.load();
    ASSERT_TRUE(log.snapshot({1}));
    medium.end_after(calls);
    EXPECT_EQ(log.append({{.kind = 1, .payload = {2}}}, true).has_value(), calls == 2);
    EXPECT_EQ(JournalLog(flash.journal).load().records.size(), calls == 0 ? 1U : 2U);
    flash.lose_power();
    const std::size_t left = JournalLog(flash.journal).load().records.size();
    EXPECT_GE(left, calls == 2 ? 2U : 1U);
    EXPECT_LE(left, calls == 0 ? 1U : 2U);
  }
}

TEST(SimulationFaults, AListIsReadAsItIsWritten) {
  const auto faults = faults_from("kill,bus_off,gps");
  ASSERT_TRUE(faults);
  EXPECT_EQ(faults->count(), 3U);
  EXPECT_EQ(to_text(*faults), "kill,bus_off,gps");
  EXPECT_EQ(faults_from("kill,nonsense"), std::nullopt);
  EXPECT_EQ(to_text(*faults_from("none")), "none");
}

TEST(SimulationFaults, OverTheSeedsEveryFaultIsOnAboutHalfTheTime) {
  std::array<int, fault_count> on{};
  for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
    const FaultSet faults = swarm_of(seed);
    for (std::size_t i = 0; i < fault_count; ++i) on[i] += faults[i] ? 1 : 0;
  }
  for (const int n : on) {
    EXPECT_GT(n, 400);
    EXPECT_LT(n, 650);
  }
  EXPECT_TRUE(swarm_of(16).none());
  EXPECT_TRUE(swarm_of(8).all());
}

}  // namespace
}  // namespace srfs::simulation
