// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/telecommand_router.hpp"

#include <algorithm>

#include <gtest/gtest.h>

#include <mission/structures.hpp>

#include "base/crc32c.hpp"
#include "nodes/ttc/test/router_with_parts.hpp"
#include "wire/pus.hpp"

namespace srfs {
namespace {

class Router : public RouterWithParts {
 protected:
  Router() {
    for (const mission::Structure& structure : dictionary_.structures()) {
      if (structure.id != 0) {
        housekeeping_.add_structure(structure.id, structure.apid, 0, 2000,
                                    {.enabled = true, .interval = structure.interval});
      }
    }
    for (const mission::Event& event : dictionary_.events()) events_.add_event(event.id);
  }
  /// Sends a command in the ground's text form. @return service.subtype of everything it caused, in order
  std::vector<std::string> send(const std::string& name, const std::vector<std::string>& arguments = {},
                                std::uint8_t ack = wire::ack::all, bool durable = true) {
    const auto encoded = dictionary_.encode(name, arguments);
    EXPECT_TRUE(encoded) << (encoded ? "" : encoded.error().message);
    if (!encoded) return {};
    return send(encoded->command->apid, encoded->command->service, encoded->command->subtype, encoded->data,
                ack, durable);
  }
  std::vector<std::string> send(std::uint16_t apid, std::uint8_t service, std::uint8_t subtype, Octets data,
                                std::uint8_t ack = wire::ack::all, bool durable = true) {
    wire::TcPacket packet;
    packet.apid = apid;
    packet.sequence_count = 77;
    packet.ack_flags = ack;
    packet.service = service;
    packet.subtype = subtype;
    packet.application = std::move(data);
    return process(wire::make_tc_packet(packet), durable);
  }
  std::vector<std::string> process(const Octets& packet, bool durable = true) {
    JudgedTelecommand judged = judge(packet);
    judged.durable = durable;
    router_.carry_out(std::move(judged), now_);
    return taken();
  }
  JudgedTelecommand judge(const Octets& packet) {
    JudgedTelecommand judged = router_.judge(packet, now_);
    judged.telecommand.origin.id = ++id_;
    return judged;
  }
  Octets packet_of(const std::string& name, const std::vector<std::string>& arguments) {
    const auto encoded = dictionary_.encode(name, arguments);
    wire::TcPacket packet;
    packet.apid = encoded->command->apid;
    packet.service = encoded->command->service;
    packet.subtype = encoded->command->subtype;
    packet.application = encoded->data;
    return wire::make_tc_packet(packet);
  }
  std::vector<std::string> taken() {
    reports_ = report_queue_.take();
    std::vector<std::string> names;
    names.reserve(reports_.size());
    for (const Report& report : reports_)
      names.push_back(std::to_string(report.service) + "," + std::to_string(report.subtype));
    return names;
  }
  /// Failure code and following data of the last report.
  [[nodiscard]] Octets failure() const {
    return reports_.empty() ? Octets{} : Octets(reports_.back().data.begin() + 4, reports_.back().data.end());
  }
  static Octets code(std::uint16_t code, Octets parameter = {}) {
    Octets octets{static_cast<std::uint8_t>(code >> 8), static_cast<std::uint8_t>(code)};
    octets.insert(octets.end(), parameter.begin(), parameter.end());
    return octets;
  }
  using Names = std::vector<std::string>;

