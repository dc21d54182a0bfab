#include "ros/parameters.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <rcl_interfaces/msg/parameter_type.hpp>

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

std::string range_refusal(double value, const ParameterRange& range) {
  if (value >= range.lowest && value <= range.highest) return {};
  return fmt::format("{} is outside {}..{}", value, range.lowest, range.highest);
}

std::string range_refusal(const ParameterValue& value, const ParameterDeclaration& declaration) {
  if (!declaration.range) return {};
  const ParameterRange& range = *declaration.range;
  if (const auto* i = std::get_if<std::int64_t>(&value)) return range_refusal(static_cast<double>(*i), range);
  if (const auto* d = std::get_if<double>(&value)) return range_refusal(*d, range);
  if (const auto* list = std::get_if<std::vector<std::int64_t>>(&value)) {
    for (const auto item : *list) {
      if (auto why = range_refusal(static_cast<double>(item), range); !why.empty()) return why;
    }
  }
  if (const auto* list = std::get_if<std::vector<double>>(&value)) {
    for (const auto item : *list) {
      if (auto why = range_refusal(item, range); !why.empty()) return why;
    }
  }
  return {};
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
    if (const std::string why = range_refusal(*override_value, declaration); !why.empty()) {
      throw overrides_->bad(name, fmt::format("{} from {} to {}", expected, declaration.range->lowest,
                                              declaration.range->highest));
    }
    value = *override_value;
  }
  return entries_.insert_or_assign(name, Entry{std::move(declaration), std::move(value)}).first->second.value;
}

void ParameterSet::finish() const {
  if (overrides_) overrides_->finish();
}

std::string ParameterSet::refusal(const std::string& name, const ParameterValue& value) const {
  const auto found = entries_.find(name);
  if (found == entries_.end()) return fmt::format("parameter '{}' has not been declared", name);
  const ParameterDeclaration& declaration = found->second.declaration;
  if (declaration.read_only) return fmt::format("parameter '{}' is read-only", name);
  if (value.index() != declaration.default_value.index()) {
    return fmt::format("parameter '{}' is of type {}, not {}", name, type_text(declaration.default_value),
                       type_text(value));
  }
  if (const std::string why = range_refusal(value, declaration); !why.empty())
    return fmt::format("parameter '{}': {}", name, why);
  if (check_) {
    if (const auto checked = check_(name, value); !checked) return checked.error();
  }
  return {};
}

std::vector<std::string> ParameterSet::set_atomically(
    const std::vector<std::pair<std::string, ParameterValue>>& changes) {
  std::vector<std::string> refusals;
  bool all_fine = true;
  for (const auto& [name, value] : changes) {
    refusals.push_back(refusal(name, value));
    all_fine = all_fine && refusals.back().empty();
  }
  if (!all_fine) return refusals;
  for (const auto& [name, value] : changes) entries_.at(name).value = value;
  if (changed_) {
    for (const auto& change : changes) changed_(change.first);
  }
  return refusals;
}

const ParameterValue* ParameterSet::find(const std::string& name) const {
  const auto found = entries_.find(name);
  return found == entries_.end() ? nullptr : &found->second.value;
}

const ParameterDeclaration* ParameterSet::declaration(const std::string& name) const {
  const auto found = entries_.find(name);
  return found == entries_.end() ? nullptr : &found->second.declaration;
}

std::vector<std::string> ParameterSet::names() const {
  std::vector<std::string> all;
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
  if (declaration.range) {
    const bool integer = declaration.default_value.index() == 1 || declaration.default_value.index() == 5;
    if (integer) {
      d.integer_range.push_back({static_cast<std::int64_t>(declaration.range->lowest),
                                 static_cast<std::int64_t>(declaration.range->highest), 1});
    } else {
      d.floating_point_range.push_back({declaration.range->lowest, declaration.range->highest, 0.0});
    }
  }
  return d;
}

}  // namespace srfs::ros
