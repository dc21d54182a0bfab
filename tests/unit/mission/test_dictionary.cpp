// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdlib>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mission/structures.hpp>

#include "base/config.hpp"
#include "msgs/mission/dictionary.hpp"
#include "tests/temporary_folder.hpp"
#include "wire/pus.hpp"

namespace srfs::mission {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const Dictionary& dictionary() {
  static const Dictionary loaded = Dictionary::load(std::string(SRFS_SOURCE_DIR) + "/mission");
  return loaded;
}

std::string refusal(std::string_view command, const std::vector<std::string>& arguments) {
  const auto encoded = dictionary().encode(command, arguments);
  return encoded ? "sent" : encoded.error().message;
}

std::string octets(std::string_view command, const std::vector<std::string>& arguments) {
  const auto encoded = dictionary().encode(command, arguments);
  return encoded ? to_hex(encoded->data) : encoded.error().message;
}

/// A dictionary with one file, in a folder that exists only during the test.
class DictionaryFile : public ::testing::Test {
 protected:
  std::string fault(const std::string& content) {
    std::ofstream(folder_ / "mission.yaml") << content;
    try {
      static_cast<void>(Dictionary::load(folder_));
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "accepted";
  }
  const testing_support::TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
};

TEST(Dictionary, AgreesWithTheGeneratedStructs) {
  const auto* eps = dictionary().structure(structure::payload_eps);
  ASSERT_NE(eps, nullptr);
  EXPECT_EQ(eps->name, "payload_eps");
  EXPECT_EQ(eps->max_size(), PayloadEpsHousekeeping::max_size);
  EXPECT_EQ(eps->apid, apid::payload_eps);
  EXPECT_EQ(dictionary().structure("beacon")->max_size(), Beacon::max_size);
  EXPECT_EQ(dictionary().structure("adcs_measurement")->max_size(), AdcsMeasurement::max_size);
  EXPECT_EQ(dictionary().spacecraft_id(), spacecraft_id);
  for (const auto& e : dictionary().events()) EXPECT_EQ(e.severity, event_severity(e.id)) << e.name;
  for (const auto& f : dictionary().failure_codes()) EXPECT_EQ(f.text, failure_text(f.code));
}

TEST(Dictionary, FindsCommandsByNameFunctionAndService) {
  const auto* by_name = dictionary().command("eps.switch_load");
  ASSERT_NE(by_name, nullptr);
  EXPECT_EQ(dictionary().function(apid::payload_eps, EpsSwitchLoad::function_id), by_name);
  EXPECT_EQ(by_name->peripheral_function, 1);
  EXPECT_EQ(by_name->repeat_class, RepeatClass::by_id);
  EXPECT_EQ(dictionary().request(apid::ttc, 17, 1), dictionary().command("ttc.ping"));
  EXPECT_EQ(dictionary().function(apid::payload_eps, 999), nullptr);
  EXPECT_EQ(dictionary().request(apid::payload_eps, 17, 1), nullptr);
  EXPECT_TRUE(dictionary().has_service(apid::payload_eps, 8));
  EXPECT_FALSE(dictionary().has_service(apid::payload_eps, 15));
}

TEST(Dictionary, KnowsWhereItStandsInTheSourceTree) {
  EXPECT_TRUE(std::filesystem::exists(Dictionary::default_folder() / "mission.yaml"));
}

TEST(CommandText, BecomesOctets) {
  EXPECT_EQ(octets("eps.switch_load", {"load=3", "state=on"}),
            "0001"
            "03"
            "01");
  EXPECT_EQ(octets("eps.switch_load", {"state=0", "load=0x2"}),
            "0001"
            "02"
            "00");
  EXPECT_EQ(octets("ttc.ping", {}), "");
  EXPECT_EQ(octets("housekeeping.set_interval", {"structure=payload_eps", "interval_ms=1000ms"}),
            "0001"
            "0011"
            "000003e8");
  EXPECT_EQ(octets("housekeeping.one_shot", {"structure=7"}).find("housekeeping.one_shot"), 0U);
  EXPECT_EQ(octets("events.disable", {"event=adcs.eclipse_entered"}),
            "0001"
            "0641");
  EXPECT_EQ(octets("storage.retrieve", {"from=2026-11-21T08:00:00Z", "to=2026-11-21T08:00:00.5Z"}),
            "0001"
            "0001"
            "1f8193ae25000000"
            "1f8193ae25800000");
  EXPECT_EQ(octets("thermal.set_setpoint", {"heater=1", "setpoint_k=290 K"}),
            "0002"
            "01"
            "43910000");
}

TEST(CommandText, UsesTheDefaultOfAnArgumentThatIsNotGiven) {
  EXPECT_EQ(octets("adcs.set_target_quaternion", {"z=1", "w=0"}),
            "0002"
            "00000000"
            "00000000"
            "3f800000"
            "00000000");
  EXPECT_EQ(octets("eps.power_cycle_peripheral", {}),
            "0011"
            "00c8");
}

TEST(CommandText, SaysReadablyWhatIsWrong) {
  EXPECT_EQ(refusal("eps.switch_load", {"load=7", "state=on"}),
            "eps.switch_load: argument 'load': 7 is out of range 0..3");
  EXPECT_EQ(refusal("eps.switch_load", {"load=-1", "state=on"}),
            "eps.switch_load: argument 'load': -1 is out of range 0..3");
  EXPECT_EQ(refusal("eps.switch_load", {"load=1", "state=dim"}),
            "eps.switch_load: argument 'state': 'dim' is not one of off (0), on (1)");
  EXPECT_EQ(refusal("eps.switch_load", {"load=1"}),
            "eps.switch_load: argument 'state' is missing (New state)");
  EXPECT_EQ(refusal("eps.switch_load", {"load=x", "state=on"}),
            "eps.switch_load: argument 'load': 'x' is not a whole number");
  EXPECT_THAT(refusal("eps.switch_load", {"lod=1"}), HasSubstr("has no argument 'lod', it has load, state"));
  EXPECT_THAT(refusal("eps.switch_load", {"load"}), HasSubstr("'load' is not key=value"));
  EXPECT_THAT(refusal("eps.switch_load", {"load=1", "load=2"}), HasSubstr("given twice"));
  EXPECT_THAT(refusal("eps.explode", {}), HasSubstr("no telecommand is called 'eps.explode'"));
  EXPECT_THAT(refusal("housekeeping.enable", {"structure=weather"}),
              HasSubstr("no housekeeping structure is called 'weather'"));
  EXPECT_THAT(refusal("housekeeping.enable", {"structure=999"}),
              HasSubstr("no housekeeping structure has the number 999"));
  EXPECT_THAT(refusal("housekeeping.enable", {"structure=eps_measurement"}),
              HasSubstr("is called 'eps_measurement'"));
  EXPECT_THAT(refusal("thermal.set_setpoint", {"heater=0", "setpoint_k=20C"}),
              HasSubstr("'20C' is not a number of K"));
  EXPECT_THAT(refusal("thermal.set_setpoint", {"heater=0", "setpoint_k=nan"}), HasSubstr("is not a number"));
  EXPECT_THAT(refusal("storage.retrieve", {"from=yesterday", "to=now"}), HasSubstr("is not a UTC time like"));
}

TEST(ArgumentCheck, AgreesWithTheGeneratedDecoders) {
  const auto check = [](const char* name, const Octets& arguments) {
    return dictionary().check_arguments(*dictionary().command(name), arguments);
  };
  EXPECT_TRUE(check("eps.switch_load", {3, 1}));
  EXPECT_EQ(check("eps.switch_load", {4, 1}).error(), ArgumentError{1});
  EXPECT_EQ(check("eps.switch_load", {3, 2}).error(), ArgumentError{2});
  EXPECT_EQ(check("eps.switch_load", {3}).error(), ArgumentError{0});
  EXPECT_EQ(check("eps.switch_load", {3, 1, 0}).error(), ArgumentError{0});
  EXPECT_EQ(check("eps.set_charge_limit", *from_hex("7fc00000")).error(), ArgumentError{1});
  EXPECT_TRUE(check("ttc.ping", {}));
  EXPECT_EQ(check("ttc.ping", {1}).error(), ArgumentError{0});
  EXPECT_TRUE(check("housekeeping.enable", *from_hex("000200100011")));
  EXPECT_EQ(check("housekeeping.enable", *from_hex("0002001003e7")).error(), ArgumentError{1});
  EXPECT_EQ(check("housekeeping.enable", *from_hex("0000")).error(), ArgumentError{0});
  EXPECT_EQ(check("storage.retrieve", *from_hex("00010001"
                                                "2f8193ae25000000"
                                                "1f8193ae25800000"))
                .error(),
            ArgumentError{2});
}

TEST(CommandText, HasAHeadBeforeTheGroupsAndMayHaveNoGroup) {
  const std::string from = "1f8193ae25000000";  // from the ground link's vectors
  EXPECT_EQ(octets("schedule.shift", {"offset_s=-2", "request_apid=17", "request_sequence=3"}),
            "fffffffe"
            "0001"
            "000000110003");
  EXPECT_EQ(octets("schedule.delete_group", {}), "0000");
  EXPECT_EQ(octets("schedule.delete_group", {"group_id=4"}), "000104");
  const std::string all = octets("schedule.delete_filter", {});
  EXPECT_EQ(all.substr(0, 2), "01");
  EXPECT_EQ(all.substr(34), "0000");
  EXPECT_EQ(octets("schedule.delete_filter", {"group_id=2"}), all.substr(0, 34) + "000102");
  EXPECT_THAT(refusal("schedule.shift", {"request_apid=17", "request_sequence=3"}), HasSubstr("offset_s"));

  const Command& shift = *dictionary().command("schedule.shift");
  const auto check = [&](const std::string& hex) {
    return dictionary().check_arguments(shift, *from_hex(hex));
  };
  EXPECT_TRUE(check("fffffffe0001000000110003"));
  EXPECT_EQ(check("fffffffe000100000fff0003").error(), ArgumentError{3}) << "counted from the head on";
  EXPECT_EQ(check("fffffffe0000").error(), ArgumentError{0}) << "no group";
  EXPECT_EQ(check("fffffffe00010000001100").error(), ArgumentError{0});
}

TEST(CommandText, TakesAWholePacketInHexadecimal) {
  const std::string packet = "1801c01600062f11010000ab62";  // 17,1 from the ground link's vectors
  EXPECT_EQ(octets("schedule.insert", {"release=2026-11-22T10:00:00Z", "request=" + packet}).substr(0, 6),
            "000100");
  for (const std::string& wrong : {packet.substr(2), packet + "00", std::string("18"), std::string("xy")})
    EXPECT_THAT(refusal("schedule.insert", {"release=2026-11-22T10:00:00Z", "request=" + wrong}),
                HasSubstr("not a whole packet"));
  const Command& insert = *dictionary().command("schedule.insert");
  const auto good =
      dictionary().encode("schedule.insert", {"release=2026-11-22T10:00:00Z", "request=" + packet});
  ASSERT_TRUE(good);
  EXPECT_TRUE(dictionary().check_arguments(insert, good->data));
  Octets cut = good->data;
  cut.pop_back();
  EXPECT_EQ(dictionary().check_arguments(insert, cut).error(), ArgumentError{0});
  Octets longer = good->data;
  longer[2 + 1 + 8 + 4] = 0x7F;  // a length beyond the packet's end
  EXPECT_EQ(dictionary().check_arguments(insert, longer).error(), ArgumentError{3});
}

TEST(CommandText, AListMakesAsManyGroups) {
  EXPECT_EQ(octets("monitor.enable", {"id=7"}), "00010007");
  EXPECT_EQ(octets("monitor.enable", {"id=7,8,0x9"}), "0003000700080009");
  EXPECT_EQ(octets("monitor.report", {}), "0000");
  EXPECT_EQ(octets("housekeeping.set_interval", {"structure=1,134", "interval_ms=1000"}),
            "00020001000003e80086000003e8");  // one value holds for all
  EXPECT_EQ(octets("functional_monitor.add", {"id=5", "monitor=7,8", "minimum_failing=2"}).substr(0, 8),
            "00010005");
  EXPECT_TRUE(octets("functional_monitor.add", {"id=5", "monitor=7,8", "minimum_failing=2"})
                  .ends_with("02000200070008"));
}

TEST(CommandText, AListThatFitsNoGroupsIsRefused) {
  EXPECT_THAT(refusal("housekeeping.set_interval", {"structure=1,134", "interval_ms=1000,2000,3000"}),
              HasSubstr("argument 'interval_ms' has 3 values, another one 2"));
  EXPECT_THAT(refusal("monitor.enable", {"id=1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17"}),
              HasSubstr("17 groups, at most 16"));
  EXPECT_THAT(refusal("monitor.enable", {"id=1,"}), HasSubstr("argument 'id'"));
  EXPECT_THAT(refusal("functional_monitor.add", {"id=5,6", "monitor=7"}), HasSubstr("argument 'id'"));
  EXPECT_THAT(refusal("eps.switch_load", {"load=1,2", "state=on"}), HasSubstr("argument 'load'"));
}

TEST(CommandText, TakesAPacketAsTheTelecommandItIs) {
  const auto added = dictionary().encode(
      "event_action.add", {"event=eps.battery_low", "request=eps.switch_load load=2 state=off"});
  ASSERT_TRUE(added) << added.error().message;
  EXPECT_TRUE(dictionary().check_arguments(*added->command, added->data));
  const auto packet = wire::parse_tc_packet(OctetView(added->data).subspan(6));
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->apid, apid::payload_eps);
  EXPECT_EQ(packet->application, dictionary().encode("eps.switch_load", {"load=2", "state=off"})->data);
  EXPECT_THAT(
      refusal("event_action.add", {"event=eps.battery_low", "request=eps.switch_load load=9 state=off"}),
      HasSubstr("nor a telecommand: eps.switch_load: argument 'load': 9 is out of range 0..3"));
}

TEST(Telemetry, ElementsHaveANameAndANumber) {
  const auto number = dictionary().telemetry("payload_eps.load_current_a[2]");
  ASSERT_TRUE(number);
  EXPECT_EQ(*number >> 16U, structure::payload_eps);
  EXPECT_EQ(dictionary().telemetry_name(*number), "payload_eps.load_current_a[2]");
  const auto element = dictionary().telemetry(*number);
  ASSERT_TRUE(element);
  EXPECT_EQ(element->field->name, "load_current_a");
  EXPECT_EQ(element->index, 2U);
  for (const char* unknown : {"payload_eps", "payload_eps.", "payload_eps.load_current_a", "moon.x", "",
                              "eps_measurement.state_of_charge"})
    EXPECT_FALSE(dictionary().telemetry(std::string_view(unknown))) << unknown;
  EXPECT_FALSE(dictionary().telemetry(*number | 0xFFFFU));
  EXPECT_FALSE(dictionary().telemetry(std::uint32_t{7}));
  EXPECT_EQ(octets("monitor.add", {"id=1", "parameter=payload_eps.load_current_a[2]", "check=at_most"})
                .substr(8, 8),
            fmt::format("{:08x}", *number));
}

TEST(Telemetry, ANumberIsCalibratedAndUnknownIsNone) {
  const Field& voltage = *dictionary().telemetry(*dictionary().telemetry("beacon.battery_voltage_v"))->field;
  const Octets known{0x1D, 0x4C};
  OctetReader in(known);
  EXPECT_NEAR(Dictionary::take_number(voltage, in).value_or(0), 7.5, 1e-9);
  EXPECT_FALSE(Dictionary::take_number(voltage, in)) << "no octets are left";
  const Octets unknown{0xFF, 0xFF};
  OctetReader none(unknown);
  EXPECT_FALSE(Dictionary::take_number(voltage, none));
}

TEST(StructureText, ShowsValuesWithUnitsAndLimits) {
  PayloadEpsHousekeeping housekeeping;
  housekeeping.measurement.battery_voltage_v = 6.5F;
  housekeeping.measurement.state_of_charge = 0.1F;
  housekeeping.measurement.battery_temperature_k = 290;
  housekeeping.measurement.load_switches = 0b1010;
  housekeeping.measurement.load_current_a[2] = 1.25F;
  housekeeping.time_to_empty_s = NAN;

  const auto fields = dictionary().decode(*dictionary().structure("payload_eps"), housekeeping.encoded());

  ASSERT_TRUE(fields);
  const auto field = [&](std::string_view name) -> const DecodedField& {
    for (const auto& f : *fields) {
      if (f.name == name) return f;
    }
    throw std::out_of_range(std::string(name));
  };
  EXPECT_EQ(field("battery_voltage_v").limit, LimitState::yellow);
  EXPECT_EQ(field("battery_voltage_v").unit, "V");
  EXPECT_EQ(field("state_of_charge").limit, LimitState::red);
  EXPECT_EQ(field("battery_temperature_k").limit, LimitState::green);
  EXPECT_EQ(field("load_switches").text, "0x0a");
  EXPECT_EQ(field("load_current_a[2]").text, "1.25");
  EXPECT_EQ(field("solar_current_a").limit, LimitState::none);
  EXPECT_EQ(field("time_to_empty_s").text, "unknown");
  EXPECT_FALSE(field("time_to_empty_s").known);
  EXPECT_EQ(field("time_to_empty_s").limit, LimitState::none);
}

TEST(StructureText, CalibratesAndNamesWhatTheBeaconCarries) {
  Beacon beacon;
  beacon.battery_charge = 20;
  beacon.battery_voltage_v = NAN;
  beacon.mode = MissionMode::nominal;
  beacon.mode_reason = "commanded";
  beacon.node_state[0] = LifecycleState::active;
  beacon.last_failure_code = failure::busy;
  const auto fields = dictionary().decode(*dictionary().structure("beacon"), beacon.encoded());
  ASSERT_TRUE(fields);
  std::map<std::string, DecodedField> by_name;
  for (const auto& f : *fields) by_name[f.name] = f;
  EXPECT_EQ(by_name["battery_charge"].text, "20");
  EXPECT_EQ(by_name["battery_charge"].limit, LimitState::yellow);
  EXPECT_EQ(by_name["battery_voltage_v"].text, "unknown");
  EXPECT_EQ(by_name["mode"].text, "nominal");
  EXPECT_EQ(by_name["mode_reason"].text, "commanded");
  EXPECT_EQ(by_name["node_state.ttc"].text, "active");
  EXPECT_EQ(by_name["last_failure_code"].text, "busy");
}

TEST(StructureText, JudgesATruthByItsLimits) {
  const Dictionary& d = dictionary();
  CanBusHousekeeping housekeeping;
  const auto flooded = [&] {
    const auto fields = d.decode(*d.structure("can_bus"), housekeeping.encoded());
    for (const auto& field : *fields) {
      if (field.name == "flooded") return field.limit;
    }
    return LimitState::none;
  };
  EXPECT_EQ(flooded(), LimitState::green);
  housekeeping.flooded = true;
  EXPECT_EQ(flooded(), LimitState::red);
}

TEST(StructureText, RefusesOctetsOfAnotherLength) {
  Octets octets = TimingHousekeeping{}.encoded();
  const auto* timing = dictionary().structure("timing");
  EXPECT_TRUE(dictionary().decode(*timing, octets));
  octets.push_back(0);
  EXPECT_FALSE(dictionary().decode(*timing, octets));
  EXPECT_FALSE(dictionary().decode(*timing, OctetView(octets).first(20)));
}

TEST(EventText, FillsInTheFields) {
  const auto* changed = dictionary().event("ttc.mode_changed");
  EXPECT_EQ(dictionary().render(*changed, TtcModeChangedEvent{MissionMode::safe, "command loss"}.encoded()),
            "mode safe: command loss");
  EXPECT_EQ(dictionary().render(*changed, Octets{1}), "mode nominal: ?");
  EXPECT_EQ(dictionary().render(*dictionary().event(event::adcs_eclipse_left), Octets{}), "eclipse left");
  EXPECT_EQ(dictionary().render(*dictionary().event(event::ttc_retrieval_done),
                                TtcRetrievalDoneEvent{2, 17, 900}.encoded()),
            "retrieval of store events sent 17 packets");
}

TEST_F(DictionaryFile, NamesFileLineAndKeyOfAFault) {
  const std::string head = "apids:\n  - { name: ttc, apid: 1, node: ttc }\n";
  EXPECT_THAT(
      fault(head + "structures:\n  - { name: a, id: 1, node: ttc, interval_ms: 1000, fields: [{ name: x, "
                   "type: u9 }] }\n"),
      AllOf(HasSubstr("mission.yaml:4"), HasSubstr("structures[0].fields[0].type"), HasSubstr("found 'u9'")));
  EXPECT_THAT(fault(head + "structures:\n  - { name: a, id: 1, node: moon, interval_ms: 1000 }\n"),
              HasSubstr("structures[0].node"));
  EXPECT_THAT(
      fault(head + "structures:\n  - { name: a, id: 1, node: ttc, interval_ms: 1000, colour: red }\n"),
      AllOf(HasSubstr("structures[0].colour"), HasSubstr("unknown key")));
  EXPECT_THAT(fault(head + "events:\n  - { name: e, id: 1, severity: awful, text: t }\n"),
              HasSubstr("events[0].severity"));
  EXPECT_THAT(fault(head + "colour: red\n"), HasSubstr("unknown key"));
  EXPECT_THAT(fault(head + "events:\n  - { name: e, id: 1, severity: low, text: t }\n  - { name: f, id: 1, "
                           "severity: low, text: t }\n"),
              HasSubstr("event id 1 stands twice"));
  EXPECT_THAT(fault("apids: ["), HasSubstr("not valid YAML"));
}

TEST_F(DictionaryFile, SaysThatThereIsNone) {
  std::filesystem::remove(folder_ / "mission.yaml");
  EXPECT_THROW(static_cast<void>(Dictionary::load(folder_)), ConfigError);
  EXPECT_THROW(static_cast<void>(Dictionary::load(folder_ / "nowhere")), ConfigError);
}

/// A mission of its own, with SRFS' part beside it.
class MissionFile : public DictionaryFile {
 protected:
  std::string fault(const std::string& more) {
    std::filesystem::create_directories(folder_ / "payload_x");
    std::ofstream(folder_ / "payload_x" / "dictionary.yaml")
        << "apids: [{ name: payload_x, apid: 300, node: payload_x }]\n"
           "structures:\n  - { name: payload_x, id: 2300, node: payload_x, interval_ms: 1000, fields: "
           "[{ name: cycle, type: u64 }, { name: charge, type: f32 }, { name: q, type: f32, count: 4 }, "
           "{ name: note, type: text, max: 8 }, { name: late, type: f32 }] }\n";
    return DictionaryFile::fault("include: [payload_x/dictionary.yaml]\nspacecraft: { name: X, id: 7 }\n" +
                                 more);
  }
};

TEST_F(MissionFile, IsReadWithThePartOfSrfsAndItsPayloadsHaveElementsAndParameters) {
  EXPECT_EQ(fault("payloads: [payload_x]\nbeacon: { battery_charge: { structure: payload_x, field: charge, "
                  "scale: 100 } }\nattitude: { structure: payload_x, field: q }\n"
                  "parameter_ids: { answer_timeout_ms: 2500 }\n"),
            "accepted");
  const Dictionary d = Dictionary::load(folder_);
  EXPECT_EQ(d.spacecraft_id(), 7);
  EXPECT_EQ(d.structure("payload_eps"), nullptr) << "another mission's";
  const std::vector<std::string> nodes{
      "ttc", "timing", "can_switcher", "image_acquisition", "image_processing", "maintenance", "payload_x"};
  EXPECT_EQ(d.nodes(), nodes);
  EXPECT_EQ(d.payloads(), std::vector<std::string>{"payload_x"});
  EXPECT_EQ(Dictionary::payloads_of(folder_), d.payloads());
  EXPECT_EQ(d.structure("beacon")->max_size(), Beacon::max_size - 2 * 4) << "nine nodes fly this mission";
  EXPECT_EQ(d.parameter("payload_x.answer_timeout_ms")->id, 2500);
  EXPECT_EQ(d.parameter("payload_x.log_level")->id, 7);

  CanSwitcherHousekeeping bus;
  for (auto* list : {&bus.grants, &bus.releases, &bus.failures, &bus.not_taken, &bus.unused}) list->resize(1);
  bus.grants[0] = 5;
  const auto fields = d.decode(*d.structure("can_switcher"), bus.encoded());
  ASSERT_TRUE(fields);
  EXPECT_EQ(fields->at(1).name, "grants") << "one element";
  EXPECT_EQ(fields->at(1).text, "5");

  ASSERT_EQ(d.beacon_sources().size(), 1U);
  EXPECT_EQ(d.beacon_sources()[0].value, "battery_charge");
  EXPECT_EQ(d.beacon_sources()[0].from.structure_id, 2300);
  EXPECT_EQ(d.beacon_sources()[0].from.offset, 8U);
  EXPECT_EQ(d.attitude()->node, "payload_x");
  EXPECT_EQ(d.attitude()->offset, 12U);
}

TEST_F(MissionFile, ListsMonitorsAndEventActionsThatTheDictionaryCanEncode) {
  const std::string good = "payloads: [payload_x]\n";
  const std::string monitor =
      "monitors: [{ id: 1, parameter: payload_x.charge, check: at_least, low: 0.2 }]\n";
  const std::string action = "event_actions: [{ event: node.error, request: ttc.set_mode mode=safe }]\n";
  ASSERT_EQ(fault(good + monitor + action), "accepted");
  const Dictionary d = Dictionary::load(folder_);
  ASSERT_EQ(d.monitors().size(), 1U);
  EXPECT_TRUE(d.encode("monitor.add", d.monitors().front()));
  ASSERT_EQ(d.event_actions().size(), 1U);
  EXPECT_TRUE(d.encode("event_action.add", d.event_actions().front()));
  EXPECT_THAT(fault(good + "monitors: [{ id: 1, parameter: moon.x, check: at_least }]\n"),
              HasSubstr("moon.x"));
  EXPECT_THAT(fault(good + "event_actions: [{ event: node.error, request: moon }]\n"),
              HasSubstr("no telecommand is called 'moon'"));
}

TEST_F(MissionFile, IsRefusedWithItsReason) {
  const std::string good = "payloads: [payload_x]\n";
  EXPECT_THAT(fault("payloads: [moon]\n"), HasSubstr("nodes of the list apids"));
  EXPECT_THAT(fault(""), HasSubstr("payloads in the mission's file"));
  EXPECT_THAT(fault(good + "beacon: { battery_charge: { structure: moon, field: x } }\n"),
              HasSubstr("structure"));
  EXPECT_THAT(fault(good + "beacon: { battery_charge: { structure: payload_x, field: q } }\n"),
              HasSubstr("1 x f32"));
  EXPECT_THAT(fault(good + "beacon: { battery_charge: { structure: payload_x, field: late } }\n"),
              HasSubstr("no text before"));
  EXPECT_THAT(fault(good + "attitude: { structure: payload_x, field: charge }\n"), HasSubstr("4 x f32"));
  EXPECT_THAT(fault(good + "beacon: { batery_charge: { structure: payload_x, field: charge } }\n"),
              HasSubstr("one of battery_voltage_v"));
  EXPECT_THAT(fault(good + "parameter_ids: { answer_timeout_ms: 65535 }\n"), HasSubstr("ids up to 65535"));
  EXPECT_THAT(fault(good + "colour: red\n"), HasSubstr("unknown key"));
  for (const char* elsewhere :
       {"payload_x.yaml", "../payload_x/dictionary.yaml", "a/payload_x/dictionary.yaml",
        "/payload_x/dictionary.yaml", "../dictionary.yaml"}) {
    EXPECT_THAT(DictionaryFile::fault("include: [" + std::string(elsewhere) + "]\n" + good),
                HasSubstr("FOLDER/dictionary.yaml"));
  }
}

TEST_F(DictionaryFile, AppliesAPolynomialCalibration) {
  std::ofstream(folder_ / "mission.yaml")
      << "apids:\n  - { name: ttc, apid: 1, node: ttc }\nstructures:\n"
         "  - { name: a, id: 1, node: ttc, interval_ms: 1000, fields: [{ name: x, type: i16, calibration: { "
         "polynomial: [1, 2, 0.5] } }] }\n";
  const Dictionary loaded = Dictionary::load(folder_);
  const auto fields = loaded.decode(*loaded.structure("a"), *from_hex("fffe"));
  ASSERT_TRUE(fields);
  EXPECT_DOUBLE_EQ(std::get<double>(fields->at(0).value), 1 - 4 + 2);
}

TEST(NodeParameters, HaveANumberANameAndTheTypeOfTheirValue) {
  const auto* handover = dictionary().parameter("can_switcher.early_handover");
  ASSERT_NE(handover, nullptr);
  EXPECT_EQ(handover->id, 112);
  EXPECT_EQ(handover->node, "can_switcher");
  EXPECT_EQ(handover->node_parameter, "early_handover");
  EXPECT_EQ(handover->field.type, FieldType::boolean);
  EXPECT_EQ(dictionary().parameter(112), handover);
  EXPECT_EQ(dictionary().parameter("payload_thermal.power_off_ms")->id,
            dictionary().parameter("payload_adcs.power_off_ms")->id + 2)
      << "ids count up over the nodes";
  EXPECT_EQ(dictionary().parameter("timing.gps_baud"), nullptr) << "for the next start only";
}

TEST(NodeParameters, ThatTouchLinkOrTickAreGuardedAsTheNodesKnowIt) {
  std::vector<std::string> guarded;
  for (const Parameter& parameter : dictionary().parameters()) {
    if (parameter.guarded) guarded.push_back(parameter.name);
  }
  std::vector<std::string> known;
  for (const GuardedParameter& parameter : node_tables.guarded_parameters)
    known.push_back(std::string(parameter.node) + "." + std::string(parameter.name));
  EXPECT_EQ(guarded, known);
  EXPECT_THAT(guarded, testing::UnorderedElementsAre("timing.tick_period_ms", "timing.late_tick_ms",
                                                     "ttc.beacon_period_ms", "ttc.repeat_window_ms",
                                                     "ttc.telecommand_lifetime_s"));
}

TEST(NodeParameters, AreWrittenInTheTypeOfTheParameterNamedBefore) {
  EXPECT_EQ(octets("parameters.set", {"parameter=can_switcher.early_handover", "value=true"}), "0001007001");
  EXPECT_EQ(octets("parameters.set", {"parameter=timing.late_tick_ms", "value=300ms"}), "00010065012c");
  EXPECT_EQ(octets("parameters.set", {"parameter=ttc.log_level", "value=warn"}), "0001000102");
  EXPECT_EQ(octets("parameters.set", {"parameter=can_switcher.rotation_order", "value=a,b"}),
            "0001006f03612c62");
  EXPECT_THAT(refusal("parameters.set", {"parameter=timing.leap_seconds", "value=61"}),
              HasSubstr("61 is out of range 30..60"));
  EXPECT_THAT(refusal("parameters.set", {"parameter=ttc.log_level", "value=loud"}), HasSubstr("debug (0)"));
  EXPECT_THAT(refusal("parameters.set", {"parameter=ttc.nothing", "value=1"}),
              HasSubstr("no node parameter is called 'ttc.nothing'"));
}

TEST(NodeParameters, AreCheckedOnBoardInTheTypeOfTheParameterNamedBefore) {
  const Command& set = *dictionary().command("parameters.set");
  const auto verdict = [&](const std::string& hex) {
    const auto checked = dictionary().check_arguments(set, *from_hex(hex));
    return checked ? -1 : static_cast<int>(checked.error().parameter);
  };
  EXPECT_EQ(verdict("0001007001"), -1);
  EXPECT_EQ(verdict("0001007002"), 2) << "no truth";
  EXPECT_EQ(verdict("00020070010065012c"), -1) << "two of different types";
  EXPECT_EQ(verdict("0002007001006501"), 0);
  EXPECT_EQ(verdict("000100700100"), 0);
  EXPECT_EQ(verdict("0001006600"), 2);
  EXPECT_EQ(verdict("000103e801"), 1) << "nobody has the parameter 1000";
  EXPECT_EQ(verdict("0000"), 0);
}

TEST(NodeParameters, AValueGoesThroughTheLinkUnchangedOrNotAtAll) {
  const auto through = [](const char* name, const Value& value) -> std::optional<Value> {
    const Parameter& parameter = *dictionary().parameter(name);
    OctetWriter out;
    if (!dictionary().put_parameter(parameter, value, out)) {
      EXPECT_EQ(out.size(), 0U);
      return std::nullopt;
    }
    OctetReader in(out.view());
    return dictionary().take_parameter(parameter, in);
  };
  EXPECT_EQ(through("can_switcher.early_handover", true), Value(true));
  EXPECT_EQ(through("timing.late_tick_ms", std::uint64_t{60000}), Value(std::uint64_t{60000}));
  EXPECT_EQ(through("timing.late_tick_ms", std::uint64_t{60001}), std::nullopt) << "out of its range";
  EXPECT_EQ(through("timing.late_tick_ms", std::uint64_t{65536 + 5}), std::nullopt);
  EXPECT_EQ(through("timing.late_tick_ms", std::string("5")), std::nullopt);
  EXPECT_EQ(through("can_switcher.rotation_order", std::string("a,b")), Value(std::string("a,b")));
  EXPECT_EQ(through("can_switcher.rotation_order", std::string(121, 'x')), std::nullopt);
}

TEST_F(DictionaryFile, AParameterNeedsANodeANumberOfItsOwnAndASendableType) {
  const std::string head =
      "spacecraft: { name: T, id: 1 }\napids: [{ name: a, apid: 1, node: a }, { name: b, apid: 2, node: b "
      "}]\n"
      "enums: { mission_mode: { labels: { safe: 0 } } }\nparameters:\n";
  EXPECT_EQ(fault(head + "  - { name: p, id: 1, nodes: [a, b], type: u8 }\n"), "accepted");
  EXPECT_THAT(fault(head + "  - { name: p, id: 1, node: c, type: u8 }\n"),
              HasSubstr("a node of the list apids"));
  EXPECT_THAT(
      fault(head +
            "  - { name: p, id: 1, nodes: [a, b], type: u8 }\n  - { name: q, id: 2, node: a, type: u8 }\n"),
      HasSubstr("parameter id 2 stands twice"));
  EXPECT_THAT(fault(head + "  - { name: p, id: 1, node: a, type: time }\n"),
              HasSubstr("a number, bool or text"));
  EXPECT_THAT(fault(head + "  - { name: p, id: 1, node: a, type: u8, list: true }\n"),
              HasSubstr("a list is a text"));
}

TEST(Reports, AreFoundByServiceAndSubtype) {
  const auto* attributes = dictionary().report(FileAttributes::service, FileAttributes::subtype);
  ASSERT_NE(attributes, nullptr);
  EXPECT_EQ(attributes->name, "file_attributes");
  EXPECT_EQ(attributes->max_size(), FileAttributes::max_size);
  EXPECT_EQ(dictionary().report(23, 5), nullptr);
  EXPECT_EQ(dictionary().report(3, 25), nullptr);
}

TEST(Reports, ThatAreSentOnRequestOnlyAreOrderedByATelecommand) {
  const auto ordered = [](const Structure& structure) {
    return std::any_of(dictionary().commands().begin(), dictionary().commands().end(),
                       [&](const auto& c) { return c.reports && c.reports->structure == structure.name; });
  };
  int found = 0;
  for (const Structure& structure : dictionary().structures()) {
    const bool on_request = structure.kind == StructureKind::report ||
                            structure.description.find("sent on request") != std::string::npos;
    if (!on_request || structure.description.ends_with("sent unasked")) continue;
    ++found;
    EXPECT_TRUE(ordered(structure)) << structure.name;
  }
  EXPECT_GE(found, 9);
}

TEST(Reports, OfATelecommandAreNamedByTheirPacket) {
  const auto& faults = dictionary().command("ring.report_faults")->reports;
  ASSERT_TRUE(faults);
  EXPECT_EQ(std::pair(faults->service, faults->subtype), housekeeping_report);
  EXPECT_EQ(faults->structure, "ring_fault");
  EXPECT_TRUE(faults->several && faults->may_be_none);
  const auto& status = dictionary().command("storage.status")->reports;
  ASSERT_TRUE(status);
  EXPECT_EQ(status->service, PacketStoreStatus::service);
  EXPECT_EQ(status->subtype, PacketStoreStatus::subtype);
  EXPECT_EQ(dictionary().command("housekeeping.one_shot")->reports->argument, "structure");
  EXPECT_EQ(dictionary().command("ttc.ping")->reports->service, 17);
  EXPECT_FALSE(dictionary().command("eps.switch_load")->reports);
}

TEST_F(DictionaryFile, ATelecommandOrdersReportsThatThereAre) {
  const std::string head =
      "apids:\n  - { name: a, apid: 1, node: a }\nenums:\n  mission_mode: { labels: { safe: 0 } }\n"
      "structures:\n  - { name: sent, id: 1, node: a, interval_ms: 100, fields: [] }\n"
      "  - { name: part, kind: group, fields: [] }\n"
      "commands:\n  - { name: c, node: a, function: 1, repeat: idempotent, reports: ";
  EXPECT_EQ(fault(head + "{ structure: sent } }\n"), "accepted");
  EXPECT_EQ(fault(head + "{ service: [17, 2], several: true } }\n"), "accepted");
  EXPECT_THAT(fault(head + "{ structure: part } }\n"), HasSubstr("a structure that is sent"));
  EXPECT_THAT(fault(head + "{ structure: other } }\n"), HasSubstr("a structure that is sent"));
  EXPECT_THAT(fault(head + "{ argument: x } }\n"), HasSubstr("names a structure"));
  EXPECT_THAT(fault(head + "{ service: [17] } }\n"), HasSubstr("[service, subtype]"));
  EXPECT_THAT(fault(head + "{ structure: sent, often: true } }\n"), HasSubstr("often"));
}

TEST(BoundsText, HasAllDigitsOfWholeNumbers) {
  EXPECT_EQ(to_text(Bounds{1, 4294967295}), "1 to 4294967295");
  EXPECT_EQ(to_text(Bounds{-273.15, 0.1}), "-273.15 to 0.1");
  EXPECT_EQ(to_text(Bounds{std::nullopt, 3}), "at most 3");
  EXPECT_EQ(to_text(Bounds{0.5, std::nullopt}), "at least 0.5");
}

// ---- unknown values

/// Octets of the fields: all elements of field @p index have the value @p raw, all other values are 0.
Octets octets_with(const std::vector<Field>& fields, std::size_t index, std::uint64_t raw) {
  OctetWriter out;
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const Field& field = fields[i];
    if (field.type == FieldType::time) {
      out.bytes(wire::encode_cuc(TaiTime(seconds(i == index ? raw : 1))));
    } else if (field.type == FieldType::text) {
      out.u8(0);
    } else {
      for (std::size_t n = 0; n < field.count; ++n)
        out.put(i == index ? raw : 0, field.max_size() / field.count);
    }
  }
  return out.take();
}