  std::vector<Report> reports_;
  std::uint64_t id_ = 0;
  MonotonicTime now_;
};

TEST_F(Router, AnswersAPing) {
  EXPECT_EQ(send("ttc.ping"), (Names{"1,1", "1,3", "17,2", "1,7"}));
  EXPECT_EQ(reports_[0].data, (Octets{0x18, 0x01, 0xC0, 77}));
}

TEST_F(Router, EveryApplicationProcessCanBeAskedWhetherItIsAlive) {
  for (const mission::ApplicationProcess& process : dictionary_.apids()) {
    if (process.node == "ttc") continue;
    EXPECT_EQ(send(process.apid, 17, 1, {}), (Names{"1,1", "1,3"})) << process.node;
    EXPECT_EQ(connections_.take_question(), process.node);
    connections_.on_answer(true);
    EXPECT_EQ(taken(), (Names{"17,2", "1,7"}));
    for (const Report& report : reports_) EXPECT_EQ(report.apid, process.apid);
  }
  EXPECT_EQ(send(mission::apid::payload_eps, 17, 1, {}), (Names{"1,1", "1,3"}));
  (void)connections_.take_question();
  connections_.on_answer(false);
  EXPECT_EQ(taken(), Names{"1,8"});
  EXPECT_EQ(failure(), code(mission::failure::node_unavailable));
}

TEST_F(Router, TestsTheConnectionToAnApplicationProcess) {
  const auto to = [](std::uint16_t apid) {
    return Octets{static_cast<std::uint8_t>(apid >> 8), static_cast<std::uint8_t>(apid)};
  };
  EXPECT_EQ(send(1, 17, 3, to(1)), (Names{"1,1", "1,3", "17,4", "1,7"}));
  EXPECT_EQ(reports_[2].data, to(1));
  EXPECT_EQ(send(1, 17, 3, to(0x123)), (Names{"1,1", "1,4"}));
  EXPECT_EQ(failure(), code(mission::failure::unknown_identifier, to(0x123)));

  EXPECT_EQ(send(1, 17, 3, to(mission::apid::maintenance)), (Names{"1,1", "1,3"}));
  EXPECT_EQ(connections_.take_question(), "maintenance");
  EXPECT_FALSE(connections_.take_question()) << "one at a time";
  for (std::size_t i = 1; i < ConnectionTester::capacity; ++i)
    EXPECT_EQ(send(1, 17, 3, to(mission::apid::timing)), (Names{"1,1", "1,3"}));
  EXPECT_EQ(send(1, 17, 3, to(mission::apid::timing)), (Names{"1,1", "1,4"}));
  EXPECT_EQ(failure(), code(mission::failure::busy));
  connections_.on_answer(true);
  EXPECT_EQ(taken(), (Names{"17,4", "1,7"}));
  EXPECT_EQ(reports_[0].apid, 1);
  EXPECT_EQ(reports_[0].data, to(mission::apid::maintenance));
  EXPECT_EQ(connections_.take_question(), "timing");
}

TEST_F(Router, SendsOnlyTheSuccessReportsThatWereAskedFor) {
  EXPECT_EQ(send("ttc.ping", {}, 0), (Names{"17,2"}));
  EXPECT_EQ(send("ttc.ping", {}, wire::ack::acceptance | wire::ack::completion),
            (Names{"1,1", "17,2", "1,7"}));
}

TEST_F(Router, RefusesWhatTheDictionaryDoesNotHave) {
  EXPECT_EQ(send(0x123, 17, 1, {}), Names{"1,10"}) << "it cannot be routed";
  EXPECT_EQ(failure(), code(mission::failure::unknown_apid));
  EXPECT_EQ(reports_.back().apid, 1) << "nobody else can answer";

  EXPECT_EQ(send(1, 99, 1, {}), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::unknown_service));

  EXPECT_EQ(send(1, 17, 99, {}), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::unknown_subtype));

  EXPECT_EQ(send(17, 8, 1, {0x7F, 0xFF}), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::unknown_function, {0x7F, 0xFF}));

  EXPECT_EQ(send(17, 8, 1, {0}), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::bad_arguments_length));
}

TEST_F(Router, RefusesMoreGroupsThanARequestMayCarry) {
  const auto groups = [](std::uint8_t count, std::size_t octets_each) {
    Octets data{0, count};
    data.resize(2 + count * octets_each);
    return data;
  };
  for (const auto& which : {std::pair{3, 5}, {3, 6}, {5, 5}, {5, 6}}) {
    const auto service = static_cast<std::uint8_t>(which.first);
    const auto subtype = static_cast<std::uint8_t>(which.second);
    const auto request = [&](std::uint8_t count) { return send(1, service, subtype, groups(count, 2)); };
    EXPECT_EQ(request(17), Names{"1,2"}) << which.first << ',' << which.second;
    EXPECT_EQ(failure(), code(mission::failure::bad_arguments_length));
    EXPECT_EQ(request(0), Names{"1,2"});
  }
  EXPECT_EQ(send(1, 15, 9, groups(9, 18)), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::bad_arguments_length));
}

