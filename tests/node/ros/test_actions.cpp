// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Actions over real DDS: server and client use two participants of this process, or one of them runs in a
// process that the test kills.

#include <algorithm>
#include <filesystem>
#include <map>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <example_interfaces/action/fibonacci.hpp>

#include "base/file.hpp"
#include "suite/node.hpp"
#include "tests/dds_domain.hpp"
#include "tests/node/ros/peer_process.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::ros {
namespace {

using example_interfaces::action::Fibonacci;
using testing::ElementsAre;
using testing_support::PeerProcess;
using FibonacciGoal = std::shared_ptr<ServerGoal<Fibonacci>>;
using FibonacciOutcome = GoalOutcome<Fibonacci>;

Fibonacci::Goal order(int n) {
  return {n};
}

class ActionTest : public testing::Test {
 protected:
  // Creating a participant takes longer than a test, so all tests share two.
  static void SetUpTestSuite() {
    here_ = Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
    there_ = Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
  }
  static void TearDownTestSuite() {
    here_.reset();
    there_.reset();
  }
  void SetUp() override {
    // Each test uses a new name: the other participant may still know the previous test's endpoints.
    static int tests = 0;
    action_ = "/test/fibonacci_" + std::to_string(++tests);
    client_ = std::make_unique<ActionClient<Fibonacci>>(executor_, *there_, action_);
  }
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(20));
  }
  /// Starts a server. It keeps its goals in running_ unless @p handlers replace that.
  void serve(ActionHandlers<Fibonacci> handlers = {}, const ActionServerOptions& options = {}) {
    if (!handlers.accepted) handlers.accepted = [this](FibonacciGoal goal) { running_.push_back(goal); };
    server_ =
        std::make_unique<ActionServer<Fibonacci>>(executor_, *here_, action_, std::move(handlers), options);
  }
  /// Waits until feedback can arrive. Feedback is lost until the server knows the client's reader.
  void expect_feedback_will_be_heard() {
    ASSERT_TRUE(wait([&] { return server_->feedback_readers() == 1; }));
  }
  struct Sent {
    std::shared_ptr<ClientGoal<Fibonacci>> goal;
    std::vector<std::int32_t> feedback;
    std::optional<FibonacciOutcome> outcome;
    std::optional<CancelOutcome> canceled;
    bool accepted = false;
  };
  void send(Sent& sent, int n, GoalDeadlines deadlines = {.response = seconds(15)}) {
    GoalCallbacks<Fibonacci> callbacks;
    callbacks.accepted = [&](UtcTime) { sent.accepted = true; };
    callbacks.feedback = [&](const Fibonacci::Feedback& f) { sent.feedback.push_back(f.sequence.at(0)); };
    callbacks.ended = [&](const FibonacciOutcome& outcome) {
      EXPECT_FALSE(sent.outcome) << "told twice";
      sent.outcome = outcome;
    };
    sent.goal = client_->send_goal(order(n), std::move(callbacks), deadlines);
  }
  void send_and_run(Sent& sent, int n) {
    const std::size_t before = running_.size();
    send(sent, n);
    ASSERT_TRUE(wait([&] { return running_.size() == before + 1 && sent.accepted; }));
  }
  void expect_end(Sent& sent, GoalState state) {
    ASSERT_TRUE(wait([&] { return sent.outcome.has_value(); }));
    ASSERT_TRUE(sent.outcome->has_value()) << to_text(sent.outcome->error());
    EXPECT_EQ((*sent.outcome)->state, state);
  }
  void expect_error(Sent& sent, GoalError error) {
    ASSERT_TRUE(wait([&] { return sent.outcome.has_value(); }));
    ASSERT_FALSE(sent.outcome->has_value());
    EXPECT_EQ(sent.outcome->error(), error);
  }
  void cancel(Sent& sent) {
    sent.goal->cancel([&](CancelOutcome outcome) { sent.canceled = outcome; });
  }

  static inline std::unique_ptr<Participant> here_;
  static inline std::unique_ptr<Participant> there_;
  std::string action_;
  Executor executor_;
  std::vector<FibonacciGoal> running_;
  std::unique_ptr<ActionServer<Fibonacci>> server_;
  std::unique_ptr<ActionClient<Fibonacci>> client_;
};

