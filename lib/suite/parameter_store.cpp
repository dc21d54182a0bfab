// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/parameter_store.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "base/crc32c.hpp"
#include "base/text.hpp"

namespace srfs::suite {
namespace {

constexpr int list_format = 1;
constexpr int history_format = 2;
constexpr std::string_view checksum_mark = "# crc32c ";

template <std::size_t... I>
std::optional<ros::ParameterValue> read_value(const std::string& type, const YAML::Node& node,
                                              std::index_sequence<I...>) {
  std::optional<ros::ParameterValue> value;
  const auto take = [&]<class T>(const T&) {
    if (!value && type == ros::type_text(ros::ParameterValue(T{}))) value = node.as<T>();
  };
  (take(std::variant_alternative_t<I, ros::ParameterValue>{}), ...);
  return value;
}

/// Throws YAML::Exception for an entry that is no such thing.
std::optional<ros::StoredParameter> read_entry(const YAML::Node& entry) {
  ros::StoredParameter p;
  p.name = entry["name"].as<std::string>();
  const auto value = read_value(entry["type"].as<std::string>(), entry["value"],
                                std::make_index_sequence<std::variant_size_v<ros::ParameterValue>>{});
  if (p.name.empty() || !value) return std::nullopt;
  p.value = *value;
  p.saved = entry["saved"].as<std::string>("");
  return p;
}

void write_value(YAML::Emitter& out, const ros::ParameterValue& value) {
  std::visit(
      [&]<class T>(const T& v) {
        if constexpr (std::is_same_v<T, std::string>) {
          out << YAML::DoubleQuoted << v;
        } else if constexpr (requires { v.begin(); }) {
          out << YAML::Flow << YAML::BeginSeq;
          for (const auto& item : v) write_value(out, ros::ParameterValue(typename T::value_type(item)));
          out << YAML::EndSeq;
        } else {
          out << v;
        }
      },
      value);
}

void write_values(YAML::Emitter& out, const std::vector<ros::StoredParameter>& values) {
  out << YAML::BeginSeq;
  for (const ros::StoredParameter& p : values) {
    out << YAML::Flow << YAML::BeginMap << YAML::Key << "name" << YAML::Value << YAML::DoubleQuoted << p.name
        << YAML::Key << "type" << YAML::Value << ros::type_text(p.value) << YAML::Key << "value"
        << YAML::Value;
    write_value(out, p.value);
    out << YAML::Key << "saved" << YAML::Value << YAML::DoubleQuoted << p.saved << YAML::EndMap;
  }
  out << YAML::EndSeq;
}

std::string checksum_line(std::string_view text) {
  return fmt::format("{}{:08x}\n", checksum_mark, crc32c(as_octets(text)));
}

bool has_its_checksum(const std::string& text) {
  const std::size_t line = text.rfind(checksum_mark);
  return line != std::string::npos && text.substr(line) == checksum_line(text.substr(0, line));
}

class FileReader {
 public:
  /// Throws YAML::Exception, or a reason as std::string.
  StoredFile read(const std::string& text) {
    const YAML::Node root = YAML::Load(text);
    if (!root.IsMap() || !root["format"]) throw std::string("not a parameter file");
    const int format = root["format"].as<int>();
    if (format == list_format) {
      read_list(root["parameters"]);
    } else if (format == history_format) {
      if (!has_its_checksum(text)) throw std::string("wrong checksum");
      read_history(root);
    } else {
      throw fmt::format("format {} instead of {}", format, history_format);
    }
    return std::move(file_);
  }

 private:
  static void check_list(const YAML::Node& list, std::size_t most) {
    if (!list || !list.IsSequence() || list.size() > most)
      throw fmt::format("expected a list of at most {} entries", most);
  }
  /// @param trial  takes those that are marked so, as earlier versions did
  std::vector<ros::StoredParameter> values_of(const YAML::Node& list,
                                              std::vector<ros::StoredParameter>* trial) {
    check_list(list, most_stored_parameters);
    std::vector<ros::StoredParameter> values;
    for (const YAML::Node& entry : list) {
      const int line = entry.Mark().line + 1;
      try {
        auto parameter = entry.IsMap() ? read_entry(entry) : std::nullopt;
        const bool on_trial = parameter && trial != nullptr && entry["trial"].as<bool>(false);
        if (parameter) {
          (on_trial ? *trial : values).push_back(std::move(*parameter));
        } else {
          file_.damaged.push_back(fmt::format("line {}: not a parameter", line));
        }
      } catch (const YAML::Exception& e) {
        file_.damaged.push_back(fmt::format("line {}: {}", line, e.msg));
      }
    }
    return values;
  }
  void read_list(const YAML::Node& list) {
    auto values = values_of(list, &file_.history.trial);
    const std::string saved = values.empty() ? "" : values.back().saved;
    file_.history.add(std::move(values), "a list of values", saved);
  }
  void read_history(const YAML::Node& root) {
    check_list(root["generations"], ParameterHistory::most_generations);
    for (const YAML::Node& entry : root["generations"]) {
      if (!entry.IsMap()) throw std::string("a generation is not a mapping");
      ParameterGeneration g{.number = entry["number"].as<std::uint32_t>(),
                            .saved = entry["saved"].as<std::string>(),
                            .origin = entry["origin"].as<std::string>(),
                            .values = values_of(entry["values"], nullptr)};
      const auto& before = file_.history.generations;
      if (g.number == 0 || (!before.empty() && g.number <= before.back().number))
        throw std::string("its generations are not in order");
      file_.history.generations.push_back(std::move(g));
    }
    file_.history.trial = values_of(root["trial"], nullptr);
  }