TEST_F(Router, RefusesAnArgumentOutOfRangeWithItsPosition) {
  EXPECT_EQ(send(17, 8, 1, {0, 1, 9, 1}), Names{"1,2"}) << "load 9";
  EXPECT_EQ(failure(), code(mission::failure::bad_argument, {1}));
  EXPECT_EQ(send(17, 8, 1, {0, 1, 2, 7}), Names{"1,2"}) << "switch state 7";
  EXPECT_EQ(failure(), code(mission::failure::bad_argument, {2}));
  EXPECT_EQ(send(17, 8, 1, {0, 1, 2, 1, 0}), Names{"1,2"}) << "one octet too many";
  EXPECT_EQ(failure(), code(mission::failure::bad_arguments_length));

  const auto rejected = router_.take_rejected();
  ASSERT_EQ(rejected.size(), 3U);
  EXPECT_EQ(rejected[0].apid, 17);
  EXPECT_EQ(rejected[0].sequence, 77);
}

TEST_F(Router, RefusesDamagedPacketsWithTheRequestIdAsItCame) {
  wire::TcPacket ping;
  ping.apid = 1;
  ping.sequence_count = 5;
  ping.service = 17;
  ping.subtype = 1;
  Octets damaged = wire::make_tc_packet(ping);
  damaged.back() ^= 1;
  EXPECT_EQ(process(damaged), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::bad_checksum));
  EXPECT_EQ(reports_[0].data[3], 5);

  EXPECT_EQ(process({1, 2}), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::bad_length));
}

TEST_F(Router, WithoutRoomWhatIsRightIsQueueFullAndTheRestHasItsOwnReason) {
  const auto judged_without_room = [this](std::uint16_t apid) {
    wire::TcPacket ping;
    ping.apid = apid;
    ping.service = 17;
    ping.subtype = 1;
    const JudgedTelecommand judged = router_.judge(wire::make_tc_packet(ping), now_, false);
    EXPECT_TRUE(judged.refusal);
    router_.carry_out(judged, now_);
    return taken();
  };
  EXPECT_EQ(judged_without_room(mission::apid::ttc), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::queue_full));
  EXPECT_EQ(judged_without_room(0x123), Names{"1,10"});
  EXPECT_EQ(failure(), code(mission::failure::unknown_apid));
}

TEST_F(Router, ForwardsACommandOfAnotherNodeAndReportsItsStages) {
  EXPECT_EQ(send("eps.switch_load", {"load=2", "state=on"}), Names{"1,1"});
  const auto published = forwarder_.take_publications();
  ASSERT_EQ(published.size(), 1U);
  EXPECT_EQ(published[0].command, dictionary_.command("eps.switch_load"));
  EXPECT_EQ(published[0].arguments, (Octets{2, 1}));

  for (const Stage stage : {Stage::acceptance, Stage::start, Stage::completion})
    forwarder_.on_report("payload_eps", {.id = published[0].origin.id, .stage = stage}, MonotonicTime{});

  EXPECT_EQ(taken(), (Names{"1,3", "1,7"}));
  EXPECT_EQ(reports_[0].apid, 17);
  EXPECT_EQ(report_queue_.last()->reached.stage, Stage::completion);
}

TEST_F(Router, RefusesACommandWhenTooManyWaitForItsNode) {
  for (int i = 0; i < 40; ++i) EXPECT_EQ(send("eps.switch_load", {"load=2", "state=on"}), Names{"1,1"});
  EXPECT_EQ(send("eps.switch_load", {"load=2", "state=on"}), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::queue_full));
  EXPECT_EQ(send("ttc.ping").size(), 4U) << "liveness answers go on";
}

