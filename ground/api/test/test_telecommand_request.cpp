// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/telecommand_request.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ground/api/api.hpp"
#include "ground/bounded_json.hpp"
#include "ground/dictionary_json.hpp"

namespace srfs::ground::api {
namespace {

using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;

const mission::Dictionary& dictionary() {
  static const auto loaded = mission::Dictionary::load(mission::Dictionary::default_folder());
  return loaded;
}

Result<TelecommandRequest, HttpResponse> read(const nlohmann::json& body) {
  return read_telecommand(body.dump(), dictionary());
}

int status_of(const nlohmann::json& body) {
  const auto order = read(body);
  return order ? 202 : order.error().status;
}

TEST(TelecommandRequest, TakesTextsAndNumbersAndLeavesOutWhatIsNull) {
  const auto order = read({{"name", "eps.switch_load"},
                           {"arguments", {{"load", 2}, {"state", "on"}}},
                           {"at", "+30s"},
                           {"ad", true}});
  ASSERT_TRUE(order) << order.error().body;
  EXPECT_THAT(order->arguments, UnorderedElementsAre("load=2", "state=on"));
  ASSERT_TRUE(order->at);
  EXPECT_TRUE(order->ad);
  EXPECT_EQ(order->encoded, dictionary().encode("eps.switch_load", {"load=2", "state=on"})->data);
}

TEST(TelecommandRequest, IsRefusedAsEncodeRefusesIt) {
  const auto order = read({{"name", "eps.switch_load"}, {"arguments", {{"load", 77}, {"state", "on"}}}});
  ASSERT_FALSE(order);
  EXPECT_EQ(order.error().status, 400);
  const auto reason = dictionary().encode("eps.switch_load", {"load=77", "state=on"}).error().message;
  EXPECT_EQ(nlohmann::json::parse(order.error().body)["error"], reason);
  EXPECT_THAT(read({{"name", "eps.swich_load"}}).error().body, HasSubstr("eps.switch_load"));
}

TEST(TelecommandRequest, OfAHazardousOneNeedsAnArmingAndItsNameTypedAgain) {
  const nlohmann::json plain{{"name", "eps.power_cycle_peripheral"}, {"arguments", {{"off_ms", 100}}}};
  const auto refused = read(plain);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().status, 409);
  EXPECT_EQ(nlohmann::json::parse(refused.error().body)["hazardous"], true);
  auto armed = plain;
  armed["arm"] = true;
  EXPECT_EQ(status_of(armed), 400);
  armed["confirm"] = "eps.power_cycle";
  EXPECT_EQ(status_of(armed), 400);
  armed["confirm"] = 1;
  EXPECT_EQ(status_of(armed), 400);
  armed["confirm"] = "eps.power_cycle_peripheral";
  EXPECT_EQ(status_of(armed), 202);
  auto check = plain;
  check["check"] = true;
  EXPECT_EQ(status_of(check), 202) << "encoding alone is harmless";
}

TEST(TelecommandRequest, OfAnyOtherFormIsRefused) {
  for (const char* body :
       {"", "[]", "{", "{}", R"({"name":1})", R"({"name":"ttc.ping","arguments":[]})",
        R"({"name":"ttc.ping","arguments":{"a":{}}})", R"({"name":"ttc.ping","at":"yesterday"})",
        R"({"name":"ttc.ping","at":5})", R"({"name":"ttc.ping","arm":"yes"})",
        R"({"name":"ttc.ping","ad":1})", R"({"name":"ttc.ping","arguments":{"a=b":"c"}})",
        R"({"name":"ttc.ping","arguments":{"x":1}})"}) {
    const auto order = read_telecommand(body, dictionary());
    ASSERT_FALSE(order) << body;
    EXPECT_EQ(order.error().status, 400) << body;
  }
  EXPECT_FALSE(read({{"name", "ttc.ping"}, {"arguments", {{"x", std::string(10'000, 'x')}}}}));
}

TEST(TelecommandRequest, ThatIsNestedDeeplyIsRefusedBeforeItIsBuilt) {
  const auto nested = [](int depth) {
    const auto levels = static_cast<std::size_t>(depth - 1);
    return R"({"name":"ttc.ping","x":)" + std::string(levels, '[') + std::string(levels, ']') + "}";
  };
  EXPECT_TRUE(read_telecommand(nested(json_depth_max), dictionary()));
  EXPECT_EQ(read_telecommand(nested(json_depth_max + 1), dictionary()).error().status, 400);
  EXPECT_EQ(read_telecommand(nested(30'000), dictionary()).error().status, 400);
  EXPECT_EQ(read_object(std::string(60'000, '[')).error().status, 400);
}

TEST(RowQuery, IsAPeriodAndABoundOrRefused) {
  const UtcTime now = *from_iso8601("2026-11-21T08:00:00Z");
  const auto query =
      read_row_query(*parse_target("/x?from=10m&to=2026-11-21T07:59:00Z&limit=7&before=9"), now);
  ASSERT_TRUE(query);
  EXPECT_EQ(query->period.from, now - seconds(600));
  EXPECT_EQ(query->period.to, now - seconds(60));
  EXPECT_EQ(query->most, 7U);
  EXPECT_EQ(query->before, 9);
  EXPECT_EQ(read_row_query(*parse_target("/x"), now)->most, RowQuery::rows_default);
  for (const char* text :
       {"/x?from=then", "/x?limit=0", "/x?limit=5001", "/x?limit=many", "/x?before=x", "/x?before=-1"})
    EXPECT_FALSE(read_row_query(*parse_target(text), now)) << text;
}

TEST(DictionaryAsJson, SaysAllOfTelecommandsStructuresAndEvents) {
  const auto json = to_json(dictionary());
  EXPECT_EQ(json["telecommands"].size(), dictionary().commands().size());
  EXPECT_EQ(json["events"].size(), dictionary().events().size());
  for (const auto& each : json["telecommands"]) {
    const auto* command = dictionary().command(each["name"].get<std::string>());
    ASSERT_NE(command, nullptr);
    EXPECT_EQ(each["hazardous"], command->hazardous);
    EXPECT_EQ(each["arguments"].size(), command->arguments.size());
    EXPECT_EQ(each["reports"].is_null(), !command->reports.has_value());
    for (std::size_t i = 0; i < command->arguments.size(); ++i) {
      const auto& field = command->arguments[i];
      const auto& argument = each["arguments"][i];
      EXPECT_EQ(argument.contains("default"), field.has_default);
      EXPECT_EQ(argument.contains("min"), field.range && field.range->low);
      if (field.enumeration != nullptr) {
        for (const auto& [value, label] : field.enumeration->labels)
          EXPECT_EQ(argument["enum"][label], value);
      }
    }
  }
}

TEST(DictionaryAsJson, NamesItsParametersAsDecodedValuesAreNamed) {
  const auto json = to_json(dictionary());
  for (const auto& each : json["structures"]) {
    const auto* structure = dictionary().structure(each["name"].get<std::string>());
    ASSERT_NE(structure, nullptr);
    if (structure->kind != mission::StructureKind::housekeeping) continue;
    const auto decoded = dictionary().decode(*structure, Octets(structure->max_size(), 0));
    if (!decoded) continue;  // texts: the longest is not what zeros say
    std::vector<std::string> names;
    for (const auto& field : *decoded) names.push_back(field.name);
    std::vector<std::string> described;
    for (const auto& parameter : each["parameters"])
      described.push_back(parameter["name"].get<std::string>());
    EXPECT_EQ(described, names) << structure->name;
  }
}

/// A good value of an argument, by what the dictionary's JSON says alone.
nlohmann::json value_of(const nlohmann::json& argument, const nlohmann::json& all) {
  const auto type = argument["type"].get<std::string>();
  if (argument.contains("default")) return nullptr;
  if (argument.contains("enum")) return argument["enum"].items().begin().key();
  if (argument.contains("reference")) {
    const auto of = argument["reference"].get<std::string>();
    if (of.starts_with("event")) return all["events"][0]["name"];
    if (of == "telemetry") {
      for (const auto& structure : all["structures"]) {
        for (const auto& parameter : structure["parameters"]) {
          if (structure["kind"] == "housekeeping" && parameter["type"] == "f32")
            return structure["name"].get<std::string>() + "." + parameter["name"].get<std::string>();
        }
      }
    }
    if (of == "structure") {
      for (const auto& structure : all["structures"]) {
        if (structure["kind"] == "housekeeping") return structure["name"];
      }
    }
    return all[of + "s"][0]["name"];
  }
  if (type == "bool") return true;
  if (type == "text") return "x";
  if (type == "time") return "2026-11-22T10:00:00Z";
  if (type == "packet") return "ttc.ping";
  if (type == "parameter_value") {
    const auto& parameter = all["parameters"][0];
    return value_of(parameter, all).is_null() ? nlohmann::json(parameter["default"])
                                              : value_of(parameter, all);
  }
  if (argument.contains("min")) return argument["min"];
  return argument.contains("max") ? argument["max"] : nlohmann::json(1);
}

TEST(TelecommandRequest, OfEachTelecommandFilledInFromTheJsonIsWhatEncodeMakesOfIt) {
  const auto all = to_json(dictionary());
  for (const auto& each : all["telecommands"]) {
    const auto name = each["name"].get<std::string>();
    nlohmann::json body{{"name", name}, {"arguments", nlohmann::json::object()}, {"check", true}};
    std::vector<std::string> written;
    for (const auto& argument : each["arguments"]) {
      const auto value = value_of(argument, all);
      const auto key = argument["name"].get<std::string>();
      body["arguments"][key] = value;
      if (value.is_null()) continue;
      written.push_back(key + "=" + (value.is_string() ? value.get<std::string>() : value.dump()));
    }
    const auto encoded = dictionary().encode(name, written);
    ASSERT_TRUE(encoded) << name << ": " << encoded.error().message;
    const auto order = read(body);
    ASSERT_TRUE(order) << name << ": " << order.error().body;
    EXPECT_EQ(order->encoded, encoded->data) << name;
  }
}

}  // namespace
}  // namespace srfs::ground::api
