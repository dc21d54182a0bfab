// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/command_line.hpp"

#include <array>
#include <filesystem>

#include <fmt/format.h>

#include "base/text.hpp"
#include "ground/files.hpp"

namespace srfs::ground {
namespace {

using Kind = CommandLine::Kind;

/// Lines that are one word, or two.
struct Fixed {
  std::string_view verb;
  std::string_view word;
  Kind kind;
};
constexpr std::array fixed_lines{Fixed{"ad", "on", Kind::ad_on},    Fixed{"ad", "off", Kind::ad_off},
                                 Fixed{"unlock", "", Kind::unlock}, Fixed{"clcw", "", Kind::clcw},
                                 Fixed{"files", "", Kind::files},   Fixed{"stats", "", Kind::stats},
                                 Fixed{"quit", "", Kind::quit}};

bool take_fixed(const std::string& verb, const Words& words, CommandLine& command) {
  for (const Fixed& line : fixed_lines) {
    const bool fits = line.word.empty() ? words.empty() : words.size() == 1 && words.front() == line.word;
    if (verb != line.verb || !fits) continue;
    command.kind = line.kind;
    return true;
  }
  return false;
}

bool take_telecommand(const std::string& verb, const Words& words, CommandLine& command) {
  command.kind = verb == "arm" ? Kind::arming : Kind::telecommand;
  if (verb == "ping" && words.empty()) {
    command.telecommand = {"ttc.ping", {}};
    return true;
  }
  if ((verb == "tc" || verb == "arm") && !words.empty()) {
    command.telecommand = {words.front(), {words.begin() + 1, words.end()}};
    return true;
  }
  if (verb != "retrieve" || (words.size() != 2 && words.size() != 3)) return false;
  const std::string store = words.size() == 3 ? words[2] : "housekeeping";
  command.telecommand = {"storage.retrieve", {"store=" + store, "from=" + words[0], "to=" + words[1]}};
  return true;
}

bool take_other(const std::string& verb, const Words& words, CommandLine& command) {
  if (verb == "setvr" && words.size() == 1) {
    const auto vr = to_number<std::uint8_t>(words.front());
    command.kind = Kind::set_vr;
    command.vr = vr.value_or(0);
    return vr.has_value();
  }
  if (verb == "put" && (words.size() == 1 || words.size() == 2)) {
    command.kind = Kind::put;
    command.file = words.front();
    command.name = words.size() == 2 ? words[1] : std::filesystem::path(words[0]).filename().string();
    return true;
  }
  const bool orders = verb == "suspend" || verb == "resume" || verb == "cancel";
  if (!orders || words.size() != 1) return false;
  const auto id = parse_transaction(words.front());
  if (!id) return false;
  command.kind = verb == "suspend" ? Kind::suspend : verb == "resume" ? Kind::resume : Kind::cancel;
  command.transfer = *id;
  return true;
}

}  // namespace

Result<CommandLine, std::string> parse_command_line(const std::string& line) {
  CommandLine command;
  Words words = words_of(line);
  const auto timeout = take_timeout(words);
  if (!timeout) return Err(timeout.error());
  const auto at = take_time_tag(words);
  if (!at) return Err(at.error());
  command.timeout = *timeout;
  command.at = *at;
  std::erase(words, "--wait");  // nothing blocks here; the stages come when they come
  if (words.empty() || words.front().starts_with('#')) return CommandLine{};
  const std::string verb = words.front();
  words.erase(words.begin());
  if (take_telecommand(verb, words, command) || take_fixed(verb, words, command) ||
      take_other(verb, words, command))
    return command;
  return Err(fmt::format("'{}': expected {}", line, command_line_forms));
}

}  // namespace srfs::ground