TEST_F(Router, WithoutStorageOnlyRecoveryCommandsRun) {
  EXPECT_EQ(send("eps.switch_load", {"load=2", "state=on"}, wire::ack::all, false), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::storage_unavailable));
  EXPECT_EQ(send("ttc.ping", {}, wire::ack::all, false).size(), 4U);
  EXPECT_EQ(router_.take_unstored_runs(), std::vector<std::uint64_t>{id_});
}

TEST_F(Router, KeepsRoomForWhatWaitsForTheDisk) {
  std::vector<JudgedTelecommand> waiting;
  for (int i = 0; i < 40; ++i) waiting.push_back(judge(packet_of("eps.switch_load", {"load=2", "state=on"})));
  EXPECT_FALSE(waiting.back().refusal);
  EXPECT_EQ(judge(packet_of("eps.switch_load", {"load=2", "state=on"})).refusal->code,
            mission::failure::queue_full);
  EXPECT_TRUE(taken().empty()) << "nothing happens before it is carried out";
  for (const JudgedTelecommand& judged : waiting) router_.carry_out(judged, MonotonicTime{});
  EXPECT_EQ(taken(), Names(40, "1,1"));
}

TEST_F(Router, ATelecommandBehindAModeChangeIsJudgedByTheModeToCome) {
  // The dictionary has no command that safe mode refuses yet, so the test makes one.
  const JudgedTelecommand change = judge(packet_of("ttc.set_mode", {"mode=safe"}));
  JudgedTelecommand behind = judge(packet_of("eps.switch_load", {"load=2", "state=on"}));
  mission::Command nominal_only = *behind.telecommand.command;
  nominal_only.modes = {static_cast<std::uint8_t>(MissionMode::nominal)};
  behind.telecommand.command = &nominal_only;
  router_.carry_out(change, MonotonicTime{});
  (void)taken();
  router_.carry_out(behind, MonotonicTime{});
  EXPECT_EQ(taken(), (Names{"1,1", "1,4"})) << "the mode changed between the decision and the act";
  EXPECT_EQ(failure(), code(mission::failure::wrong_mode, {static_cast<std::uint8_t>(MissionMode::safe)}));
}

TEST_F(Router, RefusesWhatTheJournalHasNoRoomFor) {
  const auto judged =
      router_.judge(packet_of("eps.switch_load", {"load=2", "state=on"}), MonotonicTime{}, false);
  ASSERT_TRUE(judged.refusal);
  EXPECT_EQ(judged.refusal->code, mission::failure::queue_full);
}

TEST_F(Router, AfterARestartAnIdempotentCommandOfItsOwnIsDoneAgain) {
  const Octets packet = packet_of("housekeeping.disable", {"structure=payload_adcs"});
  const TelecommandOrigin origin{.apid = 1, .ack_flags = wire::ack::all, .id = 5};
  const MonotonicTime expiry(seconds(10));
  router_.restore({.origin = origin, .expiry = expiry, .packet = packet, .progress = {}}, MonotonicTime{});
  EXPECT_EQ(taken(), (Names{"1,3", "1,7"}));
  EXPECT_FALSE(housekeeping_.plan(16)->enabled);
}

TEST_F(Router, AfterARestartWhatMayNotBeDoneAgainHasAnUnknownOutcome) {
  const Octets packet = packet_of("housekeeping.disable", {"structure=payload_adcs"});
  const TelecommandOrigin origin{.apid = 1, .ack_flags = wire::ack::all, .id = 5};
  const MonotonicTime expiry(seconds(10));
  router_.restore({.origin = origin, .expiry = expiry, .packet = packet, .progress = {}}, expiry);
  EXPECT_EQ(taken(), Names{"1,8"}) << "expired, and perhaps begun";
  EXPECT_EQ(failure(), code(mission::failure::interrupted));
  router_.restore({.origin = origin, .expiry = expiry, .packet = packet, .progress = {.other_boot = true}},
                  MonotonicTime{});
  EXPECT_EQ(taken(), Names{"1,8"});
  router_.restore({.origin = origin, .expiry = expiry, .packet = Octets{1, 2, 3}, .progress = {}},
                  MonotonicTime{});
  EXPECT_EQ(taken(), Names{"1,8"}) << "unknown to the dictionary of now";
  EXPECT_TRUE(housekeeping_.plan(16)->enabled);
}

