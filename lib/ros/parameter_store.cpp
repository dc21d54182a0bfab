#include "ros/parameter_store.hpp"

#include <optional>
#include <utility>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

namespace srfs::ros {
namespace {

constexpr int format_number = 1;

template <std::size_t... I>
std::optional<ParameterValue> read_value(const std::string& type, const YAML::Node& node,
                                         std::index_sequence<I...>) {
  std::optional<ParameterValue> value;
  const auto take = [&]<class T>(const T&) {
    if (!value && type == type_text(ParameterValue(T{}))) value = node.as<T>();
  };
  (take(std::variant_alternative_t<I, ParameterValue>{}), ...);
  return value;
}

/// Throws YAML::Exception for an entry that is no such thing.
std::optional<StoredParameter> read_entry(const YAML::Node& entry) {
  StoredParameter p;
  p.name = entry["name"].as<std::string>();
  const auto value = read_value(entry["type"].as<std::string>(), entry["value"],
                                std::make_index_sequence<std::variant_size_v<ParameterValue>>{});
  if (p.name.empty() || !value) return std::nullopt;
  p.value = *value;
  p.trial = entry["trial"].as<bool>();
  p.saved = entry["saved"].as<std::string>("");
  return p;
}

void write_value(YAML::Emitter& out, const ParameterValue& value) {
  std::visit(
      [&]<class T>(const T& v) {
        if constexpr (std::is_same_v<T, std::string>) {
          out << YAML::DoubleQuoted << v;
        } else if constexpr (requires { v.begin(); }) {
          out << YAML::Flow << YAML::BeginSeq;
          for (const auto& item : v) write_value(out, ParameterValue(typename T::value_type(item)));
          out << YAML::EndSeq;
        } else {
          out << v;
        }
      },
      value);
}

}  // namespace

Result<StoredFile, std::string> read_stored(const std::string& text) {
  StoredFile file;
  try {
    const YAML::Node root = YAML::Load(text);
    if (!root.IsMap() || !root["format"] || !root["parameters"])
      return Err(std::string("not a file of parameters"));
    if (root["format"].as<int>() != format_number)
      return Err(fmt::format("format {} instead of {}", root["format"].as<std::string>(), format_number));
    const YAML::Node list = root["parameters"];
    if (!list.IsSequence() || list.size() > most_stored_parameters)
      return Err(fmt::format("expected a list of at most {} parameters", most_stored_parameters));
    for (const YAML::Node& entry : list) {
      const int line = entry.Mark().line + 1;
      try {
        if (auto parameter = entry.IsMap() ? read_entry(entry) : std::nullopt) {
          file.parameters.push_back(std::move(*parameter));
        } else {
          file.damaged.push_back(fmt::format("line {}: not a parameter", line));
        }
      } catch (const YAML::Exception& e) {
        file.damaged.push_back(fmt::format("line {}: {}", line, e.msg));
      }
    }
  } catch (const YAML::Exception& e) {
    return Err(std::string(e.what()));
  }
  return file;
}

std::string write_stored(const std::string& node, const std::vector<StoredParameter>& parameters) {
  YAML::Emitter out;
  out.SetDoublePrecision(17);
  out << YAML::Comment("Stored parameters of /" + node + ". They go over those of the deployment file.")
      << YAML::BeginMap << YAML::Key << "format" << YAML::Value << format_number << YAML::Key << "parameters"
      << YAML::Value << YAML::BeginSeq;
  for (const StoredParameter& p : parameters) {
    out << YAML::Flow << YAML::BeginMap << YAML::Key << "name" << YAML::Value << YAML::DoubleQuoted << p.name
        << YAML::Key << "type" << YAML::Value << type_text(p.value) << YAML::Key << "value" << YAML::Value;
    write_value(out, p.value);
    out << YAML::Key << "trial" << YAML::Value << p.trial << YAML::Key << "saved" << YAML::Value
        << YAML::DoubleQuoted << p.saved << YAML::EndMap;
  }
  out << YAML::EndSeq << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

}  // namespace srfs::ros