TEST_F(ActionTest, TenThousandGoalsOfAnOutsiderAreAllAcceptedOrRejected) {
  constexpr std::size_t goals = 10'000;
  ParticipantOptions options{
      testing_support::own_domain(), {"127.0.0.1"}, &executor_, SuiteIdentity{"suite", "node", 1}};
  const auto node = Participant::create(options).value();
  ActionHandlers<Fibonacci> handlers;
  handlers.accepted = [this](FibonacciGoal goal) { running_.push_back(goal); };
  ActionServer<Fibonacci> server(executor_, *node, action_, std::move(handlers), {.limits = {.active = 8}});

  using SendGoal = Fibonacci::SendGoal;
  std::map<std::int64_t, bool> answers;
  const auto reader = TypedReader<SendGoal::Response>::create(
      executor_, *there_, reply_dds_name(action_ + "/_action/send_goal"), {.depth = 2 * goals},
      Priority::normal, [&](const SendGoal::Response& r, const MessageInfo& info) {
        answers[static_cast<std::int64_t>(info.related.sequence_number().to64long())] = r.accepted;
      });
  WriterEndpoint writer(*there_, request_dds_name(action_ + "/_action/send_goal"),
                        dds::TypeSupport(new TypeSupport<SendGoal::Request>), {});
  ASSERT_TRUE(wait([&] { return writer.matched_count() == 1 && reader->matched_count() == 1; }));
  const auto send = [&](std::size_t i) {
    SendGoal::Request request;
    request.goal_id.uuid = {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(i >> 8), 1};
    WriteParams params;
    params.related_sample_identity().writer_guid(reader->guid());
    EXPECT_TRUE(writer.write(&request, &params));
  };
  // Requests sent before the server has matched the client are lost. An answer proves the match.
  std::size_t sent = 0;
  ASSERT_TRUE(wait([&] {
    if (answers.empty()) send(sent++);
    return !answers.empty();
  }));
  const auto expected = sent + goals - static_cast<std::size_t>(answers.begin()->first - 1);
  std::thread sender([&] {
    for (std::size_t i = 0; i < goals; ++i) send(sent + i);
  });
  EXPECT_TRUE(wait([&] { return answers.size() == expected; })) << answers.size() << " of " << expected;
  sender.join();
  reader->close();
  EXPECT_EQ(std::count_if(answers.begin(), answers.end(), [](const auto& a) { return a.second; }), 8);
  EXPECT_EQ(running_.size(), 8U);
  running_.clear();
}

TEST_F(ActionTest, WorkOnAWorkerThreadSendsFeedbackAndAResult) {
  Worker worker(executor_, "fibonacci", 4, milliseconds(3000));
  serve({.accepted = [&](FibonacciGoal goal) {
    goal->run_on(worker, [](ServerGoal<Fibonacci>& work) {
      Fibonacci::Result result;
      for (int n = 0; n < work.goal().order; ++n) {
        result.sequence.push_back(n * n);
        work.publish_feedback({{n}});
      }
      return GoalEnd<Fibonacci>::succeeded(result);
    });
  }});
  expect_feedback_will_be_heard();
  Sent sent;
  send(sent, 4);
  expect_end(sent, GoalState::succeeded);
  EXPECT_THAT((*sent.outcome)->result.sequence, ElementsAre(0, 1, 4, 9));
  EXPECT_THAT(sent.feedback, ElementsAre(0, 1, 2, 3));
  EXPECT_TRUE(sent.accepted);
  EXPECT_EQ(client_->goals_under_way(), 0U);
  EXPECT_EQ(client_->calls_waiting(), 0U);
}