TEST_F(Router, AfterARestartACommandOfANodeGoesOnWithItsId) {
  const TelecommandOrigin origin{.apid = 17, .ack_flags = wire::ack::all, .id = 99};
  router_.restore({.origin = origin,
                   .expiry = MonotonicTime(seconds(10)),
                   .packet = packet_of("eps.switch_load", {"load=2", "state=on"}),
                   .progress = {}},
                  MonotonicTime{});
  forwarder_.on_time(MonotonicTime{});
  const auto published = forwarder_.take_publications();
  ASSERT_EQ(published.size(), 1U);
  EXPECT_EQ(published[0].origin.id, 99U);
  EXPECT_EQ(published[0].arguments, (Octets{2, 1}));
}

TEST_F(Router, ControlsHousekeeping) {
  EXPECT_EQ(send("housekeeping.disable", {"structure=payload_adcs"}), (Names{"1,1", "1,3", "1,7"}));
  EXPECT_FALSE(housekeeping_.plan(16)->enabled);
  EXPECT_EQ(send("housekeeping.enable", {"structure=payload_adcs"}), (Names{"1,1", "1,3", "1,7"}));
  EXPECT_TRUE(housekeeping_.plan(16)->enabled);
  EXPECT_EQ(send("housekeeping.set_interval", {"structure=payload_adcs", "interval_ms=2500"}),
            (Names{"1,1", "1,3", "1,7"}));
  EXPECT_EQ(housekeeping_.plan(16)->interval, milliseconds(2500));

  EXPECT_EQ(send("housekeeping.one_shot", {"structure=payload_adcs"}), (Names{"1,1", "1,4"}))
      << "no sample yet";
  (void)housekeeping_.on_sample(16, 16, Octets{1}, MonotonicTime{});
  EXPECT_EQ(send("housekeeping.one_shot", {"structure=payload_adcs"}), (Names{"1,1", "3,25", "1,3", "1,7"}));
}

TEST_F(Router, ControlsEventReports) {
  EXPECT_EQ(send("events.disable", {"event=node.started"}), (Names{"1,1", "1,3", "1,7"}));
  EXPECT_FALSE(events_.on_event(1, 1, 1, {}, MonotonicTime{})->live);
  EXPECT_EQ(send("events.report_disabled"), (Names{"1,1", "1,3", "5,8", "1,7"}));
  EXPECT_EQ(send("events.enable", {"event=node.started"}), (Names{"1,1", "1,3", "1,7"}));
  EXPECT_TRUE(events_.on_event(1, 1, 1, {}, MonotonicTime{})->live);
  EXPECT_EQ(send("events.report_disabled"), (Names{"1,1", "1,3", "1,7"}));
  EXPECT_EQ(send(1, 5, 5, {0, 1, 0xFF, 0xF0}), Names{"1,2"}) << "an event nobody has";
}

TEST_F(Router, StartsAndAbortsARetrieval) {
  EXPECT_EQ(send("storage.retrieve",
                 {"store=housekeeping", "from=2026-11-21T08:00:00Z", "to=2026-11-21T09:00:00Z"}),
            Names{"1,1"});
  const auto batch = retrieval_.next_batch(PacketRetrieval::room_for_batch);
  ASSERT_TRUE(batch);
  EXPECT_EQ(batch->period.store, 1);
  EXPECT_EQ(batch->period.range.to - batch->period.range.from, seconds(3600));

  EXPECT_EQ(send("storage.abort", {"store=housekeeping"}), (Names{"1,1", "1,8", "1,3", "1,7"}));
  EXPECT_FALSE(retrieval_.busy());
}

TEST_F(Router, RefusesAPeriodThatEndsBeforeItStarts) {
  EXPECT_EQ(send("storage.retrieve", {"from=2026-11-21T09:00:00Z", "to=2026-11-21T08:00:00Z"}),
            (Names{"1,1", "1,4"}));
  EXPECT_EQ(failure(), code(mission::failure::bad_time_range));
}

