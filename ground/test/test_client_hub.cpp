// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ground/client_hub.hpp"

namespace srfs::ground {
namespace {

using ::testing::HasSubstr;
using ClientId = ClientHub::ClientId;

/// A link without a line: keeps what it is ordered to do.
class FakeLink final : public StationLink {
 public:
  struct Sent {
    std::string name;
    std::uint64_t number;
    bool ad;
  };
  std::vector<Sent> sent;
  CopReport report;
  std::string sending_fails;
  bool archive_fails = false;
  std::string ad_fails;

  Result<wire::RequestId, OrderError> send(const TelecommandOrder& order) override {
    if (!sending_fails.empty()) return refused(sending_fails);
    if (archive_fails && order.recorded_alone)
      return Err(OrderError{OrderError::Kind::unrecorded, "no room in the archive"});
    sent.push_back({order.command.command->name, order.number, order.ad});
    return wire::RequestId{0x1811, static_cast<std::uint16_t>(0xC000 + sent.size())};
  }
  Result<TelecommandPacket, OrderError> make_packet(const TelecommandOrder& order) override {
    return TelecommandPacket{{0x1811, 0xC000}, order.command.data};
  }
  void settle() override {}
  Result<void, OrderError> start_ad() override {
    if (!ad_fails.empty()) {
      report.problem = ad_fails;
      enter(AdPhase::off);
    } else if (report.phase == AdPhase::off) {
      enter(AdPhase::on);
    }
    return {};
  }
  Result<void, OrderError> stop_ad() override {
    enter(AdPhase::off);
    return {};
  }
  Result<void, OrderError> unlock() override {
    enter(AdPhase::on);
    return {};
  }
  Result<void, OrderError> set_vr(std::uint8_t vr) override {
    report.vs = vr;
    enter(AdPhase::on);
    return {};
  }
  CopReport cop() const override { return report; }
  Result<void, OrderError> select_keys(suite::AssociationSet, const std::string&) override {
    if (keys_problem.empty()) return {};
    return refused(keys_problem);
  }
  std::string keys_problem;
  std::uint8_t vc() const override { return 0; }
  bool carries_files() const override { return false; }
  Result<cfdp::TransactionId, OrderError> put(const std::filesystem::path&, const std::string&,
                                              bool) override {
    return refused("no files");
  }
  std::vector<cfdp::Report> transfers() const override { return {}; }
  Result<bool, OrderError> order_transfer(cfdp::TransactionId, TransferOrder) override { return false; }
  int fd() const override { return -1; }
  Result<void, std::string> on_readable() override { return {}; }
  Result<void, std::string> on_time() override { return {}; }
  std::optional<MonotonicTime> next_deadline() const override { return std::nullopt; }
  DownlinkCounters counters() const override { return {}; }
  bool locked() const override { return true; }
  std::optional<std::uint32_t> clcw() const override { return std::nullopt; }
  std::uint64_t telecommands_sent() const override { return sent.size(); }

  void receive(const ReceivedPacket& packet) { output_.packet(packet); }
  void progress(std::uint64_t number, AdProgress progress) { output_.ad(number, progress); }
  void enter(AdPhase phase) {
    report.phase = phase;
    output_.cop(report);
  }
};

ReceivedPacket packet(std::uint16_t sequence) {
  ReceivedPacket received;
  received.packet = {.apid = 1, .sequence_count = sequence, .service = 17, .subtype = 2};
  received.raw = wire::make_tm_packet(received.packet);
  return received;
}

class Hub : public ::testing::Test {
 protected:
  explicit Hub(ClientHub::Memory memory = {})
      : hub_(link_, {.write = [](OctetView) { return Result<void, std::string>(); },
                     .log = [this](const std::string& text) { log_.push_back(text); },
                     .memory = std::move(memory)}) {}
  ClientId client(const std::string& verb = "tc") {
    const auto id = hub_.on_connect("pid 1 of user 1000");
    EXPECT_TRUE(id);
    say(*id, {{"type", "hello"},
              {"protocol", serve::protocol},
              {"verb", verb},
              {"files", false},
              {"octets", false}});
    EXPECT_EQ(next(*id).value("type", ""), "welcome");
    return *id;
  }
  void say(ClientId id, const nlohmann::json& message) { hub_.on_message(id, message.dump()); }
  /// The next message; null when there is none.
  nlohmann::json next(ClientId id) {
    const auto message = hub_.front(id);
    if (message == nullptr) return nullptr;
    auto json = nlohmann::json::parse(*message);
    hub_.pop(id);
    return json;
  }
  /// The next one of a type; what is before it is dropped.
  nlohmann::json next(ClientId id, const std::string& type) {
    for (auto json = next(id); !json.is_null(); json = next(id)) {
      if (json["type"] == type) return json;
    }
    return nullptr;
  }
  nlohmann::json order(ClientId id, const std::string& type) {
    say(id, {{"type", type}, {"call", ++calls_}, {"vr", 7}});
    return next(id, "reply");
  }
  nlohmann::json send(ClientId id, std::uint64_t number, bool ad, bool again = false,
                      bool recorded_alone = false) {
    say(id, {{"type", "send"},
             {"call", ++calls_},
             {"name", "eps.switch_load"},
             {"apid", 17},
             {"service", 8},
             {"subtype", 1},
             {"data", "00010201"},
             {"arguments", {"load=2"}},
             {"number", number},
             {"ad", ad},
             {"again", again},
             {"recorded_alone", recorded_alone},
             {"token", "t" + std::to_string(calls_)}});
    return next(id, "reply");
  }
  void drop_closing() {
    for (const ClientId id : hub_.take_closing()) hub_.on_disconnect(id);
  }