TEST_F(ActionTest, SeveralGoalsAtOnceGetTheirOwnFeedbackAndResults) {
  serve();
  expect_feedback_will_be_heard();
  std::array<Sent, 5> sent;
  for (int i = 0; i < 5; ++i) send(sent.at(static_cast<std::size_t>(i)), i);
  ASSERT_TRUE(wait([&] { return running_.size() == 5; }));
  for (const auto& goal : running_) goal->publish_feedback({{goal->goal().order}});
  for (const auto& goal : running_) goal->succeed({{goal->goal().order * 10}});
  for (int i = 0; i < 5; ++i) {
    Sent& one = sent.at(static_cast<std::size_t>(i));
    expect_end(one, GoalState::succeeded);
    EXPECT_THAT((*one.outcome)->result.sequence, ElementsAre(i * 10));
    EXPECT_TRUE(wait([&] { return one.feedback == std::vector<std::int32_t>{i}; }));
  }
}

TEST_F(ActionTest, AServerRejectsWhatItDoesNotWantAndWhatIsTooMuch) {
  ActionHandlers<Fibonacci> handlers;
  handlers.goal = [](const GoalId&, const Fibonacci::Goal& goal) {
    return goal.order < 0 ? GoalResponse::reject : GoalResponse::accept_and_execute;
  };
  serve(std::move(handlers), {.limits = {.active = 1}});
  Sent unwanted;
  send(unwanted, -1);
  expect_error(unwanted, GoalError::rejected);
  Sent first;
  send_and_run(first, 1);
  Sent too_much;
  send(too_much, 2);
  expect_error(too_much, GoalError::rejected);
  EXPECT_EQ(server_->counters().rejected_by_server, 1U);
  EXPECT_EQ(server_->counters().rejected_full, 1U);
}

TEST_F(ActionTest, ADeferredGoalIsAcceptedUntilItsWorkBegins) {
  ActionHandlers<Fibonacci> handlers;
  handlers.goal = [](const GoalId&, const Fibonacci::Goal&) { return GoalResponse::accept_and_defer; };
  serve(std::move(handlers));
  Sent sent;
  send_and_run(sent, 1);
  EXPECT_EQ(server_->goals().at(0).state, GoalState::accepted);
  running_.at(0)->execute();
  EXPECT_TRUE(wait([&] { return sent.goal->state() == GoalState::executing; }));
  running_.at(0)->abort();
  expect_end(sent, GoalState::aborted);
}

TEST_F(ActionTest, ACancelBeforeTheServersAnswerReachesTheGoalWhenItIsAccepted) {
  Sent sent;
  send(sent, 1);
  cancel(sent);
  serve();
  ASSERT_TRUE(wait([&] { return sent.canceled.has_value(); }));
  EXPECT_EQ(*sent.canceled, CancelOutcome::canceling);
  EXPECT_TRUE(running_.at(0)->is_cancel_requested());
  running_.at(0)->canceled({{7}});
  expect_end(sent, GoalState::canceled);
  EXPECT_THAT((*sent.outcome)->result.sequence, ElementsAre(7)) << "a canceled goal has a result too";
}

TEST_F(ActionTest, AGoalThatWaitsAndOneThatExecutesCanBeCanceled) {
  for (const auto how : {GoalResponse::accept_and_defer, GoalResponse::accept_and_execute}) {
    running_.clear();
    server_.reset();
    ASSERT_TRUE(wait([&] { return !client_->is_ready(); }));
    ActionHandlers<Fibonacci> handlers;
    handlers.goal = [how](const GoalId&, const Fibonacci::Goal&) { return how; };
    serve(std::move(handlers));
    Sent sent;
    send_and_run(sent, 1);
    cancel(sent);
    ASSERT_TRUE(wait([&] { return sent.canceled.has_value(); }));
    EXPECT_EQ(*sent.canceled, CancelOutcome::canceling);
    EXPECT_TRUE(wait([&] { return sent.goal->state() == GoalState::canceling; }));
    running_.at(0)->canceled();
    expect_end(sent, GoalState::canceled);
  }
}

