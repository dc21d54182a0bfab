// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/node_names.hpp"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

#include "base/excerpt.hpp"

namespace srfs::ros {
namespace {

constexpr std::size_t longest_name = 247;  // rmw: a DDS topic's 255 less its longest prefix and suffix
constexpr std::string_view topics_only = "rostopic://";
constexpr std::string_view services_only = "rosservice://";

bool take_prefix(std::string_view& text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return false;
  text.remove_prefix(prefix.size());
  return true;
}

bool is_part(std::string_view part) {
  const auto fits = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; };
  return !part.empty() && std::isdigit(static_cast<unsigned char>(part.front())) == 0 &&
         std::all_of(part.begin(), part.end(), fits);
}

bool names_the_node(std::string_view from) {
  return from == "__node" || from == "__name" || from == "__ns";
}

}  // namespace

std::string refusal_of_name(std::string_view name) {
  if (name.size() > longest_name) return fmt::format("longer than {} characters", longest_name);
  std::string_view rest = name;
  if (!take_prefix(rest, "~/")) take_prefix(rest, "/");
  for (;;) {
    const std::size_t end = rest.find('/');
    if (!is_part(rest.substr(0, end)))
      return fmt::format("'{}' is not a name: letters, digits and _ between single slashes", excerpt(name));
    if (end == std::string_view::npos) return {};
    rest.remove_prefix(end + 1);
  }
}

Result<RemapRule, std::string> parse_remap_rule(std::string_view text) {
  const std::size_t sign = text.find(":=");
  if (sign == std::string_view::npos) return Err(fmt::format("'{}': expected FROM:=TO", excerpt(text)));
  std::string_view from = text.substr(0, sign);
  RemapRule rule;
  rule.to = text.substr(sign + 2);
  // A ':' that does not belong to "rostopic://" ends the name of a node.
  if (const std::size_t colon = from.find(':');
      colon != std::string_view::npos && from.substr(colon, 3) != "://") {
    rule.node = from.substr(0, colon);
    if (!is_part(rule.node)) return Err(fmt::format("'{}' is not the name of a node", excerpt(rule.node)));
    from.remove_prefix(colon + 1);
  }
  if (take_prefix(from, topics_only)) {
    rule.of_services = false;
  } else if (take_prefix(from, services_only)) {
    rule.of_topics = false;
  }
  rule.from = from;
  if (from == "__ns") {
    const bool is_absolute = rule.to.starts_with('/');
    if (!is_absolute || (rule.to != "/" && !refusal_of_name(rule.to).empty()))
      return Err(fmt::format("'{}' is not a namespace: / or /NAME/NAME", excerpt(rule.to)));
    return rule;
  }
  if (names_the_node(from)) {
    if (!is_part(rule.to)) return Err(fmt::format("'{}' is not the name of a node", excerpt(rule.to)));
    return rule;
  }
  for (const std::string_view name : {from, std::string_view(rule.to)}) {
    if (const std::string refusal = refusal_of_name(name); !refusal.empty()) return Err(refusal);
  }
  return rule;
}

Result<CommandLine, std::string> read_command_line(int argc, const char* const* argv) {
  CommandLine line;
  bool of_ros = false;
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    if (argument == "--ros-args") {
      of_ros = true;
    } else if (!of_ros) {
      line.others.emplace_back(argument);
    } else if (argument == "--") {
      of_ros = false;
    } else if (argument == "-r" || argument == "--remap") {
      if (++i == argc) return Err(fmt::format("{}: expected FROM:=TO behind it", argument));
      auto rule = parse_remap_rule(argv[i]);
      if (!rule) return Err(rule.error());
      line.remap.push_back(std::move(*rule));
    } else {
      return Err(fmt::format("'{}' behind --ros-args is not supported; -r FROM:=TO is", excerpt(argument)));
    }
  }
  return line;
}

NodeNames::NodeNames(std::string name, std::string name_space, std::vector<RemapRule> rules)
    : name_(std::move(name)), name_space_(std::move(name_space)), rules_(std::move(rules)) {
  std::erase_if(rules_, [&](const RemapRule& r) { return !r.node.empty() && r.node != name_; });
  const auto first = [&](auto holds) { return std::find_if(rules_.begin(), rules_.end(), holds); };
  const auto space = first([](const RemapRule& r) { return r.from == "__ns"; });
  if (space != rules_.end()) name_space_ = space->to;
  const auto renamed = first([](const RemapRule& r) { return r.from == "__node" || r.from == "__name"; });
  if (renamed != rules_.end()) name_ = renamed->to;
  std::erase_if(rules_, [](const RemapRule& r) { return names_the_node(r.from); });
}

std::string NodeNames::full_name() const {
  return (name_space_ == "/" ? "/" : name_space_ + "/") + name_;
}

std::string NodeNames::expand(std::string_view name) const {
  if (name.starts_with('/')) return std::string(name);
  if (take_prefix(name, "~/")) return fmt::format("{}/{}", full_name(), name);
  return fmt::format("{}/{}", name_space_ == "/" ? "" : name_space_, name);
}

std::string NodeNames::resolve(std::string_view name, NameKind kind) const {
  const std::string expanded = expand(name);
  const auto matches = [&](const RemapRule& r) {
    return (kind == NameKind::topic ? r.of_topics : r.of_services) && expand(r.from) == expanded;
  };
  const auto rule = std::find_if(rules_.begin(), rules_.end(), matches);
  return rule == rules_.end() ? expanded : expand(rule->to);
}

}  // namespace srfs::ros
