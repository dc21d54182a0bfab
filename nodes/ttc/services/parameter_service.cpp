// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/parameter_service.hpp"

#include <algorithm>

#include <mission/structures.hpp>

namespace srfs {
namespace {

constexpr std::uint8_t value_report = 2;
constexpr std::uint8_t set_values = 3;
constexpr std::size_t reason_octets = 120;

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts;
  std::size_t begin = 0;
  while (!text.empty() && begin <= text.size()) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

std::optional<std::string> join(const std::vector<std::string>& parts) {
  std::string text;
  for (const std::string& part : parts) {
    if (part.find(',') != std::string::npos) return std::nullopt;
    text += (&part == &parts.front() ? "" : ",") + part;
  }
  return text;
}

}  // namespace

std::optional<NodeValue> to_node(const mission::Parameter& parameter, const mission::Value& value) {
  if (const auto* text = std::get_if<std::string>(&value))
    return parameter.list ? NodeValue(split(*text)) : NodeValue(*text);
  if (const auto* truth = std::get_if<bool>(&value)) return NodeValue(*truth);
  if (const auto* number = std::get_if<double>(&value)) return NodeValue(*number);
  std::int64_t integer = 0;
  if (const auto* u = std::get_if<std::uint64_t>(&value)) {
    if (*u > static_cast<std::uint64_t>(INT64_MAX)) return std::nullopt;
    integer = static_cast<std::int64_t>(*u);
  } else if (const auto* i = std::get_if<std::int64_t>(&value)) {
    integer = *i;
  } else {
    return std::nullopt;
  }
  if (parameter.field.enumeration == nullptr) return NodeValue(integer);
  const auto label = parameter.field.enumeration->labels.find(integer);
  if (label == parameter.field.enumeration->labels.end()) return std::nullopt;
  return NodeValue(label->second);
}

std::optional<mission::Value> from_node(const mission::Parameter& parameter, const NodeValue& value) {
  const bool is_signed =
      parameter.field.type >= mission::FieldType::i8 && parameter.field.type <= mission::FieldType::i64;
  const auto integer = [&](std::int64_t number) -> std::optional<mission::Value> {
    if (is_signed) return mission::Value(number);
    if (number < 0) return std::nullopt;
    return mission::Value(static_cast<std::uint64_t>(number));
  };
  if (const auto* truth = std::get_if<bool>(&value)) return mission::Value(*truth);
  if (const auto* number = std::get_if<double>(&value)) return mission::Value(*number);
  if (const auto* number = std::get_if<std::int64_t>(&value)) {
    if (parameter.field.enumeration != nullptr) return std::nullopt;
    return integer(*number);
  }
  if (const auto* list = std::get_if<std::vector<std::string>>(&value)) {
    const auto text = parameter.list ? join(*list) : std::nullopt;
    return text ? std::optional<mission::Value>(*text) : std::nullopt;
  }
  const auto& text = std::get<std::string>(value);
  if (parameter.list) return std::nullopt;
  if (parameter.field.enumeration == nullptr) return mission::Value(text);
  for (const auto& [number, label] : parameter.field.enumeration->labels) {
    if (label == text) return integer(number);
  }
  return std::nullopt;
}

std::optional<std::deque<ParameterService::Item>> ParameterService::items_of(const mission::Command& command,
                                                                             OctetView arguments) const {
  OctetReader in(arguments);
  const unsigned count = in.u16();
  std::deque<Item> items;
  for (unsigned i = 0; i < count && in.ok(); ++i) {
    Item item{.parameter = dictionary_.parameter(in.u16()), .value = {}};
    if (item.parameter == nullptr) return std::nullopt;
    if (command.subtype == set_values) {
      const auto value = dictionary_.take_parameter(*item.parameter, in);
      if (value) item.value = to_node(*item.parameter, *value);
      if (!item.value) return std::nullopt;
    }
    items.push_back(std::move(item));
  }
  if (!in.ok() || items.empty()) return std::nullopt;
  return items;
}

void ParameterService::execute(const Telecommand& telecommand, MonotonicTime now) {
  const TelecommandOrigin& origin = telecommand.origin;
  auto items = items_of(*telecommand.command, telecommand.arguments);
  if (!items) {  // not what the dictionary has checked
    report_queue_.failure(origin, Stage::start, mission::failure::unknown_identifier);
    return;
  }
  if (requests_.size() == max_waiting) {
    report_queue_.failure(origin, Stage::start, mission::failure::busy);
    return;
  }
  requests_.push_back({.origin = origin,
                       .sets = telecommand.command->subtype == set_values,
                       .items = std::move(*items),
                       .expiry = now + telecommand.command->timeout,
                       .started = false,
                       .silent_nodes = {},
                       .failure = 0,
                       .failed_parameter = 0});
}

std::optional<ParameterCall> ParameterService::next_call(MonotonicTime now) {
  if (call_under_way_) return std::nullopt;
  while (!requests_.empty()) {
    Request& request = requests_.front();
    if (!request.started && now >= request.expiry) {
      report_queue_.failure(request.origin, Stage::start, mission::failure::expired);
      requests_.pop_front();
      continue;
    }
    begin(request);
    const Item& item = request.items.front();
    const bool silent = std::find(request.silent_nodes.begin(), request.silent_nodes.end(),
                                  item.parameter->node) != request.silent_nodes.end();
    if (silent) {
      end_item(mission::failure::parameter_node_silent);
      continue;
    }
    call_under_way_ = true;
    return ParameterCall{.number = ++number_,
                         .node = item.parameter->node,
                         .parameter = item.parameter->node_parameter,
                         .value = item.value};
  }
  return std::nullopt;
}

void ParameterService::begin(Request& request) {
  if (!std::exchange(request.started, true)) report_queue_.success(request.origin, Stage::start);
}

void ParameterService::on_value(std::uint64_t call, const NodeValue& value) {
  if (!is_under_way(call)) return;
  const Request& request = requests_.front();
  const mission::Parameter& parameter = *request.items.front().parameter;
  const auto raw = request.sets ? std::nullopt : from_node(parameter, value);
  OctetWriter data;
  data.u16(1);
  data.u16(parameter.id);
  if (!raw || !dictionary_.put_parameter(parameter, *raw, data))
    return end_item(mission::failure::parameter_mismatch);
  report_queue_.put(Report{.apid = apid_,
                           .service = ParameterService::service_type,
                           .subtype = value_report,
                           .destination_id = request.origin.source_id,
                           .data = data.take()});
  end_item(mission::failure::none);
}

void ParameterService::on_set(std::uint64_t call, const Result<void, std::string>& result) {
  if (!is_under_way(call)) return;
  if (result) return end_item(mission::failure::none);
  mission::ParameterRefusedEvent event;
  event.parameter = requests_.front().items.front().parameter->id;
  event.reason = result.error().substr(0, reason_octets);
  refused_.push_back(std::move(event));
  end_item(mission::failure::parameter_refused);
}

void ParameterService::on_error(std::uint64_t call, ParameterCallError error) {
  if (!is_under_way(call)) return;
  if (error == ParameterCallError::no_such_parameter) return end_item(mission::failure::parameter_mismatch);
  Request& request = requests_.front();
  request.silent_nodes.push_back(request.items.front().parameter->node);
  end_item(mission::failure::parameter_node_silent);
}

void ParameterService::end_item(std::uint16_t failure) {
  call_under_way_ = false;
  Request& request = requests_.front();
  if (failure != mission::failure::none && request.failure == mission::failure::none) {
    request.failure = failure;
    request.failed_parameter = request.items.front().parameter->id;
  }
  request.items.pop_front();
  const bool gives_up = request.sets && request.failure != mission::failure::none;
  if (request.items.empty() || gives_up) end_request();
}

void ParameterService::end_request() {
  const Request& request = requests_.front();
  if (request.failure == mission::failure::none) {
    report_queue_.success(request.origin, Stage::completion);
  } else {
    OctetWriter parameter;
    parameter.u16(request.failed_parameter);
    report_queue_.failure(request.origin, Stage::completion, request.failure, parameter.view());
  }
  requests_.pop_front();
}

}  // namespace srfs