TEST_F(ActionTest, AServerMayRefuseACancelAndTheGoalGoesOn) {
  ActionHandlers<Fibonacci> handlers;
  handlers.cancel = [](const FibonacciGoal&) { return CancelResponse::reject; };
  serve(std::move(handlers));
  Sent sent;
  send_and_run(sent, 1);
  cancel(sent);
  ASSERT_TRUE(wait([&] { return sent.canceled.has_value(); }));
  EXPECT_EQ(*sent.canceled, CancelOutcome::rejected);
  EXPECT_FALSE(running_.at(0)->is_cancel_requested());
  running_.at(0)->succeed();
  expect_end(sent, GoalState::succeeded);
}

TEST_F(ActionTest, WorkThatEndsBeforeItNoticesTheCancelHasSucceeded) {
  serve();
  Sent sent;
  send_and_run(sent, 1);
  cancel(sent);
  ASSERT_TRUE(wait([&] { return running_.at(0)->is_cancel_requested(); }));
  running_.at(0)->succeed();
  expect_end(sent, GoalState::succeeded);
}

TEST_F(ActionTest, WorkThatSaysCanceledWithoutARequestIsAborted) {
  serve();
  Sent sent;
  send_and_run(sent, 1);
  running_.at(0)->canceled();
  expect_end(sent, GoalState::aborted);
}

TEST_F(ActionTest, AllGoalsAreCanceledAtOnce) {
  serve();
  std::array<Sent, 3> sent;
  for (Sent& one : sent) send_and_run(one, 1);
  std::optional<CancelOutcome> answer;
  client_->cancel_all_goals(seconds(5), [&](CancelOutcome outcome) { answer = outcome; });
  ASSERT_TRUE(wait([&] { return answer.has_value(); }));
  EXPECT_EQ(*answer, CancelOutcome::canceling);
  for (const auto& goal : running_) goal->canceled();
  for (Sent& one : sent) expect_end(one, GoalState::canceled);
}

TEST_F(ActionTest, AGoalWhoseWorkIsDroppedFailsOrFindsNoRoomIsAborted) {
  enum class Fate { dropped, thrown, no_room };
  Worker worker(executor_, "fibonacci", 1, milliseconds(3000));
  for (const Fate fate : {Fate::dropped, Fate::thrown}) {
    server_.reset();
    ASSERT_TRUE(wait([&] { return !client_->is_ready(); }));
    serve({.accepted = [&](const FibonacciGoal& goal) {
      if (fate == Fate::dropped) return;
      goal->run_on(worker, [](ServerGoal<Fibonacci>&) -> GoalEnd<Fibonacci> {
        throw std::runtime_error("the camera burnt");
      });
    }});
    Sent sent;
    send(sent, 1);
    expect_end(sent, GoalState::aborted);
  }
  server_.reset();
  ASSERT_TRUE(wait([&] { return !client_->is_ready(); }));
  ASSERT_TRUE(wait([&] { return !worker.progress().busy; })) << "a goal ends a little before its job";
  std::mutex gate;
  gate.lock();
  const auto blocked = [&] { const std::lock_guard hold(gate); };
  ASSERT_TRUE(worker.post(blocked));
  ASSERT_TRUE(wait([&] { return worker.progress().busy; }));
  while (worker.post(blocked)) {
  }
  serve({.accepted = [&](const FibonacciGoal& goal) {
    EXPECT_FALSE(goal->run_on(worker, [](auto&) { return GoalEnd<Fibonacci>::succeeded(); }));
  }});
  Sent sent;
  send(sent, 1);
  expect_end(sent, GoalState::aborted);
  gate.unlock();
}

TEST_F(ActionTest, AServerThatEndsTellsItsClients) {
  serve();
  Sent sent;
  send_and_run(sent, 1);
  ASSERT_TRUE(wait([&] { return server_->results_awaited() == 1; }));
  server_.reset();
  expect_end(sent, GoalState::aborted);
  running_.at(0)->succeed();  // too late, but harmless
}

