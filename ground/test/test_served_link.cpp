// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/served_link.hpp"

#include <atomic>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>

#include "fake_spacecraft.hpp"
#include "ground/files.hpp"
#include "ground/local_socket.hpp"

namespace srfs::ground {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Messages = std::vector<nlohmann::json>;

/// A server, and those that follow it at the same socket: one connection at a time, in its own thread. It
/// says what the test gave it to say.
class FakeServer {
 public:
  /// @return what it says to a message of its n-th client, from 1; nullopt: it ends instead
  using Answer = std::function<std::optional<Messages>(int client, const nlohmann::json&)>;

  FakeServer(const std::filesystem::path& socket, Answer answer)
      : listener_(*listen_at(socket)), answer_(std::move(answer)), thread_([this] { serve(); }) {}
  ~FakeServer() {
    stopped_ = true;
    thread_.join();
  }
  FakeServer(const FakeServer&) = delete;
  FakeServer& operator=(const FakeServer&) = delete;

 private:
  void serve() {
    Fd socket;
    int client = 0;
    while (!stopped_) {
      pollfd wait{socket ? socket.get() : listener_.get(), POLLIN, 0};
      if (::poll(&wait, 1, 10) <= 0) continue;
      if (!socket) {
        socket = accept_from(listener_.get());
        ++client;
        continue;
      }
      const auto received = receive_message(socket.get(), serve::message_octets_max);
      const auto* text = std::get_if<std::string>(&received);
      const auto said =
          text == nullptr ? std::optional<Messages>() : answer_(client, nlohmann::json::parse(*text));
      if (!said) {
        socket.reset();
        continue;
      }
      for (const auto& message : *said) static_cast<void>(send_message(socket.get(), message.dump()));
    }
  }

  Fd listener_;
  Answer answer_;
  std::atomic<bool> stopped_{false};
  std::thread thread_;
};

nlohmann::json cop_in(AdPhase phase) {
  CopReport report;
  report.phase = phase;
  return serve::to_message(report);
}

cfdp::Report transfer(std::uint64_t number, const std::string& name) {
  cfdp::Report report;
  report.id = {1, number};
  report.destination_file = name;
  return report;
}

nlohmann::json welcome(AdPhase phase, const std::vector<cfdp::Report>& transfers, std::uint64_t sent) {
  return {{"type", "welcome"},
          {"vc", 0},
          {"archive", true},
          {"cop", cop_in(phase)},
          {"transfers", serve::to_message(transfers)},
          {"counters", serve::to_message(DownlinkCounters{})},
          {"locked", true},
          {"clcw", nullptr},
          {"sent", sent}};
}

nlohmann::json reply_to(const nlohmann::json& message, nlohmann::json reply = nlohmann::json::object()) {
  reply["type"] = "reply";
  reply["call"] = message["call"];
  return reply;
}

class Served : public ::testing::Test {
 protected:
  void connect(FakeServer::Answer answer) {
    server_.emplace(socket(), std::move(answer));
    auto connection = ServerConnection::open(socket(), {.verb = "put", .files = true});
    ASSERT_TRUE(connection && *connection);
    link_ = std::make_unique<ServedLink>(std::move(**connection), true);
    LinkOutput output;
    output.ad = [this](auto number, auto progress) { ad_[number] = progress; };
    output.cop = [this](const auto& report) { phases_.push_back(report.phase); };
    output.file = [this](const auto& news) { news_.push_back(news); };
    link_->set_output(std::move(output));
  }
  std::filesystem::path socket() const { return var_.path() / "serve.sock"; }
  void turn() {
    EXPECT_TRUE(link_->on_readable());
    EXPECT_TRUE(link_->on_time());
  }
  /// Waits for what the server says, and for the next server.
  bool until(const std::function<bool()>& condition) {
    const MonotonicTime deadline = monotonic_now() + seconds(60);
    while (!condition() && monotonic_now() < deadline) {
      pollfd wait{link_->fd(), POLLIN, 0};
      static_cast<void>(::poll(&wait, 1, 10));
      turn();
    }
    return condition();
  }

  VarFolder var_;
  std::optional<FakeServer> server_;
  std::unique_ptr<ServedLink> link_;
  std::map<std::uint64_t, AdProgress> ad_;
  std::vector<AdPhase> phases_;
  std::vector<cfdp::News> news_;
};

TEST_F(Served, TransferThatTheNextServerDoesNotKnowHasEnded) {
  connect([](int client, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] != "hello") return std::nullopt;
    if (client == 1) return Messages{welcome(AdPhase::off, {transfer(1, "a"), transfer(2, "b")}, 3)};
    return Messages{welcome(AdPhase::off, {transfer(2, "b")}, 7)};
  });
  ASSERT_EQ(link_->transfers().size(), 2U);

  EXPECT_FALSE(link_->put("/nowhere", "c", false)) << "this server ends";
  ASSERT_TRUE(until([&] { return !news_.empty(); }));

  ASSERT_EQ(news_.size(), 1U);
  EXPECT_EQ(news_[0].event.id, transfer(1, "a").id);
  EXPECT_EQ(news_[0].event.kind, cfdp::EventKind::finished);
  EXPECT_FALSE(has_arrived(news_[0]));
  EXPECT_THAT(to_line(news_[0]), HasSubstr("whether it arrived is not known"));
  EXPECT_EQ(to_json(news_[0])["condition"], "unknown");
  ASSERT_EQ(link_->transfers().size(), 1U);
  EXPECT_EQ(link_->telecommands_sent(), 7U) << "the next server's state counts";
}

