// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/parameters.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <rcl_interfaces/msg/parameter_type.hpp>

#include "base/excerpt.hpp"

namespace srfs::ros {
namespace {

using Message = rcl_interfaces::msg::ParameterValue;

std::optional<ParameterValue> read_override(const YAML::Node& node, const ParameterValue& like) {
  try {
    return std::visit(
        [&](const auto& example) -> ParameterValue { return node.as<std::decay_t<decltype(example)>>(); },
        like);
  } catch (const YAML::Exception&) {
    return std::nullopt;
  }
}

/// As rclcpp: 100 units in the last place count as equal.
bool nearly(double a, double b) {
  return std::abs(a - b) <= 100 * std::numeric_limits<double>::epsilon() * std::max(std::abs(a), std::abs(b));
}

std::string range_refusal(double value, const ParameterRange& range) {
  if (!(value >= range.lowest && value <= range.highest))
    return fmt::format("{} is outside {}..{}", value, range.lowest, range.highest);
  if (range.step <= 0 || value == range.highest) return {};
  const double steps = std::round((value - range.lowest) / range.step);
  if (nearly(range.lowest + steps * range.step, value)) return {};
  return fmt::format("{} is not {} plus a multiple of {}", value, range.lowest, range.step);
}

std::string choice_refusal(const std::string& value, const std::vector<std::string>& choices) {
  if (std::find(choices.begin(), choices.end(), value) != choices.end()) return {};
  return fmt::format("'{}' is not one of {}", excerpt(value), fmt::join(choices, ", "));
}

template <class T, class Rule>
std::string first_refusal(const ParameterValue& value, const Rule& rule) {
  if (const auto* one = std::get_if<T>(&value)) return rule(*one);
  if (const auto* list = std::get_if<std::vector<T>>(&value)) {
    for (const T& item : *list) {
      if (auto why = rule(item); !why.empty()) return why;
    }
  }
  return {};
}

/// Why a value takes more memory than a parameter may; empty: it does not.
std::string size_refusal(const ParameterValue& value) {
  const std::size_t items = std::visit(
      []<class T>(const T& v) -> std::size_t {
        if constexpr (requires { v.size(); } && !std::is_same_v<T, std::string>) return v.size();
        return 0;
      },
      value);
  if (items > longest_parameter_list)
    return fmt::format("{} items are more than {}", items, longest_parameter_list);
  return first_refusal<std::string>(value, [](const std::string& text) {
    return text.size() <= longest_parameter_text
               ? std::string()
               : fmt::format("a text of {} octets is longer than {}", text.size(), longest_parameter_text);
  });
}

/// Why a value of the right type breaks the declaration's rules; empty: it does not.
std::string rule_refusal(const ParameterValue& value, const ParameterDeclaration& declaration) {
  std::string why = size_refusal(value);
  if (!why.empty()) return why;
  if (declaration.range) {
    const ParameterRange& range = *declaration.range;
    why = first_refusal<std::int64_t>(
        value, [&](std::int64_t i) { return range_refusal(static_cast<double>(i), range); });
    if (why.empty()) why = first_refusal<double>(value, [&](double d) { return range_refusal(d, range); });
  }
  if (why.empty() && !declaration.choices.empty()) {
    why = first_refusal<std::string>(
        value, [&](const std::string& s) { return choice_refusal(s, declaration.choices); });
  }
  return why;
}

}  // namespace

std::string type_text(const ParameterValue& value) {
  static constexpr std::array names{"bool",       "integer",       "double",       "string",
                                    "bool array", "integer array", "double array", "string array"};
  return names.at(value.index());
}

const ParameterValue& ParameterSet::declare(const std::string& name, ParameterDeclaration declaration) {
  ParameterValue value = declaration.default_value;
  if (overrides_ && overrides_->has(name)) {
    const auto override_value = read_override(overrides_->raw(name), declaration.default_value);
    const std::string expected = type_text(declaration.default_value);
    if (!override_value) throw overrides_->bad(name, expected);
    if (const std::string why = rule_refusal(*override_value, declaration); !why.empty()) {
      throw overrides_->bad(name, declaration.range
                                      ? fmt::format("{} from {} to {}", expected, declaration.range->lowest,
                                                    declaration.range->highest)
                                      : fmt::format("one of {}", fmt::join(declaration.choices, ", ")));
    }
    value = *override_value;
  }
  ParameterValue start = value;
  if (auto stored = stored_start(name, declaration)) value = std::move(*stored);
  return entries_.insert_or_assign(name, Entry{std::move(declaration), std::move(value), std::move(start)})
      .first->second.value;
}

void ParameterSet::set_stored(std::vector<StoredParameter> stored) {
  stored_ = std::move(stored);
}

void ParameterSet::put_aside(const std::string& name, std::string reason) {
  const auto found =
      std::find_if(stored_.begin(), stored_.end(), [&](const StoredParameter& s) { return s.name == name; });
  if (found == stored_.end()) return;
  set_aside_.push_back({std::move(*found), std::move(reason)});
  stored_.erase(found);
}

std::optional<ParameterValue> ParameterSet::stored_start(const std::string& name,
                                                         const ParameterDeclaration& declaration) {
  const auto found =
      std::find_if(stored_.begin(), stored_.end(), [&](const StoredParameter& s) { return s.name == name; });
  if (found == stored_.end()) return std::nullopt;
  std::string why;
  if (found->value.index() != declaration.default_value.index()) {
    why = fmt::format("it is of type {}, not {}", type_text(declaration.default_value),
                      type_text(found->value));
  } else {
    why = rule_refusal(found->value, declaration);
  }
  if (why.empty()) return found->value;
  put_aside(name, std::move(why));
  return std::nullopt;
}

void ParameterSet::finish() {
  if (overrides_) overrides_->finish();
  for (const StoredParameter& stored : std::vector<StoredParameter>(stored_)) {
    const auto entry = entries_.find(stored.name);
    if (entry == entries_.end()) {
      put_aside(stored.name, "no such parameter");
    } else if (check_) {
      const auto checked = check_(stored.name, stored.value);
      if (checked) continue;
      entry->second.value = entry->second.start;
      put_aside(stored.name, checked.error());
    }
  }
}

std::string ParameterSet::refusal(const std::string& name, const ParameterValue& value, For when) const {
  const auto found = entries_.find(name);
  if (found == entries_.end()) return fmt::format("parameter '{}' has not been declared", excerpt(name));
  const ParameterDeclaration& declaration = found->second.declaration;
  if (declaration.read_only && when == For::now) return fmt::format("parameter '{}' is read-only", name);
  if (value.index() != declaration.default_value.index()) {
    return fmt::format("parameter '{}' is of type {}, not {}", name, type_text(declaration.default_value),
                       type_text(value));
  }
  if (const std::string why = rule_refusal(value, declaration); !why.empty())
    return excerpt(fmt::format("parameter '{}': {}", name, why), longest_refusal);
  if (check_) {
    if (const auto checked = check_(name, value); !checked) return excerpt(checked.error(), longest_refusal);
  }
  return {};
}

const ParameterValue* ParameterSet::Proposal::find(const std::string& name) const {
  // The last of several changes of one parameter holds.
  const auto change = std::find_if(changes_.rbegin(), changes_.rend(),
                                   [&](const auto& entry) { return entry.first == name; });
  return change != changes_.rend() ? &change->second : set_.find(name);
}

std::vector<std::string> ParameterSet::set_atomically(
    const std::vector<std::pair<std::string, ParameterValue>>& changes) {
  std::vector<std::string> refusals;
  bool all_fine = true;
  for (const auto& [name, value] : changes) {
    refusals.push_back(refusal(name, value, For::now));
    all_fine = all_fine && refusals.back().empty();
  }
  if (all_fine && set_check_) {
    if (const auto checked = set_check_(Proposal(*this, changes)); !checked) {
      refusals.assign(changes.size(), excerpt(checked.error(), longest_refusal));
      all_fine = false;
    }
  }
  if (all_fine) apply(changes);
  return refusals;
}

void ParameterSet::put_back(const std::vector<std::pair<std::string, ParameterValue>>& values) {
  apply(values);
}

void ParameterSet::apply(const std::vector<std::pair<std::string, ParameterValue>>& changes) {
  for (const auto& [name, value] : changes) entries_.at(name).value = value;
  if (changed_) {
    for (const auto& change : changes) changed_(change.first);
  }
  if (applied_ && !changes.empty()) {
    std::vector<std::string> names;
    names.reserve(changes.size());
    for (const auto& change : changes) names.push_back(change.first);
    applied_(names);
  }
}

const ParameterValue* ParameterSet::find(const std::string& name) const {
  const auto found = entries_.find(name);
  return found == entries_.end() ? nullptr : &found->second.value;
}

const ParameterValue* ParameterSet::find_start(const std::string& name) const {
  const auto found = entries_.find(name);
  return found == entries_.end() ? nullptr : &found->second.start;
}

std::optional<ParameterDeclaration> ParameterSet::declaration(const std::string& name) const {
  const auto found = entries_.find(name);
  if (found == entries_.end()) return std::nullopt;
  ParameterDeclaration declaration = found->second.declaration;
  declaration.guarded = is_guarded(name);
  return declaration;
}

std::vector<std::string> ParameterSet::names() const {
  std::vector<std::string> all;
  all.reserve(entries_.size());
  for (const auto& entry : entries_) all.push_back(entry.first);
  return all;
}

Message to_message(const ParameterValue& value) {
  using Type = rcl_interfaces::msg::ParameterType;
  Message m;
  static constexpr std::array types{Type::PARAMETER_BOOL,         Type::PARAMETER_INTEGER,
                                    Type::PARAMETER_DOUBLE,       Type::PARAMETER_STRING,
                                    Type::PARAMETER_BOOL_ARRAY,   Type::PARAMETER_INTEGER_ARRAY,
                                    Type::PARAMETER_DOUBLE_ARRAY, Type::PARAMETER_STRING_ARRAY};
  m.type = types.at(value.index());
  switch (value.index()) {
    case 0:
      m.bool_value = std::get<0>(value);
      break;
    case 1:
      m.integer_value = std::get<1>(value);
      break;
    case 2:
      m.double_value = std::get<2>(value);
      break;
    case 3:
      m.string_value = std::get<3>(value);
      break;
    case 4:
      m.bool_array_value = std::get<4>(value);
      break;
    case 5:
      m.integer_array_value = std::get<5>(value);
      break;
    case 6:
      m.double_array_value = std::get<6>(value);
      break;
    default:
      m.string_array_value = std::get<7>(value);
      break;
  }
  return m;
}

std::optional<ParameterValue> from_message(const Message& m) {
  using Type = rcl_interfaces::msg::ParameterType;
  switch (m.type) {
    case Type::PARAMETER_BOOL:
      return m.bool_value;
    case Type::PARAMETER_INTEGER:
      return m.integer_value;
    case Type::PARAMETER_DOUBLE:
      return m.double_value;
    case Type::PARAMETER_STRING:
      return m.string_value;
    case Type::PARAMETER_BOOL_ARRAY:
      return m.bool_array_value;
    case Type::PARAMETER_INTEGER_ARRAY:
      return m.integer_array_value;
    case Type::PARAMETER_DOUBLE_ARRAY:
      return m.double_array_value;
    case Type::PARAMETER_STRING_ARRAY:
      return m.string_array_value;
    default:
      return std::nullopt;
  }
}

rcl_interfaces::msg::ListParametersResult list_parameter_names(const std::vector<std::string>& names,
                                                               const std::vector<std::string>& prefixes,
                                                               std::uint64_t depth) {
  const auto shallow = [depth](std::string_view below) {
    return depth == 0 || static_cast<std::uint64_t>(std::count(below.begin(), below.end(), '.')) < depth;
  };
  const auto wanted = [&](const std::string& name) {
    if (prefixes.empty()) return shallow(name);
    return std::any_of(prefixes.begin(), prefixes.end(), [&](const std::string& prefix) {
      return name == prefix ||
             (name.starts_with(prefix + ".") && shallow(std::string_view(name).substr(prefix.size() + 1)));
    });
  };
  rcl_interfaces::msg::ListParametersResult result;
  for (const std::string& name : names) {
    if (!wanted(name)) continue;
    result.names.push_back(name);
    const std::size_t last = name.rfind('.');
    if (last == std::string::npos) continue;
    const std::string prefix = name.substr(0, last);
    if (std::find(result.prefixes.begin(), result.prefixes.end(), prefix) == result.prefixes.end())
      result.prefixes.push_back(prefix);
  }
  return result;
}

rcl_interfaces::msg::ParameterDescriptor descriptor(const std::string& name,
                                                    const ParameterDeclaration& declaration) {
  rcl_interfaces::msg::ParameterDescriptor d;
  d.name = name;
  d.type = to_message(declaration.default_value).type;
  d.description = declaration.description;
  d.read_only = declaration.read_only;
  if (!declaration.choices.empty())
    d.additional_constraints = fmt::format("one of: {}", fmt::join(declaration.choices, ", "));
  if (declaration.guarded) {
    d.additional_constraints += d.additional_constraints.empty() ? "" : "; ";
    d.additional_constraints += "guarded: a change is on trial until it is confirmed";
  }
  if (declaration.range) {
    const bool integer = declaration.default_value.index() == 1 || declaration.default_value.index() == 5;
    if (integer) {
      d.integer_range.push_back({static_cast<std::int64_t>(declaration.range->lowest),
                                 static_cast<std::int64_t>(declaration.range->highest),
                                 static_cast<std::uint64_t>(std::max(declaration.range->step, 1.0))});
    } else {
      d.floating_point_range.push_back(
          {declaration.range->lowest, declaration.range->highest, declaration.range->step});
    }
  }
  return d;
}

}  // namespace srfs::ros
