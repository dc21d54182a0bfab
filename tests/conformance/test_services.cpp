// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Assignment of replies to requests (ROS 2's rule on Fast DDS), with several clients and with malformed
// requests.

#include <map>

#include "tests/conformance/node_process.hpp"

namespace srfs::conformance {
namespace {

constexpr const char* get_state = "lifecycle_msgs::srv::dds_::GetState";
constexpr const char* describe = "rcl_interfaces::srv::dds_::DescribeParameters";
const Octets empty_request{0, 1, 0, 0, 0, 0, 0, 0};

class Services : public ConformanceTest {};

TEST_F(Services, TheReplyCarriesTheReplyReadersGuidAndTheRequestsNumber) {
  RawClient client(peer_, "/probe/get_state", get_state);
  ASSERT_TRUE(wait_for([&] { return client.ready(); }));
  const std::uint64_t sequence = client.send(empty_request);
  const auto reply = client.replies.next();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->related.writer_guid(), client.replies.guid());
  EXPECT_EQ(reply->related.sequence_number().to64long(), sequence);
}

TEST_F(Services, ARequestWithoutAReadersGuidIsAnsweredToItsWriter) {
  RawClient client(peer_, "/probe/get_state", get_state);
  ASSERT_TRUE(wait_for([&] { return client.ready(); }));
  const auto request = client.requests.write(empty_request);
  const auto reply = client.replies.next();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->related.writer_guid(), client.requests.guid());
  EXPECT_EQ(reply->related.sequence_number(), request.sequence_number());
}

TEST_F(Services, ConcurrentClientsGetTheirOwnAnswers) {
  // Two clients in one participant and one in another, with all requests in flight at once. The answer
  // repeats the name of an unknown parameter.
  constexpr int calls = 20;
  Ros2Peer other(test_domain());
  std::vector<std::unique_ptr<RawClient>> clients;
  for (Ros2Peer* peer : {&peer_, &peer_, &other})
    clients.push_back(std::make_unique<RawClient>(*peer, "/probe/describe_parameters", describe));
  ASSERT_TRUE(wait_for([&] { return clients[0]->ready() && clients[1]->ready() && clients[2]->ready(); }));
  std::vector<std::map<std::uint64_t, std::string>> asked(clients.size());
  for (int i = 0; i < calls; ++i) {
    for (std::size_t c = 0; c < clients.size(); ++c) {
      const std::string name = "client_" + std::to_string(c) + "_call_" + std::to_string(i);
      asked[c][clients[c]->send(Cdr().strings({name}).payload())] = name;
    }
  }
  for (std::size_t c = 0; c < clients.size(); ++c) {
    while (!asked[c].empty()) {
      const auto reply = clients[c]->replies.next(
          [&](const ReceivedSample& s) { return s.related.writer_guid() == clients[c]->replies.guid(); });
      ASSERT_TRUE(reply) << asked[c].size() << " calls of client " << c << " were not answered";
      const auto found = asked[c].find(reply->related.sequence_number().to64long());
      ASSERT_NE(found, asked[c].end()) << "answered twice";
      CdrView view(reply->payload);
      ASSERT_EQ(view.u32(), 1U);
      EXPECT_EQ(view.str(), found->second);
      asked[c].erase(found);
    }
  }
}

TEST_F(Services, TheFirstReplyToAFreshClientIsNotLost) {
  // The server may have matched the request's writer but not yet the reply's reader; it must wait for it.
  for (int i = 0; i < 10; ++i) {
    Ros2Peer fresh(test_domain());
    RawClient client(fresh, "/probe/get_state", get_state);
    ASSERT_TRUE(wait_for([&] { return client.requests.matched() == 1; }));
    client.send(empty_request);
    ASSERT_TRUE(client.replies.next()) << "client " << i;
  }
}

TEST_F(Services, AnEmptyRequestMayComeWithoutItsDummyOctet) {
  RawClient client(peer_, "/probe/get_state", get_state);
  EXPECT_FALSE(client.call({0, 1, 0, 0}).empty());
}

TEST_F(Services, ARequestInBigEndianIsUnderstood) {
  RawClient client(peer_, "/probe/describe_parameters", describe);
  const Octets answer = client.call({0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 3, 'a', 'b', 0, 0});
  CdrView view(answer);
  EXPECT_EQ(view.u32(), 1U);
  EXPECT_EQ(view.str(), "ab");
}

TEST_F(Services, MalformedRequestsAreNotAnsweredAndTheNextGoodOneIs) {
  RawClient client(peer_, "/probe/describe_parameters", describe);
  ASSERT_TRUE(wait_for([&] { return client.ready(); }));
  const std::vector<Octets> malformed{
      {0, 1, 0, 0},                                              // no data where a sequence should be
      {0, 1, 0, 0, 0xff, 0xff, 0xff, 0x7f},                      // two billion names
      {0, 1, 0, 0, 1, 0, 0, 0, 0xff, 0xff, 0xff, 0x7f},          // a name longer than the sample
      {0, 1, 0, 0, 1, 0, 0, 0, 3, 0, 0, 0, 'a', 'b', 'c', 'd'},  // a name without NUL
      {0, 9, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 'a', 0, 0, 0},        // no such encapsulation
  };
  for (const Octets& request : malformed) client.send(request);
  const std::uint64_t good = client.send(Cdr().strings({"good"}).payload());
  const auto first = client.replies.next();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->related.sequence_number().to64long(), good) << "nothing came for the malformed ones";
}

}  // namespace
}  // namespace srfs::conformance