TEST_F(Router, AModeChangeCompletesWhenItIsStored) {
  EXPECT_EQ(send("ttc.set_mode", {"mode=safe"}), (Names{"1,1", "1,3"}));
  EXPECT_EQ(mode_.mode(), MissionMode::safe);
  const auto change = mode_service_.take_change();
  ASSERT_TRUE(change);
  EXPECT_EQ(ModeManager(StoredModeState::present, change->stored_text, MissionMode::nominal).mode(),
            MissionMode::safe);

  mode_service_.on_stored(*change, true);
  EXPECT_EQ(taken(), Names{"1,7"});
}

TEST_F(Router, GivesRequestsAboutFilesToTheDiskAndTheirEndComesFromThere) {
  EXPECT_EQ(send("file.delete", {"repository=images", "file=a"}), Names{"1,1"});
  const auto order = files_.next_order(MonotonicTime{});
  ASSERT_TRUE(order);
  EXPECT_EQ(order->name, "a");
  EXPECT_FALSE(order->repeated);
  files_.on_outcome({}, MonotonicTime{});
  EXPECT_EQ(taken(), (Names{"1,3", "1,7"}));
  EXPECT_EQ(send(1, 23, 2, {0, 200, 'a'}), Names{"1,2"})
      << "a name of 200 octets is not one of the dictionary";
  EXPECT_EQ(failure(), code(mission::failure::bad_argument, {2}));
}

TEST_F(Router, ARequestAboutFilesThatMayHaveBeenDoneBeforeARestartIsDoneAgainAndSaysSo) {
  const Octets packet = packet_of("file.delete", {"file=a"});
  router_.restore({.origin = {.apid = 1, .ack_flags = wire::ack::all, .source_id = 0, .id = 5},
                   .expiry = MonotonicTime(seconds(10)),
                   .packet = packet,
                   .progress = {}},
                  MonotonicTime{});
  const auto order = files_.next_order(MonotonicTime{});
  ASSERT_TRUE(order);
  EXPECT_TRUE(order->repeated);
}

TEST_F(Router, GivesRequestsAboutParametersToTheirNodes) {
  EXPECT_EQ(send("parameters.set", {"parameter=timing.leap_seconds", "value=38"}), Names{"1,1"});
  const auto call = parameters_.next_call(MonotonicTime{});
  ASSERT_TRUE(call);
  EXPECT_EQ(call->node, "timing");
  EXPECT_EQ(call->parameter, "leap_seconds");
  EXPECT_EQ(call->value, NodeValue(std::int64_t{38}));
  parameters_.on_set(call->number, {});
  EXPECT_EQ(taken(), (Names{"1,3", "1,7"}));
}

TEST_F(Router, AParameterOutOfItsRangeOrThatNobodyHasIsRefusedBeforeAnybodyIsAsked) {
  EXPECT_EQ(send(1, 20, 3, {0, 1, 0, 102, 61}), Names{"1,2"}) << "leap seconds end at 60";
  EXPECT_EQ(failure(), code(mission::failure::bad_argument, {2}));
  EXPECT_EQ(send(1, 20, 3, {0, 1, 0xFF, 0xFF, 1}), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::bad_argument, {1}));
  EXPECT_EQ(send(1, 20, 3, {0, 2, 0, 102, 38, 0, 101, 0}), Names{"1,2"}) << "the second is too short";
  EXPECT_EQ(failure(), code(mission::failure::bad_arguments_length));
  EXPECT_EQ(send(1, 20, 1, {0, 1, 0xFF, 0xFF}), Names{"1,2"});
  EXPECT_FALSE(parameters_.next_call(MonotonicTime{}));
}

// ---- hazardous telecommands

