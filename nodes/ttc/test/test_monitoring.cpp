// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/monitoring.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <sstream>

#include <gtest/gtest.h>

#include "base/file.hpp"
#include "nodes/ttc/services/monitoring_service.hpp"
#include "nodes/ttc/test/router_with_parts.hpp"
#include "tests/mission_dictionary.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

using mission::PayloadEpsHousekeeping;

const TaiTime day = to_tai(UtcTime(seconds(1'795'000'000)));

/// Samples of the power system, checked by definitions as they are written in a telecommand.
class Checks : public testing::Test {
 protected:
  void define(std::vector<std::string> arguments) {
    const auto encoded = dictionary_.encode("monitor.add", arguments);
    ASSERT_TRUE(encoded) << encoded.error().message;
    const auto definitions = mission::MonitorAdd::decode(encoded->data);
    ASSERT_TRUE(definitions);
    MonitorTable table = monitoring_.table();
    table[definitions->front().id] = {.what = definitions->front(), .enabled = true};
    monitoring_.set_table(table);
  }
  void sample(nanoseconds after = seconds(1)) {
    now_ = now_ + after;
    monitoring_.on_sample(PayloadEpsHousekeeping::structure_id, sample_.encoded(), day, now_);
  }
  void charge(float value) {
    sample_.measurement.state_of_charge = value;
    sample();
  }
  /// States that were entered, of all definitions.
  std::vector<MonitorState> states() {
    std::vector<MonitorState> states;
    for (const auto& transition : monitoring_.take_transitions()) states.push_back(transition.state);
    return states;
  }

  const mission::Dictionary& dictionary_ = testing_support::dictionary();
  Monitoring monitoring_{dictionary_};
  PayloadEpsHousekeeping sample_;
  MonotonicTime now_{seconds(100)};
};

using States = std::vector<MonitorState>;

TEST_F(Checks, ALimitIsCrossedAfterSoManySamplesInARowAndHysteresisHoldsItThere) {
  define({"id=1", "parameter=payload_eps.state_of_charge", "check=at_least", "low=0.3",
          "low_event=monitor.user_1", "repetition=2", "hysteresis=0.1"});
  charge(0.29F);
  EXPECT_EQ(states(), States{}) << "once is noise";
  charge(0.31F);
  charge(0.29F);
  EXPECT_EQ(states(), States{}) << "not in a row";
  charge(0.28F);
  const auto crossed = monitoring_.take_transitions();
  ASSERT_EQ(crossed.size(), 1U);
  EXPECT_EQ(crossed.front().state, MonitorState::below);
  EXPECT_EQ(crossed.front().event, mission::event::monitor_user_1);
  EXPECT_NEAR(crossed.front().value, 0.28, 1e-6);
  EXPECT_EQ(crossed.front().limit, 0.3);
  EXPECT_EQ(dictionary_.telemetry_name(crossed.front().parameter), "payload_eps.state_of_charge");

  charge(0.35F);
  charge(0.35F);
  EXPECT_EQ(states(), States{}) << "not so far inside";
  charge(0.41F);
  charge(0.41F);
  const auto back = monitoring_.take_transitions();
  ASSERT_EQ(back.size(), 1U);
  EXPECT_EQ(back.front().state, MonitorState::within);
  EXPECT_EQ(back.front().event, 0U);
}

TEST_F(Checks, OfTwoLimitsEachHasItsEvent) {
  define({"id=1", "parameter=payload_eps.battery_current_a", "check=limits", "low=-2", "high=2",
          "low_event=monitor.user_1", "high_event=monitor.user_2"});
  std::vector<std::uint16_t> events;
  for (const float current : {0.F, 3.F, -3.F, -2.F}) {
    sample_.measurement.battery_current_a = current;
    sample();
    for (const auto& transition : monitoring_.take_transitions()) events.push_back(transition.event);
  }
  EXPECT_EQ(events,
            (std::vector<std::uint16_t>{mission::event::monitor_user_2, mission::event::monitor_user_1, 0}));
}

TEST_F(Checks, AnExpectedValueMayBeAFloatThatIsNearest) {
  define({"id=1", "parameter=payload_eps.state_of_charge", "check=expected", "low=0.7",
          "low_event=monitor.user_1"});
  charge(0.7F);
  EXPECT_EQ(states(), States{});
  charge(0.71F);
  EXPECT_EQ(states(), States{MonitorState::unexpected});
}

TEST_F(Checks, AnExpectedIntegerIsNoFloatThatIsNearest) {
  define({"id=1", "parameter=beacon.storage_free_mib", "check=expected", "low=16777217"});
  mission::Beacon beacon;
  beacon.storage_free_mib = 16'777'216;  // the f32 nearest to 16777217
  monitoring_.on_sample(mission::Beacon::structure_id, beacon.encoded(), day, now_);
  EXPECT_EQ(states(), States{MonitorState::unexpected});
  beacon.storage_free_mib = 16'777'217;
  monitoring_.on_sample(mission::Beacon::structure_id, beacon.encoded(), day, now_);
  EXPECT_EQ(states(), States{MonitorState::within});
}

TEST_F(Checks, AnExpectedValueThatNoFloatHasIsNeverThere) {
  define({"id=1", "parameter=payload_eps.state_of_charge", "check=expected", "low=1e300"});
  charge(std::numeric_limits<float>::infinity());
  EXPECT_EQ(states(), States{MonitorState::unexpected});
}

TEST_F(Checks, ADeltaIsJudgedFromOneCheckToTheNext) {
  define({"id=1", "parameter=payload_eps.battery_temperature_k", "check=delta", "low=-1", "high=1",
          "high_event=monitor.changed"});
  for (const float kelvin : {290.F, 290.5F, 291.5F}) {
    sample_.measurement.battery_temperature_k = kelvin;
    sample();
  }
  EXPECT_EQ(states(), States{});
  sample_.measurement.battery_temperature_k = 293.F;
  sample();
  sample();
  EXPECT_EQ(states(), (States{MonitorState::above, MonitorState::within}));
}

TEST_F(Checks, AConditionOnAnotherParameterMakesItCountOrNot) {
  define({"id=1", "parameter=payload_eps.load_current_a[2]", "condition=payload_eps.load_switches",
          "condition_value=4", "check=at_least", "low=0.1", "low_event=monitor.user_1"});
  sample_.measurement.load_switches = 0;
  sample();
  EXPECT_EQ(states(), States{}) << "the load is off: it draws nothing";
  EXPECT_EQ(monitoring_.state(1), MonitorState::invalid);
  sample_.measurement.load_switches = 4;
  sample();
  EXPECT_EQ(states(), States{MonitorState::below});
  sample_.measurement.load_switches = 0;
  sample();
  EXPECT_EQ(states(), States{MonitorState::invalid}) << "that it is out of limits has ended";
}

TEST_F(Checks, AConditionOnAFloatHoldsForTheNearestOne) {
  define({"id=1", "parameter=payload_eps.battery_current_a", "condition=payload_eps.state_of_charge",
          "condition_value=0.1", "check=at_least", "low=-1"});
  sample_.measurement.battery_current_a = -2;
  charge(0.1F);
  EXPECT_EQ(states(), States{MonitorState::below});
}

TEST_F(Checks, AConditionOnAStructureThatStoppedDoesNotHold) {
  define({"id=1", "parameter=payload_eps.state_of_charge", "condition=beacon.storage_free_mib",
          "condition_value=5", "check=at_least", "low=0.3"});
  mission::Beacon beacon;
  beacon.storage_free_mib = 5;
  monitoring_.on_sample(mission::Beacon::structure_id, beacon.encoded(), day, now_);
  charge(0.1F);
  EXPECT_EQ(states(), States{MonitorState::below});
  now_ = now_ + dictionary_.structure(mission::Beacon::structure_id)->interval * 10;
  charge(0.1F);
  EXPECT_EQ(states(), States{MonitorState::invalid}) << "what it was says nothing of now";
  monitoring_.on_sample(mission::Beacon::structure_id, beacon.encoded(), day, now_);
  charge(0.1F);
  EXPECT_EQ(states(), States{MonitorState::below});
}

TEST_F(Checks, AMaskSelectsBitsOfTheConditionAndOfTheExpectedValue) {
  define({"id=1", "parameter=payload_eps.load_current_a[2]", "condition=payload_eps.load_switches",
          "condition_mask=4", "condition_value=4", "check=at_least", "low=0.1"});
  define({"id=2", "parameter=payload_eps.load_switches", "mask=3", "check=expected", "low=1"});
  sample_.measurement.load_switches = 0b1001;
  sample();
  EXPECT_EQ(monitoring_.state(1), MonitorState::invalid);
  EXPECT_EQ(monitoring_.state(2), MonitorState::within);
  sample_.measurement.load_switches = 0b0111;
  sample();
  EXPECT_EQ(monitoring_.state(1), MonitorState::below);
  EXPECT_EQ(monitoring_.state(2), MonitorState::unexpected);
}

TEST_F(Checks, AnUnknownValueIsNeverJudged) {
  define({"id=1", "parameter=payload_eps.state_of_charge", "check=at_least", "low=0.3"});
  charge(std::nanf(""));
  EXPECT_EQ(states(), States{});
  EXPECT_EQ(monitoring_.state(1), MonitorState::invalid);
}

TEST_F(Checks, AChangeBetweenInfiniteValuesIsUnknown) {
  define({"id=1", "parameter=payload_eps.state_of_charge", "check=delta", "low=-1", "high=1"});
  charge(0.5F);
  charge(std::numeric_limits<float>::infinity());
  EXPECT_EQ(states(), States{MonitorState::above});
  charge(std::numeric_limits<float>::infinity());
  EXPECT_EQ(states(), States{MonitorState::invalid});
}

TEST(CalibratedNumbers, AnInfiniteValueThatItsCalibrationMakesNoNumberIsUnknown) {
  mission::Field field;
  field.type = mission::FieldType::f32;
  field.calibration = {1, 0, 2};
  OctetWriter out;
  out.f32(std::numeric_limits<float>::infinity());
  out.f32(3);
  OctetReader in(out.view());
  EXPECT_FALSE(mission::Dictionary::take_number(field, in)) << "0 times infinity";
  EXPECT_EQ(mission::Dictionary::take_number(field, in), 19);
}

TEST_F(Checks, AnIntervalLeavesSamplesOut) {
  define({"id=1", "parameter=payload_eps.state_of_charge", "check=at_least", "low=0.3", "interval_ms=5000"});
  for (int i = 0; i < 10; ++i) charge(0.5F);
  EXPECT_EQ(monitoring_.counters().checks, 2U);
}

TEST_F(Checks, SamplesThatStopAreStaleAfterSoManyIntervalsAndFreshWithTheNext) {
  define({"id=1", "parameter=payload_eps.state_of_charge", "check=stale", "repetition=3", "interval_ms=2000",
          "low_event=monitor.stale"});
  const auto pass = [this](int times) {
    for (int i = 0; i < times; ++i) {
      now_ = now_ + seconds(1);
      monitoring_.on_time(day, now_);
    }
  };
  pass(100);
  EXPECT_EQ(states(), States{}) << "what never came may not be there";
  sample();
  pass(6);
  EXPECT_EQ(states(), States{});
  pass(1);
  EXPECT_EQ(states(), States{MonitorState::stale});
  pass(10);
  EXPECT_EQ(states(), States{});
  sample();
  EXPECT_EQ(states(), States{MonitorState::within});
}

TEST_F(Checks, TimeInWhichTheProcessCouldNotRunMakesNothingStale) {
  define({"id=1", "parameter=payload_eps.state_of_charge", "check=stale", "repetition=3"});
  monitoring_.on_time(day, now_);
  sample();
  monitoring_.on_time(day, now_);
  now_ = now_ + seconds(60);
  monitoring_.on_time(day, now_);
  EXPECT_EQ(states(), States{});
}

TEST_F(Checks, BehindATextOfAnyLengthTheRightOctetsAreRead) {
  define({"id=1", "parameter=beacon.storage_free_mib", "check=at_least", "low=64"});
  define({"id=2", "parameter=beacon.node_restarts.ttc", "check=at_most", "high=3"});
  mission::Beacon beacon;
  beacon.node_state.resize(dictionary_.nodes().size());
  beacon.node_restarts.resize(dictionary_.nodes().size());
  beacon.node_version.resize(dictionary_.nodes().size());
  beacon.storage_free_mib = 100;
  for (const std::size_t length : {0U, 1U, 30U, 60U}) {
    beacon.mode_reason = std::string(length, 'x');
    monitoring_.on_sample(mission::Beacon::structure_id, beacon.encoded(), day, now_);
    EXPECT_EQ(monitoring_.state(1), MonitorState::within) << length;
    EXPECT_EQ(monitoring_.state(2), MonitorState::within) << length;
  }
  beacon.storage_free_mib = 63;
  beacon.node_restarts[0] = 4;
  monitoring_.on_sample(mission::Beacon::structure_id, beacon.encoded(), day, now_);
  EXPECT_EQ(states(), (States{MonitorState::below, MonitorState::above}));
}

TEST_F(Checks, SamplesThatAreCutOrRandomAreNoHarm) {
  monitoring_.set_table(factory_monitors(dictionary_));
  std::mt19937 random(1);
  for (int i = 0; i < 2000; ++i) {
    const auto& structures = dictionary_.structures();
    const mission::Structure& structure = structures[random() % structures.size()];
    Octets octets(random() % (structure.max_size() + 8));
    for (auto& octet : octets) octet = static_cast<std::uint8_t>(random());
    monitoring_.on_sample(structure.id, octets, day, now_);
  }
  EXPECT_GT(monitoring_.counters().checks, 1000U);
  EXPECT_LE(monitoring_.out_of_limits_count(), monitoring_.table().size());
  EXPECT_EQ(monitoring_.out_of_limits().size(), monitoring_.out_of_limits_count());
}

TEST_F(Checks, TheFunctionSwitchedOffForgetsEveryState) {
  define({"id=1", "parameter=payload_eps.state_of_charge", "check=at_least", "low=0.3"});
  charge(0.1F);
  monitoring_.set_enabled(false);
  charge(0.1F);
  EXPECT_EQ(monitoring_.out_of_limits_count(), 0U);
  monitoring_.set_enabled(true);
  static_cast<void>(states());
  charge(0.1F);
  EXPECT_EQ(states(), States{MonitorState::below});
}

TEST_F(Checks, ChangingOneDefinitionLeavesTheStatesOfTheOthers) {
  define({"id=1", "parameter=payload_eps.state_of_charge", "check=at_least", "low=0.3"});
  charge(0.1F);
  EXPECT_EQ(states(), States{MonitorState::below});
  define({"id=2", "parameter=payload_eps.bus_voltage_v", "check=at_least", "low=0"});
  charge(0.1F);
  EXPECT_EQ(states(), States{});
  EXPECT_EQ(monitoring_.state(1), MonitorState::below);
}

// ---- factory set

TEST_F(Checks, TheFactorySetHasEachLimitOfTheDictionaryAndEachStructureOfAnotherNode) {
  const MonitorTable table = factory_monitors(dictionary_);
  const auto watched = [&](const mission::Field& field, std::uint32_t parameter,
                           const mission::Bounds& bounds) {
    return std::any_of(table.begin(), table.end(),
                       [&](const auto& entry) {
                         const mission::MonitorAdd& what = entry.second.what;
                         return entry.second.enabled && what.parameter == parameter &&
                                what.check != MonitorCheck::stale &&
                                (!bounds.low || what.low == *bounds.low) &&
                                (!bounds.high || what.high == *bounds.high);
                       }) ||
           field.name.empty();
  };
  std::size_t limits = 0;
  for (const mission::Structure& structure : dictionary_.structures()) {
    if (structure.id == 0) continue;
    std::uint32_t parameter = static_cast<std::uint32_t>(structure.id) << 16U;
    for (const mission::Field& field : structure.fields) {
      for (std::size_t i = 0; i < field.count; ++i, ++parameter) {
        const bool at_its_source =
            structure.id == mission::Beacon::structure_id &&
            std::any_of(dictionary_.beacon_sources().begin(), dictionary_.beacon_sources().end(),
                        [&](const auto& source) { return source.value == field.name; });
        for (const auto& bounds : {field.soft, field.hard}) {
          if (!bounds || at_its_source) continue;
          ++limits;
          EXPECT_TRUE(watched(field, parameter, *bounds)) << structure.name << "." << field.name;
        }
      }
    }
    if (structure.apid == mission::apid::ttc || structure.interval < seconds(1)) continue;
    EXPECT_TRUE(table.contains(static_cast<std::uint16_t>(first_stale_id + structure.id))) << structure.name;
  }
  EXPECT_GT(limits, 60U);
  EXPECT_LT(table.size(), Monitoring::max_definitions / 2) << "room for those of the ground";
  for (const auto& [id, definition] : table) {
    EXPECT_EQ(id, definition.what.id);
    const auto refusal = why_not_taken(definition.what, dictionary_);
    EXPECT_FALSE(refusal) << id << ": " << (refusal ? refusal->code : 0);
  }
}

TEST_F(Checks, TheReferencePageListsTheFactorySet) {
  const MonitorTable table = factory_monitors(dictionary_);
  const auto page = read_file(std::string(SRFS_SOURCE_DIR) + "/docs/reference/dictionary.md", 4U << 20);
  ASSERT_TRUE(page);
  const auto first = page->find("## Monitors");
  std::istringstream lines(page->substr(first, page->find("## Event-actions") - first));
  std::size_t listed = 0;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string bar;
    std::string parameter;
    int id = 0;
    if (!(words >> bar >> id >> bar >> parameter)) continue;
    ++listed;
    const auto found = table.find(static_cast<std::uint16_t>(id));
    ASSERT_NE(found, table.end()) << line;
    EXPECT_EQ(dictionary_.telemetry_name(found->second.what.parameter), parameter) << line;
  }
  EXPECT_EQ(listed, table.size());
}

TEST_F(Checks, TheHardLimitOfTheBatteryHasItsOwnEvent) {
  monitoring_.set_table(factory_monitors(dictionary_));
  sample_.measurement.battery_voltage_v = 7.5F;
  sample_.measurement.battery_temperature_k = 290;
  sample_.time_to_empty_s = 7200;
  std::vector<std::uint16_t> events;
  for (int i = 0; i < 5; ++i) {
    charge(0.14F);
    for (const auto& transition : monitoring_.take_transitions()) events.push_back(transition.event);
  }
  EXPECT_EQ(std::count(events.begin(), events.end(), mission::event::monitor_battery_empty), 1);
}

// ---- requests

class MonitoringRequests : public RouterWithParts {
 protected:
  MonitoringRequests() { restart({}); }

  void restart(const FoundTable& found) { service_.emplace(dictionary_, found, report_queue_); }
  /// @return "" when it was completed, else the name of the failure code
  std::string send(const std::string& name, const std::vector<std::string>& arguments = {},
                   bool stored = true) {
    const auto encoded = dictionary_.encode(name, arguments);
    if (!encoded) return encoded.error().message;
    const OctetView data = encoded->data;
    Telecommand telecommand{
        .origin = {.ack_flags = wire::ack::all, .id = ++id_},
        .command = encoded->command,
        .arguments = Octets(data.begin() + (encoded->command->is_function() ? 2 : 0), data.end())};
    if (const auto bad = dictionary_.check_arguments(*telecommand.command, telecommand.arguments); !bad)
      return "bad_argument";
    service_->execute(telecommand, now_);
    if (auto change = service_->take_change(now_)) {
      if (stored) disk_ = change->table;
      service_->on_stored(*change, stored, now_);
    }
    service_->go_on(1U << 20, now_);
    reports_ = report_queue_.take();
    for (const StageReached& stage : report_queue_.take_stages()) {
      if (!stage.success) return dictionary_.failure_code(stage.failure_code)->name;
    }
    return "";
  }
  static std::vector<std::string> definition(int id, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments{"id=" + std::to_string(id), "parameter=payload_eps.state_of_charge",
                                       "check=at_least", "low=0.5", "low_event=monitor.user_1"};
    for (std::string& one : more) {
      const std::string key = one.substr(0, one.find('=') + 1);
      std::erase_if(arguments, [&](const std::string& argument) { return argument.starts_with(key); });
      arguments.push_back(std::move(one));
    }
    return arguments;
  }

  std::optional<MonitoringService> service_;
  std::optional<StoredTable> disk_;
  std::vector<Report> reports_;
  std::uint64_t id_ = 0;
  MonotonicTime now_{seconds(100)};
};

TEST_F(MonitoringRequests, ADefinitionIsAddedDisabledEnabledModifiedAndDeleted) {
  EXPECT_EQ(send("monitor.add", definition(7)), "");
  EXPECT_FALSE(service_->monitoring().table().at(7).enabled);
  EXPECT_EQ(send("monitor.enable", {"id=7"}), "");
  EXPECT_TRUE(service_->monitoring().table().at(7).enabled);
  EXPECT_EQ(send("monitor.modify", definition(7, {"low=0.6"})), "");
  EXPECT_TRUE(service_->monitoring().table().at(7).enabled);
  EXPECT_EQ(service_->monitoring().table().at(7).what.low, 0.6);
  EXPECT_EQ(send("monitor.delete", {"id=7"}), "still_enabled");
  EXPECT_EQ(send("monitor.disable", {"id=7"}), "");
  EXPECT_EQ(send("monitor.delete", {"id=7"}), "");
  EXPECT_FALSE(service_->monitoring().table().contains(7));
}

TEST_F(MonitoringRequests, BadDefinitionsAreRefusedWithTheReasonAndChangeNothing) {
  const MonitorTable before = service_->monitoring().table();
  EXPECT_EQ(send("monitor.add", definition(1)), "monitor_exists");
  EXPECT_EQ(send("monitor.modify", definition(999)), "unknown_identifier");
  EXPECT_EQ(send("monitor.enable", {"id=999"}), "unknown_identifier");
  EXPECT_EQ(send("monitor.add", definition(7, {"parameter=none"})), "not_monitorable");
  EXPECT_EQ(send("monitor.add", definition(7, {"parameter=beacon.mode_reason"})), "not_monitorable");
  EXPECT_EQ(send("monitor.add", definition(7, {"condition=beacon.mode_reason"})), "not_monitorable");
  EXPECT_EQ(send("monitor.add", definition(7, {"check=limits", "low=2", "high=1"})), "contradictory_limits");
  EXPECT_EQ(send("monitor.add", definition(7, {"check=limits", "low=1", "high=2", "hysteresis=0.6"})),
            "contradictory_limits");
  EXPECT_EQ(send("monitor.add", definition(7, {"check=expected", "hysteresis=1"})), "contradictory_limits");
  EXPECT_EQ(send("monitor.add", definition(7, {"mask=1"})), "not_monitorable") << "a float has no bits";
  EXPECT_EQ(send("monitor.add", definition(7, {"parameter=payload_eps.load_switches", "mask=1"})),
            "contradictory_limits")
      << "only an expected value has a mask";
  EXPECT_EQ(send("monitor.add", definition(7, {"low_event=eps.battery_low"})), "no_monitor_event");
  EXPECT_EQ(send("monitor.delete_all"), "still_enabled");
  EXPECT_EQ(service_->monitoring().table(), before);
  EXPECT_TRUE(service_->is_factory());
  EXPECT_FALSE(disk_) << "nothing was written";
  EXPECT_NE(send("monitor.add", definition(7, {"parameter=payload_eps.nonsense"})), "");
  EXPECT_NE(send("monitor.add", definition(7, {"parameter=4294967295"})), "");
}

TEST_F(MonitoringRequests, AFullTableTakesNoMoreAndFitsItsFile) {
  int id = 10'000;
  while (service_->monitoring().table().size() < Monitoring::max_definitions)
    ASSERT_EQ(send("monitor.add", definition(++id)), "");
  EXPECT_EQ(send("monitor.add", definition(++id)), "table_full");
  ASSERT_TRUE(disk_);
  EXPECT_LT(encode_table(*disk_).size(), StateFile<StoredTable>::largest_octets);
  EXPECT_EQ(send("monitor.report"), "");
  EXPECT_EQ(reports_.size(), Monitoring::max_definitions + 2) << "1,3, each definition, 1,7";
}

TEST_F(MonitoringRequests, ALongReportWaitsForRoomOnTheLine) {
  const auto encoded = dictionary_.encode("monitor.report", {});
  ASSERT_TRUE(encoded);
  service_->execute({.origin = {.ack_flags = wire::ack::all, .id = 1},
                     .command = encoded->command,
                     .arguments = encoded->data,
                     .expiry = now_ + seconds(60)},
                    now_);
  std::size_t reports = 0;
  int turns = 0;
  for (; service_->is_reporting(); ++turns) {
    service_->go_on(20U << 10, now_);
    reports += report_queue_.take().size();
    ASSERT_LT(turns, 1000);
  }
  EXPECT_GT(turns, 2);
  EXPECT_EQ(reports, service_->monitoring().table().size() + 2);
}

TEST_F(MonitoringRequests, AReportThatFindsNoRoomEndsAtItsExpiry) {
  const auto encoded = dictionary_.encode("monitor.report", {});
  ASSERT_TRUE(encoded);
  service_->execute({.origin = {.ack_flags = wire::ack::all, .id = 1},
                     .command = encoded->command,
                     .arguments = encoded->data,
                     .expiry = now_ + seconds(60)},
                    now_);
  service_->go_on(0, now_ + seconds(59));
  EXPECT_TRUE(service_->is_reporting());
  service_->go_on(0, now_ + seconds(60));
  EXPECT_FALSE(service_->is_reporting());
  EXPECT_EQ(report_queue_.counters().failed, 1U);
}

TEST_F(MonitoringRequests, TheTableOutlivesTheProcessAndTheFactorySetComesBackByCommand) {
  ASSERT_EQ(send("monitor.add", definition(7)), "");
  ASSERT_EQ(send("monitor.enable", {"id=7"}), "");
  ASSERT_EQ(send("monitor.stop"), "");
  const MonitorTable table = service_->monitoring().table();
  restart({.table = disk_});
  EXPECT_EQ(service_->monitoring().table(), table);
  EXPECT_FALSE(service_->monitoring().enabled());
  EXPECT_FALSE(service_->is_factory());
  EXPECT_EQ(send("monitor.delete_all"), "") << "the function is disabled";
  EXPECT_EQ(send("monitor.restore"), "");
  restart({.table = disk_});
  EXPECT_EQ(service_->monitoring().table(), factory_monitors(dictionary_));
  EXPECT_TRUE(service_->monitoring().enabled());
}

TEST_F(MonitoringRequests, AChangeThatIsNotStoredSaysSo) {
  EXPECT_EQ(send("monitor.add", definition(7), false), "storage_unavailable");
  EXPECT_TRUE(service_->monitoring().table().contains(7)) << "it holds until the process ends";
}

TEST_F(MonitoringRequests, AChangeThatIsNotStoredIsStoredLater) {
  EXPECT_EQ(send("monitor.add", definition(7), false), "storage_unavailable");
  EXPECT_FALSE(service_->take_change(now_)) << "not at once";
  EXPECT_EQ(service_->retry_at(), now_ + MonitoringService::retry_period);
  now_ = now_ + MonitoringService::retry_period;
  auto again = service_->take_change(now_);
  ASSERT_TRUE(again);
  EXPECT_TRUE(again->origins.empty()) << "its end was reported";
  service_->on_stored(*again, false, now_);
  now_ = now_ + MonitoringService::retry_period;
  again = service_->take_change(now_);
  ASSERT_TRUE(again);
  service_->on_stored(*again, true, now_);
  EXPECT_FALSE(service_->retry_at());
  restart({.table = again->table});
  EXPECT_TRUE(service_->monitoring().table().contains(7));
}

TEST_F(MonitoringRequests, ChangesThatComeTogetherAreStoredTogetherAndAllComplete) {
  for (const int id : {7, 8, 9}) {
    const auto encoded = dictionary_.encode("monitor.add", definition(id));
    ASSERT_TRUE(encoded);
    service_->execute({.origin = {.ack_flags = wire::ack::all, .id = ++id_},
                       .command = encoded->command,
                       .arguments = encoded->data},
                      now_);
  }
  const auto change = service_->take_change(now_);
  ASSERT_TRUE(change);
  EXPECT_EQ(change->origins.size(), 3U);
  EXPECT_FALSE(service_->take_change(now_)) << "one write";
  service_->on_stored(*change, true, now_);
  EXPECT_EQ(report_queue_.counters().completed, 3U);
  EXPECT_EQ(report_queue_.counters().failed, 0U);
  restart({.table = change->table});
  for (const int id : {7, 8, 9})
    EXPECT_TRUE(service_->monitoring().table().contains(static_cast<std::uint16_t>(id)));
}

TEST_F(MonitoringRequests, ARequestThatWasRefusedBeforeALaterOneIsNotTakenAsDone) {
  EXPECT_EQ(send("monitor.enable", {"id=999"}), "unknown_identifier");
  const std::uint64_t refused = id_;
  ASSERT_EQ(send("monitor.add", definition(7)), "");
  restart({.table = disk_});
  const auto encoded = dictionary_.encode("monitor.enable", {"id=999"});
  ASSERT_TRUE(encoded);
  EXPECT_FALSE(service_->restore({.origin = {.ack_flags = wire::ack::all, .id = refused},
                                  .command = encoded->command,
                                  .arguments = encoded->data},
                                 {}, now_));
}

TEST_F(MonitoringRequests, ATableThatIsCutOrOfAnotherVersionIsDamagedAndTheFactorySetHolds) {
  ASSERT_EQ(send("monitor.add", definition(7)), "");
  StoredTable cut = *disk_;
  cut.content.pop_back();
  restart({.table = cut});
  EXPECT_TRUE(service_->is_damaged());
  EXPECT_EQ(service_->monitoring().table(), factory_monitors(dictionary_));
  StoredTable other = *disk_;
  other.content.front() = 0;
  restart({.table = other});
  EXPECT_TRUE(service_->is_damaged());
  EXPECT_EQ(service_->monitoring().table(), factory_monitors(dictionary_));
  ASSERT_EQ(send("monitor.add", definition(8)), "");
  EXPECT_GT(disk_->generation, other.generation) << "the next one holds";
}

TEST_F(MonitoringRequests, ARequestThatTheTableOnDiskHasIsNotCarriedOutAgain) {
  ASSERT_EQ(send("monitor.add", definition(7)), "");
  restart({.table = disk_});
  const auto encoded = dictionary_.encode("monitor.add", definition(7));
  ASSERT_TRUE(encoded);
  Telecommand known{.origin = {.ack_flags = wire::ack::all, .id = id_},
                    .command = encoded->command,
                    .arguments = encoded->data};
  EXPECT_TRUE(service_->restore(known, {}, now_));
  EXPECT_EQ(report_queue_.take().size(), 2U);
  known.origin.id = id_ + 1;
  EXPECT_FALSE(service_->restore(known, {}, now_)) << "the disk does not have it";
}

TEST_F(MonitoringRequests, ReportsAreBoundedWaitAndAreCountedWhenTheyWaitedTooLong) {
  const Monitoring::Transition transition{.definition = 1, .state = MonitorState::below};
  const auto unreported = [&] {
    mission::TtcMonitoringHousekeeping h;
    service_->fill(h);
    return h.unreported;
  };
  for (int i = 0; i < 200; ++i) service_->on_transition(transition, now_);
  std::size_t reported = service_->take_reports(now_).size();
  EXPECT_EQ(reported, MonitoringService::report_burst);
  EXPECT_EQ(unreported(), 0U) << "they wait";
  reported += service_->take_reports(now_ + seconds(1)).size();
  EXPECT_EQ(reported, MonitoringService::report_burst + 8);
  reported += service_->take_reports(now_ + MonitoringService::default_reporting_delay).size();
  EXPECT_EQ(unreported(), 200 - reported);
  EXPECT_TRUE(service_->take_reports(now_ + seconds(60)).empty());
}

TEST_F(MonitoringRequests, NoMoreTransitionsWaitThanThereIsRoomFor) {
  ASSERT_EQ(send("monitor.set_reporting_delay", {"delay_ms=3600000"}), "");
  for (std::size_t i = 0; i < MonitoringService::max_waiting + 5; ++i) service_->on_transition({}, now_);
  mission::TtcMonitoringHousekeeping h;
  service_->fill(h);
  EXPECT_EQ(h.unreported, 5U);
}

TEST_F(MonitoringRequests, TheReportingDelayIsChangedReportedAndStored) {
  EXPECT_EQ(send("monitor.set_reporting_delay", {"delay_ms=3600001"}).empty(), false);
  ASSERT_EQ(send("monitor.set_reporting_delay", {"delay_ms=0"}), "");
  restart({.table = disk_});
  ASSERT_EQ(send("monitor.report", {"id=1"}), "");
  const auto report = mission::MonitorDefinition::decode(OctetView(reports_.at(1).data));
  ASSERT_TRUE(report);
  EXPECT_EQ(report->reporting_delay_ms, 0U);
  for (int i = 0; i < 100; ++i) service_->on_transition({}, now_);
  EXPECT_EQ(service_->take_reports(now_).size(), MonitoringService::report_burst);
  mission::TtcMonitoringHousekeeping h;
  service_->fill(h);
  EXPECT_EQ(h.unreported, 100 - MonitoringService::report_burst) << "nothing may wait";
}

TEST_F(MonitoringRequests, TheStatusOfEachDefinitionIsReported) {
  ASSERT_EQ(send("monitor.disable", {"id=1"}), "");
  ASSERT_EQ(send("monitor.report_status"), "");
  std::size_t statuses = 0;
  for (const Report& report : reports_) {
    if (report.service != 12) continue;
    EXPECT_EQ(report.subtype, 14);
    const auto status = mission::MonitorStatus::decode(OctetView(report.data));
    ASSERT_TRUE(status);
    ++statuses;
    EXPECT_EQ(status->status == mission::FunctionStatus::enabled, status->id != 1) << status->id;
  }
  EXPECT_EQ(statuses, service_->monitoring().table().size());
}

// ---- functional monitors

/// Two monitors of the battery and a functional one of both.
class Functional : public MonitoringRequests {
 protected:
  Functional() {
    EXPECT_EQ(send("monitor.add", definition(7, {"low_event=none"})), "");
    EXPECT_EQ(send("monitor.add", {"id=8", "parameter=payload_eps.battery_temperature_k", "check=at_most",
                                   "high=300", "repetition=2", "hysteresis=5"}),
              "");
    EXPECT_EQ(send("monitor.enable", {"id=7,8"}), "");
  }
  static std::vector<std::string> functional(int id, std::string monitors = "7,8", int minimum = 2) {
    return {"id=" + std::to_string(id), "monitor=" + monitors, "minimum_failing=" + std::to_string(minimum),
            "event=monitor.functional_1"};
  }
  void watch(int minimum = 2, const std::vector<std::string>& more = {}) {
    auto arguments = functional(5, "7,8", minimum);
    arguments.insert(arguments.end(), more.begin(), more.end());
    ASSERT_EQ(send("functional_monitor.add", arguments), "");
    ASSERT_EQ(send("functional_monitor.enable", {"id=5"}), "");
  }
  /// @return events of functional monitors that failed
  std::vector<std::uint16_t> sample(float charge, float kelvin) {
    sample_.measurement.state_of_charge = charge;
    sample_.measurement.battery_temperature_k = kelvin;
    now_ = now_ + seconds(1);
    service_->monitoring().on_sample(sample_.structure_id, sample_.encoded(), day, now_);
    std::vector<std::uint16_t> events;
    for (const auto& failure : service_->monitoring().take_functional_failures())
      events.push_back(failure.event);
    return events;
  }
  FunctionalState state() { return service_->monitoring().functional_state(5); }
  FunctionalDefinition stored() { return service_->monitoring().functional_table().at(5); }

  PayloadEpsHousekeeping sample_;
};

using Events = std::vector<std::uint16_t>;

TEST_F(Functional, FailsOnceSoManyOfItsMonitorsAreOutOfLimitsAtTheSameTime) {
  watch();
  EXPECT_EQ(state(), FunctionalState::unchecked);
  EXPECT_EQ(sample(0.9F, 280), Events{});
  EXPECT_EQ(state(), FunctionalState::running);
  EXPECT_EQ(sample(0.4F, 280), Events{});
  EXPECT_EQ(sample(0.4F, 310), Events{}) << "not yet twice in a row";
  EXPECT_EQ(sample(0.4F, 310), Events{mission::event::monitor_functional_1});
  EXPECT_EQ(state(), FunctionalState::failed);
  EXPECT_EQ(sample(0.3F, 320), Events{}) << "it has failed already";
  sample(0.4F, 297);
  EXPECT_EQ(sample(0.4F, 297), Events{}) << "hysteresis of the monitor";
  EXPECT_EQ(state(), FunctionalState::failed);
  sample(0.4F, 290);
  sample(0.4F, 290);
  EXPECT_EQ(state(), FunctionalState::running);
  sample(0.4F, 310);
  EXPECT_EQ(sample(0.4F, 310), Events{mission::event::monitor_functional_1}) << "it fails anew";
}

TEST_F(Functional, OfOneAnyMonitorIsEnough) {
  watch(1);
  EXPECT_EQ(sample(0.4F, 280), Events{mission::event::monitor_functional_1});
}

TEST_F(Functional, IsInvalidWhileItsConditionDoesNotHold) {
  watch(1, {"condition=payload_eps.load_switches", "condition_mask=4", "condition_value=4"});
  sample_.measurement.load_switches = 0;
  EXPECT_EQ(sample(0.4F, 280), Events{});
  EXPECT_EQ(state(), FunctionalState::invalid);
  sample_.measurement.load_switches = 6;
  EXPECT_EQ(sample(0.4F, 280), Events{mission::event::monitor_functional_1});
  sample_.measurement.load_switches = 0;
  sample(0.4F, 280);
  EXPECT_EQ(state(), FunctionalState::invalid);
}

TEST_F(Functional, AMonitorWithoutAValueOrDisabledNeverCounts) {
  watch(1);
  EXPECT_EQ(sample(std::nanf(""), std::nanf("")), Events{});
  EXPECT_EQ(state(), FunctionalState::invalid);
  ASSERT_EQ(send("monitor.disable", {"id=7"}), "");
  sample(0.1F, 280);
  EXPECT_EQ(sample(0.1F, 280), Events{});
  EXPECT_EQ(state(), FunctionalState::running);
}

TEST_F(Functional, WithEitherFunctionOffNothingIsChecked) {
  watch(1);
  sample(0.4F, 280);
  ASSERT_EQ(send("functional_monitor.stop"), "");
  EXPECT_EQ(state(), FunctionalState::unchecked);
  EXPECT_EQ(sample(0.4F, 280), Events{});
  ASSERT_EQ(send("functional_monitor.start"), "");
  EXPECT_EQ(sample(0.4F, 280), Events{mission::event::monitor_functional_1});
  ASSERT_EQ(send("monitor.stop"), "");
  EXPECT_EQ(state(), FunctionalState::unchecked);
  EXPECT_EQ(sample(0.4F, 280), Events{});
}

TEST_F(Functional, AStaleMonitorCounts) {
  ASSERT_EQ(
      send("monitor.add", {"id=9", "parameter=payload_eps.state_of_charge", "check=stale", "repetition=3"}),
      "");
  ASSERT_EQ(send("monitor.enable", {"id=9"}), "");
  ASSERT_EQ(send("functional_monitor.add", functional(5, "9", 1)), "");
  ASSERT_EQ(send("functional_monitor.enable", {"id=5"}), "");
  sample(0.9F, 280);
  for (int i = 0; i < 60; ++i) {
    now_ = now_ + seconds(1);
    service_->monitoring().on_time(day, now_);
  }
  EXPECT_EQ(state(), FunctionalState::failed);
}

TEST_F(Functional, BadDefinitionsAreRefusedWithTheReason) {
  watch();
  EXPECT_EQ(send("functional_monitor.add", functional(5)), "monitor_exists");
  EXPECT_EQ(send("functional_monitor.add", functional(6, "7,999")), "unknown_identifier");
  EXPECT_EQ(send("functional_monitor.add", functional(6, "7,7")), "contradictory_limits");
  EXPECT_EQ(send("functional_monitor.add", functional(6, "7,8", 3)), "contradictory_limits");
  EXPECT_EQ(send("functional_monitor.add", {"id=6", "monitor=7", "event=monitor.user_1"}),
            "no_monitor_event");
  EXPECT_EQ(send("functional_monitor.add", {"id=6", "monitor=7", "condition=beacon.mode_reason"}),
            "not_monitorable");
  EXPECT_EQ(send("monitor.add", definition(10, {"low_event=monitor.functional"})), "no_monitor_event");
  for (const char* order : {"enable", "disable", "protect", "unprotect", "delete", "report"})
    EXPECT_EQ(send(std::string("functional_monitor.") + order, {"id=6"}), "unknown_identifier") << order;
  EXPECT_EQ(service_->monitoring().functional_table().size(), 1U);
}

TEST_F(Functional, AMonitorThatItHasCannotBeDeletedButChanged) {
  watch();
  ASSERT_EQ(send("monitor.disable", {"id=7"}), "");
  EXPECT_EQ(send("monitor.delete", {"id=7"}), "monitor_in_use");
  EXPECT_EQ(send("monitor.modify", definition(7, {"low=0.6"})), "");
  ASSERT_EQ(send("monitor.stop"), "");
  EXPECT_EQ(send("monitor.delete_all"), "monitor_in_use");
  EXPECT_EQ(send("functional_monitor.delete", {"id=5"}), "still_enabled");
  ASSERT_EQ(send("functional_monitor.disable", {"id=5"}), "");
  ASSERT_EQ(send("functional_monitor.delete", {"id=5"}), "");
  EXPECT_EQ(send("monitor.delete", {"id=7"}), "");
}

TEST_F(Functional, WhatIsProtectedCanBeNeitherDisabledNorChangedNorDeleted) {
  watch();
  ASSERT_EQ(send("functional_monitor.protect", {"id=5"}), "");
  EXPECT_EQ(send("functional_monitor.disable", {"id=5"}), "monitor_protected");
  EXPECT_EQ(send("functional_monitor.delete", {"id=5"}), "monitor_protected");
  EXPECT_EQ(send("monitor.disable", {"id=7"}), "monitor_protected");
  EXPECT_EQ(send("monitor.modify", definition(7)), "monitor_protected");
  EXPECT_EQ(send("monitor.delete", {"id=7"}), "monitor_protected");
  EXPECT_EQ(send("monitor.enable", {"id=7"}), "");
  ASSERT_EQ(send("functional_monitor.unprotect", {"id=5"}), "");
  EXPECT_EQ(send("functional_monitor.disable", {"id=5"}), "");
  ASSERT_EQ(send("functional_monitor.protect", {"id=5"}), "");
  EXPECT_EQ(send("monitor.restore"), "") << "the factory set comes back whatever is protected";
  EXPECT_TRUE(service_->monitoring().functional_table().empty());
}

TEST_F(Functional, OutlivesTheProcessAndBeginsUnchecked) {
  watch(1, {"condition=payload_eps.load_switches", "condition_mask=4", "condition_value=4"});
  ASSERT_EQ(send("functional_monitor.protect", {"id=5"}), "");
  ASSERT_EQ(send("functional_monitor.stop"), "");
  const FunctionalTable table = service_->monitoring().functional_table();
  restart({.table = disk_});
  EXPECT_EQ(service_->monitoring().functional_table(), table);
  EXPECT_FALSE(service_->monitoring().functional_enabled());
  EXPECT_TRUE(stored().enabled && stored().is_protected);
  EXPECT_EQ(state(), FunctionalState::unchecked);
}

TEST_F(Functional, ATableWithoutFunctionalMonitorsIsThatOfAnEarlierVersion) {
  const Octets before = disk_->content;
  watch();
  EXPECT_GT(disk_->content.size(), before.size());
  ASSERT_EQ(send("functional_monitor.disable", {"id=5"}), "");
  ASSERT_EQ(send("functional_monitor.delete", {"id=5"}), "");
  restart({.table = disk_});
  EXPECT_FALSE(service_->is_damaged());
  // Behind the ids of the requests that were applied, which are more.
  const std::size_t more = disk_->content.size() - before.size();
  EXPECT_EQ(more, 4 * sizeof(std::uint64_t));
}

TEST_F(Functional, ATableThatIsCutAnywhereIsDamagedOrHasNone) {
  watch();
  const StoredTable whole = *disk_;
  for (std::size_t cut = 1; cut < 40; ++cut) {
    StoredTable table = whole;
    table.content.resize(whole.content.size() - cut);
    restart({.table = table});
    EXPECT_TRUE(service_->is_damaged() || service_->monitoring().functional_table().empty()) << cut;
  }
}

TEST_F(Functional, RandomTablesAreNoHarm) {
  watch();
  const StoredTable whole = *disk_;
  std::mt19937_64 random(28);
  for (int turn = 0; turn < 500; ++turn) {
    StoredTable table = whole;
    for (int change = 0; change < 3; ++change) {
      const std::size_t behind = table.content.size() / 2;
      table.content[behind + random() % (table.content.size() - behind)] =
          static_cast<std::uint8_t>(random());
    }
    restart({.table = table});
    sample(0.4F, 310);
    EXPECT_LE(service_->monitoring().functional_table().size(), Monitoring::max_functional);
    EXPECT_EQ(send("monitor.restore"), "");
  }
}

TEST_F(Functional, OneThatNamesAMonitorThatIsGoneIsCountedAndUnchecked) {
  watch(1);
  MonitorTable table = service_->monitoring().table();
  table.erase(7);  // as another dictionary's factory set may do
  service_->monitoring().set_table(table);
  EXPECT_EQ(sample(0.1F, 320), Events{});
  EXPECT_EQ(sample(0.1F, 320), Events{});
  EXPECT_EQ(state(), FunctionalState::unchecked);
  mission::TtcMonitoringHousekeeping h;
  service_->fill(h);
  EXPECT_EQ(h.unresolved, 1U);
}

TEST_F(Functional, AFullTableOfBothTakesNoMoreAndFitsItsFile) {
  int id = 10'000;
  while (service_->monitoring().table().size() < Monitoring::max_definitions)
    ASSERT_EQ(send("monitor.add", definition(++id)), "");
  std::string monitors = "7,8";
  for (int more = 10'001; more < 10'015; ++more) monitors += "," + std::to_string(more);
  for (std::size_t i = 1; i <= Monitoring::max_functional; ++i)
    ASSERT_EQ(send("functional_monitor.add", functional(static_cast<int>(i), monitors)), "");
  EXPECT_EQ(send("functional_monitor.add", functional(1000)), "table_full");
  EXPECT_NE(send("functional_monitor.add", functional(1000, monitors + ",10020")), "") << "17 monitors";
  EXPECT_LT(encode_table(*disk_).size(), StateFile<StoredTable>::largest_octets);
  const FunctionalTable table = service_->monitoring().functional_table();
  restart({.table = disk_});
  EXPECT_EQ(service_->monitoring().functional_table(), table);
}

TEST_F(Functional, DefinitionAndStatusAreReported) {
  watch();
  ASSERT_EQ(send("functional_monitor.protect", {"id=5"}), "");
  sample(0.9F, 280);
  ASSERT_EQ(send("functional_monitor.report"), "");
  ASSERT_EQ(reports_.size(), 3U);
  EXPECT_EQ(reports_[1].subtype, 26);
  const auto report = mission::FunctionalMonitorDefinition::decode(OctetView(reports_[1].data));
  ASSERT_TRUE(report);
  EXPECT_EQ(report->id, 5);
  EXPECT_EQ(report->minimum_failing, 2);
  EXPECT_EQ(report->monitors, 2);
  EXPECT_EQ(report->monitor[0], 7);
  EXPECT_EQ(report->monitor[1], 8);
  EXPECT_EQ(report->monitor[2], 0);
  EXPECT_EQ(report->protection, mission::ProtectionStatus::protected_);
  ASSERT_EQ(send("functional_monitor.report_status"), "");
  ASSERT_EQ(reports_.size(), 3U);
  EXPECT_EQ(reports_[1].subtype, 28);
  const auto status = mission::FunctionalMonitorStatus::decode(OctetView(reports_[1].data));
  ASSERT_TRUE(status);
  EXPECT_EQ(status->status, mission::FunctionStatus::enabled);
  EXPECT_EQ(status->state, FunctionalState::running);
}

/// Against a model that knows nothing of how it is done: what fails, and when that is news.
TEST_F(Functional, WhateverComesItFailsWithItsMonitors) {
  std::mt19937_64 random(12);
  watch();
  FunctionalState before = FunctionalState::unchecked;
  for (int turn = 0; turn < 5000; ++turn) {
    const auto events = sample(random() % 2 == 0 ? 0.4F : 0.9F, random() % 2 == 0 ? 310.F : 280.F);
    const auto out = [&](std::uint16_t id) { return is_out_of_limits(service_->monitoring().state(id)); };
    EXPECT_EQ(state() == FunctionalState::failed, out(7) && out(8));
    EXPECT_EQ(events.size(),
              state() == FunctionalState::failed && before != FunctionalState::failed ? 1U : 0U);
    before = state();
  }
}

// ---- the table on disk

TEST(StoredTables, ACutOrChangedCopyIsDamagedAndTheOtherOneHolds) {
  const std::string whole = encode_table({.generation = 3, .content = {1, 2, 3}});
  ASSERT_EQ(decode_table(whole), (StoredTable{.generation = 3, .content = {1, 2, 3}}));
  for (std::size_t i = 0; i < whole.size(); ++i) {
    EXPECT_FALSE(decode_table(whole.substr(0, i)));
    std::string changed = whole;
    changed[i] = static_cast<char>(changed[i] ^ 0x10);
    EXPECT_FALSE(decode_table(changed));
  }
}

TEST(StoredTables, WhereverThePowerIsLostTheTableIsTheOldOrTheNewOne) {
  const testing_support::TemporaryFolder folder;
  const auto path = folder.path() / "monitors";
  const StoredTable old{.generation = 1, .content = {1}};
  const StoredTable next{.generation = 2, .content = {2, 2}};
  // Each copy is replaced at once or not at all; between the two, one is newer.
  for (const bool first_written : {false, true}) {
    ASSERT_TRUE(stored_table_file(path).store(old).durable());
    const bool written = !first_written || write_file_atomically(path.string() + ".0", encode_table(next));
    ASSERT_TRUE(written);
    EXPECT_EQ(stored_table_file(path).load().state, first_written ? next : old);
  }
  // A rotten copy of the newer one leaves the older.
  ASSERT_TRUE(write_file_atomically(path.string() + ".0", "rotten"));
  const auto found = stored_table_file(path).load();
  EXPECT_EQ(found.state, old);
  EXPECT_EQ(found.damaged.size(), 1U);
}

TEST(StoredTables, AnyContentIsReadWithoutHarm) {
  const auto& dictionary = testing_support::dictionary();
  std::mt19937 random(2);
  for (int i = 0; i < 300; ++i) {
    StoredTable table{.generation = 1, .content = Octets(random() % 300)};
    for (auto& octet : table.content) octet = static_cast<std::uint8_t>(random());
    if (table.content.size() > 3)
      std::copy_n(std::array<std::uint8_t, 3>{1, 0, 0}.begin(), 3, table.content.begin());
    ReportQueue report_queue;
    const MonitoringService service(dictionary, {.table = table}, report_queue);
    EXPECT_LE(service.monitoring().table().size(), Monitoring::max_definitions);
  }
}

}  // namespace
}  // namespace srfs