TEST(NotKnown, EveryFieldWithSuchAValueSaysSoAndIsJudgedByNoLimits) {
  std::vector<std::pair<std::string, std::vector<Field>>> all;
  for (const Structure& s : dictionary().structures()) all.emplace_back(s.name, s.fields);
  for (const Event& e : dictionary().events()) all.emplace_back(e.name, e.fields);
  int tried = 0;
  for (const auto& [owner, fields] : all) {
    for (std::size_t index = 0; index < fields.size(); ++index) {
      const Field& field = fields[index];
      if (!field.unknown) continue;
      ++tried;
      const auto raw = static_cast<std::uint64_t>(*field.unknown);
      const auto unknown = dictionary().decode(fields, octets_with(fields, index, raw));
      const auto known = dictionary().decode(fields, octets_with(fields, index, raw == 0 ? 1 : raw - 1));
      ASSERT_TRUE(unknown && known) << owner;
      int elements = 0;
      for (std::size_t i = 0; i < unknown->size(); ++i) {
        const DecodedField& told = (*unknown)[i];
        const std::string name = told.name.substr(0, told.name.find_first_of("[."));
        if (name != field.name) continue;
        ++elements;
        EXPECT_FALSE(told.known) << owner << "." << told.name;
        EXPECT_EQ(told.text, "unknown") << owner << "." << told.name;
        EXPECT_EQ(told.limit, LimitState::none) << owner << "." << told.name;
        EXPECT_TRUE((*known)[i].known) << owner << "." << told.name;
        EXPECT_NE((*known)[i].text, "unknown") << owner << "." << told.name;
      }
      EXPECT_EQ(elements, static_cast<int>(field.count)) << owner << "." << field.name;
    }
  }
  EXPECT_GE(tried, 25);
}