class HazardousTelecommands : public Router {
 protected:
  static constexpr const char* hazard = "eps.power_cycle_peripheral";
  /// Arms like the ground (ground/arming.cpp).
  Names arm(const std::string& name, const std::vector<std::string>& arguments = {}) {
    const auto meant = dictionary_.encode(name, arguments);
    return send("ttc.arm", {"of_apid=" + std::to_string(meant->command->apid),
                            "of_service=" + std::to_string(meant->command->service),
                            "of_subtype=" + std::to_string(meant->command->subtype),
                            "digest=" + std::to_string(crc32c(meant->data))});
  }
  /// News of the hazards: nullopt for an arming, the reason for a disarming.
  std::vector<std::optional<mission::DisarmReason>> news() {
    std::vector<std::optional<mission::DisarmReason>> reasons;
    for (const HazardNews& news : hazards_.take_news()) reasons.push_back(news.reason);
    return reasons;
  }
  using Reasons = std::vector<std::optional<mission::DisarmReason>>;
};

TEST_F(HazardousTelecommands, RunOnceAfterTheyWereArmed) {
  EXPECT_EQ(send(hazard), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::not_armed));
  EXPECT_EQ(arm(hazard), (Names{"1,1", "1,3", "1,7"}));
  EXPECT_EQ(news(), Reasons{std::nullopt});

  EXPECT_EQ(send(hazard), Names{"1,1"});
  EXPECT_EQ(forwarder_.under_way(), 1U);
  EXPECT_EQ(news(), Reasons{mission::DisarmReason::fired});
  EXPECT_EQ(send(hazard), Names{"1,2"}) << "once";
  EXPECT_EQ(failure(), code(mission::failure::not_armed));
}

TEST_F(HazardousTelecommands, TheTransmitterIsSwitchedOffOnceItIsArmedAndOnWithoutThat) {
  EXPECT_EQ(send("ttc.transmitter_off", {"duration_s=60"}), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::not_armed));
  arm("ttc.transmitter_off", {"duration_s=60"});
  EXPECT_EQ(send("ttc.transmitter_off", {"duration_s=60"}), (Names{"1,1", "1,3"}));
  const MonotonicTime silence = now_ + TransmitterSwitch::grace;
  EXPECT_FALSE(transmitter_.may_transmit(silence));
  const auto off = transmitter_service_.take_change();
  ASSERT_TRUE(off);
  EXPECT_EQ(off->off, seconds(60));
  EXPECT_EQ(off->stored_text, transmitter_.stored_text());
  transmitter_service_.on_stored(*off, true);
  EXPECT_EQ(taken(), Names{"1,7"});

  EXPECT_EQ(send("ttc.transmitter_on"), (Names{"1,1", "1,3"}));
  EXPECT_TRUE(transmitter_.may_transmit(silence));
  const auto on = transmitter_service_.take_change();
  ASSERT_TRUE(on);
  EXPECT_EQ(on->stored_text, "");
  transmitter_service_.on_stored(*on, false);
  EXPECT_EQ(taken(), Names{"1,8"});
}

TEST_F(HazardousTelecommands, RescueIsEnteredOnceItIsArmedAndItsOrderIsStored) {
  EXPECT_EQ(send("rescue.enter"), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::not_armed));
  arm("rescue.enter");
  EXPECT_EQ(send("rescue.enter"), (Names{"1,1", "1,3"}));
  const auto entry = rescue_service_.take_change();
  ASSERT_TRUE(entry);
  rescue_service_.on_stored(*entry, true);
  EXPECT_EQ(taken(), Names{"1,7"});

  EXPECT_EQ(send("rescue.reboot"), (Names{"1,1", "1,4"})) << "what srfs_rescue alone does";
  EXPECT_EQ(failure(), code(mission::failure::suite_runs));
  EXPECT_FALSE(rescue_service_.take_change());
}

TEST_F(HazardousTelecommands, TwoThatComeTogetherFireOnce) {
  arm(hazard);
  const Octets packet = packet_of(hazard, {});
  const JudgedTelecommand first = judge(packet);
  const JudgedTelecommand second = judge(packet);
  EXPECT_FALSE(first.refusal);
  EXPECT_TRUE(second.refusal);
}

