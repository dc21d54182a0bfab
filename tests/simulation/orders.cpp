// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/orders.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <mission/structures.hpp>

#include "base/crc32c.hpp"
#include "tests/simulation/kernel.hpp"

namespace srfs::simulation {
namespace {

using mission::FieldType;
using Values = std::vector<std::string>;

/// The first and the last of what a reference can name.
template <class List, class Name>
Values ends_of(const List& list, Name name) {
  return {name(list.front()), name(list.back())};
}

Values ends_of_reference(const mission::Dictionary& dictionary, mission::Reference reference) {
  const auto name = [](const auto& entry) { return entry.name; };
  switch (reference) {
    case mission::Reference::structure:
      return {"beacon", "payload_eps"};
    case mission::Reference::event:
      return ends_of(dictionary.events(), name);
    case mission::Reference::event_or_none:
      return {"none", "monitor.user_8"};
    case mission::Reference::store:
      return ends_of(dictionary.stores(), name);
    case mission::Reference::parameter:
      return ends_of(dictionary.parameters(), name);
    case mission::Reference::failure_code:
      return ends_of(dictionary.failure_codes(), name);
    case mission::Reference::telemetry:
      return {"timing.cycle", "payload_eps.state_of_charge"};
    case mission::Reference::none:
      break;
  }
  return {};
}

Values ends_of_type(const mission::Field& argument) {
  switch (argument.type) {
    case FieldType::u8:
      return {"0", "255"};
    case FieldType::u16:
      return {"0", "65535"};
    case FieldType::u32:
      return {"0", "4294967295"};
    case FieldType::u64:
      return {"0", "18446744073709551615"};
    case FieldType::i8:
      return {"-128", "127"};
    case FieldType::i16:
      return {"-32768", "32767"};
    case FieldType::i32:
      return {"-2147483648", "2147483647"};
    case FieldType::i64:
      return {"-9223372036854775808", "9223372036854775807"};
    case FieldType::f32:
      return {"-3e38", "3e38"};
    case FieldType::f64:
      return {"-1e300", "1e300"};
    case FieldType::boolean:
      return {"false", "true"};
    case FieldType::time:
      return {"1980-01-06T00:00:00Z", "2093-12-31T00:00:00Z"};
    case FieldType::packet:
      return {std::string(mission::TtcSetMode::name) + " mode=safe"};
    case FieldType::text:
      return {"", std::string(argument.max_text, 'x')};
    case FieldType::parameter_value:
      break;
  }
  return {};
}

Values values_of(const mission::Dictionary& dictionary, const mission::Field& argument) {
  if (argument.type == FieldType::text && argument.name == "node") return dictionary.nodes();
  if (argument.enumeration != nullptr) {
    Values labels;
    for (const auto& [number, label] : argument.enumeration->labels) labels.push_back(label);
    return labels;
  }
  if (argument.range && argument.range->low && argument.range->high)
    return {fmt::format("{:.17g}", *argument.range->low), fmt::format("{:.17g}", *argument.range->high)};
  const Values named = ends_of_reference(dictionary, argument.reference);
  return named.empty() ? ends_of_type(argument) : named;
}

}  // namespace

std::string to_text(const Order& order) {
  return fmt::format("{} {}", order.command->name, fmt::join(order.arguments, " "));
}

std::vector<Order> all_orders(const mission::Dictionary& dictionary) {
  std::vector<Order> orders;
  for (const mission::Command& command : dictionary.commands()) {
    std::vector<Values> values;
    std::size_t most = 1;
    for (const mission::Field& argument : command.arguments) {
      values.push_back(values_of(dictionary, argument));
      most = std::max(most, values.back().size());
    }
    if (std::any_of(values.begin(), values.end(), [](const Values& v) { return v.empty(); })) continue;
    for (std::size_t number = 0; number < most; ++number) {
      Order order{.command = &command, .arguments = {}};
      for (std::size_t i = 0; i < values.size(); ++i)
        order.arguments.push_back(command.arguments[i].name + "=" + values[i][number % values[i].size()]);
      orders.push_back(std::move(order));
    }
  }
  return orders;
}

Order arming_of(const mission::Dictionary& dictionary, const Order& order) {
  const auto encoded = dictionary.encode(order.command->name, order.arguments);
  if (!encoded) throw Violation{"L8", "the dictionary refuses " + to_text(order)};
  return {.command = dictionary.command(mission::TtcArm::name),
          .arguments = {fmt::format("of_apid={}", order.command->apid),
                        fmt::format("of_service={}", order.command->service),
                        fmt::format("of_subtype={}", order.command->subtype),
                        fmt::format("digest={}", crc32c(encoded->data))}};
}

}  // namespace srfs::simulation
