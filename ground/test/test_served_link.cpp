// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/served_link.hpp"

#include <atomic>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>

#include "fake_server.hpp"
#include "fake_spacecraft.hpp"
#include "ground/direct_link.hpp"
#include "ground/files.hpp"
#include "ground/local_socket.hpp"
#include "tests/mission_dictionary.hpp"

namespace srfs::ground {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

cfdp::Report transfer(std::uint64_t number, const std::string& name) {
  cfdp::Report report;
  report.id = {1, number};
  report.destination_file = name;
  return report;
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

TEST_F(Served, OrderWithoutAnAnswerIsNotKnownAndNoneElseIs) {
  std::atomic<int> sends{0};
  connect([&sends](int, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] == "hello") return Messages{welcome(AdPhase::off, {}, 0, false)};
    if (message["type"] == "send") ++sends;
    if (message["type"] == "unlock") return Messages{reply_to(message, {{"error", "the line is closed"}})};
    return std::nullopt;
  });
  mission::Command command;
  command.name = "eps.switch_load";
  const mission::EncodedCommand encoded{&command, {}};

  const auto sent = link_->send({.command = encoded, .number = 1});
  const auto put = link_->put("/nowhere", "a", false);
  const auto packet = link_->make_packet({.command = encoded});
  const auto unlocked = link_->unlock();

  ASSERT_FALSE(sent);
  EXPECT_TRUE(sent.error().is_unknown());
  EXPECT_THAT(sent.error().text, HasSubstr("eps.switch_load: it is not known whether it was sent"));
  EXPECT_EQ(sends, 1) << "no server without an archive is asked again";
  ASSERT_FALSE(put);
  EXPECT_TRUE(put.error().is_unknown());
  EXPECT_THAT(put.error().text, HasSubstr("a: it is not known whether it goes up"));
  ASSERT_FALSE(packet);
  EXPECT_FALSE(packet.error().is_unknown()) << "a packet that nobody sends does nothing";
  ASSERT_FALSE(unlocked);
  EXPECT_FALSE(unlocked.error().is_unknown());
  EXPECT_EQ(unlocked.error().text, "the line is closed");
}

TEST_F(Served, ServerThatCannotTellWhetherItWasSentSaysSo) {
  connect([](int client, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] == "hello") return Messages{welcome(AdPhase::off, {}, 0)};
    if (client == 1) return std::nullopt;
    return Messages{reply_to(message, {{"error", "this server has no archive"}, {"unknown", true}})};
  });
  mission::Command command;
  command.name = "eps.switch_load";

  const auto sent = link_->send({.command = {&command, {}}, .number = 1});

  ASSERT_FALSE(sent);
  EXPECT_TRUE(sent.error().is_unknown());
  EXPECT_THAT(sent.error().text, HasSubstr("this server has no archive"));
}

TEST_F(Served, OrderThatIsNotRecordedIsNotGivenToTheNextServer) {
  std::atomic<int> unrecorded{0};
  std::atomic<int> later{0};
  connect([&](int client, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] == "hello") return Messages{welcome(AdPhase::off, {}, 0)};
    if (client > 1) ++later;
    if (message["recorded_alone"] == true)
      return Messages{reply_to(message, {{"error", "no room"}, {"unrecorded", true}})};
    ++unrecorded;
    return std::nullopt;  // it is sent, and the server is killed
  });
  mission::Command command;
  command.name = "eps.switch_load";

  const auto sent = link_->send({.command = {&command, {}}, .number = 1});

  ASSERT_FALSE(sent);
  EXPECT_TRUE(sent.error().is_unknown());
  EXPECT_EQ(unrecorded, 1);
  EXPECT_EQ(later, 0) << "its archive knows nothing of it";
}

TEST_F(Served, OrderThatIsNotRecordedIsSentAllTheSame) {
  connect([](int, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] == "hello") return Messages{welcome(AdPhase::off, {}, 0)};
    if (message["recorded_alone"] == true)
      return Messages{reply_to(message, {{"error", "no room"}, {"unrecorded", true}})};
    return Messages{reply_to(message, {{"request", serve::to_message(wire::RequestId{0x1811, 0xC001})}})};
  });
  mission::Command command;
  command.name = "eps.switch_load";

  EXPECT_TRUE(link_->send({.command = {&command, {}}, .number = 1}));
}

TEST_F(Served, OrderThatIsSentUnrecordedHasAnotherToken) {
  std::vector<std::string> tokens;
  connect([&tokens](int, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] == "hello") return Messages{welcome(AdPhase::off, {}, 0)};
    tokens.push_back(message["token"].get<std::string>());
    if (message["recorded_alone"] == true)
      return Messages{reply_to(message, {{"error", "no answer in time"}, {"unrecorded", true}})};
    return Messages{reply_to(message, {{"request", serve::to_message(wire::RequestId{0x1811, 0xC001})}})};
  });
  mission::Command command;
  command.name = "eps.switch_load";

  EXPECT_TRUE(link_->send({.command = {&command, {}}, .number = 1, .token = "a"}));
  server_.reset();

  EXPECT_THAT(tokens, ElementsAre("a", "a-unrecorded"))
      << "the first attempt may have been recorded, too late";
}

