// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// srfs-ground: the operator's side of the ground link on a command line.
#include <algorithm>
#include <cctype>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include "base/file.hpp"
#include "base/version.hpp"
#include "ground/console.hpp"
#include "ground/fragments.hpp"
#include "ground/installation.hpp"
#include "ground/package_arguments.hpp"
#include "ground/remote.hpp"
#include "ros/deployment.hpp"
#include "update/package_keys.hpp"

namespace {

using namespace srfs;
using namespace srfs::ground;

struct Arguments {
  std::string port = "var/rs422";
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
  PackageArguments package;
};

std::optional<milliseconds> duration(double value_s) {
  if (value_s <= 0) return std::nullopt;
  return milliseconds(static_cast<std::int64_t>(value_s * 1000));
}

void define(CLI::App& app, Arguments& a) {
  app.require_subcommand(1);
  app.set_version_flag("--version", version());
  app.add_option("--port", a.port, "Serial port of the ground link")->capture_default_str();
  app.add_option("--deployment", a.deployment, "Deployment file, or its name in launch_config")
      ->capture_default_str();
  app.add_option("--state", a.state, "Folder of the security counter (default: ground beside the port)");
  app.add_option("--keys", a.keys, "Keys of this run: a, b or contingency (default: those last selected)")
      ->check(CLI::IsMember({"a", "b", "contingency"}));
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
  const auto timeout = [&a](CLI::App* sub) {
    sub->add_option("--timeout", a.timeout_s, "Seconds to wait for the final report")
        ->check(CLI::Range(0.001, 86400.0));
  };
  timeout(app.add_subcommand("ping", "Ask the spacecraft whether it is alive (17,1)"));
  auto* tc = app.add_subcommand("tc", "Send a telecommand of the mission dictionary");
  tc->add_option("name", a.name, "Telecommand, as in 'list'")->required();
  tc->add_option("arguments", a.pairs, "key=value ...");
  tc->add_flag("--wait", a.wait, "Wait for completion, not only acceptance");
  const std::string at_help = "Release time on board: UTC, or +30s, +10m, +2h from now";
  auto* at = tc->add_option("--at", a.at, at_help);
  auto* show = tc->add_option("--show", a.show,
                              "Wait for completion, and show the packets of this structure received "
                              "meanwhile (default: those that the telecommand orders)")
                   ->excludes(at);
  tc->add_flag("--no-report", a.no_report, "Do not wait for the reports that the telecommand orders")
      ->excludes(show);
  tc->add_flag("--arm", a.arm, "Arm the hazardous telecommand first, and send it when arming has completed")
      ->excludes(at);
  timeout(tc);
  auto* arm =
      app.add_subcommand("arm", "Arm a hazardous telecommand with these arguments, for a limited time");
  arm->add_option("name", a.name, "Telecommand, as in 'list'")->required();
  arm->add_option("arguments", a.pairs, "key=value ...");
  arm->add_option("--at", a.at, at_help);
  timeout(arm);
  auto* schedule = app.add_subcommand("schedule", "The schedule of time-tagged telecommands on board");
  schedule
      ->add_option(
          "action", a.action,
          "list | groups | enable | disable | reset | delete APID COUNT [SOURCE] | shift SECONDS [APID "
          "COUNT [SOURCE]]")
      ->check(CLI::IsMember({"list", "groups", "enable", "disable", "reset", "delete", "shift"}))
      ->capture_default_str();
  schedule->add_option("values", a.values, "Numbers for the action; 'list' shows those of an activity");
  timeout(schedule);
  auto* listen = app.add_subcommand("listen", "Show telemetry, events and the beacon");
  listen->add_option("--duration", a.duration_s, "Seconds (default: until interrupted)")
      ->check(CLI::PositiveNumber);
  auto* retrieve = app.add_subcommand("retrieve", "Retrieve the stored packets of a period");
  retrieve->add_option("--from", a.from, "UTC, like 2026-11-21T08:00:00Z")->required();
  retrieve->add_option("--to", a.to, "UTC")->required();
  retrieve->add_option("--store", a.store, "Packet store")->capture_default_str();
  timeout(retrieve);
  app.add_subcommand("list", "Show the telecommands")->add_option("name", a.name, "Only this one");
  app.add_subcommand("session",
                     "Read command lines from standard input, write everything that happens as JSON lines");
  auto* script =
      app.add_subcommand("script", "Run a file of commands, waits and expectations (ground/README.md)");
  script->add_option("file", a.file, "The script")->required();
  script->add_flag("--keep-going", a.keep_going, "Continue after a line that does not end as expected");
  app.add_subcommand("unlock", "Unlock FARM-1 and start the AD service");
  app.add_subcommand("setvr", "Set FARM-1's V(R) and start the AD service")
      ->add_option("vr", a.vr, "V(R)")
      ->required()
      ->check(CLI::Range(0U, 255U));
  timeout(app.add_subcommand("clcw", "Show the state of FARM-1"));
  auto* put = app.add_subcommand("put", "Send a file up and wait until the spacecraft has it (CFDP)");
  put->add_option("file", a.source, "The file")->required()->check(CLI::ExistingFile);
  put->add_option("name", a.destination, "Its name on board (default: the file's)");
  timeout(put);
  auto* files = app.add_subcommand("files", "Transfer files up and down; received files are in STATE/files");
  files->add_option("--duration", a.duration_s, "Seconds (default: until interrupted)")
      ->check(CLI::PositiveNumber);
  auto* remote = app.add_subcommand("remote", "The folder of files on board (PUS 23): " + remote_actions());
  remote->add_option("action", a.action, "Action")->required();
  remote->add_option("words", a.words, "Arguments of the action");
  timeout(remote);
  auto* param = app.add_subcommand("param",
                                   "Parameters of the nodes: list [NAME|NODE...] | get [NAME|NODE...] | "
                                   "set NAME=VALUE... | keep NODE | confirm NODE | history NODE | "
                                   "restore NODE GENERATION | reset NODE");
  param->add_option("action", a.action, "Action")
      ->required()
      ->check(CLI::IsMember({"list", "get", "set", "keep", "confirm", "history", "restore", "reset"}));
  param->add_option("words", a.words, "NODE.PARAMETER, NODE, or NODE.PARAMETER=VALUE");
  timeout(param);
  auto* bridge =
      app.add_subcommand("bridge", "Forward TM frames and CLTUs or TC frames between the port and UDP");
  bridge->add_option("--tm", a.tm, "Destination of TM frames, [HOST:]PORT")->capture_default_str();
  bridge->add_option("--tc", a.tc, "Where CLTUs or TC frames are received, [HOST:]PORT")
      ->capture_default_str();
  define_package(app, a.package, a.timeout_s);
  for (auto* sub : app.get_subcommands({})) sub->fallthrough();
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

Result<std::vector<ScriptStep>, std::string> load_script(const mission::Dictionary& dictionary,
                                                         const std::string& file) {
  const auto text = read_file(file, script_octets_max);
  if (!text) return Err(text.error().message);
  auto steps =
      parse_script(*text, [&](const auto& name, const auto& arguments) -> std::optional<std::string> {
        const auto encoded = dictionary.encode(name, arguments);
        return encoded ? std::nullopt : std::optional(encoded.error().message);
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

/// Where 'put' puts its file.
std::string name_on_board(const Arguments& a) {
  return a.destination.empty() ? std::filesystem::path(a.source).filename().string() : a.destination;
}

Exit bridge(const Arguments& a, const ros::LinkSettings& link, Port port, const UdpAddresses& udp) {
  auto opened = Bridge::open(link, std::move(port), udp.tm, udp.tc);
  if (!opened) return fail(a, opened.error());
  if (!a.json)
    std::printf("TM frames go to %s, CLTUs or TC frames are received at %s\n", to_text(udp.tm).c_str(),
                to_text(opened->uplink_address()).c_str());
  return run_bridge(*opened, a.json);
}

/// What 'schedule' sends: the telecommand and its arguments. nullopt: the numbers do not fit the action.
std::optional<std::pair<std::string, std::vector<std::string>>> schedule_command(const Arguments& a) {
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
    return {{"schedule.delete", id_from(0)}};
  }
  if (a.action == "shift") {
    if (given != 1 && given != 3 && given != 4) return std::nullopt;
    std::vector<std::string> arguments = given == 1 ? std::vector<std::string>{} : id_from(1);
    arguments.push_back("offset_s=" + std::to_string(a.values[0]));
    return {{given == 1 ? "schedule.shift_all" : "schedule.shift", arguments}};
  }
  if (given != 0) return std::nullopt;
  if (a.action == "list") return {{"schedule.detail_all", {}}};
  if (a.action == "groups") return {{"schedule.report_groups", {}}};
  return {{"schedule." + a.action, {}}};
}

/// The reports that are shown with the telecommand: those of --show, else those that it orders. nullopt:
/// none.
std::optional<ReportOrder> order_of(
    const CLI::App& app, const Arguments& a, const mission::Dictionary& dictionary,
    const std::optional<std::pair<std::string, std::vector<std::string>>>& scheduling) {
  const bool telecommand = app.got_subcommand("tc") && a.at.empty();
  if (!telecommand && !scheduling) return std::nullopt;
  if (telecommand && !a.show.empty()) return ReportOrder::of_structure(*dictionary.structure(a.show));
  if (a.no_report) return std::nullopt;
  const auto encoded = scheduling ? dictionary.encode(scheduling->first, scheduling->second)
                                  : dictionary.encode(a.name, a.pairs);
  return encoded ? ReportOrder::of(dictionary, *encoded) : std::nullopt;
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

/// What is wrong with the telecommands that this call is to send, before the port is opened. nullopt:
/// nothing.
std::optional<std::string> wrong_telecommand(const mission::Dictionary& dictionary,
                                             const std::vector<TelecommandText>& telecommands) {
  for (const TelecommandText& telecommand : telecommands) {
    const auto encoded = dictionary.encode(telecommand.name, telecommand.arguments);
    if (!encoded) return encoded.error().message;
  }
  return std::nullopt;
}

/// Those that are known before anything is sent; of 'package' see installation().
std::vector<TelecommandText> telecommands_of(
    const CLI::App& app, const Arguments& a, const RemoteRequest& remote,
    const std::vector<TelecommandText>& settings, const std::optional<TelecommandText>& keeping,
    const std::optional<std::pair<std::string, std::vector<std::string>>>& scheduling) {
  std::vector<TelecommandText> telecommands = remote.telecommands;
  if (app.got_subcommand("tc") || app.got_subcommand("arm")) telecommands.push_back({a.name, a.pairs});
  if (app.got_subcommand("retrieve"))
    telecommands.push_back({"storage.retrieve", {"store=" + a.store, "from=" + a.from, "to=" + a.to}});
  telecommands.insert(telecommands.end(), settings.begin(), settings.end());
  if (keeping) telecommands.push_back(*keeping);
  if (scheduling) telecommands.push_back({scheduling->first, scheduling->second});
  return telecommands;
}

/// What is to be installed, before anything goes up.
Result<Installation, std::string> installation(const Arguments& a, const mission::Dictionary& dictionary,
                                               const std::filesystem::path& var_dir) {
  std::string key = a.package.command.key;
  const auto own = var_dir / update::public_key_file;
  if (key.empty() && std::filesystem::exists(own)) key = own.string();
  auto made = prepare_installation(a.package.command.file, key);
  if (!made) return made;
  made->activate = !a.package.no_activate;
  const TelecommandText telecommand = install_telecommand(made->name, made->activate);
  const auto encoded = dictionary.encode(telecommand.name, telecommand.arguments);
  if (!encoded) return Err(encoded.error().message);
  return made;
}

Exit operate(const CLI::App& app, Arguments& a) {
  const bool installs = app.got_subcommand("package");
  if (installs) {
    a.package.command.json = a.json;
    if (const auto ended = run_package(*app.get_subcommand("package"), a.package)) return *ended;
  }
  const std::filesystem::path port_path = a.port;
  const auto var_dir = port_path.has_parent_path() ? port_path.parent_path() : std::filesystem::path(".");
  const std::filesystem::path state_dir =
      a.state.empty() ? var_dir / "ground" : std::filesystem::path(a.state);
  std::vector<std::string> warnings;
  const auto loaded =
      load_dictionary(mission::Dictionary::default_folder(),
                      {{a.fragments.begin(), a.fragments.end()}, state_dir / "fragments", var_dir}, warnings);
  if (!loaded) return fail(a, loaded.error());
  for (const std::string& warning : warnings) std::fprintf(stderr, "srfs-ground: %s\n", warning.c_str());
  const mission::Dictionary& dictionary = *loaded;
  if (app.got_subcommand("list")) return list(dictionary, a.name, a.json);
  bool asks = false;
  if (app.got_subcommand("tc") && a.at.empty() && !a.arm && !a.json && isatty(STDIN_FILENO) == 1) {
    const auto* command = dictionary.command(a.name);
    asks = command != nullptr && command->hazardous;
  }
  RemoteRequest remote;
  if (app.got_subcommand("remote")) {
    auto made = remote_request(a.action, a.words, system_utc_now());
    if (!made) return fail(a, made.error());
    remote = std::move(*made);
  }
  std::vector<const mission::Parameter*> parameters;
  const bool reads = a.action == "list" || a.action == "get";
  std::optional<TelecommandText> keeping;
  if (app.got_subcommand("param") && !reads && a.action != "set") {
    auto command = keeping_command(a.action, a.words);
    if (!command) return fail(a, command.error());
    keeping = std::move(*command);
  }
  if (app.got_subcommand("param") && reads) {
    auto named = parameters_named(dictionary, a.words);
    if (!named) return fail(a, named.error());
    parameters = std::move(*named);
    if (a.action == "list") {
      for (const auto* parameter : parameters) std::fputs(to_line(*parameter).c_str(), stdout);
      return Exit::done;
    }
  }
  std::vector<TelecommandText> settings;
  if (app.got_subcommand("param") && a.action == "set") {
    if (a.words.empty()) return fail(a, "expected param set NODE.PARAMETER=VALUE...");
    for (const std::string& change : a.words) {
      auto setting = setting_command(change);
      if (!setting) return fail(a, setting.error());
      settings.push_back(std::move(*setting));
    }
  }
  std::vector<ScriptStep> steps;
  if (app.got_subcommand("script")) {
    auto script = load_script(dictionary, a.file);
    if (!script) return fail(a, script.error());
    steps = std::move(*script);
  }
  const auto at = a.at.empty() ? std::optional<TimeTag>{} : parse_time_tag(a.at);
  if (!a.at.empty() && !at) return fail(a, "--at needs " + std::string(time_tag_forms));
  const bool schedules = app.got_subcommand("schedule");
  const auto scheduling = schedules ? schedule_command(a) : std::nullopt;
  if (schedules && !scheduling) return fail(a, "schedule " + a.action + ": wrong number of values (--help)");
  if (!a.show.empty() && dictionary.structure(a.show) == nullptr)
    return fail(a, fmt::format("--show: no structure '{}' (see docs/reference/dictionary.md)", a.show));
  if (const auto wrong =
          wrong_telecommand(dictionary, telecommands_of(app, a, remote, settings, keeping, scheduling)))
    return fail(a, *wrong);
  const auto order = order_of(app, a, dictionary, scheduling);
  std::optional<UdpAddresses> udp;
  if (app.got_subcommand("bridge")) {
    const auto addresses = udp_addresses(a);
    if (!addresses) return fail(a, addresses.error());
    udp = *addresses;
  }
  if (app.got_subcommand("put")) {
    if (const auto wrong = wrong_name_on_board(name_on_board(a))) return fail(a, *wrong);
  }
  const auto deployment = find_deployment(a.deployment);
  if (!deployment) return fail(a, deployment.error());
  const auto link = ros::Deployment::load(*deployment).link;
  Installation package;
  if (installs) {
    auto made = installation(a, dictionary, var_dir);
    if (!made) return fail(a, made.error());
    package = std::move(*made);
  }
  if (asks && !confirmed(a)) return Exit::refused;
  a.arm = a.arm || asks;
  auto port = Port::open(port_path, link.baud);
  if (!port) return fail(a, port.error());
  if (udp) return bridge(a, link, std::move(*port), *udp);
  auto uplink = Uplink::open(link, var_dir, state_dir, system_utc_now(), key_set_of(a.keys));
  if (!uplink) return fail(a, uplink.error());
  if (const std::string warning = uplink->warning(); !warning.empty()) warn(a, warning);
  const bool colour = !a.json && isatty(STDOUT_FILENO) == 1;
  const wire::FopSettings fop{.window = static_cast<std::uint8_t>(a.window),
                              .timer = milliseconds(static_cast<std::int64_t>(a.t1_s * 1000)),
                              .transmission_limit = static_cast<std::uint8_t>(a.transmissions)};
  Console console(
      dictionary, link, std::move(*port), std::move(*uplink),
      {.json = a.json || app.got_subcommand("session"), .colour = colour, .ad = a.ad, .fop = fop});
  const bool carries_files = !remote.awaited_file.empty() || installs || app.got_subcommand("put") ||
                             app.got_subcommand("files") || app.got_subcommand("listen") ||
                             app.got_subcommand("session");
  if (carries_files) {
    auto files = open_files(state_dir, system_utc_now(), monotonic_now());
    if (!files) return fail(a, files.error());
    if ((*files)->damaged())
      std::fprintf(stderr, "srfs-ground: unfinished file transfers start again: checkpoint %s\n",
                   std::string(cfdp::to_string(*(*files)->damaged())).c_str());
    console.carry_files(std::move(*files));
  }
  if (app.got_subcommand("put")) return console.put(a.source, name_on_board(a), duration(a.timeout_s));
  if (installs) return console.install(package.file, package.name, package.activate, duration(a.timeout_s));
  if (app.got_subcommand("remote")) return console.remote(remote, duration(a.timeout_s));
  if (app.got_subcommand("param")) {
    if (keeping) return console.keep_parameters(*keeping, duration(a.timeout_s));
    return reads ? console.get_parameters(parameters, duration(a.timeout_s))
                 : console.set_parameters(settings, duration(a.timeout_s));
  }
  if (app.got_subcommand("files")) return console.files(duration(a.duration_s));
  if (app.got_subcommand("ping")) return console.ping(duration(a.timeout_s));
  if (app.got_subcommand("arm") || (app.got_subcommand("tc") && a.arm)) {
    const Exit armed = console.arm(a.name, a.pairs, duration(a.timeout_s), at);
    if (armed != Exit::done || app.got_subcommand("arm")) return armed;
  }
  if (order)
    return console.telecommand_with_reports(schedules ? scheduling->first : a.name,
                                            schedules ? scheduling->second : a.pairs, *order,
                                            duration(a.timeout_s));
  if (app.got_subcommand("tc"))
    return console.telecommand(a.name, a.pairs, a.wait, duration(a.timeout_s), at);
  if (scheduling)
    return console.telecommand(scheduling->first, scheduling->second, true, duration(a.timeout_s));
  if (app.got_subcommand("listen")) return console.listen(duration(a.duration_s));
  if (app.got_subcommand("retrieve")) return console.retrieve(a.store, a.from, a.to, duration(a.timeout_s));
  if (app.got_subcommand("script")) return console.script(steps, a.keep_going);
  if (app.got_subcommand("unlock")) return console.unlock();
  if (app.got_subcommand("setvr")) return console.set_vr(static_cast<std::uint8_t>(a.vr));
  if (app.got_subcommand("clcw")) return console.clcw(duration(a.timeout_s));
  return console.session();
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The operator's side of the ground link");
  Arguments arguments;
  define(app, arguments);
  try {
    app.parse(argc, argv);
    return static_cast<int>(operate(app, arguments));
  } catch (const CLI::ParseError& error) {
    // 0: help was asked for; CLI11 numbers its errors from 100.
    return app.exit(error) == 0 ? 0 : static_cast<int>(Exit::unusable);
  } catch (const std::exception& error) {
    return static_cast<int>(fail(arguments, error.what()));
  }
}
