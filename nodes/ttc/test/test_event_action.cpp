// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/event_action_service.hpp"

#include <algorithm>
#include <deque>
#include <map>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "base/crc32c.hpp"
#include "nodes/ttc/test/router_with_parts.hpp"
#include "nodes/ttc/ttc_core.hpp"
#include "tests/mission_dictionary.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs {
namespace {

constexpr std::uint16_t low = mission::event::eps_battery_low;
constexpr std::uint16_t high = mission::event::eps_battery_recovered;
constexpr std::uint16_t eps = mission::apid::payload_eps;

/// The service alone: no action is forbidden, and the disk is as fast as the test.
class EventActions : public RouterWithParts {
 protected:
  EventActions() { restart({}); }

  void restart(const FoundTable& found) {
    service_.emplace(dictionary_, report_queue_);
    service_->load(found, [this](OctetView packet) -> std::optional<std::uint16_t> {
      const auto error = router_.check_scheduled(packet);
      return error ? std::optional(error->first) : std::nullopt;
    });
  }
  /// @return "" when it was completed, else the name of the failure code
  std::string send(const std::string& name, const std::vector<std::string>& arguments = {}) {
    const auto encoded = dictionary_.encode(name, arguments);
    if (!encoded) return encoded.error().message;
    const OctetView data = encoded->data;
    Telecommand telecommand{
        .origin = {.ack_flags = wire::ack::all, .id = ++id_},
        .command = encoded->command,
        .arguments = Octets(data.begin() + (encoded->command->is_function() ? 2 : 0), data.end())};
    service_->execute(telecommand, now_);
    if (auto change = service_->take_change(now_)) {
      disk_ = change->table;
      service_->on_stored(*change, true, now_);
    }
    service_->go_on(1U << 20, now_);
    reports_ = report_queue_.take();
    for (const StageReached& stage : report_queue_.take_stages()) {
      if (!stage.success) return dictionary_.failure_code(stage.failure_code)->name;
    }
    return "";
  }
  void define(const std::string& event, const std::string& request) {
    EXPECT_EQ(send("event_action.add", {"event=" + event, "request=" + request}), "");
    EXPECT_EQ(send("event_action.enable", {"event=" + event}), "");
  }
  /// Releases all that is due. @return how many
  std::size_t release() {
    std::size_t released = 0;
    for (const auto& due : service_->due(now_)) {
      if (!service_->may_release(now_)) continue;
      service_->on_accepted(due.key, ++telecommand_, now_);
      released += service_->on_passed(telecommand_, true) ? 1 : 0;
    }
    return released;
  }

  std::optional<EventActionService> service_;
  std::optional<StoredTable> disk_;
  std::vector<Report> reports_;
  std::uint64_t id_ = 0;
  std::uint64_t telecommand_ = 1000;  ///< released last
  MonotonicTime now_{seconds(100)};
};

TEST_F(EventActions, AnEventReleasesItsTelecommandUnderASourceOfItsOwn) {
  define("eps.battery_low", "eps.switch_load load=2 state=off");
  service_->on_event(eps, high, now_);
  EXPECT_EQ(service_->waiting(), 0U);
  service_->on_event(eps, low, now_);
  const auto due = service_->due(now_);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due.front().raised_by, eps);
  const auto request = wire::parse_tc_packet(EventActionService::request_of(due.front().packet, 77));
  ASSERT_TRUE(request);
  EXPECT_EQ(request->source_id, EventActionService::on_board_source);
  EXPECT_EQ(request->sequence_count, 77U);
  const auto wanted = dictionary_.encode("eps.switch_load", {"load=2", "state=off"});
  EXPECT_EQ(request->application, wanted->data);
  EXPECT_EQ(release(), 1U);
  EXPECT_EQ(service_->waiting(), 0U);
}

TEST_F(EventActions, OnlyTheApplicationProcessThatIsNamedTriggersIt) {
  const std::vector<std::string> key{"of_apid=17", "event=node.error"};
  EXPECT_EQ(send("event_action.add", {key[0], key[1], "request=ttc.set_mode mode=safe"}), "");
  EXPECT_EQ(send("event_action.enable", key), "");
  service_->on_event(16, mission::event::node_error, now_);
  EXPECT_EQ(service_->waiting(), 0U);
  service_->on_event(17, mission::event::node_error, now_);
  EXPECT_EQ(service_->waiting(), 1U);
}