TEST_F(Served, TransferWhoseEndTheLastServerToldIsNotEndedAgain) {
  connect([](int client, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] == "hello")
      return Messages{welcome(AdPhase::off,
                              client == 1 ? std::vector{transfer(1, "a")} : std::vector<cfdp::Report>(), 0)};
    if (client == 1 && message["type"] == "suspend") {
      cfdp::News news;
      news.event.kind = cfdp::EventKind::finished;
      news.event.id = {1, 1};
      news.file = transfer(1, "a");
      return Messages{serve::to_message(news),
                      reply_to(message, {{"known", true},
                                         {"transfers", serve::to_message(std::vector{transfer(1, "a")})}})};
    }
    return client == 1 ? std::nullopt
                       : std::optional(Messages{reply_to(
                             message, {{"known", true},
                                       {"transfers", serve::to_message(std::vector<cfdp::Report>())}})});
  });

  EXPECT_EQ(link_->order_transfer({1, 1}, StationLink::TransferOrder::suspend), true);
  EXPECT_FALSE(link_->order_transfer({1, 9}, StationLink::TransferOrder::resume)) << "not known: it ended";
  EXPECT_EQ(link_->order_transfer({1, 9}, StationLink::TransferOrder::cancel), true) << "the next one";
  turn();

  ASSERT_EQ(news_.size(), 1U);
  EXPECT_TRUE(has_arrived(news_[0]));
}

TEST_F(Served, AdServiceGoesOnWithTheServerThatACallFound) {
  std::atomic<int> hellos_with_ad{0};
  std::atomic<int> repeated{0};
  connect([&](int client, const nlohmann::json& message) -> std::optional<Messages> {
    repeated += message.value("again", false) ? 1 : 0;
    if (message["type"] == "hello") {
      const bool ad = message.value("ad", false);
      hellos_with_ad += ad ? 1 : 0;
      return Messages{welcome(ad ? AdPhase::on : AdPhase::off, {}, 0)};
    }
    if (message["type"] == "start_ad") return Messages{cop_in(AdPhase::on), reply_to(message)};
    if (message["type"] == "send" && client == 2 && message["number"] == 1)
      return Messages{reply_to(message, {{"request", {0x1811, 0xC000}}, {"known", true}})};
    if (message["type"] == "send" && (client == 2 || message["number"] == 7))
      return Messages{reply_to(message, {{"request", {0x1811, 0xC001}}})};
    return std::nullopt;
  });
  mission::Command command;
  command.name = "eps.switch_load";
  const mission::EncodedCommand encoded{&command, {}};
  ASSERT_TRUE(link_->start_ad());
  ASSERT_TRUE(link_->send({.command = encoded, .number = 7, .ad = true}));

  EXPECT_TRUE(link_->send({.command = encoded, .number = 1, .ad = true})) << "the next server knows it";
  EXPECT_TRUE(link_->send({.command = encoded, .number = 2, .ad = true}));
  EXPECT_TRUE(ad_.empty()) << "nothing is reported within an order";
  turn();

  EXPECT_EQ(hellos_with_ad, 1);
  EXPECT_EQ(repeated, 1) << "the order that the first server did not answer says that it may have been sent";
  EXPECT_EQ(link_->cop().phase, AdPhase::on);
  EXPECT_THAT(phases_, ElementsAre(AdPhase::on)) << "it was never off";
  EXPECT_THAT(ad_, ElementsAre(std::pair(1U, AdProgress::unknown), std::pair(7U, AdProgress::unknown)))
      << "what the first server had, and not what the second has";
}

TEST_F(Served, AdServiceThatEndedIsNotStartedByTheNextServer) {
  std::atomic<int> hellos_with_ad{0};
  connect([&](int client, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] == "hello") {
      hellos_with_ad += message.value("ad", false) ? 1 : 0;
      return Messages{welcome(AdPhase::off, {}, static_cast<std::uint64_t>(client))};
    }
    if (message["type"] == "start_ad")
      return Messages{cop_in(AdPhase::on), reply_to(message), cop_in(AdPhase::off)};
    return std::nullopt;
  });
  ASSERT_TRUE(link_->start_ad());
  ASSERT_TRUE(until([&] { return link_->cop().phase == AdPhase::off; }));

  EXPECT_FALSE(link_->select_keys(suite::AssociationSet::b, "test")) << "this server ends before it answers";
  ASSERT_TRUE(until([&] { return link_->telecommands_sent() == 2; }));

  EXPECT_EQ(hellos_with_ad, 0);
}

TEST(ServerConnection, HearsARefusalOfAServerThatClosedAtOnce) {
  const VarFolder var;
  const auto socket = var.path() / "serve.sock";
  const Fd listener = *listen_at(socket);
  std::thread server([&] {
    pollfd wait{listener.get(), POLLIN, 0};
    static_cast<void>(::poll(&wait, 1, 60'000));
    const Fd client = accept_from(listener.get());
    wait = {client.get(), POLLIN, 0};
    static_cast<void>(::poll(&wait, 1, 60'000));  // the hello is there, and never read
    static_cast<void>(send_message(client.get(), R"({"type":"refused","message":"full"})"));
  });

  const auto connection = ServerConnection::open(socket, {.verb = "tc"});
  server.join();

  ASSERT_FALSE(connection);
  EXPECT_EQ(connection.error(), "full");
}

}  // namespace
}  // namespace srfs::ground