TEST_F(HazardousTelecommands, AreArmedWithTheirArgumentsAndNoOthers) {
  arm(hazard, {"off_ms=100"});
  EXPECT_EQ(send(hazard, {"off_ms=101"}), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::not_armed));
  EXPECT_EQ(send(hazard, {"off_ms=100"}), Names{"1,1"}) << "the other one did not disarm it";
}

TEST_F(HazardousTelecommands, OneIsArmedAtATime) {
  arm(hazard, {"off_ms=100"});
  arm(hazard, {"off_ms=200"});
  EXPECT_EQ(news(), (Reasons{std::nullopt, mission::DisarmReason::replaced, std::nullopt}));
  EXPECT_EQ(send(hazard, {"off_ms=100"}), Names{"1,2"});
  EXPECT_EQ(send(hazard, {"off_ms=200"}), Names{"1,1"});
}

TEST_F(HazardousTelecommands, AreArmedForTheWindowOnly) {
  arm(hazard);
  news();
  now_ += hazards_.window();
  EXPECT_EQ(send(hazard), Names{"1,2"});
  EXPECT_EQ(hazards_.next_due(), now_);
  hazards_.on_time(now_);
  EXPECT_EQ(news(), Reasons{mission::DisarmReason::expired});
  EXPECT_FALSE(hazards_.next_due());
}

TEST_F(HazardousTelecommands, AreDisarmedByCommandAndByAChangeOfMode) {
  arm(hazard);
  EXPECT_EQ(send("ttc.disarm"), (Names{"1,1", "1,3", "1,7"}));
  EXPECT_EQ(send(hazard), Names{"1,2"});
  arm(hazard);
  send("ttc.set_mode", {"mode=safe"});
  EXPECT_EQ(send(hazard), Names{"1,2"});
  EXPECT_EQ(news(), (Reasons{std::nullopt, mission::DisarmReason::commanded, std::nullopt,
                             mission::DisarmReason::mode_changed}));
}

TEST_F(HazardousTelecommands, NothingElseIsArmed) {
  EXPECT_EQ(arm("ttc.ping"), (Names{"1,1", "1,4"}));
  EXPECT_EQ(failure(), code(mission::failure::not_hazardous));
  EXPECT_TRUE(news().empty());
}

TEST_F(HazardousTelecommands, AnArmingThatACrashInterruptedIsNotDoneAgain) {
  const Octets packet = packet_of("ttc.arm", {"of_apid=17", "digest=1"});
  TelecommandOrigin origin;
  origin.ack_flags = wire::ack::all;
  origin.id = 7;
  router_.restore({.origin = origin, .expiry = now_ + seconds(10), .packet = packet, .progress = {}}, now_);
  EXPECT_EQ(taken(), Names{"1,8"});
  EXPECT_EQ(failure(), code(mission::failure::interrupted));
  EXPECT_TRUE(news().empty());
}

// ---- keys

TEST_F(Router, ChangesTheKeysOfAChannelOnceTheChangeIsStored) {
  EXPECT_EQ(send("ttc.select_keys", {"set=b"}), (Names{"1,1", "1,3"}));
  const auto change = key_service_.take_change();
  ASSERT_TRUE(change);
  EXPECT_EQ(change->vc, 0);
  EXPECT_EQ(change->set, KeySet::b);
  EXPECT_FALSE(key_service_.take_change());
  key_service_.on_stored(*change, true);
  EXPECT_EQ(taken(), Names{"1,7"});
  key_service_.on_stored(*change, false);
  EXPECT_EQ(taken(), Names{"1,8"});
  EXPECT_EQ(failure(), code(mission::failure::storage_unavailable));
}

TEST_F(Router, RefusesKeysThatTheChannelDoesNotHave) {
  EXPECT_EQ(send("ttc.select_keys", {"vc=1", "set=b"}), (Names{"1,1", "1,4"}));
  EXPECT_EQ(failure(), code(mission::failure::unknown_identifier, {0, 1}));
  EXPECT_FALSE(key_service_.take_change());
}

}  // namespace
}  // namespace srfs
