// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A node's information about itself, and the parameters that outlive the node.

#include <rcl_interfaces/srv/describe_parameters.hpp>
#include <rcl_interfaces/srv/list_parameters.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>
#include <rcl_interfaces/srv/set_parameters_atomically.hpp>
#include <srfs_msgs/srv/get_executor_statistics.hpp>
#include <srfs_msgs/srv/get_node_status.hpp>
#include <srfs_msgs/srv/save_parameters.hpp>

#include <mission/structures.hpp>

#include "base/log.hpp"
#include "tests/node/suite/node_fixture.hpp"

namespace srfs::suite {
namespace {

using srfs_msgs::srv::GetExecutorStatistics;
using srfs_msgs::srv::GetNodeStatus;
using srfs_msgs::srv::SaveParameters;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;
using Statistics = srfs_msgs::msg::CallbackStatistics;

void busy_for(milliseconds d) {
  const MonotonicTime end = monotonic_now() + d;
  while (monotonic_now() < end) {
  }
}

class NodeStatistics : public ScriptedNodeTest {
 protected:
  GetExecutorStatistics::Response ask(bool reset = false) {
    GetExecutorStatistics::Request request;
    request.reset = reset;
    return call<GetExecutorStatistics>("/probe/get_executor_statistics", request);
  }
  static Statistics find(const GetExecutorStatistics::Response& all, std::uint8_t kind,
                         const std::string& name) {
    for (const Statistics& s : all.callbacks) {
      if (s.kind == kind && s.name == name) return s;
    }
    ADD_FAILURE() << "no " << name;
    return {};
  }
};

TEST_F(NodeStatistics, NameEveryCallbackWithItsRunTimes) {
  int runs = 0;
  const auto timer = node_->create_timer(
      milliseconds(1),
      [&] {
        ++runs;
        busy_for(milliseconds(3));
      },
      "probe timer");
  ASSERT_TRUE(wait([&] { return runs >= 20; }));
  const auto all = ask();
  const Statistics s = find(all, Statistics::TIMER, "probe timer");
  EXPECT_GE(s.count, 20U);
  EXPECT_GE(s.p50_us, 3000U);
  EXPECT_GE(s.p99_us, s.p50_us);
  EXPECT_GE(s.max_us, s.p99_us);
  EXPECT_GE(s.total_us, s.count * 3000);
  EXPECT_EQ(s.budget_us, 20'000U);
  EXPECT_GT(s.missed_periods + all.missed_timer_periods, 0U) << "3 ms of work every 1 ms";
  EXPECT_GE(all.busy_ns, s.total_us * 1000);
  EXPECT_EQ(find(all, Statistics::SERVICE, "/probe/get_executor_statistics").budget_us, 100'000U);
}

TEST_F(NodeStatistics, CountTheInputsWithWhatWasLost) {
  const ros::Topic<srfs_msgs::msg::TimeTick> topic{"/test/tick", {.depth = 4}};
  std::uint64_t last = 0;
  const auto subscription =
      node_->create_subscription(topic, [&](const srfs_msgs::msg::TimeTick& t) { last = t.cycle; });
  ros::Publisher<srfs_msgs::msg::TimeTick> publisher(*there_, topic);
  ASSERT_TRUE(
      wait([&] { return publisher.subscription_count() == 1 && subscription->publisher_count() == 1; }));
  srfs_msgs::msg::TimeTick tick;
  tick.cycle = 1;
  publisher.publish(tick);
  ASSERT_TRUE(wait([&] { return last == 1; }));
  for (tick.cycle = 2; tick.cycle <= 40; ++tick.cycle) publisher.publish(tick);
  ASSERT_TRUE(wait([&] { return last == 40; }));

  const auto all = ask();
  const auto input = std::find_if(all.inputs.begin(), all.inputs.end(),
                                  [](const auto& i) { return i.name == "/test/tick"; });
  ASSERT_NE(input, all.inputs.end());
  EXPECT_EQ(input->received + input->lost, 40U);
  EXPECT_EQ(input->matched, 1U);
  EXPECT_EQ(find(all, Statistics::SUBSCRIPTION, "/test/tick").count, input->received);
}

TEST_F(NodeStatistics, StartAnewWhenAskedTo) {
  bool ran = false;
  const auto timer = node_->create_one_shot(
      monotonic_now(), [&] { ran = true; }, "once");
  ASSERT_TRUE(wait([&] { return ran; }));
  EXPECT_EQ(find(ask(true), Statistics::TIMER, "once").count, 1U);
  EXPECT_EQ(find(ask(), Statistics::TIMER, "once").count, 0U);
}

TEST_F(NodeStatistics, ACallbackOverItsBudgetRaisesAnEventOnce) {
  std::vector<srfs_msgs::msg::Event> heard;
  const ros::Subscription<srfs_msgs::msg::Event> events(
      executor_, *there_, topics::event,
      [&](const srfs_msgs::msg::Event& e, const ros::MessageInfo&) { heard.push_back(e); });
  ASSERT_TRUE(is_heard(events));
  ASSERT_EQ(node_->parameters().set_atomically({{"callback_budget_ms", std::int64_t{1}}})[0], "");
  int runs = 0;
  const auto timer = node_->create_timer(
      milliseconds(1),
      [&] {
        ++runs;
        busy_for(milliseconds(3));
      },
      "slow");
  const auto reports = [&] {
    std::vector<mission::NodeCallbackOverBudgetEvent> found;
    for (const auto& e : heard) {
      if (e.event_id != mission::event::node_callback_over_budget) continue;
      const auto event = mission::NodeCallbackOverBudgetEvent::decode(OctetView(e.data));
      if (event && event->callback == "slow") found.push_back(*event);
    }
    return found;
  };
  ASSERT_TRUE(wait([&] { return runs >= 10 && !reports().empty(); }));
  ASSERT_THAT(reports(), SizeIs(1)) << "10 runs in less than 10 s";
  EXPECT_GE(reports()[0].took_us, 3000U);
  EXPECT_EQ(reports()[0].budget_us, 1000U);
  EXPECT_GE(find(ask(), Statistics::TIMER, "slow").over_budget, 10U);
}

class StoredParameters : public ScriptedNodeTest {
 protected:
  using Values = std::vector<std::pair<std::string, ros::ParameterValue>>;

  SaveParameters::Response save(const std::vector<std::string>& names, const Values& values = {}) {
    SaveParameters::Request request;
    request.names = names;
    for (const auto& [name, value] : values) request.values.push_back({name, ros::to_message(value)});
    return call<SaveParameters>("/probe/save_parameters", request);
  }
  SaveParameters::Response ask(std::uint8_t operation, std::uint32_t generation = 0) {
    SaveParameters::Request request;
    request.operation = operation;
    request.generation = generation;
    request.origin = "test";
    return call<SaveParameters>("/probe/save_parameters", request);
  }
  void set(const std::string& name, const ros::ParameterValue& value) {
    ASSERT_EQ(node_->parameters().set_atomically({{name, value}})[0], "");
  }
  [[nodiscard]] std::int64_t period() const { return node_->get_parameter<std::int64_t>("period_ms"); }
  [[nodiscard]] std::filesystem::path file() const { return folder_ / "state/probe/parameters.yaml"; }
};

TEST_F(StoredParameters, OutliveARestartUntilTheyAreForgotten) {
  set("period_ms", std::int64_t{700});
  const auto saved = save({"period_ms"});
  EXPECT_TRUE(saved.success) << saved.reason;
  EXPECT_THAT(saved.stored, ElementsAre("period_ms"));

  start_node();
  EXPECT_EQ(period(), 700);
  EXPECT_TRUE(ask(SaveParameters::Request::FORGET).success);
  EXPECT_EQ(period(), 700) << "forgetting takes effect at the next start";

  start_node();
  EXPECT_EQ(period(), 50) << "the deployment's";
}

TEST_F(StoredParameters, MayBeReadOnlyOnesThatWaitForTheNextStart) {
  EXPECT_TRUE(save({}, {{"window", std::int64_t{9}}}).success);
  EXPECT_EQ(node_->get_parameter<std::int64_t>("window"), 4);
  start_node();
  EXPECT_EQ(node_->get_parameter<std::int64_t>("window"), 9);
}

TEST_F(StoredParameters, AreRefusedWithAReasonAndThenNothingIsWritten) {
  EXPECT_THAT(save({"nonsense"}).reason, HasSubstr("has not been declared"));
  EXPECT_THAT(save({}, {{"window", std::int64_t{900}}}).reason, HasSubstr("outside 1..64"));
  EXPECT_FALSE(std::filesystem::exists(file()));
}

TEST_F(StoredParameters, ThatAreGuardedGoBackByThemselvesUnlessTheyAreConfirmed) {
  set("parameter_trial_s", std::int64_t{1});
  set("guarded_ms", std::int64_t{200});
  const auto kept = save({});
  EXPECT_TRUE(kept.success) << kept.reason;
  EXPECT_THAT(kept.stored, ElementsAre("parameter_trial_s"));
  EXPECT_THAT(kept.on_trial, ElementsAre("guarded_ms"));
  EXPECT_GT(kept.trial_left_ms, 0U);
  EXPECT_LE(kept.trial_left_ms, 1000U);
  ASSERT_TRUE(wait([&] { return node_->get_parameter<std::int64_t>("guarded_ms") == 100; }));
  EXPECT_THAT(ask(SaveParameters::Request::REPORT).on_trial, SizeIs(0));
  std::string refused;  // while what was reverted is being kept, it is another one
  ASSERT_TRUE(wait([&] {
    refused = ask(SaveParameters::Request::CONFIRM).reason;
    return refused != "another save is in progress";
  }));
  EXPECT_EQ(refused, "nothing is on trial");

  set("parameter_trial_s", std::int64_t{300});
  set("guarded_ms", std::int64_t{300});
  EXPECT_TRUE(save({}).success);
  const auto confirmed = ask(SaveParameters::Request::CONFIRM);
  EXPECT_TRUE(confirmed.success) << confirmed.reason;
  EXPECT_THAT(confirmed.stored, Contains("guarded_ms"));
  start_node();
  EXPECT_EQ(node_->get_parameter<std::int64_t>("guarded_ms"), 300);
}

TEST_F(StoredParameters, OnTrialAreNotUsedByTheNextProcessWhichSaysSo) {
  set("guarded_ms", std::int64_t{200});
  EXPECT_TRUE(save({}).success);
  start_node();
  EXPECT_EQ(node_->get_parameter<std::int64_t>("guarded_ms"), 100);
  std::vector<srfs_msgs::msg::Event> heard;
  const ros::Subscription<srfs_msgs::msg::Event> events(
      executor_, *there_, topics::event,
      [&](const srfs_msgs::msg::Event& e, const ros::MessageInfo&) { heard.push_back(e); });
  ASSERT_TRUE(is_heard(events));
  ASSERT_TRUE(change("configure"));
  ASSERT_TRUE(change("activate"));
  const auto reverted = [&]() -> std::optional<mission::ParameterRevertedEvent> {
    for (const auto& e : heard) {
      if (e.event_id == mission::event::parameter_reverted)
        return mission::ParameterRevertedEvent::decode(OctetView(e.data));
    }
    return std::nullopt;
  };
  ASSERT_TRUE(wait([&] { return reverted().has_value(); }));
  EXPECT_EQ(reverted()->content, "guarded_ms=100");
}

TEST_F(StoredParameters, HaveAHistoryOutOfWhichTheyAreRestored) {
  set("period_ms", std::int64_t{700});
  EXPECT_TRUE(ask(SaveParameters::Request::KEEP).success);
  set("period_ms", std::int64_t{800});
  EXPECT_TRUE(ask(SaveParameters::Request::KEEP).success);
  EXPECT_TRUE(ask(SaveParameters::Request::RESET).success);
  EXPECT_EQ(period(), 50);
  start_node();
  EXPECT_EQ(period(), 50);

  const auto report = ask(SaveParameters::Request::REPORT);
  ASSERT_THAT(report.history, SizeIs(3));
  EXPECT_EQ(report.history[0].count, 0U);
  EXPECT_EQ(report.history[0].origin, "factory reset (test)");
  EXPECT_EQ(report.history[1].values, "period_ms=800");
  EXPECT_EQ(report.history[2].values, "period_ms=700");
  EXPECT_TRUE(ask(SaveParameters::Request::RESTORE, report.history[2].number).success);
  EXPECT_EQ(period(), 700);
  start_node();
  EXPECT_EQ(period(), 700);
  EXPECT_EQ(ask(SaveParameters::Request::RESTORE, 99).reason, "there is no generation 99");
  EXPECT_EQ(ask(17).reason, "there is no operation 17");
}

TEST_F(StoredParameters, ThatCannotBeUsedAreMovedAsideAndTheOthersHold) {
  ASSERT_TRUE(write_file_atomically(
      file(),
      "format: 1\nparameters:\n"
      "  - { name: period_ms, type: integer, value: 5000, trial: false, saved: x }\n"
      "  - { name: removed, type: bool, value: true, trial: false, saved: x }\n"
      "  - { name: window, type: integer, value: lots, trial: false, saved: x }\n"
      "  - { name: callback_budget_ms, type: integer, value: 30, trial: false, saved: x }\n"));
  start_node();
  EXPECT_EQ(period(), 50);
  EXPECT_EQ(node_->get_parameter<std::int64_t>("callback_budget_ms"), 30);
  const auto status = call<GetNodeStatus>("/probe/get_status", {});
  EXPECT_THAT(status.parameters_set_aside, SizeIs(3));
  EXPECT_THAT(status.parameters_set_aside, Contains(HasSubstr("5000 is outside 10..1000")));
  EXPECT_THAT(status.parameters_set_aside, Contains(HasSubstr("removed: no such parameter")));
  EXPECT_THAT(read_file(folder_ / "state/probe/parameters_set_aside.yaml").value(), HasSubstr("5000"));

  start_node();
  EXPECT_THAT(call<GetNodeStatus>("/probe/get_status", {}).parameters_set_aside, SizeIs(0)) << "told once";
  EXPECT_EQ(node_->get_parameter<std::int64_t>("callback_budget_ms"), 30);

  ASSERT_TRUE(write_file_atomically(
      file(),
      "format: 1\nparameters:\n  - { name: gone, type: integer, value: 17, trial: false, saved: x }\n"));
  start_node();
  const std::string aside = read_file(folder_ / "state/probe/parameters_set_aside.yaml").value();
  EXPECT_THAT(aside, HasSubstr("17"));
  EXPECT_THAT(aside, HasSubstr("5000")) << "what was set aside before is kept";
}

TEST_F(StoredParameters, InADamagedFileAreSetAsideWholeAndTheNodeStarts) {
  ASSERT_TRUE(write_file_atomically(file(), "format: 1\nparameters: [ {\n"));
  start_node();
  EXPECT_EQ(period(), 50);
  EXPECT_FALSE(std::filesystem::exists(file()));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "state/probe/parameters.damaged"));
  EXPECT_THAT(call<GetNodeStatus>("/probe/get_status", {}).parameters_set_aside, SizeIs(1));

  set("period_ms", std::int64_t{700});
  EXPECT_TRUE(save({}).success);
  std::string text = read_file(file()).value();
  text[text.find("700")] = '8';
  ASSERT_TRUE(write_file_atomically(file(), text));
  start_node();
  EXPECT_EQ(period(), 50) << "a value that was changed on the disk is none";
}

TEST_F(StoredParameters, ThatCannotBeWrittenAreReportedAndNotHeldForStored) {
  ASSERT_TRUE(write_file_atomically(folder_ / "state/probe", "a file where the folder should be"));
  const auto saved = save({}, {{"window", std::int64_t{9}}});
  EXPECT_FALSE(saved.success);
  EXPECT_THAT(saved.reason, HasSubstr("parameters.yaml"));
  EXPECT_THAT(saved.stored, SizeIs(0));
}

TEST_F(ScriptedNodeTest, ASetOfParametersIsOneEvent) {
  std::vector<rcl_interfaces::msg::ParameterEvent> heard;
  const ros::Subscription<rcl_interfaces::msg::ParameterEvent> events(
      executor_, *there_, ros::topics::parameter_events,
      [&](const rcl_interfaces::msg::ParameterEvent& e, const ros::MessageInfo&) { heard.push_back(e); });
  ASSERT_TRUE(is_heard(events));
  rcl_interfaces::srv::SetParametersAtomically_Request request;
  request.parameters.push_back({"period_ms", ros::to_message(std::int64_t{20})});
  request.parameters.push_back({"callback_budget_ms", ros::to_message(std::int64_t{30})});
  EXPECT_TRUE(call<rcl_interfaces::srv::SetParametersAtomically>("/probe/set_parameters_atomically", request)
                  .result.successful);
  ASSERT_TRUE(wait([&] { return !heard.empty(); }));
  EXPECT_THAT(heard, SizeIs(1));
  EXPECT_EQ(heard[0].node, "/probe");
  EXPECT_THAT(heard[0].changed_parameters, SizeIs(2));
}

TEST_F(ScriptedNodeTest, TheLogLevelIsAParameter) {
  rcl_interfaces::srv::SetParameters_Request request;
  request.parameters.push_back({"log_level", ros::to_message(std::string("error"))});
  request.parameters.push_back({"log_level", ros::to_message(std::string("loud"))});
  const auto results = call<rcl_interfaces::srv::SetParameters>("/probe/set_parameters", request).results;
  EXPECT_TRUE(results.at(0).successful);
  EXPECT_THAT(results.at(1).reason, HasSubstr("not one of debug, info, warn, error, fatal"));
  EXPECT_EQ(log::level(), log::Severity::error);
  log::set_level(log::Severity::info);
}

TEST_F(ScriptedNodeTest, ALateReaderGetsTheLinesOnRosoutWithTheirPlace) {
  log::info("before anybody listens {}", 1);
  std::vector<rcl_interfaces::msg::Log> heard;
  const ros::Subscription<rcl_interfaces::msg::Log> lines(
      executor_, *there_, ros::topics::rosout,
      [&](const rcl_interfaces::msg::Log& m, const ros::MessageInfo&) { heard.push_back(m); });
  const auto found = [&] {
    return std::find_if(heard.begin(), heard.end(),
                        [](const auto& m) { return m.msg == "before anybody listens 1"; });
  };
  ASSERT_TRUE(wait([&] { return found() != heard.end(); }));
  EXPECT_EQ(found()->name, "probe");
  EXPECT_EQ(found()->level, 20);
  EXPECT_EQ(found()->file, "test_node_introspection.cpp");
  EXPECT_GT(found()->line, 0U);
  EXPECT_THAT(found()->function, HasSubstr("ALateReader"));
}

}  // namespace
}  // namespace srfs::suite