TEST(NotKnown, IsAValueOfTheDictionaryNotAWordInADescription) {
  for (const Structure& s : dictionary().structures()) {
    for (const Field& field : s.fields) {
      for (const char* sentinel :
           {"0: not known", "0: unknown", "4294967295", "18446744073709551615", "1970:"})
        EXPECT_EQ(field.description.find(sentinel), std::string::npos) << s.name << "." << field.name;
    }
  }
}

TEST(NotKnown, IsSaidInTheTextOfAnEvent) {
  UpdateInstalledEvent event;
  event.node = "payload_eps";
  event.version = 3;
  event.outage_ms = UINT32_MAX;
  EXPECT_THAT(dictionary().render(*dictionary().event("update.installed"), event.encoded()),
              HasSubstr("after an outage of unknown ms"));
}

TEST_F(DictionaryFile, OnlyAnIntegerOrATimeHasAValueForNotKnown) {
  const auto with = [&](const std::string& field) {
    return fault(
        "apids:\n  - { name: a, apid: 1, node: a }\nenums:\n  e: { labels: { one: 1 } }\nstructures:\n"
        "  - { name: s, id: 1, node: a, interval_ms: 100, fields: [{ name: f, " +
        field + " }] }\n");
  };
  for (const char* fine : {"type: u8, unknown: 255", "type: i16, unknown: -32768", "type: time, unknown: 0",
                           "type: u64, unknown: 18446744073709551615"})
    EXPECT_EQ(with(fine), "accepted") << fine;
  for (const char* bad :
       {"type: u8, unknown: 256", "type: u32, unknown: -1", "type: f32, unknown: 0", "type: bool, unknown: 1",
        "type: time, unknown: 1", "type: u8, enum: e, unknown: 1", "type: u64, unknown: -1"})
    EXPECT_THAT(with(bad), HasSubstr("unknown")) << bad;
}