TEST_F(Served, OrderThatReliesOnItsRecordIsNotSentWithoutOne) {
  std::atomic<int> sends{0};
  connect([&sends](int, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] == "hello") return Messages{welcome(AdPhase::off, {}, 0)};
    ++sends;
    if (message["recorded_alone"] == true)
      return Messages{reply_to(message, {{"error", "no room"}, {"unrecorded", true}})};
    return Messages{reply_to(message, {{"request", serve::to_message(wire::RequestId{0x1811, 0xC001})}})};
  });
  mission::Command command;
  command.name = "eps.switch_load";

  const auto sent =
      link_->send({.command = {&command, {}}, .number = 1, .token = "a", .recorded_alone = true});

  ASSERT_FALSE(sent);
  EXPECT_FALSE(sent.error().is_unknown());
  EXPECT_EQ(sent.error().text, "no room; it was not sent");
  EXPECT_EQ(sends, 1);
}

TEST(DirectLink, ForgetsATelecommandThatWasPerhapsRecordedAndIsNotSent) {
  const VarFolder var;
  const auto& dictionary = testing_support::dictionary();
  auto uplink = Uplink::open(secured_link(), var.path(), var.path() / "ground", system_utc_now());
  ASSERT_TRUE(uplink) << uplink.error();
  DirectLink link(dictionary, secured_link(), Port::closed(var.path() / "rs422"), std::move(*uplink));
  std::vector<std::string> unsent;
  link.set_made_output([](const TelecommandOrder&, const wire::RequestId&, bool) { return false; });
  link.set_unsent_output([&unsent](const TelecommandOrder& order) { unsent.push_back(order.token); });
  const auto encoded = dictionary.encode("eps.switch_load", {"load=2", "state=on"});
  ASSERT_TRUE(encoded);

  const auto bd = link.send({.command = *encoded, .token = "a", .recorded_alone = true});
  const auto ad = link.send({.command = *encoded, .ad = true, .token = "b", .recorded_alone = true});

  ASSERT_FALSE(bd);
  EXPECT_EQ(bd.error().kind, OrderError::Kind::unrecorded);
  ASSERT_FALSE(ad);
  EXPECT_EQ(ad.error().kind, OrderError::Kind::unrecorded);
  EXPECT_THAT(unsent, ElementsAre("a", "b"));
}

TEST_F(Served, OrderWithoutAnAnswerStaysUnknownWhenNoServerComesBack) {
  connect([this](int, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] == "hello") return Messages{welcome(AdPhase::off, {}, 0)};
    std::filesystem::remove(socket());
    return std::nullopt;
  });
  mission::Command command;
  command.name = "eps.switch_load";

  const auto sent = link_->send({.command = {&command, {}}, .number = 1});

  ASSERT_FALSE(sent);
  EXPECT_TRUE(sent.error().is_unknown()) << sent.error().text;
  EXPECT_THAT(sent.error().text, HasSubstr("eps.switch_load: it is not known whether it was sent"));
  EXPECT_THAT(sent.error().text, HasSubstr("no other is there"));
}

TEST_F(Served, OrderWithoutAnAnswerStaysUnknownWhenTheNextServerRefusesTheClient) {
  connect([](int client, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] != "hello") return std::nullopt;
    if (client == 1) return Messages{welcome(AdPhase::off, {}, 0)};
    return Messages{nlohmann::json{{"type", "refused"}, {"message", "another version"}}, nullptr};
  });
  mission::Command command;
  command.name = "eps.switch_load";

  const auto sent = link_->send({.command = {&command, {}}, .number = 1});
  const auto next = link_->send({.command = {&command, {}}, .number = 2});

  ASSERT_FALSE(sent);
  EXPECT_TRUE(sent.error().is_unknown());
  EXPECT_THAT(sent.error().text, HasSubstr("another version"));
  ASSERT_FALSE(next);
  EXPECT_FALSE(next.error().is_unknown()) << "no server ever had this one";
}

TEST_F(Served, OrderThatTheNextServerLookedUpAndRefusesIsRefused) {
  connect([](int client, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] == "hello") return Messages{welcome(AdPhase::off, {}, 0)};
    if (client == 1) return std::nullopt;
    return Messages{reply_to(message, {{"error", "the line is closed"}})};
  });
  mission::Command command;
  command.name = "eps.switch_load";

  const auto sent = link_->send({.command = {&command, {}}, .number = 1});

  ASSERT_FALSE(sent);
  EXPECT_FALSE(sent.error().is_unknown());
  EXPECT_EQ(sent.error().text, "the line is closed");
}

TEST_F(Served, OrderThatWasCarriedOutIsNotRefusedWhenTheLineCloses) {
  connect([](int, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] == "hello") return Messages{welcome(AdPhase::off, {}, 0)};
    return Messages{nlohmann::json{{"type", "line_closed"}, {"message", "the port is gone"}},
                    reply_to(message)};
  });

  EXPECT_TRUE(link_->unlock());

  EXPECT_TRUE(link_->next_deadline()) << "there is news";
  const auto turned = link_->on_time();
  ASSERT_FALSE(turned) << "it is told after the order";
  EXPECT_EQ(turned.error(), "the port is gone");
  EXPECT_TRUE(link_->on_time()) << "and once";
}

TEST_F(Served, OrderThatTheServerDidNotTakeGoesToTheNextOne) {
  connect([](int client, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] != "hello") return Messages{reply_to(message)};
    if (client == 1) return Messages{welcome(AdPhase::off, {}, 0, false), nullptr};
    return Messages{welcome(AdPhase::off, {}, 0, false)};
  });
  pollfd closed{link_->fd(), POLLRDHUP, 0};
  ASSERT_EQ(::poll(&closed, 1, 60'000), 1) << "this server has ended, and the link has not noticed yet";

  EXPECT_TRUE(link_->unlock());
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