TEST_F(EventActions, DisabledActionsAndTheDisabledFunctionOnlyCount) {
  EXPECT_EQ(send("event_action.add", {"event=eps.battery_low", "request=ttc.set_mode mode=safe"}), "");
  service_->on_event(eps, low, now_);
  EXPECT_EQ(service_->waiting(), 0U) << "added disabled";
  EXPECT_EQ(send("event_action.enable", {"event=eps.battery_low"}), "");
  service_->on_event(eps, low, now_);
  EXPECT_EQ(send("event_action.stop"), "");
  EXPECT_EQ(service_->waiting(), 0U) << "what waited is given up";
  service_->on_event(eps, low, now_);
  EXPECT_EQ(service_->counters().passive, 2U);
  EXPECT_EQ(send("event_action.start"), "");
  service_->on_event(eps, low, now_);
  EXPECT_EQ(send("event_action.disable", {"event=eps.battery_low"}), "");
  EXPECT_EQ(service_->waiting(), 0U);
}

TEST_F(EventActions, BadRequestsAreRefusedAndChangeNothing) {
  define("eps.battery_low", "ttc.set_mode mode=safe");
  const ActionTable before = service_->table();
  EXPECT_EQ(send("event_action.add", {"event=eps.battery_low", "request=ttc.set_mode mode=safe"}),
            "still_enabled");
  EXPECT_EQ(send("event_action.delete", {"event=eps.battery_low"}), "still_enabled");
  EXPECT_EQ(send("event_action.enable", {"event=eps.loads_changed"}), "unknown_identifier");
  EXPECT_EQ(send("event_action.delete", {"event=eps.loads_changed"}), "unknown_identifier");
  EXPECT_EQ(send("event_action.report", {"event=eps.loads_changed"}), "unknown_identifier");
  const std::string safe = "request=ttc.set_mode mode=safe";
  EXPECT_EQ(send("event_action.add", {"of_apid=1999", "event=eps.loads_changed", safe}), "unknown_identifier")
      << "there is no such application process";
  EXPECT_EQ(send("event_action.add", {"of_apid=17", "event=monitor.user_1", safe}), "unknown_identifier")
      << "only ttc raises it";
  Octets damaged = service_->table().begin()->second.packet;
  damaged.back() ^= 1;
  EXPECT_EQ(send("event_action.add", {"event=eps.loads_changed", "request=" + to_hex(damaged)}), "no_action");
  EXPECT_NE(send("event_action.add", {"event=eps.loads_changed", "request=eps.nonsense"}), "");
  EXPECT_EQ(service_->table(), before);
}

TEST_F(EventActions, AFullTableTakesNoMore) {
  std::string refused;
  std::size_t added = 0;
  for (const mission::Event& event : dictionary_.events()) {
    refused = send("event_action.add", {"event=" + event.name, "request=ttc.set_mode mode=safe"});
    if (!refused.empty() && refused != "still_enabled") break;
    ++added;
  }
  EXPECT_EQ(refused, "table_full");
  EXPECT_EQ(service_->table().size(), EventActionService::max_actions);
  EXPECT_LT(encode_table(*disk_).size(), StateFile<StoredTable>::largest_octets);
  EXPECT_EQ(send("event_action.report_status"), "");
  EXPECT_EQ(reports_.size(), EventActionService::max_actions + 2);
}

TEST_F(EventActions, TheTableOutlivesTheProcessAndTheFactorySetComesBackByCommand) {
  const ActionTable factory = service_->table();
  EXPECT_TRUE(factory.contains({0, mission::event::monitor_battery_empty}));
  define("eps.battery_low", "ttc.set_mode mode=safe");
  ASSERT_EQ(send("event_action.stop"), "");
  const ActionTable table = service_->table();
  restart({.table = disk_});
  EXPECT_EQ(service_->table(), table);
  EXPECT_FALSE(service_->enabled());
  EXPECT_EQ(send("event_action.delete_all"), "");
  EXPECT_TRUE(service_->table().empty());
  EXPECT_EQ(send("event_action.restore"), "");
  restart({.table = disk_});
  EXPECT_EQ(service_->table(), factory);
  EXPECT_TRUE(service_->enabled());
}