// ---- fragments of added nodes

const std::string mission_folder = std::string(SRFS_SOURCE_DIR) + "/mission";

std::string fragment_text() {
  std::ifstream file(std::string(SRFS_SOURCE_DIR) + "/examples/payload_impact/dictionary.yaml");
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The error in the fragment after @p part is replaced with @p by.
std::string refused(const std::string& part, const std::string& by) {
  std::string text = fragment_text();
  const auto at = text.find(part);
  EXPECT_NE(at, std::string::npos) << part;
  text.replace(at, part.size(), by);
  try {
    (void)Dictionary::load(mission_folder, {{"changed", text}});
    return "it was taken";
  } catch (const ConfigError& e) {
    return e.what();
  }
}

TEST(Fragment, IsPartOfTheDictionary) {
  const Dictionary with = Dictionary::load(mission_folder, {{"impact", fragment_text()}});
  EXPECT_EQ(Fragment({"impact", fragment_text()}).node(), "payload_impact");
  ASSERT_NE(with.apid_of_node("payload_impact"), nullptr);
  EXPECT_TRUE(with.apid_of_node("payload_impact")->added);
  EXPECT_FALSE(with.apid_of_node("payload_eps")->added);
  ASSERT_NE(with.structure("payload_impact"), nullptr);
  EXPECT_EQ(with.structure("payload_impact")->apid, 19);
  EXPECT_NE(with.function(19, 1), nullptr);
  EXPECT_NE(with.event(1901), nullptr);
  EXPECT_EQ(with.structures().size(), dictionary().structures().size() + 3);
  EXPECT_TRUE(with.encode("impact.set_threshold", {"threshold_v=0.5"}));
}

TEST(Fragment, MayNotTakeWhatIsTakenNorWhatIsTheWholeSpacecrafts) {
  EXPECT_THAT(refused("apid: 19", "apid: 17"), HasSubstr("APID 17 stands twice"));
  EXPECT_THAT(refused("apid: 19", "apid: 2045"), HasSubstr("2039")) << "files go by it";
  EXPECT_THAT(refused("id: 1019", "id: 17"), HasSubstr("structure id 17 stands twice"));
  EXPECT_THAT(refused("name: impact_measurement", "name: eps_measurement"), HasSubstr("eps_measurement"));
  EXPECT_THAT(refused("id: 1901", "id: 1701"), HasSubstr("event id 1701"));
  EXPECT_THAT(refused("impact.clear", "impact.set_threshold"), HasSubstr("stands twice"));
  EXPECT_THAT(refused("apid: 19, node: payload_impact", "apid: 19, node: payload_eps"),
              HasSubstr("a node of the list apids"));
  EXPECT_THAT(refused("subsystem: payload_impact", "stores: [{ name: s, id: 9, quota_mib: 1 }]"),
              HasSubstr("stores"));
  EXPECT_THAT(refused("subsystem: payload_impact", "failure_codes: []"), HasSubstr("failure_codes"));
  EXPECT_THAT(refused("subsystem: payload_impact", "colour: red"), HasSubstr("colour"));
}

TEST(Fragment, IsAboutItsNodeAloneAndHasFunctionsOnly) {
  EXPECT_THAT(refused("    node: payload_impact\n    function: 1\n", "    node: ttc\n    function: 1\n"),
              HasSubstr("whose fragment this is"));
  EXPECT_THAT(refused("function: 1\n", "service: [20, 99]\n"), HasSubstr("a function"));
  EXPECT_THAT(refused("description: \"Impacts of dust and debris\" }",
                      "description: \"\" }\n  - { name: second, apid: 20, node: second }"),
              HasSubstr("one entry"));
  EXPECT_THAT(refused("{ structure: slot_statistics, as: slots }", "{ structure: no_such, as: slots }"),
              HasSubstr("structure"));
  EXPECT_FALSE(Fragment({"bad", "[1, 2"}).node());
}

TEST(Fragment, ThatDoesNotFitIsLeftOutAndTheOthersStay) {
  std::vector<RefusedFragment> refused;
  const Dictionary loaded = Dictionary::load_fitting(
      mission_folder, {{"broken", ": ["}, {"impact", fragment_text()}, {"again", fragment_text()}}, refused);
  EXPECT_NE(loaded.structure("payload_impact"), nullptr);
  ASSERT_EQ(refused.size(), 2U);
  EXPECT_EQ(refused[0].name, "broken");
  EXPECT_EQ(refused[1].name, "again");
}

TEST(Fragment, PointersIntoADictionaryHoldWhenItIsMoved) {
  Dictionary first = Dictionary::load(mission_folder);
  const Command* command = first.command("eps.switch_load");
  const Dictionary kept =
      std::exchange(first, Dictionary::load(mission_folder, {{"impact", fragment_text()}}));
  EXPECT_EQ(kept.command("eps.switch_load"), command);
  EXPECT_EQ(command->arguments[1].enumeration->labels.at(1), "on");
}

}  // namespace
}  // namespace srfs::mission