TEST_F(ActionTest, WithoutAServerAGoalFailsAtItsDeadline) {
  Sent sent;
  send(sent, 1, {.response = milliseconds(50)});
  expect_error(sent, GoalError::no_server);
  EXPECT_EQ(client_->calls_waiting(), 0U);
}

TEST_F(ActionTest, AGoalPastItsResultDeadlineFailsAndIsCanceledAtTheServer) {
  serve();
  Sent sent;
  send(sent, 1, {.response = seconds(15), .result = milliseconds(300)});
  expect_error(sent, GoalError::result_late);
  EXPECT_TRUE(wait([&] { return running_.at(0)->is_cancel_requested(); }));
  EXPECT_TRUE(wait([&] { return client_->calls_waiting() == 0; }));
}

TEST_F(ActionTest, ADroppedClientGoalIsForgottenHereAndRunsOnThere) {
  serve();
  Sent sent;
  send_and_run(sent, 1);
  sent.goal.reset();
  EXPECT_EQ(client_->goals_under_way(), 0U);
  EXPECT_EQ(client_->calls_waiting(), 0U);
  EXPECT_EQ(server_->goals().at(0).state, GoalState::executing);
}

TEST_F(ActionTest, TooManyGoalsAreRefusedAtTheClient) {
  std::array<Sent, ActionClient<Fibonacci>::most_goals> sent;
  for (Sent& one : sent) send(one, 1);
  Sent too_much;
  send(too_much, 1);
  ASSERT_TRUE(too_much.outcome.has_value());
  EXPECT_EQ(too_much.outcome->error(), GoalError::refused);
}

TEST_F(ActionTest, AResultIsKeptForItsTimeAndThenTheGoalIsUnknown) {
  serve({}, {.limits = {.result_timeout = milliseconds(400)}});
  Sent sent;
  send_and_run(sent, 1);
  const GoalId id = sent.goal->id();
  running_.at(0)->succeed({{42}});
  expect_end(sent, GoalState::succeeded);

  Client<Fibonacci::GetResult> asker(executor_, *there_, action_ + "/_action/get_result", Qos{},
                                     Priority::normal);
  const auto ask = [&] {
    std::optional<Fibonacci::GetResult::Response> answer;
    Fibonacci::GetResult::Request request;
    request.goal_id.uuid = id;
    asker.call(request, seconds(15), 1, [&](const auto& response) { answer = response.value(); });
    EXPECT_TRUE(wait([&] { return answer.has_value(); }));
    return answer.value_or(Fibonacci::GetResult::Response{});
  };
  ASSERT_TRUE(wait([&] { return asker.is_ready(); }));
  if (server_->counters().expired == 0) {
    const auto kept = ask();
    EXPECT_TRUE(kept.status == 4 || server_->counters().expired == 1);
  }
  ASSERT_TRUE(wait([&] { return server_->counters().expired == 1; }));
  EXPECT_EQ(ask().status, 0);
}

TEST_F(ActionTest, WhoeverComesLateSeesTheStatusOfAllGoals) {
  serve();
  Sent sent;
  send_and_run(sent, 1);
  std::vector<std::int8_t> seen;
  const auto late = Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
  Subscription<action_msgs::msg::GoalStatusArray> subscription(
      executor_, *late, {action_ + "/_action/status", action_status_qos},
      [&](const action_msgs::msg::GoalStatusArray& m, const MessageInfo&) {
        for (const auto& one : m.status_list) seen.push_back(one.status);
      });
  ASSERT_TRUE(wait([&] { return !seen.empty(); }));
  EXPECT_THAT(seen, ElementsAre(2));
}

TEST_F(ActionTest, FeedbackBeyondItsBoundDropsTheOldestAndTheEndStillArrives) {
  serve();
  Sent sent;
  send_and_run(sent, 1);
  constexpr int many = static_cast<int>(GoalMailbox::most_feedback) + 9;
  for (int n = 0; n < many; ++n)
    running_.at(0)->publish_feedback({{n}});  // keeps the work thread busy, which is this thread
  running_.at(0)->succeed();
  expect_end(sent, GoalState::succeeded);
  EXPECT_EQ(server_->dropped_feedback(), 9U);
}