TEST_F(EventActions, AReportOfDefinitionsWaitsForRoomAndEndsAtItsExpiry) {
  define("eps.battery_low", "ttc.set_mode mode=safe");
  const auto encoded = dictionary_.encode("event_action.report", {});
  ASSERT_TRUE(encoded);
  const Telecommand report{.origin = {.ack_flags = wire::ack::all, .id = ++id_},
                           .command = encoded->command,
                           .arguments = encoded->data,
                           .expiry = now_ + seconds(60)};
  service_->execute(report, now_);
  service_->go_on(0, now_);
  EXPECT_EQ(report_queue_.take().size(), 1U) << "1,3";
  service_->go_on(1U << 20, now_);
  EXPECT_EQ(report_queue_.take().size(), service_->table().size() + 1);
  const std::uint32_t failed = report_queue_.counters().failed;
  service_->execute(report, now_);
  service_->go_on(0, report.expiry);
  EXPECT_FALSE(service_->is_reporting());
  EXPECT_EQ(report_queue_.counters().failed, failed + 1);
}

// ---- storms

TEST_F(EventActions, AStormOfOneEventReleasesABurstThenOneEachPeriodAndSaysSoOnce) {
  define("eps.battery_low", "eps.switch_load load=2 state=off");
  std::size_t released = 0;
  std::size_t said = 0;
  const MonotonicTime begin = now_;
  for (; now_ - begin < std::chrono::minutes(10); now_ = now_ + milliseconds(10)) {
    service_->on_event(eps, low, now_);
    released += release();
    said += service_->take_delayed().size();
  }
  EXPECT_GE(released, 12U);
  EXPECT_LE(released, EventActionService::burst + 10);
  EXPECT_LE(said, released);
  EXPECT_LE(service_->waiting(), 1U);
  EXPECT_GT(service_->counters().merged, 50'000U);
}

TEST_F(EventActions, AllActionsTogetherAreBoundedTooAndNoneIsForgotten) {
  std::size_t actions = 0;
  for (const mission::Event& event : dictionary_.events()) {
    if (event.id == mission::event::monitor_battery_empty || actions == 40) continue;
    define(event.name, "eps.switch_load load=2 state=off");
    ++actions;
  }
  for (const auto& [key, action] : service_->table()) service_->on_event(eps, key.event, now_);
  const std::size_t all = service_->waiting();
  EXPECT_EQ(release(), EventActionService::total_burst);
  std::size_t released = EventActionService::total_burst;
  const MonotonicTime begin = now_;
  for (; service_->waiting() > 0 && now_ - begin < std::chrono::minutes(10); now_ = now_ + seconds(1))
    released += release();
  EXPECT_EQ(released, all);
  EXPECT_GE(now_ - begin,
            nanoseconds(EventActionService::total_period) * (all - EventActionService::total_burst - 1));
}

TEST_F(EventActions, WhatWaitsTooLongIsDroppedAndSaid) {
  define("eps.battery_low", "eps.switch_load load=2 state=off");
  service_->on_event(eps, low, now_);
  now_ = now_ + EventActionService::longest_wait - nanoseconds(1);
  EXPECT_TRUE(service_->drop_overdue(now_).empty());
  now_ = now_ + nanoseconds(1);
  const auto dropped = service_->drop_overdue(now_);
  ASSERT_EQ(dropped.size(), 1U);
  EXPECT_EQ(dropped.front().event, low);
  EXPECT_EQ(service_->waiting(), 0U);
}

TEST_F(EventActions, WhatAnEarlierProcessReleasedCountsForTheRateAndBlocksForAPeriodAtMost) {
  define("eps.battery_low", "eps.switch_load load=2 state=off");
  service_->on_event(eps, low, now_);
  const Octets request = EventActionService::request_of(service_->due(now_).front().packet, 1);
  restart({.table = disk_});
  // Ended: the journal has forgotten its packet.
  const AcceptedTelecommand known{.origin = {.request = *wire::peek_request_id(request)},
                                  .accepted_at = now_,
                                  .packet_crc = crc32c(request),
                                  .packet_octets = static_cast<std::uint16_t>(request.size())};
  for (int i = 0; i < 256; ++i) service_->on_known_release(known);
  service_->on_event(eps, low, now_);
  EXPECT_EQ(release(), 0U);
  now_ = now_ + EventActionService::period;
  EXPECT_EQ(release(), 1U);
}

TEST_F(EventActions, WhateverComesTheRatesAndTheBoundsHold) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    restart({});
    define("eps.battery_low", "eps.switch_load load=2 state=off");
    define("eps.battery_recovered", "eps.switch_load load=2 state=on");
    std::map<ActionKey, std::deque<MonotonicTime>> releases;
    for (int i = 0; i < 500; ++i) {
      now_ = now_ + milliseconds(random() % 5000);
      service_->on_event(eps, random() % 2 == 0 ? low : high, now_);
      for (const auto& due : service_->due(now_)) {
        if (!service_->may_release(now_) || random() % 3 == 0) continue;  // no room
        service_->on_accepted(due.key, ++telecommand_, now_);
        EXPECT_TRUE(service_->on_passed(telecommand_, true));
        auto& times = releases[due.key];
        times.push_back(now_);
        if (times.size() <= EventActionService::burst) continue;
        if (times.size() > EventActionService::burst + 1) times.pop_front();
        ASSERT_GE(times.back() - times.front(), nanoseconds(EventActionService::period));
      }
      static_cast<void>(service_->drop_overdue(now_));
      ASSERT_LE(service_->waiting(), 2U);
      ASSERT_EQ(service_->waiting() > 0, service_->next_due(now_).has_value());
    }
  }
}

