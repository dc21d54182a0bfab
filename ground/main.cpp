// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// srfs-ground: the operator's side of the ground link on a command line.
#include <algorithm>
#include <array>
#include <cctype>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <sys/prctl.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include "base/file.hpp"
#include "base/version.hpp"
#include "ground/api/web_gateway.hpp"
#include "ground/archive/archive_report.hpp"
#include "ground/archive/recorder.hpp"
#include "ground/archive_commands.hpp"
#include "ground/console.hpp"
#include "ground/dictionary_json.hpp"
#include "ground/direct_link.hpp"
#include "ground/files.hpp"
#include "ground/fragments.hpp"
#include "ground/installation.hpp"
#include "ground/name_hint.hpp"
#include "ground/package_arguments.hpp"
#include "ground/place.hpp"
#include "ground/program_help.hpp"
#include "ground/remote.hpp"
#include "ground/served_link.hpp"
#include "ground/server.hpp"
#include "ground/station_status.hpp"
#include "suite/deployment.hpp"
#include "update/package_keys.hpp"

namespace {

using namespace srfs;
using namespace srfs::ground;

struct Arguments {
  std::string port;
  std::string verb;
  std::string deployment = "sim";
  std::string state;
  std::string keys;
  std::vector<std::string> fragments;
  bool json = false;
  double timeout_s = 0;
  bool wait = false;
  std::string show;
  bool no_report = false;
  bool arm = false;
  double duration_s = 0;
  std::string name;
  std::vector<std::string> pairs;
  std::string from;
  std::string to;
  std::string store = "housekeeping";
  bool ad = false;
  unsigned window = wire::FopSettings{}.window;
  double t1_s = std::chrono::duration<double>(wire::FopSettings{}.timer).count();
  unsigned transmissions = wire::FopSettings{}.transmission_limit;
  unsigned station = 0;
  std::string counters_from;
  unsigned vr = 0;
  std::string file;
  bool keep_going = false;
  std::string at;
  std::string action = "list";
  std::vector<std::int64_t> values;
  std::string source;
  std::string destination;
  std::string tm = "127.0.0.1:10015";
  std::string tc = "127.0.0.1:10025";
  std::vector<std::string> words;
  bool csv = false;
  std::size_t most = 0;
  std::string severity = "info";
  std::string table;
  double keep_days = 0;
  bool no_archive = false;
  bool fill = false;
  bool limits = false;
  bool names = false;
  api::WebOptions web;
  pid_t owner = 0;
  CLI::Option* web_option = nullptr;  // of serve: whether it was given
  PackageArguments package;
  Exit exit = Exit::done;  // of the verb, which CLI11 runs when it has read all arguments
};

std::optional<milliseconds> duration(double value_s) {
  if (value_s <= 0) return std::nullopt;
  return milliseconds(static_cast<std::int64_t>(value_s * 1000));
}

Exit fail(const Arguments& a, const std::string& message) {
  if (a.json) {
    const nlohmann::json json{{"type", "error"}, {"message", message}};
    std::puts(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
  } else {
    std::fprintf(stderr, "srfs-ground: %s\n", message.c_str());
  }
  return Exit::unusable;
}

/// What is no failure.
void warn(const Arguments& a, const std::string& message) {
  if (a.json) {
    const nlohmann::json json{{"type", "note"}, {"message", message}};
    std::puts(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
  } else {
    std::fprintf(stderr, "srfs-ground: %s\n", message.c_str());
  }
}

/// What a verb works with.
struct Operation {
  const Arguments& arguments;
  std::filesystem::path var_dir;
  std::filesystem::path state_dir;
  mission::Dictionary dictionary;
};
using Verb = Exit (*)(const Operation&);

/// As the deployment says; it need not be readable for verbs that do without.
std::filesystem::path dictionary_of(const Arguments& a) {
  try {
    const auto deployment = find_deployment(a.deployment);
    auto own = deployment ? suite::Deployment::load(*deployment).dictionary : std::filesystem::path();
    if (!own.empty()) return own;
  } catch (const ConfigError&) {
    // who needs the deployment reports it
  }
  return mission::Dictionary::default_folder();
}

std::string environment(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? "" : value;
}

Place find_place(const Arguments& a) {
  PlaceHints hints{.port_argument = a.port,
                   .port_environment = environment("SRFS_PORT"),
                   .var_environment = environment("SRFS_VAR")};
  std::error_code error;
  hints.var_here = std::filesystem::exists("var/rs422", error);
  const bool known = !(hints.port_argument + hints.port_environment + hints.var_environment).empty();
  if (!known && !hints.var_here) hints.running = running_simulations();
  return place_of(hints);
}

Exit operate(Arguments& a, Verb verb) {
  const Place place = find_place(a);
  a.port = place.port;
  const std::filesystem::path var_dir = place.var;
  const std::filesystem::path state_dir =
      a.state.empty() ? var_dir / "ground" : std::filesystem::path(a.state);
  std::vector<std::string> warnings;
  auto dictionary =
      load_dictionary(dictionary_of(a),
                      {{a.fragments.begin(), a.fragments.end()}, state_dir / "fragments", var_dir}, warnings);
  if (!dictionary) return fail(a, dictionary.error());
  for (const std::string& warning : warnings) std::fprintf(stderr, "srfs-ground: %s\n", warning.c_str());
  return verb({a, var_dir, state_dir, std::move(*dictionary)});
}

/// @throws std::runtime_error  no such deployment, or one that cannot be read
suite::LinkSettings link_of(const Arguments& a) {
  const auto deployment = find_deployment(a.deployment);
  if (!deployment) throw std::runtime_error(deployment.error());
  return suite::Deployment::load(*deployment).link;
}

struct Use {
  bool files = false;  ///< files are carried too
  bool json = false;   ///< even without --json
};

wire::FopSettings fop_settings(const Arguments& a) {
  return {.window = static_cast<std::uint8_t>(a.window),
          .timer = milliseconds(static_cast<std::int64_t>(a.t1_s * 1000)),
          .transmission_limit = static_cast<std::uint8_t>(a.transmissions)};
}

/// The line itself.
Result<std::unique_ptr<DirectLink>, std::string> open_line(const Operation& operation,
                                                           const suite::LinkSettings& link, Port port,
                                                           bool files) {
  const Arguments& a = operation.arguments;
  auto uplink = Uplink::open(link, operation.var_dir, operation.state_dir, system_utc_now(),
                             key_set_of(a.keys), static_cast<std::uint8_t>(a.station));
  if (!uplink) return Err(uplink.error());
  if (!a.counters_from.empty()) {
    const auto from = from_iso8601(a.counters_from);
    if (!from) return Err(std::string("--counters-from needs a time such as 2026-11-21T08:00:00Z"));
    uplink->on_time(*from);
  }
  if (const std::string warning = uplink->warning(); !warning.empty()) warn(a, warning);
  auto line = std::make_unique<DirectLink>(operation.dictionary, link, std::move(port), std::move(*uplink),
                                           fop_settings(a));
  if (!files) return line;
  auto transfers = open_files(operation.state_dir, system_utc_now(), monotonic_now());
  if (!transfers) return Err(transfers.error());
  if ((*transfers)->damaged())
    std::fprintf(stderr, "srfs-ground: unfinished file transfers start again: checkpoint %s\n",
                 std::string(cfdp::to_string(*(*transfers)->damaged())).c_str());
  line->carry_files(std::move(*transfers));
  return line;
}

/// The server that owns the line. nullopt: none runs.
Result<std::optional<ServerConnection>, std::string> server_of(const Operation& operation, bool files,
                                                               bool octets) {
  const Arguments& a = operation.arguments;
  return ServerConnection::open(
      operation.state_dir / serve::socket_name,
      {.verb = a.verb, .files = files, .octets = octets, .keys = key_set_of(a.keys)});
}

/// The way to the spacecraft: through the server if one runs, else the line itself.
Result<std::unique_ptr<StationLink>, std::string> open_link(const Operation& operation,
                                                            const suite::LinkSettings& link, bool files) {
  auto server = server_of(operation, files, false);
  if (!server) return Err(server.error());
  if (*server) {
    const wire::FopSettings fop = fop_settings(operation.arguments);
    const nlohmann::json wanted{{"window", fop.window},
                                {"t1_ms", fop.timer / milliseconds(1)},
                                {"transmissions", fop.transmission_limit}};
    if (operation.arguments.ad && (*server)->welcome().value("ad", wanted) != wanted)
      warn(operation.arguments, "a server owns the line: its --window, --t1 and --transmissions count");
    return std::make_unique<ServedLink>(std::move(**server), files);
  }
  auto port = Port::open(operation.arguments.port, link.baud);
  if (!port) return Err(port.error());
  // Counters and transfers of the folder are one process's, also while a server has not opened its port yet.
  auto lock = lock_state(operation.state_dir);
  if (!lock) return Err(lock.error());
  auto line = open_line(operation, link, std::move(*port), files);
  if (!line) return Err(line.error());
  (*line)->hold_state(std::move(*lock));
  return std::move(*line);
}

/// Opens the link and does @p what with the spacecraft.
Exit with_console(const Operation& operation, const suite::LinkSettings& link, Use use,
                  const std::function<Exit(Console&)>& what) {
  const Arguments& a = operation.arguments;
  auto line = open_link(operation, link, use.files);
  if (!line) return fail(a, line.error());
  const wire::FopSettings fop = fop_settings(a);
  ConsoleOptions options{
      .json = a.json || use.json, .colour = !a.json && isatty(STDOUT_FILENO) == 1, .ad = a.ad};
  // By the AD service a ping may have to be repeated.
  if (a.ad) options.ping_patience = fop.timer * fop.transmission_limit;
  Console console(operation.dictionary, std::move(*line), options);
  return what(console);
}

/// The octets of the line, through the server if one runs.
Result<std::unique_ptr<OctetLine>, std::string> open_octets(const Operation& operation,
                                                            const suite::LinkSettings& link) {
  auto server = server_of(operation, false, true);
  if (!server) return Err(server.error());
  if (*server) return std::make_unique<ServedLine>(std::move(**server));
  auto port = Port::open(operation.arguments.port, link.baud);
  if (!port) return Err(port.error());
  return std::make_unique<Port>(std::move(*port));
}

/// The time of --at. nullopt: now.
Result<std::optional<TimeTag>, std::string> release_time(const Arguments& a) {
  if (a.at.empty()) return std::optional<TimeTag>{};
  const auto at = parse_time_tag(a.at);
  if (!at) return Err("--at needs " + std::string(time_tag_forms));
  return at;
}

/// Why a telecommand cannot be encoded; of an unknown one with names that are near.
std::string explained(const mission::Dictionary& dictionary, const std::string& name,
                      const std::string& why) {
  if (dictionary.command(name) != nullptr) return why;
  std::vector<std::string> known;
  for (const auto& command : dictionary.commands()) known.push_back(command.name);
  return why + did_you_mean(name, known);
}

/// What is wrong with telecommands, before the port is opened. nullopt: nothing.
std::optional<std::string> wrong_telecommand(const Operation& operation,
                                             const std::vector<TelecommandText>& telecommands) {
  for (const TelecommandText& telecommand : telecommands) {
    const auto encoded = operation.dictionary.encode(telecommand.name, telecommand.arguments);
    if (!encoded) return explained(operation.dictionary, telecommand.name, encoded.error().message);
  }
  return std::nullopt;
}

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

struct UdpAddresses {
  sockaddr_in tm;
  sockaddr_in tc;
};

Result<UdpAddresses, std::string> udp_addresses(const Arguments& a) {
  const auto tm = parse_udp_address(a.tm);
  const auto tc = parse_udp_address(a.tc);
  if (!tm || ntohs(tm->sin_port) == 0) return Err(a.tm + ": expected [HOST:]PORT, the host as a.b.c.d");
  if (!tc) return Err(a.tc + ": expected [HOST:]PORT, the host as a.b.c.d");
  return UdpAddresses{*tm, *tc};
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

/// What is to be installed, before anything goes up.
Result<Installation, std::string> installation(const Operation& operation) {
  const Arguments& a = operation.arguments;
  std::string key = a.package.command.key;
  const auto own = operation.var_dir / update::public_key_file;
  if (key.empty() && std::filesystem::exists(own)) key = own.string();
  auto made = prepare_installation(a.package.command.file, key);
  if (!made) return made;
  made->activate = !a.package.no_activate;
  if (const auto wrong = wrong_telecommand(operation, {install_telecommand(made->name, made->activate)}))
    return Err(*wrong);
  return made;
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

Exit listen(const Operation& operation) {
  const Arguments& a = operation.arguments;
  return with_console(operation, link_of(a), {.files = true},
                      [&](Console& console) { return console.listen(duration(a.duration_s)); });
}

Exit retrieve(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const TelecommandText telecommand{"storage.retrieve", {"store=" + a.store, "from=" + a.from, "to=" + a.to}};
  if (const auto wrong = wrong_telecommand(operation, {telecommand})) return fail(a, *wrong);
  return with_console(operation, link_of(a), {}, [&](Console& console) {
    return console.retrieve(a.store, a.from, a.to, duration(a.timeout_s));
  });
}

Exit list(const Operation& operation) {
  if (operation.arguments.names) {
    for (const auto& command : operation.dictionary.commands()) std::puts(command.name.c_str());
    return Exit::done;
  }
  return ground::list(operation.dictionary, operation.arguments.name, operation.arguments.json);
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

Exit put(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const std::string name =
      a.destination.empty() ? std::filesystem::path(a.source).filename().string() : a.destination;
  if (const auto wrong = wrong_name_on_board(name)) return fail(a, *wrong);
  return with_console(operation, link_of(a), {.files = true},
                      [&](Console& console) { return console.put(a.source, name, duration(a.timeout_s)); });
}

Exit files(const Operation& operation) {
  const Arguments& a = operation.arguments;
  return with_console(operation, link_of(a), {.files = true},
                      [&](Console& console) { return console.files(duration(a.duration_s)); });
}

Exit remote(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto request = remote_request(a.action, a.words, system_utc_now());
  if (!request) return fail(a, request.error());
  if (const auto wrong = wrong_telecommand(operation, request->telecommands)) return fail(a, *wrong);
  return with_console(operation, link_of(a), {.files = !request->awaited_file.empty()},
                      [&](Console& console) { return console.remote(*request, duration(a.timeout_s)); });
}

Exit get_parameters(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto parameters = parameters_named(operation.dictionary, a.words);
  if (!parameters) return fail(a, parameters.error());
  if (a.action == "list") {
    for (const auto* parameter : *parameters) std::fputs(to_line(*parameter).c_str(), stdout);
    return Exit::done;
  }
  return with_console(operation, link_of(a), {}, [&](Console& console) {
    return console.get_parameters(*parameters, duration(a.timeout_s));
  });
}

Exit set_parameters(const Operation& operation) {
  const Arguments& a = operation.arguments;
  if (a.words.empty()) return fail(a, "expected param set NODE.PARAMETER=VALUE...");
  std::vector<TelecommandText> settings;
  for (const std::string& change : a.words) {
    auto setting = setting_command(change);
    if (!setting) return fail(a, setting.error());
    settings.push_back(std::move(*setting));
  }
  if (const auto wrong = wrong_telecommand(operation, settings)) return fail(a, *wrong);
  return with_console(operation, link_of(a), {}, [&](Console& console) {
    return console.set_parameters(settings, duration(a.timeout_s));
  });
}

Exit param(const Operation& operation) {
  const Arguments& a = operation.arguments;
  if (a.action == "list" || a.action == "get") return get_parameters(operation);
  if (a.action == "set") return set_parameters(operation);
  const auto telecommand = keeping_command(a.action, a.words);
  if (!telecommand) return fail(a, telecommand.error());
  if (const auto wrong = wrong_telecommand(operation, {*telecommand})) return fail(a, *wrong);
  return with_console(operation, link_of(a), {}, [&](Console& console) {
    return console.keep_parameters(*telecommand, duration(a.timeout_s));
  });
}

Exit bridge(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto udp = udp_addresses(a);
  if (!udp) return fail(a, udp.error());
  const auto link = link_of(a);
  auto line = open_octets(operation, link);
  if (!line) return fail(a, line.error());
  auto opened = Bridge::open(link, std::move(*line), udp->tm, udp->tc);
  if (!opened) return fail(a, opened.error());
  if (!a.json)
    std::printf("TM frames go to %s, CLTUs or TC frames are received at %s\n", to_text(udp->tm).c_str(),
                to_text(opened->uplink_address()).c_str());
  return run_bridge(*opened, a.json);
}

/// The archive of a server. nullptr: none; the station works without it.
std::unique_ptr<Recorder> open_recorder(const Operation& operation) {
  const Arguments& a = operation.arguments;
  if (a.no_archive) return nullptr;
  auto archive = open_archive(operation.state_dir / archive_name, ArchiveUse::write);
  if (!archive) {
    log_of_server(archive.error() +
                  "; nothing is recorded until it is repaired (srfs-ground archive repair)");
    return nullptr;
  }
  auto recorder = std::make_unique<Recorder>(std::move(*archive), operation.dictionary, log_of_server);
  if (a.fill) recorder->fill_gaps();
  if (a.keep_days > 0) {
    const auto kept =
        std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(a.keep_days * 86400));
    for (const char* table : {"packets", "telecommands", "files", "passes", "gaps"}) {
      const auto pruned = recorder->archive().prune(table, system_utc_now() - kept);
      if (!pruned) log_of_server(pruned.error());
    }
  }
  return recorder;
}

/// The program of the web gateway, as this one was called.
std::vector<std::string> web_command(const Operation& operation) {
  const Arguments& a = operation.arguments;
  std::vector<std::string> command{"/proc/self/exe",
                                   "--port",
                                   a.port,
                                   "--deployment",
                                   a.deployment,
                                   "--state",
                                   operation.state_dir.string()};
  for (const std::string& fragment : a.fragments) command.insert(command.end(), {"--fragment", fragment});
  command.insert(command.end(), {"web", a.web.address, "--owner", std::to_string(::getpid())});
  const auto add = [&command](const char* option, const std::filesystem::path& path) {
    if (!path.empty()) command.insert(command.end(), {option, path.string()});
  };
  add("--web-certificate", a.web.certificate);
  add("--web-key", a.web.key);
  add("--web-root", a.web.root);
  return command;
}

Exit serve(const Operation& operation) {
  const Arguments& a = operation.arguments;
  if (const auto wrong = api::wrong_options(a.web)) return fail(a, *wrong);
  const auto link = link_of(a);
  auto server = Server::open(operation.state_dir);
  if (!server) return fail(a, server.error());
  auto line = open_line(operation, link, Port::closed(a.port), true);
  if (!line) return fail(a, line.error());
  const auto recorder = open_recorder(operation);
  std::optional<api::WebKeeper> web;
  if (a.web_option->count() > 0) web.emplace(web_command(operation), log_of_server);
  std::printf("serving %s at %s\n", a.port.c_str(), server->socket().c_str());
  std::fflush(stdout);
  server->run(
      **line, [&] { return Port::open(a.port, link.baud); }, fop_settings(a), recorder.get(),
      [&web](MonotonicTime now) {
        if (web) web->on_time(now);
      });
  return Exit::done;
}

/// Serves until a signal; with its server's end it ends, too.
Exit web(const Operation& operation) {
  const Arguments& a = operation.arguments;
  if (a.owner != 0) {
    static_cast<void>(::prctl(PR_SET_PDEATHSIG, SIGKILL));
    if (::getppid() != a.owner) return Exit::done;  // it ended before
  }
  const auto done = api::run_web_gateway(operation.dictionary, operation.state_dir, a.web);
  return done ? Exit::done : fail(a, done.error());
}

Exit dictionary(const Operation& operation) {
  const std::string text =
      to_json(operation.dictionary).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  std::puts(text.c_str());
  return Exit::done;
}

/// What the verbs about the archive share. The error is ready to print.
Result<ArchiveCommand, std::string> archive_command(const Operation& operation) {
  const Arguments& a = operation.arguments;
  ArchiveCommand command{.file = operation.state_dir / archive_name,
                         .form = a.csv    ? RowForm::csv
                                 : a.json ? RowForm::json
                                          : RowForm::lines,
                         .most = a.most,
                         .parameter = a.name,
                         .source = a.source,
                         .table = a.table};
  constexpr std::array severities{"info", "low", "medium", "high"};
  for (unsigned i = 0; i < severities.size(); ++i) {
    if (a.severity == severities.at(i)) command.severity = i + 1;
  }
  const UtcTime now = system_utc_now();
  for (const auto& [text, end] :
       {std::pair(&a.from, &command.period.from), std::pair(&a.to, &command.period.to)}) {
    if (text->empty()) continue;
    *end = parse_moment(*text, now);
    if (!*end)
      return Err(fmt::format(
          "'{}': expected a UTC time like 2026-11-21T08:00:00Z, or how long ago: 10m, 2h, 3d", *text));
  }
  return command;
}

template <class Show>
Exit show(const Operation& operation, const Show& rows) {
  const auto command = archive_command(operation);
  return command ? rows(*command) : fail(operation.arguments, command.error());
}

Exit events(const Operation& operation) {
  return show(operation, [&](const ArchiveCommand& c) { return show_events(c, operation.dictionary); });
}

Exit packets(const Operation& operation) {
  return show(operation, [&](const ArchiveCommand& c) { return show_packets(c, operation.dictionary); });
}

Exit commands(const Operation& operation) {
  return show(operation, [&](const ArchiveCommand& c) { return show_commands(c, operation.dictionary); });
}

Exit parameter_history(const Operation& operation) {
  return show(operation, [&](const ArchiveCommand& c) { return show_history(c, operation.dictionary); });
}

Exit gaps(const Operation& operation) {
  return show(operation, [&](const ArchiveCommand& c) { return show_gaps(c, operation.dictionary); });
}

Exit passes(const Operation& operation) {
  return show(operation, [](const ArchiveCommand& c) { return show_passes(c); });
}

Exit transfers(const Operation& operation) {
  return show(operation, [](const ArchiveCommand& c) { return show_transfers(c); });
}

Exit station(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto archive = open_archive(operation.state_dir / archive_name, ArchiveUse::read);
  if (!archive) return fail(a, archive.error());
  auto status = read_status(**archive, operation.dictionary);
  if (!status) return fail(a, status.error());
  const auto server = server_of(operation, false, false);
  if (!server) return fail(a, server.error());
  if (*server) status->server = serve::status_of((*server)->welcome());
  const UtcTime now = system_utc_now();
  const std::string text = a.json ? to_json(*status, operation.dictionary, now)
                                            .dump(-1, ' ', true, nlohmann::json::error_handler_t::replace) +
                                        "\n"
                                  : to_lines(*status, operation.dictionary, now);
  std::fputs(text.c_str(), stdout);
  return Exit::done;
}

Exit beacon(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto archive = open_archive(operation.state_dir / archive_name, ArchiveUse::read);
  if (!archive) return fail(a, archive.error());
  const auto status = read_status(**archive, operation.dictionary);
  if (!status) return fail(a, status.error());
  const auto* newest = status->latest.structure("beacon");
  if (newest == nullptr) {
    fail(a, "no beacon has been recorded yet");
    return Exit::refused;
  }
  const std::string text =
      a.json ? to_json(newest->report).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace) + "\n"
             : to_lines(newest->report, isatty(STDOUT_FILENO) == 1);
  std::fputs(text.c_str(), stdout);
  return Exit::done;
}

Exit watch(const Operation& operation) {
  const Arguments& a = operation.arguments;
  return with_console(operation, link_of(a), {}, [&](Console& console) {
    return console.watch(a.name, a.limits, duration(a.duration_s));
  });
}

Exit archive(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto command = archive_command(operation);
  if (!command) return fail(a, command.error());
  if (a.action == "check") return check_archive(*command);
  if (a.action == "prune") {
    if (a.table.empty() || !command->period.to)
      return fail(a, "archive prune: --table and --to are needed, for example --table packets --to 90d");
  }
  // One process writes: the server would have to wait.
  const auto lock = lock_state(operation.state_dir);
  if (!lock) return fail(a, lock.error());
  if (a.action == "rebuild") return rebuild(*command);
  return a.action == "prune" ? prune(*command) : repair(*command);
}

Exit package_install(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto link = link_of(a);
  const auto package = installation(operation);
  if (!package) return fail(a, package.error());
  return with_console(operation, link, {.files = true}, [&](Console& console) {
    return console.install(package->file, package->name, package->activate, duration(a.timeout_s));
  });
}

}  // namespace verbs

/// Adds a subcommand that runs @p verb.
CLI::App& add(CLI::App& app, Arguments& a, const std::string& name, const std::string& help, Verb verb) {
  CLI::App& sub = *app.add_subcommand(name, help)->fallthrough();
  sub.final_callback([&a, verb, name] {
    a.verb = name;
    a.exit = operate(a, verb);
  });
  return sub;
}

void add_timeout(CLI::App& sub, Arguments& a) {
  sub.add_option("--timeout", a.timeout_s, "Seconds to wait for the final report")
      ->check(CLI::Range(0.001, 86400.0));
}

void add_duration(CLI::App& sub, Arguments& a) {
  sub.add_option("--duration", a.duration_s, "Seconds (default: until interrupted)")
      ->check(CLI::PositiveNumber);
}

void add_telecommand(CLI::App& sub, Arguments& a) {
  sub.add_option("name", a.name, "Telecommand, as in 'list'")->required();
  sub.add_option("arguments", a.pairs, "key=value ...");
}

CLI::Option* add_release_time(CLI::App& sub, Arguments& a) {
  return sub.add_option("--at", a.at, "Release time on board: UTC, or +30s, +10m, +2h from now");
}

void define_run(CLI::App& app, Arguments& a) {
  app.require_subcommand(1);
  app.set_version_flag("--version", version());
  app.add_option(
      "--port", a.port,
      "Serial port of the ground link (default: $SRFS_PORT, $SRFS_VAR/rs422, var/rs422, or that of "
      "the simulation that runs)");
  app.add_option("--deployment", a.deployment, "Deployment file, or its name in launch_config")
      ->envname("SRFS_DEPLOYMENT")
      ->capture_default_str();
  app.add_option("--state", a.state, "Folder of the security counter (default: ground beside the port)");
  app.add_option("--keys", a.keys, "Keys of this run: a, b or contingency (default: those last selected)")
      ->check(CLI::IsMember({"a", "b", "contingency"}));
  app.add_option("--station", a.station,
                 "Number of this ground station, 0 to 255: stations that command at the same time need "
                 "different ones (strict link)")
      ->envname("SRFS_STATION")
      ->check(CLI::Range(0, 255))
      ->capture_default_str();
  app.add_option("--counters-from", a.counters_from,
                 "Security counters go on from this UTC time: for a spacecraft whose clock is ahead, which "
                 "takes telecommands for too old (strict link)");
  app.add_option("--fragment", a.fragments,
                 "Dictionary fragment of an added node; may be repeated (also used: STATE/fragments/*.yaml "
                 "and those of the VAR beside the port)")
      ->allow_extra_args(false);
  app.add_flag("--json", a.json, "One JSON object per line");
  app.add_flag("--ad", a.ad,
               "Send telecommands with the AD service (COP-1): in order, each once, repeated when lost");
  app.add_option("--window", a.window, "AD: frames awaiting acknowledgement, K")
      ->check(CLI::Range(1U, wire::farm_window_default / 2U))
      ->capture_default_str();
  app.add_option("--t1", a.t1_s, "AD: seconds without acknowledgement until frames are repeated")
      ->check(CLI::Range(0.01, 3600.0))
      ->capture_default_str();
  app.add_option("--transmissions", a.transmissions, "AD: maximum number of transmissions of a frame")
      ->check(CLI::Range(1U, 255U))
      ->capture_default_str();
}

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

void define_screens(CLI::App& app, Arguments& a) {
  add(app, a, "station", "The station at a glance: line, COP-1, mode, limits, last telecommand, gaps",
      verbs::station);
  add(app, a, "beacon", "The newest beacon that was recorded", verbs::beacon);
  CLI::App& watch = add(app, a, "watch", "Newest values, in place, until interrupted", verbs::watch);
  watch.add_option("filter", a.name, "A structure, or the beginning of STRUCTURE.FIELD (default: all)");
  watch.add_flag("--limits", a.limits, "Values outside their limits alone");
  add_duration(watch, a);
}

void define_telemetry(CLI::App& app, Arguments& a) {
  add_duration(add(app, a, "listen", "Show telemetry, events and the beacon", verbs::listen), a);
  CLI::App& retrieve = add(app, a, "retrieve", "Retrieve the stored packets of a period", verbs::retrieve);
  retrieve.add_option("--from", a.from, "UTC, like 2026-11-21T08:00:00Z")->required();
  retrieve.add_option("--to", a.to, "UTC")->required();
  retrieve.add_option("--store", a.store, "Packet store")->capture_default_str();
  add_timeout(retrieve, a);
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

void define_files(CLI::App& app, Arguments& a) {
  CLI::App& put =
      add(app, a, "put", "Send a file up and wait until the spacecraft has it (CFDP)", verbs::put);
  put.add_option("file", a.source, "The file")->required()->check(CLI::ExistingFile);
  put.add_option("name", a.destination, "Its name on board (default: the file's)");
  add_timeout(put, a);
  add_duration(
      add(app, a, "files", "Transfer files up and down; received files are in STATE/files", verbs::files), a);
  CLI::App& remote =
      add(app, a, "remote", "The folder of files on board (PUS 23): " + remote_actions(), verbs::remote);
  remote.add_option("action", a.action, "Action")->required();
  remote.add_option("words", a.words, "Arguments of the action");
  add_timeout(remote, a);
}

void define_parameters(CLI::App& app, Arguments& a) {
  CLI::App& param = add(app, a, "param",
                        "Parameters of the nodes: list [NAME|NODE...] | get [NAME|NODE...] | "
                        "set NAME=VALUE... | keep NODE | confirm NODE | history NODE | "
                        "restore NODE GENERATION | reset NODE",
                        verbs::param);
  param.add_option("action", a.action, "Action")
      ->required()
      ->check(CLI::IsMember({"list", "get", "set", "keep", "confirm", "history", "restore", "reset"}));
  param.add_option("words", a.words, "NODE.PARAMETER, NODE, or NODE.PARAMETER=VALUE");
  add_timeout(param, a);
}

void add_web(CLI::App& sub, Arguments& a) {
  sub.add_option("--web-certificate", a.web.certificate, "PEM: HTTPS, needed where others reach it")
      ->check(CLI::ExistingFile);
  sub.add_option("--web-key", a.web.key, "PEM: the certificate's key")->check(CLI::ExistingFile);
  sub.add_option("--web-root", a.web.root, "Folder of the page (default: that of the installation)")
      ->check(CLI::ExistingDirectory);
}

void define_server(CLI::App& app, Arguments& a) {
  CLI::App& serve = add(app, a, "serve",
                        "Own the line, share it among all other srfs-ground commands, and record what "
                        "happens, until interrupted",
                        verbs::serve);
  serve.add_flag("--no-archive", a.no_archive, "Record nothing");
  serve.add_flag("--fill", a.fill,
                 "Retrieve missing packets from the packet stores on board, during contact");
  serve.add_option("--keep-days", a.keep_days, "At the start, remove what is older (default: keep all)")
      ->check(CLI::PositiveNumber);
  a.web_option =
      serve.add_option("--web", a.web.address, "Web page and HTTP API at [ADDRESS:]PORT; port 0: a free one")
          ->expected(0, 1)
          ->capture_default_str();
  add_web(serve, a);
  CLI::App& web =
      add(app, a, "web", "Web page and HTTP API of the server that runs, until interrupted", verbs::web);
  web.add_option("address", a.web.address, "[ADDRESS:]PORT; port 0: a free one")->capture_default_str();
  web.add_option("--owner", a.owner)->group("");  // the server that started it
  add_web(web, a);
}

/// A verb that shows rows of the archive.
CLI::App& add_rows(CLI::App& app, Arguments& a, const std::string& name, const std::string& help, Verb verb) {
  CLI::App& sub = add(app, a, name, help, verb);
  sub.add_option("--from", a.from, "UTC, or how long ago: 10m, 2h, 3d");
  sub.add_option("--to", a.to, "Likewise; not included");
  sub.add_flag("--csv", a.csv, "Comma-separated values")->excludes(app.get_option("--json"));
  return sub;
}

void define_archive(CLI::App& app, Arguments& a) {
  CLI::App& events = add_rows(app, a, "events", "Recorded events", verbs::events);
  events.add_option("--severity", a.severity, "At least: info, low, medium, high")
      ->check(CLI::IsMember({"info", "low", "medium", "high"}))
      ->capture_default_str();
  CLI::App& commands =
      add_rows(app, a, "commands", "Telecommands: when, what, by whom, with what result", verbs::commands);
  CLI::App& packets = add_rows(app, a, "packets", "Recorded packets, decoded anew", verbs::packets);
  packets.add_option("--source", a.source, "Of this application process alone");
  for (CLI::App* rows : {&events, &commands, &packets})
    rows->add_option("--last", a.most, "The newest so many")->check(CLI::PositiveNumber);
  CLI::App& history =
      add_rows(app, a, "history", "Values of one parameter, STRUCTURE.FIELD", verbs::parameter_history);
  history.add_option("parameter", a.name, "As in eps_power.battery_v")->required();
  history.add_option("--points", a.most, "At most so many; more values become spans of time (default: 2000)")
      ->check(CLI::PositiveNumber);
  add_rows(app, a, "gaps", "Packets that did not come", verbs::gaps);
  add_rows(app, a, "passes", "Times of contact", verbs::passes);
  add_rows(app, a, "transfers", "Recorded transfers of files", verbs::transfers);
  CLI::App& archive = add(app, a, "archive", "Care of the archive", verbs::archive);
  archive.add_option("action", a.action, "check | repair | rebuild | prune")
      ->required()
      ->check(CLI::IsMember({"check", "repair", "rebuild", "prune"}));
  archive.add_option("--table", a.table, "To prune: packets, telecommands, files, passes, gaps or minutes");
  archive.add_option("--to", a.to, "To prune: what is older, UTC or 90d");
}

void define_bridge(CLI::App& app, Arguments& a) {
  CLI::App& bridge = add(app, a, "bridge",
                         "Forward TM frames and CLTUs or TC frames between the port and UDP", verbs::bridge);
  bridge.add_option("--tm", a.tm, "Destination of TM frames, [HOST:]PORT")->capture_default_str();
  bridge.add_option("--tc", a.tc, "Where CLTUs or TC frames are received, [HOST:]PORT")
      ->capture_default_str();
}

void define_packages(CLI::App& app, Arguments& a) {
  CLI::App& package = define_package(app, a.package, a.timeout_s);
  const auto run = [&](const char* name, Exit (*verb)(const PackageCommand&)) {
    package.get_subcommand(name)->final_callback([&a, verb] {
      a.package.command.json = a.json;
      a.exit = verb(a.package.command);
    });
  };
  run("make", make_package);
  run("keygen", make_keys);
  run("show", show_package);
  run("verify", verify_package);
  package.get_subcommand("install")->final_callback([&a] {
    a.verb = "package install";
    a.exit = operate(a, verbs::package_install);
  });
}

void define_help(CLI::App& app, Arguments&) {
  app.add_subcommand("completion", "Write a completion script for bash: source <(srfs-ground completion)")
      ->final_callback([&app] { std::fputs(bash_completion(app, "srfs-ground").c_str(), stdout); });
  app.add_subcommand("man", "Write the manual page: srfs-ground man | man -l -")->final_callback([&app] {
    std::fputs(man_page(app, "srfs-ground", version()).c_str(), stdout);
  });
}

/// The order is that of --help.
void define(CLI::App& app, Arguments& a) {
  define_run(app, a);
  define_telecommands(app, a);
  define_telemetry(app, a);
  define_screens(app, a);
  define_lists_of_commands(app, a);
  define_farm(app, a);
  define_files(app, a);
  define_parameters(app, a);
  define_bridge(app, a);
  define_server(app, a);
  define_archive(app, a);
  define_packages(app, a);
  define_help(app, a);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The operator's side of the ground link");
  Arguments arguments;
  define(app, arguments);
  try {
    app.parse(argc, argv);
    return static_cast<int>(arguments.exit);
  } catch (const CLI::ParseError& error) {
    // 0: help was asked for; CLI11 numbers its errors from 100.
    return app.exit(error) == 0 ? 0 : static_cast<int>(Exit::unusable);
  } catch (const std::exception& error) {
    return static_cast<int>(fail(arguments, error.what()));
  }
}
