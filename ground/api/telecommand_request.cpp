// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/telecommand_request.hpp"

#include <fmt/format.h>

#include "ground/bounded_json.hpp"
#include "ground/name_hint.hpp"

namespace srfs::ground::api {
namespace {

constexpr std::size_t argument_octets_max = 8192;

/// An argument's value as an operator would write it. nullopt: none that could be.
std::optional<std::string> argument_text(const nlohmann::json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return value.get<bool>() ? "true" : "false";
  if (value.is_number()) return value.dump();
  return std::nullopt;
}

std::optional<std::string> take_flag(const nlohmann::json& json, const char* name, bool& flag) {
  if (!json.contains(name) || json[name].is_null()) return std::nullopt;
  if (!json[name].is_boolean()) return fmt::format("'{}': expected true or false", name);
  flag = json[name].get<bool>();
  return std::nullopt;
}

/// Why the members beside the name are none.
std::optional<std::string> take_members(const nlohmann::json& json, TelecommandRequest& order) {
  std::size_t octets = 0;
  const auto arguments = json.value("arguments", nlohmann::json::object());
  if (!arguments.is_object()) return "'arguments': expected an object";
  for (const auto& [name, value] : arguments.items()) {
    if (value.is_null()) continue;  // its default
    const auto text = argument_text(value);
    if (!text || name.find('=') != std::string::npos)
      return fmt::format("argument '{}': expected a text, a number, true or false", name);
    order.arguments.push_back(name + "=" + *text);
    octets += order.arguments.back().size();
  }
  if (octets > argument_octets_max) return "the arguments are too long";
  if (json.contains("at") && !json["at"].is_null()) {
    if (json["at"].is_string()) order.at = parse_time_tag(json["at"].get<std::string>());
    if (!order.at) return "'at': expected " + std::string(time_tag_forms);
  }
  for (const auto& [name, flag] :
       {std::pair("arm", &order.arm), std::pair("ad", &order.ad), std::pair("check", &order.check)}) {
    if (const auto wrong = take_flag(json, name, *flag)) return wrong;
  }
  return std::nullopt;
}

}  // namespace

Result<nlohmann::json, HttpResponse> read_object(const std::string& body) {
  auto json = parse_bounded(body);
  if (!json.is_object())
    return Err(error_response(
        400, fmt::format("the body is no JSON object, or nested deeper than {}", json_depth_max)));
  return json;
}

Result<TelecommandRequest, HttpResponse> read_telecommand(const std::string& body,
                                                          const mission::Dictionary& dictionary) {
  auto json = read_object(body);
  if (!json) return Err(json.error());
  TelecommandRequest order;
  if (!json->contains("name") || !(*json)["name"].is_string())
    return Err(error_response(400, "'name': expected the name of a telecommand"));
  order.name = (*json)["name"].get<std::string>();
  const auto* command = dictionary.command(order.name);
  if (command == nullptr) {
    std::vector<std::string> known;
    for (const auto& each : dictionary.commands()) known.push_back(each.name);
    return Err(error_response(
        400, fmt::format("no telecommand is called '{}'{}", order.name, did_you_mean(order.name, known))));
  }
  if (const auto wrong = take_members(*json, order)) return Err(error_response(400, *wrong));
  auto encoded = dictionary.encode(order.name, order.arguments);
  if (!encoded) return Err(error_response(400, encoded.error().message));
  order.encoded = std::move(encoded->data);
  if (order.check || !command->hazardous) return order;
  if (!order.arm)
    return Err(json_response(
        409,
        {{"error", order.name + " is hazardous: it is sent with \"arm\": true and its name in \"confirm\""},
         {"hazardous", true}}));
  const auto& confirm = json->contains("confirm") ? (*json)["confirm"] : nlohmann::json();
  if (confirm != nlohmann::json(order.name))
    return Err(error_response(400, "'confirm': expected the name of the hazardous telecommand, typed again"));
  return order;
}

}  // namespace srfs::ground::api
