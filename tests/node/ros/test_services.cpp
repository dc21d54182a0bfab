// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Services and clients over real DDS: retries, vanishing peers, races.

#include <algorithm>
#include <map>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <srfs_msgs/srv/check_alive.hpp>

#include "ros/client.hpp"
#include "ros/service.hpp"
#include "tests/dds_domain.hpp"
#include "tests/node/ros/peer_process.hpp"

namespace srfs::ros {
namespace {

using srfs_msgs::srv::CheckAlive;
using testing_support::PeerProcess;
using Answer = Result<CheckAlive::Response, CallError>;

std::unique_ptr<Participant> participant() {
  return Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
}

CheckAlive::Request nonce(std::uint64_t n) {
  CheckAlive::Request request;
  request.nonce = n;
  return request;
}

class ServicesTest : public testing::Test {
 protected:
  // Creating a participant takes longer than a test, so all tests share two.
  static void SetUpTestSuite() {
    here_ = participant();
    there_ = participant();
  }
  static void TearDownTestSuite() {
    here_.reset();
    there_.reset();
  }
  void SetUp() override {
    // Each test uses a new name: the other participant may still know the previous test's endpoints.
    static int tests = 0;
    name_ = "/test/check_alive_" + std::to_string(++tests);
  }
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(20));
  }
  /// Answers nonce + 1 and counts the requests.
  std::unique_ptr<Service<CheckAlive>> counting_service() {
    return std::make_unique<Service<CheckAlive>>(
        executor_, *here_, name_, Qos{}, Priority::normal,
        [this](const CheckAlive::Request& q, CheckAlive::Response& r) {
          ++executed_;
          r.nonce = q.nonce + 1;
        });
  }
  /// Keeps the tickets of all requests.
  std::unique_ptr<Service<CheckAlive>> deferring_service() {
    return std::make_unique<Service<CheckAlive>>(
        executor_, *here_, name_, Qos{}, Priority::normal, defer_replies,
        [this](const CheckAlive::Request&, Ticket ticket) { tickets_.push_back(ticket); });
  }
  static inline std::unique_ptr<Participant> here_;
  static inline std::unique_ptr<Participant> there_;
  std::string name_;
  Executor executor_;
  int executed_ = 0;
  std::vector<Ticket> tickets_;
};

TEST_F(ServicesTest, ConcurrentClientsOfSeveralProcessesGetTheirOwnAnswers) {
  const auto service = counting_service();
  constexpr std::uint64_t clients = 4;
  constexpr std::uint64_t calls = 5;
  std::vector<std::unique_ptr<Participant>> participants;
  std::vector<std::unique_ptr<Client<CheckAlive>>> all;
  for (std::uint64_t c = 0; c < clients; ++c) {
    participants.push_back(participant());
    all.push_back(std::make_unique<Client<CheckAlive>>(executor_, *participants.back(), name_, Qos{},
                                                       Priority::normal));
  }
  std::map<std::uint64_t, std::uint64_t> answers;
  for (std::uint64_t n = 0; n < clients * calls; ++n) {
    all.at(n % clients)->call(nonce(n * 100), seconds(5), 3, [&answers, n](const Answer& answer) {
      if (answer) answers[n] = answer->nonce;
    });
  }
  ASSERT_TRUE(wait([&] { return answers.size() == clients * calls; }));
  for (const auto& [n, answer] : answers) EXPECT_EQ(answer, n * 100 + 1);
  EXPECT_EQ(executed_, static_cast<int>(clients * calls)) << "each once, also those that were repeated";
  all.clear();
}

TEST_F(ServicesTest, ARequestRepeatedWhileItIsExecutedIsExecutedOnce) {
  const auto service = deferring_service();
  Client<CheckAlive> client(executor_, *there_, name_, Qos{}, Priority::normal);
  ASSERT_TRUE(wait([&] { return client.is_ready(); }));
  std::optional<std::uint64_t> answer;
  client.call(nonce(1), milliseconds(300), 50, [&](const Answer& a) { answer = a.value().nonce; });
  ASSERT_TRUE(wait([&] { return service->counters().repeats >= 2; }));
  ASSERT_EQ(tickets_.size(), 1U);
  CheckAlive::Response response;
  response.nonce = 77;
  EXPECT_TRUE(service->reply(tickets_.at(0), response));
  ASSERT_TRUE(wait([&] { return answer.has_value(); }));
  EXPECT_EQ(*answer, 77U);
  EXPECT_EQ(service->pending(), 0U);
}

