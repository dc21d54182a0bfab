// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "ros/transport.hpp"
#include "tests/rtps_message.hpp"

namespace srfs::ros {
namespace {

using Message = testing_support::RtpsMessage;

GuidPrefix prefix(std::uint8_t number) {
  return {1, 15, 7, 7, number, 0, 0, 0, 0, 0, 0, 9};
}

sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

/// Two sockets on a free port of this host, and one that sends to it.
class SortedSocketsTest : public testing::Test {
 protected:
  void SetUp() override {
    const Fd probe = bound(0);
    sockaddr_in address{};
    socklen_t length = sizeof address;
    ASSERT_EQ(getsockname(probe.get(), reinterpret_cast<sockaddr*>(&address), &length), 0);
    port_ = ntohs(address.sin_port);
  }
  /// A socket of somebody else on a port; empty: the port is taken.
  static Fd bound(std::uint16_t port, bool shared = false) {
    Fd fd(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const int on = 1;
    if (shared) setsockopt(fd.get(), SOL_SOCKET, SO_REUSEPORT, &on, sizeof on);
    const sockaddr_in address = loopback(port);
    if (bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return {};
    return fd;
  }
  static std::optional<SortedSockets> sorted(std::uint16_t port) {
    return SortedSockets::bind(htonl(INADDR_LOOPBACK), port);
  }
  void send(OctetView datagram) const {
    const sockaddr_in to = loopback(port_);
    ASSERT_EQ(sendto(sender_.get(), datagram.data(), datagram.size(), 0,
                     reinterpret_cast<const sockaddr*>(&to), sizeof to),
              static_cast<ssize_t>(datagram.size()));
  }
  static std::size_t waiting(const Fd& socket) {
    std::size_t count = 0;
    std::array<std::uint8_t, 1> octet{};
    while (recv(socket.get(), octet.data(), octet.size(), MSG_TRUNC) >= 0) ++count;
    return count;
  }
  std::uint16_t port_ = 0;
  Fd sender_{socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
};

TEST_F(SortedSocketsTest, EveryDatagramComesToTheSocketOfItsSender) {
  const auto sockets = sorted(port_);
  ASSERT_TRUE(sockets);
  std::vector<GuidPrefix> members;
  for (std::uint8_t i = 0; i < 64; ++i) members.push_back(prefix(i));
  ASSERT_TRUE(sort_by_sender(sockets->ours.get(), members));
  for (const GuidPrefix& member : members) send(Message(member).timestamp());
  EXPECT_EQ(waiting(sockets->ours), 64U);
  EXPECT_EQ(waiting(sockets->foreign), 0U);
  for (std::uint8_t i = 64; i < 128; ++i) send(Message(prefix(i)).timestamp());
  for (const std::size_t octet : {0U, 2U, 4U, 11U}) {  // all but one octet are those of a member
    GuidPrefix other = members[5];
    other[octet] ^= 0x80;
    send(Message(other).timestamp());
  }
  EXPECT_EQ(waiting(sockets->ours), 0U);
  EXPECT_EQ(waiting(sockets->foreign), 68U);
}

TEST_F(SortedSocketsTest, WhatIsTooShortForASenderIsForeign) {
  const auto sockets = sorted(port_);
  ASSERT_TRUE(sockets && sort_by_sender(sockets->ours.get(), std::vector{prefix(1)}));
  const Message message = Message(prefix(1)).timestamp();
  const OctetView whole = message;
  send(whole);
  for (std::size_t octets = 1; octets < 20; ++octets) send(Octets(whole.begin(), whole.begin() + octets));
  EXPECT_EQ(waiting(sockets->ours), 1U);
  EXPECT_EQ(waiting(sockets->foreign), 19U);
}

TEST_F(SortedSocketsTest, AMemberThatHasComeOrGoneIsSortedAnew) {
  const auto sockets = sorted(port_);
  ASSERT_TRUE(sockets);
  send(Message(prefix(1)).timestamp());
  EXPECT_EQ(waiting(sockets->foreign), 1U);
  ASSERT_TRUE(sort_by_sender(sockets->foreign.get(), std::vector{prefix(1)}));
  send(Message(prefix(1)).timestamp());
  EXPECT_EQ(waiting(sockets->ours), 1U);
  ASSERT_TRUE(sort_by_sender(sockets->ours.get(), {}));
  send(Message(prefix(1)).timestamp());
  EXPECT_EQ(waiting(sockets->ours), 0U);
}

TEST_F(SortedSocketsTest, AFloodFromOutsideFillsTheOtherSocketAlone) {
  const auto sockets = sorted(port_);
  ASSERT_TRUE(sockets && sort_by_sender(sockets->ours.get(), std::vector{prefix(1)}));
  Octets large(60'000);
  const Message message = Message(prefix(2)).timestamp();
  const OctetView begin = message;
  std::copy(begin.begin(), begin.end(), large.begin());
  for (int i = 0; i < 1000; ++i) send(large);
  for (int i = 0; i < 50; ++i) send(Message(prefix(1)).timestamp());
  EXPECT_EQ(waiting(sockets->ours), 50U);
  EXPECT_LT(waiting(sockets->foreign), 100U) << "the kernel dropped the others";
}

TEST_F(SortedSocketsTest, APortThatIsTakenIsNotShared) {
  {
    const Fd taken = bound(port_);
    EXPECT_FALSE(sorted(port_));
  }
  {
    const Fd shared = bound(port_, true);
    EXPECT_FALSE(sorted(port_));
  }
  const auto sockets = sorted(port_);
  EXPECT_TRUE(sockets);
  EXPECT_FALSE(sorted(port_)) << "by another process of the suite";
  EXPECT_FALSE(bound(port_));
}

}  // namespace
}  // namespace srfs::ros