// ---- in ttc

/// A core with its clock, without line and disk: what it writes is written at once.
class ActionsInTtc : public testing::Test {
 protected:
  ActionsInTtc() { begin({}); }

  /// The process ends anywhere and begins anew, in the same boot, with what is on disk.
  void restart(const std::vector<std::pair<std::string, std::string>>& actions) {
    AcceptanceJournal journal("boot", seconds(60));
    for (const JournalRecord& record : records_) EXPECT_TRUE(journal.apply(record));
    journal.begin({}, 1, now_);
    begin_with(table_of(actions), std::move(journal));
    core_->restore(now_);
    settle();
  }

  /// @param actions  event and request of each, in place of the factory set; none: the factory set
  void begin(const std::vector<std::pair<std::string, std::string>>& actions) {
    begin_with(table_of(actions));
  }
  void begin_with(const FoundTable& actions) {
    AcceptanceJournal journal("boot", seconds(60));
    journal.begin({}, 1, now_);
    begin_with(actions, std::move(journal));
  }
  void begin_with(const FoundTable& actions, AcceptanceJournal journal) {
    UplinkConfig uplink;
    uplink.spacecraft_id = 1;
    uplink.cltu.randomized = false;
    uplink.channels.push_back(UplinkChannel{.vc = 1, .associations = {}});
    core_.emplace(TtcCore::Setup{.dictionary = dictionary_,
                                 .node = "ttc",
                                 .journal = std::move(journal),
                                 .uplink = std::move(uplink),
                                 .downlink = {},
                                 .mode = ModeManager(StoredModeState::first_start, "", MissionMode::nominal),
                                 .transmitter = TransmitterSwitch("boot", "", now_),
                                 .command_loss = CommandLossTimer("boot", "", seconds(259'200), now_),
                                 .stores = "",
                                 .event_actions = actions,
                                 .keys = {},
                                 .boot = {.count = 1},
                                 .clock = SpacecraftClock(UtcTime(seconds(1'795'000'000)), now_)});
    for (const mission::Event& event : dictionary_.events()) core_->events().add_event(event.id);
    for (const mission::Structure& structure : dictionary_.structures()) {
      if (structure.id != 0)
        core_->housekeeping().add_structure(structure.id, structure.apid, 0, structure.max_size(), {});
    }
    core_->activate(now_);
    reported_at_start_ = core_->events().counters().reported;
    settle();
  }
  [[nodiscard]] FoundTable table_of(const std::vector<std::pair<std::string, std::string>>& actions) const {
    if (actions.empty()) return {};
    OctetWriter out;
    out.u8(1);   // version
    out.u16(0);  // requests that changed it
    out.u8(1);   // the function is enabled
    out.u16(static_cast<std::uint16_t>(actions.size()));
    for (const auto& [event, request] : actions) {
      const auto added = dictionary_.encode("event_action.add", {"event=" + event, "request=" + request});
      EXPECT_TRUE(added) << added.error().message;
      out.u8(1);
      out.bytes(OctetView(added->data).subspan(2));
    }
    return {.table = StoredTable{.generation = 1, .content = out.take()}};
  }
  [[nodiscard]] Octets packet_of(const std::string& name, const std::vector<std::string>& arguments) const {
    const auto encoded = dictionary_.encode(name, arguments);
    EXPECT_TRUE(encoded) << encoded.error().message;
    if (!encoded) return {};
    return wire::make_tc_packet({.apid = encoded->command->apid,
                                 .service = encoded->command->service,
                                 .subtype = encoded->command->subtype,
                                 .application = encoded->data});
  }
  /// A telecommand of the ground. @return events
  std::vector<std::uint16_t> send(const std::string& name, const std::vector<std::string>& arguments) {
    const auto encoded = dictionary_.encode(name, arguments);
    EXPECT_TRUE(encoded) << encoded.error().message;
    const Octets packet = wire::make_tc_packet({.apid = encoded->command->apid,
                                                .sequence_count = ++sequence_,
                                                .service = encoded->command->service,
                                                .subtype = encoded->command->subtype,
                                                .application = encoded->data});
    const auto cltu =
        wire::make_uplink_cltu({.spacecraft_id = 1, .vc = 1}, wire::TcFrameType::bd, 0, nullptr, packet);
    EXPECT_TRUE(cltu);
    core_->on_octets(*cltu, now_);
    return settle();
  }
  std::vector<std::uint16_t> raise(std::uint16_t event) {
    core_->on_event("payload_eps", event, 1, Octets(4), now_);
    return settle();
  }

  /// @return ids of the events raised on the topic
  std::vector<std::uint16_t> settle() {
    std::vector<std::uint16_t> events;
    for (int turn = 0; turn < 8; ++turn) {
      for (const TtcAction& action : core_->settle(now_)) {
        if (const auto* journal = std::get_if<WriteJournal>(&action)) {
          const JournalBatch& batch = journal->batch;
          if (batch.snapshot) records_ = {{.kind = journal_snapshot_kind, .payload = *batch.snapshot}};
          records_.insert(records_.end(), batch.records.begin(), batch.records.end());
          if (disk_works_) {
            core_->on_journal_written(batch, {}, 0, now_);
          } else {
            core_->on_journal_written(batch, Err(FileError{}), 0, now_);
          }
        }
        if (const auto* state = std::get_if<WriteState>(&action))
          core_->on_state_written(state->change, true);
        if (const auto* mode = std::get_if<PublishMode>(&action)) {
          mode_ = mode->mode;
          mode_reason_ = mode->reason;
        }
        if (const auto* event = std::get_if<RaiseEvent>(&action)) {
          events.push_back(event->event_id);
          core_->on_event("ttc", event->event_id, static_cast<std::uint8_t>(event->severity), event->data,
                          now_);
        }
        if (const auto* published = std::get_if<PublishTelecommand>(&action))
          published_.insert(published->telecommand.origin.id);
        if (const auto* table = std::get_if<WriteTable>(&action))
          core_->on_table_written(table->name, table->change, true);
      }
    }
    return events;
  }
  void charge(float value) {
    sample_.measurement.state_of_charge = value;
    now_ = now_ + seconds(1);
    EXPECT_TRUE(core_->on_telemetry("payload_eps", eps, sample_.structure_id, sample_.encoded(), now_));
  }
  static bool has(const std::vector<std::uint16_t>& events, std::uint16_t id) {
    return std::find(events.begin(), events.end(), id) != events.end();
  }
  const mission::Dictionary& dictionary_ = testing_support::dictionary();
  MonotonicTime now_{seconds(100)};
  std::optional<TtcCore> core_;
  mission::PayloadEpsHousekeeping sample_;
  MissionMode mode_ = MissionMode::nominal;
  std::string mode_reason_;
  bool disk_works_ = true;
  std::vector<JournalRecord> records_;  ///< of the journal on disk
  std::set<std::uint64_t> published_;   ///< ids of telecommands for other nodes
  std::uint16_t sequence_ = 0;
  std::uint64_t reported_at_start_ = 0;  ///< events on their way to the ground
};

TEST_F(ActionsInTtc, AnEmptyBatteryCommandsSafeModeAfterTwoSamples) {
  charge(0.14F);
  settle();
  EXPECT_EQ(mode_, MissionMode::nominal) << "once is noise";
  charge(0.14F);
  EXPECT_TRUE(has(settle(), mission::event::event_action_released));
  EXPECT_EQ(mode_, MissionMode::safe);
  EXPECT_EQ(mode_reason_, "event-action");
  EXPECT_EQ(core_->journal().counters().accepted, 1U);
  EXPECT_EQ(core_->journal().known().front()->origin.source_id, EventActionService::on_board_source);
  EXPECT_EQ(core_->journal().open(), 0U) << "it ended in the journal";
}

TEST_F(ActionsInTtc, AnActionThatCommandsTheModeInForceLeavesTheReasonThatEndsIt) {
  send("ttc.set_mode", {"mode=safe"});
  ASSERT_EQ(mode_reason_, "commanded");
  charge(0.14F);
  charge(0.14F);
  const auto events = settle();
  EXPECT_TRUE(has(events, mission::event::event_action_released));
  EXPECT_FALSE(has(events, mission::event::ttc_mode_changed));
  EXPECT_EQ(mode_, MissionMode::safe);
  EXPECT_EQ(mode_reason_, "commanded");
  EXPECT_EQ(core_->journal().open(), 0U) << "it ended as done";
}

TEST_F(ActionsInTtc, ADamagedTableIsSaidAndTheFactorySetHolds) {
  EXPECT_EQ(reported_at_start_, 0U);
  begin_with({.table = {}, .damaged = true});
  EXPECT_EQ(reported_at_start_, 1U) << "monitor.table_damaged";
  charge(0.14F);
  charge(0.14F);
  settle();
  EXPECT_EQ(mode_, MissionMode::safe);
}

TEST_F(ActionsInTtc, AHazardousTelecommandAndOneThatChangesEventActionsAreNoActions) {
  const auto added = [this](const std::string& request) {
    send("event_action.add", {"event=eps.battery_low", "request=" + request});
    return core_->journal().known().back()->end->failure_code;
  };
  EXPECT_EQ(added("eps.power_cycle_peripheral"), mission::failure::no_action);
  EXPECT_EQ(added("event_action.restore"), mission::failure::no_action);
  EXPECT_EQ(added("event_action.stop"), mission::failure::no_action);
  const mission::Command* arm = dictionary_.command("ttc.arm");
  ASSERT_NE(arm, nullptr);
  EXPECT_EQ(added(to_hex(packet_of("ttc.arm", {"of_apid=17", "of_service=8", "of_subtype=1", "digest=0"}))),
            mission::failure::no_action)
      << "nothing on board arms";
  const std::string inner = to_hex(packet_of("eps.power_cycle_peripheral", {}));
  EXPECT_EQ(added(to_hex(packet_of("schedule.insert", {"release=2030-01-01T00:00:00Z", "request=" + inner}))),
            mission::failure::no_action)
      << "what the packet in it does is not judged";
  EXPECT_EQ(added("eps.switch_load load=1 state=off"), mission::failure::none);
}

TEST_F(ActionsInTtc, ALoopOfCrashesReleasesNoNewBurstEachTime) {
  const std::vector<std::pair<std::string, std::string>> actions{
      {"eps.battery_low", "ttc.set_mode mode=safe"}};
  begin(actions);
  std::size_t released = 0;
  for (int crash = 0; crash < 10; ++crash) {
    for (int i = 0; i < 5; ++i) released += has(raise(low), mission::event::event_action_released) ? 1 : 0;
    EXPECT_EQ(core_->journal().open(), 0U) << "all have ended";
    restart(actions);
  }
  EXPECT_EQ(released, EventActionService::burst);
  now_ = now_ + EventActionService::period;
  EXPECT_TRUE(has(raise(low), mission::event::event_action_released));
}

TEST_F(ActionsInTtc, AnActionThatIsRefusedBecauseOfTheDiskWaitsUntilItWorks) {
  begin({{"eps.battery_low", "eps.switch_load load=2 state=off"}});
  disk_works_ = false;
  EXPECT_FALSE(has(raise(low), mission::event::event_action_released));
  EXPECT_TRUE(published_.empty());
  EXPECT_TRUE(core_->has_waiting_actions());
  disk_works_ = true;
  now_ = now_ + PersistenceGate::retry_period;
  core_->on_deadline(now_);
  now_ = now_ + EventActionService::period;
  EXPECT_TRUE(has(settle(), mission::event::event_action_released));
  EXPECT_EQ(published_.size(), 1U);
  EXPECT_FALSE(core_->has_waiting_actions());
}

TEST_F(ActionsInTtc, AStoredActionThatTheRulesOfNowForbidIsSaidAndNotReleased) {
  begin({{"eps.battery_low", to_hex(packet_of("event_action.stop", {}))}});
  EXPECT_EQ(reported_at_start_, 0U);
  EXPECT_GE(core_->events().counters().reported, 1U) << "event_action.unusable";
  EXPECT_FALSE(has(raise(low), mission::event::event_action_released));
  EXPECT_EQ(core_->journal().counters().accepted, 0U);
  EXPECT_FALSE(core_->has_waiting_actions());
}

TEST_F(ActionsInTtc, AnEventThatIsNotSoundOrNotItsSendersOwnTriggersNothing) {
  begin({{"eps.battery_low", "eps.switch_load load=2 state=off"}});
  core_->on_event("payload_eps", low, 0, Octets(4), now_);
  core_->on_event("payload_eps", low, 9, Octets(4), now_);
  core_->on_event("payload_eps", low, 1, Octets(3), now_);
  core_->on_event("payload_eps", low, 1, Octets(5), now_);
  settle();
  EXPECT_TRUE(published_.empty());
  raise(low);
  EXPECT_EQ(published_.size(), 1U);

  begin({});
  const mission::MonitorBatteryEmptyEvent forged;
  EXPECT_FALSE(core_->on_event("payload_eps", forged.event_id, 4, forged.encoded(), now_));
  settle();
  EXPECT_EQ(mode_, MissionMode::nominal) << "monitors are ttc's";
}

TEST_F(ActionsInTtc, AnActionThatRaisesItsOwnEventEndsInItsRate) {
  begin({{"ttc.transmitter_on", "ttc.transmitter_on"}});
  std::size_t delayed = 0;
  send("ttc.transmitter_on", {});
  const MonotonicTime began = now_;
  for (; now_ - began < std::chrono::minutes(5); now_ = now_ + seconds(1)) {
    for (const std::uint16_t event : settle())
      delayed += event == mission::event::event_action_delayed ? 1 : 0;
  }
  const std::uint64_t released = core_->journal().counters().accepted - 1;
  EXPECT_GE(released, 5U);
  EXPECT_LE(released, EventActionService::burst + 6);
  EXPECT_GE(delayed, 1U) << "and is said";
}

TEST_F(ActionsInTtc, TwoActionsThatUndoEachOtherEndInTheirRateAndTheContradictionIsSaid) {
  begin({{"eps.battery_low", "eps.switch_load load=2 state=off"},
         {"eps.battery_recovered", "eps.switch_load load=2 state=on"}});
  EXPECT_FALSE(has(raise(low), mission::event::event_action_contradiction));
  EXPECT_TRUE(has(raise(high), mission::event::event_action_contradiction)) << "the first has not ended";
  for (int i = 0; i < 100; ++i) {
    raise(low);
    raise(high);
  }
  EXPECT_LE(published_.size(), 2 * EventActionService::burst);
}

TEST_F(ActionsInTtc, AnActionOnATelecommandOfTheGroundThatIsUnderWaySaysSo) {
  begin({{"eps.battery_low", "eps.switch_load load=2 state=off"}});
  send("eps.switch_load", {"load=2", "state=on"});
  EXPECT_TRUE(has(raise(low), mission::event::event_action_contradiction));
  EXPECT_EQ(published_.size(), 2U) << "and is released behind it";
}

TEST_F(ActionsInTtc, AnEventThatIsNotReportedTriggersItsActionAllTheSame) {
  begin({{"eps.battery_low", "eps.switch_load load=2 state=off"}});
  send("events.disable", {"event=eps.battery_low"});
  raise(low);
  EXPECT_EQ(published_.size(), 1U);
}

TEST_F(ActionsInTtc, ANodeWhoseQueueIsFullDoesNotHoldUpTheActionOfAnother) {
  begin({{"eps.battery_low", "eps.switch_load load=2 state=off"},
         {"eps.battery_recovered", "ttc.set_mode mode=safe"}});
  for (std::size_t i = 0; i < CommandForwarder::max_unacknowledged + CommandForwarder::max_queued; ++i)
    send("eps.set_charge_limit", {"limit=0." + std::to_string(100 + i)});
  raise(low);
  EXPECT_TRUE(core_->has_waiting_actions());
  raise(high);
  EXPECT_EQ(mode_, MissionMode::safe);
}

}  // namespace
}  // namespace srfs