/// A client made of bare endpoints, so that a test can write arbitrary requests.
class BareClient {
 public:
  BareClient(Executor& executor, Participant& participant, const std::string& name)
      : reader_(TypedReader<CheckAlive::Response>::create(
            executor, participant, reply_dds_name(name), Qos{}, Priority::normal,
            [this](const CheckAlive::Response& r, const MessageInfo& info) {
              if (info.related.writer_guid() != reader_->guid()) return;
              replies.emplace_back(static_cast<std::int64_t>(info.related.sequence_number().to64long()),
                                   r.nonce);
            })),
        writer_(participant, request_dds_name(name), dds::TypeSupport(new TypeSupport<CheckAlive::Request>),
                {}) {}
  ~BareClient() { reader_->close(); }
  BareClient(const BareClient&) = delete;
  BareClient& operator=(const BareClient&) = delete;

  std::int64_t write(std::uint64_t n, std::optional<std::int64_t> first) {
    const auto request = nonce(n);
    WriteParams params;
    params.related_sample_identity().writer_guid(reader_->guid());
    if (first) params.related_sample_identity().sequence_number(sequence_number(*first));
    EXPECT_TRUE(writer_.write(&request, &params));
    return static_cast<std::int64_t>(params.sample_identity().sequence_number().to64long());
  }
  [[nodiscard]] bool request_is_matched() const { return writer_.matched_count() > 0; }
  [[nodiscard]] bool is_matched() const { return request_is_matched() && reader_->matched_count() > 0; }

  std::vector<std::pair<std::int64_t, std::uint64_t>> replies;  ///< sequence of the request, nonce

 private:
  std::shared_ptr<TypedReader<CheckAlive::Response>> reader_;
  WriterEndpoint writer_;
};

/// A node of a suite, and an outsider that, like ROS 2, does not repeat its requests.
class OutsidersRequests : public ServicesTest {
 protected:
  static constexpr std::size_t burst = 10'000;

  OutsidersRequests() {
    ParticipantOptions options{
        testing_support::own_domain(), {"127.0.0.1"}, &executor_, SuiteIdentity{"suite", "node", 1}};
    node_ = Participant::create(options).value();
  }
  /// Writes a burst of requests as fast as possible, with ROS 2's depth of 10.
  /// @return the nonces of the replies, by the number of their request
  std::map<std::int64_t, std::uint64_t> replies_to_a_burst() {
    std::map<std::int64_t, std::uint64_t> replies;
    const auto reader = TypedReader<CheckAlive::Response>::create(
        executor_, *there_, reply_dds_name(name_), {.depth = 2 * burst}, Priority::normal,
        [&](const CheckAlive::Response& r, const MessageInfo& info) {
          const auto number = static_cast<std::int64_t>(info.related.sequence_number().to64long());
          EXPECT_TRUE(replies.emplace(number, r.nonce).second) << "answered twice: " << number;
        });
    WriterEndpoint writer(*there_, request_dds_name(name_),
                          dds::TypeSupport(new TypeSupport<CheckAlive::Request>), {});
    EXPECT_TRUE(wait([&] { return writer.matched_count() == 1 && reader->matched_count() == 1; }));
    const auto send = [&] {
      const auto request = nonce(1);
      WriteParams params;
      params.related_sample_identity().writer_guid(reader->guid());
      EXPECT_TRUE(writer.write(&request, &params));
    };
    // Requests sent before the service has matched the client are lost. A reply proves the match.
    std::int64_t sent = 0;
    EXPECT_TRUE(wait([&] {
      if (replies.empty()) {
        send();
        ++sent;
      }
      return !replies.empty();
    }));
    const std::int64_t first = replies.empty() ? 0 : replies.begin()->first;
    std::thread sender([&] {
      for (std::size_t i = 0; i < burst; ++i) send();
    });
    const auto expected = static_cast<std::size_t>(sent - first + 1) + burst;
    // The first reply may be a refusal while earlier requests still wait for an answer.
    const auto since_first = [&] {
      return static_cast<std::size_t>(std::distance(replies.lower_bound(first), replies.end()));
    };
    EXPECT_TRUE(wait([&] { return since_first() == expected; })) << since_first() << " of " << expected;
    sender.join();
    reader->close();
    return replies;
  }
  std::unique_ptr<Participant> node_;
};