  StoredFile file_;
};

std::string render(const std::string& node, const ParameterHistory& history) {
  YAML::Emitter out;
  out.SetDoublePrecision(17);
  out << YAML::Comment("Kept parameters of /" + node + ": the last generation overrides the deployment file.")
      << YAML::BeginMap << YAML::Key << "format" << YAML::Value << history_format << YAML::Key
      << "generations" << YAML::Value << YAML::BeginSeq;
  for (const ParameterGeneration& g : history.generations) {
    out << YAML::BeginMap << YAML::Key << "number" << YAML::Value << g.number << YAML::Key << "saved"
        << YAML::Value << YAML::DoubleQuoted << g.saved << YAML::Key << "origin" << YAML::Value
        << YAML::DoubleQuoted << g.origin << YAML::Key << "values" << YAML::Value;
    write_values(out, g.values);
    out << YAML::EndMap;
  }
  out << YAML::EndSeq << YAML::Key << "trial" << YAML::Value;
  write_values(out, history.trial);
  out << YAML::EndMap;
  const std::string text = std::string(out.c_str()) + "\n";
  return text + checksum_line(text);
}

std::string value_text(const ros::ParameterValue& value) {
  return std::visit(
      []<class T>(const T& v) -> std::string {
        if constexpr (std::is_same_v<T, std::string>) {
          return v;
        } else if constexpr (requires { v.begin(); }) {
          std::string text;
          for (const auto& item : v) {
            text += (text.empty() ? "" : ",") + value_text(ros::ParameterValue(typename T::value_type(item)));
          }
          return "[" + text + "]";
        } else {
          return fmt::format("{}", v);
        }
      },
      value);
}

}  // namespace

const ParameterGeneration* ParameterHistory::find(std::uint32_t number) const {
  const auto found = std::find_if(generations.begin(), generations.end(),
                                  [&](const ParameterGeneration& g) { return g.number == number; });
  return found == generations.end() ? nullptr : &*found;
}

void ParameterHistory::add(std::vector<ros::StoredParameter> values, const std::string& origin,
                           const std::string& saved) {
  const std::vector<ros::StoredParameter> present = this->values();
  const bool same = std::equal(values.begin(), values.end(), present.begin(), present.end(),
                               [](const ros::StoredParameter& a, const ros::StoredParameter& b) {
                                 return a.name == b.name && a.value == b.value;
                               });
  if (same) return;
  const std::uint32_t number = generations.empty() ? 1 : generations.back().number + 1;
  generations.push_back({.number = number, .saved = saved, .origin = origin, .values = std::move(values)});
  if (generations.size() > most_generations) generations.pop_front();
}

Result<StoredFile, std::string> read_stored(const std::string& text) {
  try {
    return FileReader().read(text);
  } catch (const YAML::Exception& e) {
    return Err(std::string(e.what()));
  } catch (const std::string& why) {
    return Err(why);
  }
}

Result<std::string, std::string> write_stored(const std::string& node, ParameterHistory& history) {
  if (history.values().size() > most_stored_parameters || history.trial.size() > most_stored_parameters)
    return Err(fmt::format("more than {} stored parameters", most_stored_parameters));
  std::string text = render(node, history);
  while (text.size() > largest_parameter_file && history.generations.size() > 1) {
    history.generations.pop_front();
    text = render(node, history);
  }
  if (text.size() > largest_parameter_file)
    return Err(fmt::format("more than {} octets of stored parameters", largest_parameter_file));
  return text;
}

std::string write_list(const std::string& node, const std::vector<ros::StoredParameter>& values) {
  YAML::Emitter out;
  out.SetDoublePrecision(17);
  out << YAML::Comment("Parameters of /" + node + ".") << YAML::BeginMap << YAML::Key << "format"
      << YAML::Value << list_format << YAML::Key << "parameters" << YAML::Value;
  write_values(out, values);
  out << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

std::string to_text(const std::vector<ros::StoredParameter>& values) {
  std::string text;
  for (const ros::StoredParameter& p : values)
    text += fmt::format("{}{}={}", text.empty() ? "" : ", ", p.name, value_text(p.value));
  return text;
}

}  // namespace srfs::suite
