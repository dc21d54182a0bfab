// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A suite whose datagrams bear a seal, and a stranger who has none, over real DDS.

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <srfs_msgs/srv/check_alive.hpp>

#include "base/fd.hpp"
#include "ros/client.hpp"
#include "ros/datagram_seal.hpp"
#include "ros/service.hpp"
#include "tests/dds_domain.hpp"

namespace srfs::ros {
namespace {

using srfs_msgs::srv::CheckAlive;
using Answer = Result<CheckAlive::Response, CallError>;

CheckAlive::Request nonce(std::uint64_t n) {
  CheckAlive::Request request;
  request.nonce = n;
  return request;
}

class SealedSuite : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    // Before the process has a key, and without an executor: what it sends bears no seal.
    stranger_ = make("liar", nullptr);
    seal_datagrams({SealKey{1, 2, 3}}, [] { return std::nullopt; });
    timing_ = make("timing", &executor_);
    ttc_ = make("ttc", &executor_);
  }
  static void TearDownTestSuite() {
    stranger_.reset();
    timing_.reset();
    ttc_.reset();
  }
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(20));
  }
  /// Answers nonce + @p more.
  std::unique_ptr<Service<CheckAlive>> service_of(Participant& who, std::uint64_t more) {
    return std::make_unique<Service<CheckAlive>>(
        executor_, who, name_, Qos{}, Priority::normal,
        [this, more](const CheckAlive::Request& q, CheckAlive::Response& r) {
          asked_.push_back(q.nonce);
          r.nonce = q.nonce + more;
        });
  }
  [[nodiscard]] std::unique_ptr<Client<CheckAlive>> client_of(Participant& who) {
    return std::make_unique<Client<CheckAlive>>(executor_, who, name_, Qos{}, Priority::normal);
  }
  void SetUp() override {
    static int tests = 0;
    name_ = "/test/sealed_" + std::to_string(++tests);
  }

  [[nodiscard]] static GuidPrefix prefix_of(const GUID_t& guid) {
    GuidPrefix prefix{};
    std::copy_n(guid.guidPrefix.value, prefix.size(), prefix.begin());
    return prefix;
  }

  /// Of all participants of the domain.
  static void send_to_discovery(const Octets& datagram) {
    const Fd fd(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    for (int number = 0; number < 32; ++number) {
      sockaddr_in to{};
      to.sin_family = AF_INET;
      to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      to.sin_port =
          htons(static_cast<std::uint16_t>(7400 + 250 * testing_support::own_domain() + 10 + 2 * number));
      (void)sendto(fd.get(), datagram.data(), datagram.size(), 0, reinterpret_cast<const sockaddr*>(&to),
                   sizeof to);
    }
  }

  static inline Executor executor_;
  static inline std::unique_ptr<Participant> stranger_;
  static inline std::unique_ptr<Participant> timing_;
  static inline std::unique_ptr<Participant> ttc_;
  std::string name_;
  std::vector<std::uint64_t> asked_;

 private:
  static std::unique_ptr<Participant> make(const std::string& node, Executor* executor) {
    return Participant::create(
               {testing_support::own_domain(), {"127.0.0.1"}, executor, SuiteIdentity{"suite", node, 1}})
        .value();
  }
};

TEST_F(SealedSuite, ARequestInAMembersNameIsNotExecuted) {
  const auto service = service_of(*timing_, 1);
  const auto client = client_of(*ttc_);
  WriterEndpoint writer(*stranger_, request_dds_name(name_),
                        dds::TypeSupport(new TypeSupport<CheckAlive::Request>), {});
  ASSERT_TRUE(wait([&] { return client->is_ready() && writer.matched(service->reader_guid()); }));
  const auto request = nonce(100);
  WriteParams params;
  params.related_sample_identity().writer_guid(client->reader_guid());
  ASSERT_TRUE(writer.write(&request, &params));
  ASSERT_TRUE(wait([&] { return service->stats().unanswered == 1; }));
  std::optional<std::uint64_t> answer;
  client->call(nonce(7), seconds(5), 3, [&](const Answer& a) { answer = a.value().nonce; });
  ASSERT_TRUE(wait([&] { return answer.has_value(); }));
  EXPECT_EQ(asked_, (std::vector<std::uint64_t>{7}));
}

TEST_F(SealedSuite, AStrangersReplyEndsNoCall) {
  const auto liar = service_of(*stranger_, 1000);
  const auto client = client_of(*ttc_);
  ASSERT_TRUE(wait([&] { return client->is_ready(); }));
  std::optional<std::uint64_t> answer;
  client->call(nonce(7), seconds(1), 30, [&](const Answer& a) { answer = a ? a->nonce : 0; });
  // It has answered attempts before the honest one is there.
  ASSERT_TRUE(wait([&] { return liar->counters().repeats >= 2; }));
  const auto service = service_of(*timing_, 1);
  ASSERT_TRUE(wait([&] { return answer.has_value(); }));
  EXPECT_EQ(*answer, 8U);
}

/// As often as somebody sends it, to whatever port.
TEST_F(SealedSuite, ARecordedDatagramIsTakenOnce) {
  const auto service = service_of(*timing_, 1);
  const auto client = client_of(*ttc_);
  ASSERT_TRUE(wait([&] { return client->is_ready(); }));
  const auto before = datagram_seal()->forged().repeated;
  Octets message = departure_message(prefix_of(service->writer_guid()));
  message.resize(20);  // the header: it says nothing
  Octets recorded;
  DatagramSeal({SealKey{1, 2, 3}}, [] { return std::nullopt; }).seal(message, monotonic_now(), recorded);
  for (int times = 0; times < 3; ++times) send_to_discovery(recorded);
  ASSERT_TRUE(wait([&] { return datagram_seal()->forged().repeated >= before + 4; }));
  EXPECT_TRUE(client->is_ready());
}

TEST_F(SealedSuite, AStrangerCannotSayGoodbyeForAMember) {
  const auto service = service_of(*timing_, 1);
  const auto client = client_of(*ttc_);
  ASSERT_TRUE(wait([&] { return client->is_ready(); }));
  const auto before = datagram_seal()->forged().about;
  const auto others = client_of(*stranger_);
  const GuidPrefix liar = prefix_of(others->writer_guid());
  // The disposal of the member's participant in the stranger's own name: only what the sample is about is the
  // member's.
  Octets goodbye = departure_message(prefix_of(service->writer_guid()));
  std::copy(liar.begin(), liar.end(), goodbye.begin() + 8);
  send_to_discovery(goodbye);
  ASSERT_TRUE(wait([&] { return datagram_seal()->forged().about >= before + 2; }));
  EXPECT_TRUE(client->is_ready());
  std::optional<std::uint64_t> answer;
  client->call(nonce(7), seconds(5), 3, [&](const Answer& a) { answer = a.value().nonce; });
  ASSERT_TRUE(wait([&] { return answer.has_value(); }));
  EXPECT_EQ(*answer, 8U);
}

}  // namespace
}  // namespace srfs::ros