TEST_F(OutsidersRequests, AreAllAnsweredOrRefusedHoweverManyComeAtOnce) {
  Service<CheckAlive> service(executor_, *node_, name_, Qos{}, Priority::normal,
                              [this](const CheckAlive::Request& q, CheckAlive::Response& r) {
                                ++executed_;
                                r.nonce = q.nonce + 1;
                              });
  const auto replies = replies_to_a_burst();
  const auto answered =
      std::count_if(replies.begin(), replies.end(), [](const auto& reply) { return reply.second == 2; });
  EXPECT_EQ(answered, executed_) << "the others got the empty response";
  EXPECT_GT(executed_, 0);  // the number depends on the machine's speed
  RecordProperty("executed", executed_);
}

TEST_F(OutsidersRequests, ThatFindTooManyWaitingAreRefused) {
  Service<CheckAlive> service(
      executor_, *node_, name_, Qos{}, Priority::normal, defer_replies,
      [this](const CheckAlive::Request&, Ticket ticket) { tickets_.push_back(ticket); });
  const Timer answers = executor_.add_timer(monotonic_now(), milliseconds(20), [&] {
    for (const Ticket ticket : std::exchange(tickets_, {})) {
      CheckAlive::Response response;
      response.nonce = 7;
      ++executed_;
      EXPECT_TRUE(service.reply(ticket, response));
    }
  });
  const auto replies = replies_to_a_burst();
  const auto answered =
      std::count_if(replies.begin(), replies.end(), [](const auto& reply) { return reply.second == 7; });
  EXPECT_EQ(answered, executed_);
  EXPECT_GT(service.counters().refused, 0U);
}

TEST_F(ServicesTest, ARequestRepeatedAfterItsAnswerWasLostIsAnsweredAgainAndNotExecuted) {
  const auto service = counting_service();
  BareClient client(executor_, *there_, name_);
  ASSERT_TRUE(wait([&] { return client.is_matched(); }));
  const auto first = client.write(1, std::nullopt);
  ASSERT_TRUE(wait([&] { return client.replies.size() == 1; }));
  const auto repeat = client.write(1, first);
  ASSERT_TRUE(wait([&] { return client.replies.size() == 2; }));
  EXPECT_EQ(client.replies.at(1), std::make_pair(repeat, std::uint64_t{2}));
  EXPECT_EQ(executed_, 1);

  client.write(1, std::nullopt);  // same content but not marked as a repeat: a new request, as in ROS 2
  ASSERT_TRUE(wait([&] { return client.replies.size() == 3; }));
  EXPECT_EQ(executed_, 2);
}

TEST_F(ServicesTest, AReplyIsNotLostWhenTheRequestIsFasterThanTheMatch) {
  const auto service = counting_service();
  for (int round = 0; round < 8; ++round) {
    const auto fresh = participant();
    BareClient client(executor_, *fresh, name_);
    ASSERT_TRUE(wait([&] { return client.request_is_matched(); }));
    client.write(1, std::nullopt);  // whether or not the reply endpoints have matched
    ASSERT_TRUE(wait([&] { return client.replies.size() == 1; })) << "round " << round;
  }
  EXPECT_EQ(service->dropped_replies(), 0U);
}

TEST_F(ServicesTest, AReplyToAReaderThatNeverComesIsGivenUpAndCounted) {
  WriterEndpoint writer(*here_, "rr/test/nobody", dds::TypeSupport(new TypeSupport<CheckAlive::Response>),
                        {});
  ReplyQueue queue(executor_, writer);
  SampleIdentity nobody;
  GUID_t guid;
  guid.guidPrefix.value[0] = 1;
  guid.entityId.value[3] = 0x04;
  nobody.writer_guid(guid);
  EXPECT_TRUE(queue.send(nobody, std::make_shared<CheckAlive::Response>()));
  EXPECT_EQ(queue.dropped(), 0U);
  EXPECT_TRUE(wait([&] { return queue.dropped() == 1; }));
}

TEST_F(ServicesTest, AServerThatNeverAnswersCostsItsDeadlinesAndNothingElse) {
  const auto service = deferring_service();
  Client<CheckAlive> client(executor_, *there_, name_, Qos{}, Priority::normal);
  ASSERT_TRUE(wait([&] { return client.is_ready(); }));
  std::optional<CallError> error;
  client.call(nonce(1), milliseconds(100), 3, [&](const Answer& answer) { error = answer.error(); });
  ASSERT_TRUE(wait([&] { return error.has_value(); }));
  EXPECT_EQ(*error, CallError::timeout);
  EXPECT_EQ(client.waiting(), 0U);
  EXPECT_EQ(tickets_.size(), 1U);
}