  FakeLink link_;
  std::vector<std::string> log_;
  ClientHub hub_;
  std::uint64_t calls_ = 0;
};

class HubWithArchive : public Hub {
 protected:
  HubWithArchive()
      : Hub({.packet = {},
             .request_of = [this](const std::string&) { return request_; },
             .packets_after = {},
             .file = {},
             .problem = [this] { return problem_; }}) {}
  /// What the archive says of every token.
  Result<std::optional<wire::RequestId>, std::string> request_ = std::optional<wire::RequestId>();
  std::string problem_;
};

TEST_F(Hub, SendsTheTelecommandsOfAllClientsInTheOrderOfTheirComing) {
  const ClientId first = client();
  const ClientId second = client();

  const auto one = send(first, 1, false);
  const auto two = send(second, 1, false);

  EXPECT_NE(serve::request_of(one["request"]), serve::request_of(two["request"]));
  EXPECT_EQ(link_.sent.size(), 2U);
  EXPECT_TRUE(next(first).is_null()) << "what another client sends is not its matter";
}

TEST_F(Hub, TellsOfTelecommandsOfOthersTheClientsThatAsked) {
  const ClientId sender = client();
  const auto watcher = hub_.on_connect("pid 2 of user 1000");
  ASSERT_TRUE(watcher);
  say(*watcher, {{"type", "hello"},
                 {"protocol", serve::protocol},
                 {"verb", "web"},
                 {"files", false},
                 {"octets", false},
                 {"telecommands", true}});
  next(*watcher, "welcome");
  const SeenTelecommand seen{{0x1811, 0xC007}, "eps.switch_load", "pid 1 of user 1000, tc", true};

  hub_.on_telecommand(seen);

  const auto told = serve::telecommand_of(next(*watcher, "telecommand"));
  EXPECT_EQ(told.request, seen.request);
  EXPECT_EQ(told.name, seen.name);
  EXPECT_EQ(told.who, seen.who);
  EXPECT_TRUE(told.scheduled);
  EXPECT_TRUE(next(sender, "telecommand").is_null()) << "it did not ask";
}

TEST_F(Hub, RefusesOrdersForItsMemoryWithoutAnArchive) {
  const ClientId id = client();
  EXPECT_EQ(order(id, "fill_gaps").value("error", ""), "this server has no archive");
  say(id, {{"type", "acknowledge"}, {"call", 99}, {"id", 1}, {"who", "Ada"}});
  EXPECT_EQ(next(id, "reply").value("error", ""), "this server has no archive");
}

TEST_F(Hub, DoesNotSendARepeatedOrderWhenNobodyKnowsWhetherItWasSent) {
  const ClientId id = client();
  const nlohmann::json reply = send(id, 1, false, true);
  EXPECT_THAT(reply["error"].get<std::string>(), HasSubstr("no archive"));
  EXPECT_EQ(reply["unknown"], true);
  EXPECT_EQ(send(id, 1, true, true)["unknown"], true) << "with the AD service, too";
  EXPECT_TRUE(link_.sent.empty());
  EXPECT_TRUE(send(id, 2, false).contains("request"));
  EXPECT_EQ(link_.sent.size(), 1U);
}

TEST_F(HubWithArchive, LooksARepeatedOrderUpBeforeItRefusesIt) {
  const ClientId id = client();  // without the AD service
  request_ = wire::RequestId{0x1811, 0xC005};
  const nlohmann::json known = send(id, 1, true, true);
  EXPECT_EQ(serve::request_of(known.value("request", nlohmann::json())), (wire::RequestId{0x1811, 0xC005}));
  EXPECT_TRUE(known.value("known", false));

  request_ = Err(std::string("the disk is broken"));
  const nlohmann::json unknown = send(id, 2, true, true);
  EXPECT_EQ(unknown.value("error", ""), "the disk is broken");
  EXPECT_TRUE(unknown.value("unknown", false));

  request_ = std::optional<wire::RequestId>();
  const nlohmann::json refused = send(id, 3, true, true);
  EXPECT_THAT(refused.value("error", ""), HasSubstr("the AD service ended"));
  EXPECT_FALSE(refused.contains("unknown")) << "the archive says that it was not sent";
  EXPECT_TRUE(link_.sent.empty());
}

TEST_F(HubWithArchive, DoesNotSendARepeatedOrderWhileNothingIsRecorded) {
  const ClientId id = client();
  problem_ = "no room";
  const nlohmann::json reply = send(id, 1, false, true);
  EXPECT_EQ(reply.value("error", ""), "no room");
  EXPECT_TRUE(reply.value("unknown", false));
  EXPECT_TRUE(link_.sent.empty());
  EXPECT_TRUE(send(id, 2, false).contains("request")) << "a new order is sent, recorded or not";

  problem_.clear();
  EXPECT_TRUE(send(id, 3, false, true).contains("request")) << "it was not sent";
}

TEST_F(HubWithArchive, DoesNotSendWhatItCannotRecordUnlessTheClientTakesItSo) {
  const ClientId id = client();
  link_.archive_fails = true;
  const nlohmann::json refused = send(id, 1, false, false, true);
  EXPECT_EQ(refused.value("error", ""), "no room in the archive");
  EXPECT_TRUE(refused.value("unrecorded", false));
  EXPECT_TRUE(link_.sent.empty());
  EXPECT_TRUE(send(id, 2, false).contains("request"));
}

TEST_F(Hub, TellsWhyATelecommandWasNotSent) {
  const ClientId id = client();
  link_.sending_fails = "the line is closed";
  const nlohmann::json reply = send(id, 1, false);
  EXPECT_EQ(reply["error"], "the line is closed");
  EXPECT_FALSE(reply.contains("unknown")) << "it was not sent, and that is known";
}

TEST_F(Hub, GivesEveryPacketToEveryClient) {
  const ClientId first = client();
  const ClientId second = client("listen");

  link_.receive(packet(5));

  for (const ClientId id : {first, second}) {
    const auto received = serve::packet_of(next(id, "packet"));
    EXPECT_EQ(received.packet.sequence_count, 5);
    EXPECT_EQ(received.raw, packet(5).raw);
  }
}

TEST_F(Hub, DisconnectsAClientThatDoesNotReadAndNoOtherMissesAPacket) {
  const ClientId reads = client();
  const ClientId sleeps = client("listen");
  std::size_t rounds = 0;
  for (; hub_.take_closing().empty() && rounds < 1'000'000; ++rounds) {
    link_.receive(packet(static_cast<std::uint16_t>(rounds & 0x3FFF)));
    ASSERT_FALSE(next(reads, "packet").is_null());
  }
  ASSERT_EQ(hub_.take_closing(), std::vector<ClientId>{sleeps});
  EXPECT_THAT(log_.back(), HasSubstr("does not read"));
  drop_closing();

  link_.receive(packet(1));
  EXPECT_FALSE(next(reads, "packet").is_null());
  EXPECT_EQ(hub_.clients(), 1U);
}

TEST_F(Hub, DisconnectsAClientThatSendsRubbish) {
  const ClientId good = client();
  for (
      const char* rubbish :
      {"", "{", "[]", "5", "{}", R"({"type":5})", R"({"type":"send","call":1})", "\xff\xfe",
       R"({"type":"drop tables","call":1})",
       R"({"type":"send","call":1,"name":"x","apid":99999,"service":8,"subtype":1,"data":"","arguments":[],"number":1,"ad":false,"token":"t"})",
       R"({"type":"send","call":1,"name":"x","apid":1,"service":8,"subtype":1,"data":"0","arguments":[],"number":1,"ad":false,"token":"t"})"}) {
    const ClientId bad = client();
    hub_.on_message(bad, rubbish);
    EXPECT_EQ(hub_.take_closing(), std::vector<ClientId>{bad}) << rubbish;
    drop_closing();
  }
  EXPECT_TRUE(link_.sent.empty());
  EXPECT_TRUE(send(good, 1, false).contains("request"));
}

TEST_F(Hub, ClientWithoutGreetingGetsNothing) {
  const auto id = hub_.on_connect("pid 1 of user 1000");
  ASSERT_TRUE(id);
  link_.receive(packet(1));
  EXPECT_EQ(hub_.front(*id), nullptr);
  say(*id, {{"type", "start_ad"}, {"call", 1}});
  EXPECT_EQ(hub_.take_closing().size(), 1U);
}

TEST_F(Hub, RefusesAClientOfAnotherProtocol) {
  const auto id = hub_.on_connect("pid 1 of user 1000");
  say(*id, {{"type", "hello"},
            {"protocol", serve::protocol + 1},
            {"verb", "tc"},
            {"files", false},
            {"octets", false}});
  EXPECT_EQ(next(*id)["type"], "refused");
  EXPECT_EQ(hub_.take_closing().size(), 1U);
}

TEST_F(Hub, HasABoundForItsClients) {
  for (std::size_t i = 0; i < ClientHub::clients_max; ++i) client();
  const auto refused = hub_.on_connect("pid 2 of user 1000");
  ASSERT_FALSE(refused);
  EXPECT_EQ(nlohmann::json::parse(refused.error())["type"], "refused");
  hub_.on_disconnect(1);
  EXPECT_TRUE(hub_.on_connect("pid 2 of user 1000"));
}

TEST_F(Hub, ClientThatSaysNothingDoesNotKeepItsPlace) {
  const ClientId greeted = client();
  const auto silent = hub_.on_connect("pid 2 of user 1000");
  ASSERT_TRUE(silent);
  MonotonicTime now(seconds(100));
  hub_.on_time(now);
  hub_.on_time(now += ClientHub::hello_patience - milliseconds(1));
  EXPECT_TRUE(hub_.take_closing().empty());

  hub_.on_time(now += milliseconds(1));

  EXPECT_EQ(hub_.take_closing(), std::vector<ClientId>{*silent});
  drop_closing();
  EXPECT_TRUE(send(greeted, 1, false).contains("request")) << "it may be silent as long as it likes";
}

TEST_F(Hub, TellsWhyOtherKeysAreNotUsed) {
  const ClientId id = client();
  const auto select = [&] {
    say(id, {{"type", "select_keys"}, {"call", ++calls_}, {"keys", "b"}, {"why", "test"}});
    return next(id, "reply").value("error", "");
  };
  EXPECT_EQ(select(), "");
  link_.keys_problem = "the disk is full";
  EXPECT_EQ(select(), "the disk is full");
}

TEST_F(Hub, TellsWhyTheAdServiceDidNotStart) {
  const ClientId id = client();
  link_.ad_fails = "the line is closed";
  EXPECT_EQ(order(id, "start_ad").value("error", ""), "the line is closed");
  EXPECT_FALSE(order(id, "stop_ad").contains("error"));
  link_.ad_fails.clear();
  EXPECT_FALSE(order(id, "start_ad").contains("error"));
}

TEST_F(Hub, KeepsTheAdServiceOnWhileAClientUsesIt) {
  const ClientId first = client();
  const ClientId second = client();
  order(first, "start_ad");
  order(second, "start_ad");

  order(first, "stop_ad");
  EXPECT_EQ(link_.report.phase, AdPhase::on);
  EXPECT_EQ(send(first, 1, true).value("error", ""),
            "the AD service ended before the telecommand was transmitted");
  EXPECT_TRUE(send(second, 1, true).contains("request"));

  hub_.on_disconnect(second);  // a client that dies leaves it, too
  EXPECT_EQ(link_.report.phase, AdPhase::off);
}

TEST_F(Hub, GivesTheAdServiceToAClientThatHadItOfTheServerBefore) {
  const auto id = hub_.on_connect("pid 1 of user 1000");
  ASSERT_TRUE(id);
  say(*id, {{"type", "hello"},
            {"protocol", serve::protocol},
            {"verb", "script"},
            {"files", false},
            {"octets", false},
            {"ad", true}});

  const auto welcome = next(*id);
  ASSERT_EQ(welcome["type"], "welcome") << "before all else";
  EXPECT_EQ(serve::cop_of(welcome["cop"]).phase, AdPhase::on);
  EXPECT_TRUE(send(*id, 1, true).contains("request"));
}

TEST_F(Hub, ShowsTheAdServiceOnlyToItsUsers) {
  const ClientId user = client();
  const ClientId other = client();
  order(user, "start_ad");
  link_.report.nnr = 3;
  link_.enter(AdPhase::on);
  EXPECT_EQ(serve::cop_of(next(user, "cop")).nnr, 3);
  const auto seen = next(other, "cop");
  EXPECT_TRUE(seen.is_null() || serve::cop_of(seen).phase == AdPhase::off);
}

TEST_F(Hub, RefusesADirectiveThatWouldEndTheServiceOfAnother) {
  const ClientId user = client("script");
  const ClientId other = client();
  order(user, "start_ad");
  for (const char* directive : {"unlock", "set_vr"}) {
    EXPECT_THAT(order(other, directive).value("error", ""), HasSubstr("'script'")) << directive;
    EXPECT_FALSE(order(user, directive).contains("error")) << "its own service";
  }
}

TEST_F(Hub, TellsTheSenderAloneWhatTheAdServiceDidWithItsTelecommand) {
  const ClientId first = client();
  const ClientId second = client();
  order(first, "start_ad");
  order(second, "start_ad");
  send(first, 1, true);
  send(second, 1, true);
  ASSERT_EQ(link_.sent.size(), 2U);
  ASSERT_NE(link_.sent[0].number, link_.sent[1].number);

  link_.progress(link_.sent[1].number, AdProgress::transmitted);
  link_.progress(link_.sent[1].number, AdProgress::delivered);

  EXPECT_EQ(next(second, "ad")["progress"], "transmitted");
  EXPECT_EQ(next(second, "ad")["progress"], "delivered");
  EXPECT_TRUE(next(first, "ad").is_null());
  hub_.on_disconnect(first);
  link_.progress(link_.sent[0].number, AdProgress::delivered);  // to a client that has gone: no harm
}

TEST_F(Hub, TakesAnyTextWithoutHarmToOthers) {
  std::mt19937 random(1);
  const std::string sound =
      R"({"type":"send","call":1,"name":"eps.switch_load","apid":17,"service":8,"subtype":1,"data":"0001","arguments":["a"],"number":1,"ad":false,"token":"t"})";
  const ClientId good = client();
  for (int round = 0; round < 2000; ++round) {
    std::string text = sound;
    for (int i = 0; i < 3; ++i) text.at(random() % text.size()) = static_cast<char>(random());
    if (round % 3 == 0) text.resize(random() % text.size());
    hub_.on_message(client(), text);
    drop_closing();
    if (hub_.clients() > 40) {
      for (ClientId id = good + 1; hub_.clients() > 1; ++id) hub_.on_disconnect(id);
    }
  }
  EXPECT_TRUE(send(good, 7, false).contains("request"));
}

TEST(ServeMessages, CarryAllOfAReport) {
  CopReport cop;
  cop.phase = AdPhase::on;
  cop.state = wire::FopState::retransmit_with_wait;
  cop.vs = 5;
  cop.nnr = 4;
  cop.outstanding = 1;
  cop.queued = 2;
  cop.repeated = 3;
  cop.clcw = wire::make_clcw(wire::FarmState{}, 0);
  cop.problem = "limit";
  EXPECT_EQ(serve::to_message(serve::cop_of(serve::to_message(cop))), serve::to_message(cop));
  EXPECT_EQ(serve::cop_of(serve::to_message(cop)).state, wire::FopState::retransmit_with_wait);

  cfdp::News news;
  news.event.kind = cfdp::EventKind::fault;
  news.event.id = {2, 17};
  news.event.role = cfdp::Role::receiving;
  news.event.outcome.condition = cfdp::CfdpCondition::positive_ack_limit;
  news.event.handler = cfdp::FaultHandler::suspend;
  news.event.file_fault = cfdp::FileFault::no_space;
  news.file.id = {2, 17};
  news.file.destination_file = "a.bin";
  news.file.file_octets = 5;
  news.file.rest = cfdp::Rest::by_fault;
  const auto again = serve::news_of(serve::to_message(news));
  EXPECT_EQ(serve::to_message(again), serve::to_message(news));
  EXPECT_EQ(again.event.outcome, news.event.outcome);
  EXPECT_EQ(again.file.rest, cfdp::Rest::by_fault);

  auto wrong = serve::to_message(news);
  wrong["fault"] = 200;
  EXPECT_THROW(static_cast<void>(serve::news_of(wrong)), std::invalid_argument);
}

}  // namespace
}  // namespace srfs::ground
