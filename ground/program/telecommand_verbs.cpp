// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/program/verbs.hpp"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <iostream>

#include <fmt/format.h>
#include <unistd.h>

#include "base/file.hpp"
#include "ground/dictionary_json.hpp"
#include "ground/name_hint.hpp"

namespace srfs::ground::program {
namespace {

Result<std::vector<ScriptStep>, std::string> load_script(const mission::Dictionary& dictionary,
                                                         const std::string& file) {
  const auto text = read_file(file, script_octets_max);
  if (!text) return Err(text.error().message);
  auto steps =
      parse_script(*text, [&](const auto& name, const auto& arguments) -> std::optional<std::string> {
        const auto encoded = dictionary.encode(name, arguments);
        return encoded ? std::nullopt : std::optional(explained(dictionary, name, encoded.error().message));
      });
  if (!steps) return Err(file + ":" + std::to_string(steps.error().line) + ": " + steps.error().message);
  return std::move(*steps);
}

/// What 'schedule' sends: the telecommand and its arguments. nullopt: the numbers do not fit the action.
std::optional<TelecommandText> schedule_command(const Arguments& a) {
  const auto id_from = [&a](std::size_t first) {
    std::vector<std::string> arguments{"request_apid=" + std::to_string(a.values[first]),
                                       "request_sequence=" + std::to_string(a.values[first + 1])};
    if (a.values.size() == first + 3)
      arguments.push_back("request_source=" + std::to_string(a.values[first + 2]));
    return arguments;
  };
  const std::size_t given = a.values.size();
  if (a.action == "delete") {
    if (given != 2 && given != 3) return std::nullopt;
    return TelecommandText{"schedule.delete", id_from(0)};
  }
  if (a.action == "shift") {
    if (given != 1 && given != 3 && given != 4) return std::nullopt;
    std::vector<std::string> arguments = given == 1 ? std::vector<std::string>{} : id_from(1);
    arguments.push_back("offset_s=" + std::to_string(a.values[0]));
    return TelecommandText{given == 1 ? "schedule.shift_all" : "schedule.shift", arguments};
  }
  if (given != 0) return std::nullopt;
  if (a.action == "list") return TelecommandText{"schedule.detail_all", {}};
  if (a.action == "groups") return TelecommandText{"schedule.report_groups", {}};
  return TelecommandText{"schedule." + a.action, {}};
}

/// The operator confirms at the terminal before a hazardous telecommand is armed and sent.
bool confirmed(const Arguments& a) {
  std::fprintf(stderr, "%s is hazardous. Arm it and send it? [yes/no] ", a.name.c_str());
  std::string answer;
  std::getline(std::cin, answer);
  std::erase_if(answer, [](unsigned char c) { return std::isspace(c) != 0; });
  std::transform(answer.begin(), answer.end(), answer.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (answer == "y" || answer == "yes") return true;
  std::fprintf(stderr, "srfs-ground: nothing was sent: the answer was not yes\n");
  return false;
}

// One function for each subcommand. What can be checked is checked before the port is opened.
namespace verbs {

Exit ping(const Operation& operation) {
  const Arguments& a = operation.arguments;
  return with_console(operation, link_of(a), {},
                      [&](Console& console) { return console.ping(duration(a.timeout_s)); });
}

/// The satellite's health at a glance: mode, why, what was shed, what comes next.
Exit status(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const std::string one_shot = "housekeeping.one_shot";
  const std::vector<std::string> health{"structure=health"};
  const auto encoded = operation.dictionary.encode(one_shot, health);
  if (!encoded) return fail(a, encoded.error().message);
  const auto order = ReportOrder::of(operation.dictionary, *encoded);
  if (!order) return fail(a, "the dictionary has no structure health");
  return with_console(operation, link_of(a), {}, [&](Console& console) {
    return console.telecommand_with_reports(one_shot, health, *order, duration(a.timeout_s));
  });
}

Exit tc(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto at = release_time(a);
  if (!at) return fail(a, at.error());
  const auto* structure = operation.dictionary.structure(a.show);
  if (!a.show.empty() && structure == nullptr)
    return fail(a, fmt::format("--show: no structure '{}' (see docs/reference/dictionary.md)", a.show));
  const auto encoded = operation.dictionary.encode(a.name, a.pairs);
  if (!encoded) return fail(a, explained(operation.dictionary, a.name, encoded.error().message));
  std::optional<ReportOrder> order;
  if (structure != nullptr)
    order = ReportOrder::of_structure(*structure);
  else if (!*at && !a.no_report)
    order = ReportOrder::of(operation.dictionary, *encoded);
  const auto link = link_of(a);
  const bool asks = !*at && !a.arm && !a.json && isatty(STDIN_FILENO) == 1 &&
                    operation.dictionary.command(a.name)->hazardous;
  if (asks && !confirmed(a)) return Exit::refused;
  return with_console(operation, link, {}, [&](Console& console) {
    if (asks || a.arm) {
      const Exit armed = console.arm(a.name, a.pairs, duration(a.timeout_s), *at);
      if (armed != Exit::done) return armed;
    }
    if (order) return console.telecommand_with_reports(a.name, a.pairs, *order, duration(a.timeout_s));
    return console.telecommand(a.name, a.pairs, a.wait, duration(a.timeout_s), *at);
  });
}

Exit arm(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto at = release_time(a);
  if (!at) return fail(a, at.error());
  if (const auto wrong = wrong_telecommand(operation, {{a.name, a.pairs}})) return fail(a, *wrong);
  return with_console(operation, link_of(a), {}, [&](Console& console) {
    return console.arm(a.name, a.pairs, duration(a.timeout_s), *at);
  });
}

Exit schedule(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto telecommand = schedule_command(a);
  if (!telecommand) return fail(a, "schedule " + a.action + ": wrong number of values (--help)");
  const auto encoded = operation.dictionary.encode(telecommand->name, telecommand->arguments);
  if (!encoded) return fail(a, encoded.error().message);
  const auto order = ReportOrder::of(operation.dictionary, *encoded);
  return with_console(operation, link_of(a), {}, [&](Console& console) {
    if (order)
      return console.telecommand_with_reports(telecommand->name, telecommand->arguments, *order,
                                              duration(a.timeout_s));
    return console.telecommand(telecommand->name, telecommand->arguments, true, duration(a.timeout_s));
  });
}

Exit list(const Operation& operation) {
  if (operation.arguments.names) {
    for (const auto& command : operation.dictionary.commands()) std::puts(command.name.c_str());
    return Exit::done;
  }
  return ground::list(operation.dictionary, operation.arguments.name, operation.arguments.json);
}

Exit dictionary(const Operation& operation) {
  const std::string text =
      to_json(operation.dictionary).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  std::puts(text.c_str());
  return Exit::done;
}

Exit session(const Operation& operation) {
  return with_console(operation, link_of(operation.arguments), {.files = true, .json = true},
                      [](Console& console) { return console.session(); });
}

Exit script(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto steps = load_script(operation.dictionary, a.file);
  if (!steps) return fail(a, steps.error());
  return with_console(operation, link_of(a), {},
                      [&](Console& console) { return console.script(*steps, a.keep_going); });
}

Exit unlock(const Operation& operation) {
  return with_console(operation, link_of(operation.arguments), {},
                      [](Console& console) { return console.unlock(); });
}

Exit setvr(const Operation& operation) {
  const Arguments& a = operation.arguments;
  return with_console(operation, link_of(a), {},
                      [&](Console& console) { return console.set_vr(static_cast<std::uint8_t>(a.vr)); });
}

Exit clcw(const Operation& operation) {
  const Arguments& a = operation.arguments;
  return with_console(operation, link_of(a), {},
                      [&](Console& console) { return console.clcw(duration(a.timeout_s)); });
}

}  // namespace verbs

void add_telecommand(CLI::App& sub, Arguments& a) {
  sub.add_option("name", a.name, "Telecommand, as in 'list'")->required();
  sub.add_option("arguments", a.pairs, "key=value ...");
}

CLI::Option* add_release_time(CLI::App& sub, Arguments& a) {
  return sub.add_option("--at", a.at, "Release time on board: UTC, or +30s, +10m, +2h from now");
}

}  // namespace

void define_telecommands(CLI::App& app, Arguments& a) {
  add_timeout(add(app, a, "ping", "Ask the spacecraft whether it is alive (17,1)", verbs::ping), a);
  add_timeout(add(app, a, "status", "Show mode, why, what was shed, which nodes obey, what comes next",
                  verbs::status),
              a);
  CLI::App& tc = add(app, a, "tc", "Send a telecommand of the mission dictionary", verbs::tc);
  add_telecommand(tc, a);
  tc.add_flag("--wait", a.wait, "Wait for completion, not only acceptance");
  auto* at = add_release_time(tc, a);
  auto* show = tc.add_option("--show", a.show,
                             "Wait for completion, and show the packets of this structure received "
                             "meanwhile (default: those that the telecommand orders)")
                   ->excludes(at);
  tc.add_flag("--no-report", a.no_report, "Do not wait for the reports that the telecommand orders")
      ->excludes(show);
  tc.add_flag("--arm", a.arm, "Arm the hazardous telecommand first, and send it when arming has completed")
      ->excludes(at);
  add_timeout(tc, a);
  CLI::App& arm =
      add(app, a, "arm", "Arm a hazardous telecommand with these arguments, for a limited time", verbs::arm);
  add_telecommand(arm, a);
  add_release_time(arm, a);
  add_timeout(arm, a);
  CLI::App& schedule =
      add(app, a, "schedule", "The schedule of time-tagged telecommands on board", verbs::schedule);
  schedule
      .add_option(
          "action", a.action,
          "list | groups | enable | disable | reset | delete APID COUNT [SOURCE] | shift SECONDS [APID "
          "COUNT [SOURCE]]")
      ->check(CLI::IsMember({"list", "groups", "enable", "disable", "reset", "delete", "shift"}))
      ->capture_default_str();
  schedule.add_option("values", a.values, "Numbers for the action; 'list' shows those of an activity");
  add_timeout(schedule, a);
}

void define_lists_of_commands(CLI::App& app, Arguments& a) {
  CLI::App& list = add(app, a, "list", "Show the telecommands", verbs::list);
  list.add_flag("--names", a.names, "Names alone");
  list.add_option("name", a.name, "Only this one, or those whose names begin so");
  add(app, a, "dictionary", "The whole mission dictionary, as one JSON object", verbs::dictionary);
  add(app, a, "session",
      "Read command lines from standard input, write everything that happens as JSON lines", verbs::session);
  CLI::App& script = add(app, a, "script",
                         "Run a file of commands, waits and expectations (ground/README.md)", verbs::script);
  script.add_option("file", a.file, "The script")->required();
  script.add_flag("--keep-going", a.keep_going, "Continue after a line that does not end as expected");
}

void define_farm(CLI::App& app, Arguments& a) {
  add(app, a, "unlock", "Unlock FARM-1 and start the AD service", verbs::unlock);
  add(app, a, "setvr", "Set FARM-1's V(R) and start the AD service", verbs::setvr)
      .add_option("vr", a.vr, "V(R)")
      ->required()
      ->check(CLI::Range(0U, 255U));
  add_timeout(add(app, a, "clcw", "Show the state of FARM-1", verbs::clcw), a);
}

}  // namespace srfs::ground::program