TEST_F(ServicesTest, RequestsToAKilledServerEndAtTheirDeadlines) {
  PeerProcess peer("mute", name_);
  Client<CheckAlive> client(executor_, *there_, name_, Qos{}, Priority::normal);
  ASSERT_TRUE(wait([&] { return client.is_ready(); }));
  int failed = 0;
  for (std::uint64_t n = 0; n < 8; ++n)
    client.call(nonce(n), milliseconds(500), 2, [&](const Answer& answer) { failed += answer ? 0 : 1; });
  peer.kill_now();
  ASSERT_TRUE(wait([&] { return failed == 8; }));
  EXPECT_EQ(client.waiting(), 0U);
}

TEST_F(ServicesTest, RequestsOfAClientThatLeftAreDropped) {
  const auto service = deferring_service();
  auto client = std::make_unique<Client<CheckAlive>>(executor_, *there_, name_, Qos{}, Priority::normal);
  client->call(nonce(1), seconds(15), 1, [](const Answer&) {});
  ASSERT_TRUE(wait([&] { return service->pending() == 1; }));
  std::vector<Ticket> dropped;
  service->on_clients_changed([&](std::span<const Ticket> tickets) {
    dropped.insert(dropped.end(), tickets.begin(), tickets.end());
  });
  client.reset();
  ASSERT_TRUE(wait([&] { return !dropped.empty(); }));
  EXPECT_EQ(dropped, tickets_);
  EXPECT_EQ(service->pending(), 0U);
  EXPECT_TRUE(service->reply(tickets_.at(0), {})) << "nobody is there to be answered: no error";
}

TEST_F(ServicesTest, AHandlerThatThrowsLeavesNoRequestWaiting) {
  bool throws = true;
  Service<CheckAlive> service(executor_, *here_, name_, Qos{}, Priority::normal,
                              [&](const CheckAlive::Request&, CheckAlive::Response&) {
                                if (std::exchange(throws, false)) throw std::runtime_error("out of memory");
                              });
  int failed = 0;
  executor_.on_failure([&](const CallbackRecord&, const std::string&) { ++failed; });
  Client<CheckAlive> client(executor_, *there_, name_, Qos{}, Priority::normal);
  ASSERT_TRUE(wait([&] { return client.is_ready(); }));
  bool answered = false;
  client.call(nonce(1), milliseconds(100), 50, [&](const Answer& answer) { answered = answer.has_value(); });
  ASSERT_TRUE(wait([&] { return answered; }));
  EXPECT_EQ(failed, 1);
  EXPECT_EQ(service.pending(), 0U);
}

TEST_F(ServicesTest, AForgottenCallIsNotHeardOfAgain) {
  const auto service = deferring_service();
  Client<CheckAlive> client(executor_, *there_, name_, Qos{}, Priority::normal);
  ASSERT_TRUE(wait([&] { return client.is_ready(); }));
  bool called = false;
  const auto call = client.call(nonce(1), seconds(15), 1, [&](const Answer&) { called = true; });
  ASSERT_TRUE(wait([&] { return tickets_.size() == 1; }));
  client.forget(call);
  EXPECT_EQ(client.waiting(), 0U);
  service->reply(tickets_.at(0), {});
  std::optional<CallError> other;
  client.call(nonce(2), milliseconds(200), 1, [&](const Answer& answer) { other = answer.error(); });
  ASSERT_TRUE(wait([&] { return other.has_value(); }));
  EXPECT_FALSE(called);
}

TEST_F(ServicesTest, AClientMayBeDroppedByItsOwnCallback) {
  const auto service = counting_service();
  auto client = std::make_unique<Client<CheckAlive>>(executor_, *there_, name_, Qos{}, Priority::normal);
  bool answered = false;
  client->call(nonce(1), seconds(15), 1, [&](const Answer&) {
    answered = true;
    client.reset();
  });
  ASSERT_TRUE(wait([&] { return answered; }));
  EXPECT_EQ(client, nullptr);

  auto lonely =
      std::make_unique<Client<CheckAlive>>(executor_, *there_, "/test/nobody", Qos{}, Priority::normal);
  lonely->call(nonce(1), milliseconds(20), 1, [&](const Answer&) { lonely.reset(); });
  EXPECT_TRUE(wait([&] { return lonely == nullptr; }));
}

}  // namespace
}  // namespace srfs::ros