TEST_F(ActionTest, AKilledClientLeavesNoRequestBehindAndItsGoalRunsOn) {
  serve();
  PeerProcess peer("waiter", action_);
  ASSERT_TRUE(wait([&] { return running_.size() == 1 && server_->results_awaited() == 1; }));
  peer.kill_now();
  EXPECT_TRUE(wait([&] { return server_->results_awaited() == 0; }));
  EXPECT_TRUE(wait([&] { return server_->orphans() == 1; }));
  EXPECT_FALSE(running_.at(0)->is_cancel_requested());
  running_.at(0)->succeed();
  EXPECT_TRUE(wait([&] { return server_->goals().at(0).state == GoalState::succeeded; }));
}

TEST_F(ActionTest, AKilledClientsGoalIsCanceledWhereThatIsThePolicy) {
  serve({}, {.orphans = OrphanPolicy::cancel});
  PeerProcess peer("waiter", action_);
  ASSERT_TRUE(wait([&] { return running_.size() == 1 && server_->results_awaited() == 1; }));
  peer.kill_now();
  EXPECT_TRUE(wait([&] { return running_.at(0)->is_cancel_requested(); }));
  EXPECT_EQ(server_->goals().at(0).state, GoalState::canceling);
}

TEST_F(ActionTest, AKilledServerIsNoticedAndNothingIsLeft) {
  PeerProcess peer("server", action_);
  Sent sent;
  send(sent, 0, {.response = seconds(15), .result = std::chrono::hours(1)});
  ASSERT_TRUE(wait([&] { return sent.feedback.size() >= 3; }));
  peer.kill_now();
  expect_error(sent, GoalError::server_lost);
  EXPECT_EQ(client_->goals_under_way(), 0U);
  EXPECT_EQ(client_->calls_waiting(), 0U);

  // The next server serves the next goal.
  PeerProcess next("server", action_);
  Sent again;
  send(again, 0);
  ASSERT_TRUE(wait([&] { return !again.feedback.empty(); }));
  cancel(again);
  expect_end(again, GoalState::canceled);
}

class ImagingNode : public suite::Node {
 public:
  explicit ImagingNode(suite::NodeContext& context) : Node(context) {
    worker_ = create_worker("camera", 4);
    capture_ = create_action_server<Fibonacci>("~/capture", {.accepted = [this](FibonacciGoal goal) {
                                                 goal->run_on(*worker_, [](ServerGoal<Fibonacci>& work) {
                                                   while (!work.is_cancel_requested())
                                                     std::this_thread::yield();
                                                   return GoalEnd<Fibonacci>::canceled();
                                                 });
                                               }});
    client = create_action_client<Fibonacci>("/imaging/capture");
  }
  std::shared_ptr<ActionClient<Fibonacci>> client;

 private:
  std::shared_ptr<Worker> worker_;
  std::shared_ptr<ActionServer<Fibonacci>> capture_;
};

TEST_F(ActionTest, ANodeServesAndCallsActionsByName) {
  const testing_support::TemporaryFolder temporary;
  const std::filesystem::path& folder = temporary.path();
  ASSERT_TRUE(write_file_atomically(
      folder / "d.yaml", "deployment: t\nnodes: [{name: imaging, executable: x, parameters: {}}]\n"));
  const suite::Deployment deployment = suite::Deployment::load(folder / "d.yaml");
  suite::NodeContext context{"imaging", deployment, suite::VarPaths{folder}, 1, executor_, *here_};
  ImagingNode node(context);
  Sent sent;
  const auto goal = node.client->send_goal(
      order(1), {.ended = [&](const FibonacciOutcome& outcome) { sent.outcome = outcome; }},
      {.response = seconds(15)});
  ASSERT_TRUE(wait([&] { return goal->state() == GoalState::executing; }));
  goal->cancel();
  expect_end(sent, GoalState::canceled);
}

}  // namespace
}  // namespace srfs::ros
