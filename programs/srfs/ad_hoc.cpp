// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/ad_hoc.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

namespace srfs::tool {
namespace {

std::string emitted(const YAML::Node& node) {
  YAML::Emitter out;
  out << YAML::Flow << node;
  return out.c_str();
}

/// Lists are values; mappings are names. Depth is that of the file, which yaml-cpp bounds.
void flatten(const YAML::Node& node, const std::string& prefix, std::vector<GivenParameter>& found) {
  for (const auto& entry : node) {
    const std::string name = prefix + entry.first.as<std::string>();
    if (entry.second.IsMap()) {
      flatten(entry.second, name + ".", found);
    } else {
      found.push_back({name, emitted(entry.second)});
    }
  }
}

Result<GivenParameter, std::string> parse_parameter(const std::string& text) {
  const std::size_t sign = text.find(":=");
  if (sign == std::string::npos || sign == 0)
    return Err(fmt::format("-p {}: expected NAME:=VALUE behind -p", text));
  return GivenParameter{text.substr(0, sign), text.substr(sign + 2)};
}

}  // namespace

Result<AdHocArguments, std::string> read_ad_hoc_arguments(const std::vector<std::string>& arguments) {
  AdHocArguments read;
  bool of_ros = false;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& argument = arguments[i];
    of_ros = argument == "--ros-args" || (of_ros && argument != "--");
    const bool is_parameter = of_ros && (argument == "-p" || argument == "--param");
    const bool is_file = of_ros && argument == "--params-file";
    if (!is_parameter && !is_file) {
      read.others.push_back(argument);
      continue;
    }
    if (++i == arguments.size()) return Err(argument + ": expected a value behind it");
    if (is_file) {
      read.files.push_back(arguments[i]);
      continue;
    }
    auto parameter = parse_parameter(arguments[i]);
    if (!parameter) return Err(parameter.error());
    read.parameters.push_back(std::move(*parameter));
  }
  return read;
}

Result<std::vector<GivenParameter>, std::string> parameters_of_file(const std::string& text,
                                                                    std::string_view node) {
  std::vector<GivenParameter> found;
  try {
    const YAML::Node file = YAML::Load(text);
    if (!file.IsMap()) return Err(std::string("expected names of nodes"));
    for (const auto& entry : file) {
      std::string_view name = entry.first.Scalar();
      if (name.starts_with('/')) name.remove_prefix(1);
      if (name != "**" && name != node) continue;
      const YAML::Node parameters = entry.second["ros__parameters"];
      if (!parameters || !parameters.IsMap())
        return Err(fmt::format("{}: expected ros__parameters, a mapping", entry.first.Scalar()));
      flatten(parameters, "", found);
    }
  } catch (const YAML::Exception& error) {
    return Err(std::string(error.what()));
  }
  return found;
}

std::string node_name_of(std::string_view program) {
  constexpr std::string_view end = "_node";
  program.remove_prefix(program.rfind('/') + 1);  // npos + 1 is 0
  if (program.ends_with(end)) program.remove_suffix(end.size());
  return std::string(program);
}

Result<std::string, std::string> ad_hoc_deployment(const std::string& node, const std::string& program,
                                                   const std::vector<GivenParameter>& parameters) {
  YAML::Node entry;
  entry["name"] = node;
  entry["executable"] = program;
  for (const GivenParameter& parameter : parameters) {
    try {
      entry["parameters"][parameter.name] = YAML::Load(parameter.value);
    } catch (const YAML::Exception& error) {
      return Err(fmt::format("parameter {}: {}", parameter.name, error.what()));
    }
  }
  YAML::Node file;
  file["deployment"] = "ad_hoc";
  file["dds"]["orders"] = "open";
  file["nodes"].push_back(entry);
  return fmt::format("# Written by `srfs run`.\n{}\n", YAML::Dump(file));
}

}  // namespace srfs::tool
