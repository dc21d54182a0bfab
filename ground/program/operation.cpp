// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/program/operation.hpp"

#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include <fmt/format.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/version.hpp"
#include "ground/dictionary_cache.hpp"
#include "ground/files.hpp"
#include "ground/fragments.hpp"
#include "ground/name_hint.hpp"
#include "ground/place.hpp"
#include "ground/server.hpp"

namespace srfs::ground::program {
namespace {

suite::Deployment load_deployment(const Arguments& a) {
  const auto deployment = find_deployment(a.deployment);
  if (!deployment) throw std::runtime_error(deployment.error());
  return suite::Deployment::load(*deployment);
}

/// Read once: a run of the program has one, and reading it takes longer than all else that a short command
/// does.
const suite::Deployment& deployment_of(const Arguments& a) {
  static const suite::Deployment deployment = load_deployment(a);
  return deployment;
}

/// As the deployment says; it need not be readable for verbs that do without.
std::filesystem::path dictionary_of(const Arguments& a) {
  try {
    const auto& own = deployment_of(a).dictionary;
    if (!own.empty()) return own;
  } catch (const std::runtime_error&) {
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

}  // namespace

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

void warn(const Arguments& a, const std::string& message) {
  if (a.json) {
    const nlohmann::json json{{"type", "note"}, {"message", message}};
    std::puts(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
  } else {
    std::fprintf(stderr, "srfs-ground: %s\n", message.c_str());
  }
}

Exit operate(Arguments& a, Verb verb) {
  const Place place = find_place(a);
  a.port = place.port;
  const std::filesystem::path var_dir = place.var;
  const std::filesystem::path state_dir =
      a.state.empty() ? var_dir / "ground" : std::filesystem::path(a.state);
  std::vector<std::string> warnings;
  auto dictionary = load_dictionary(
      dictionary_of(a), {{a.fragments.begin(), a.fragments.end()}, state_dir / "fragments", var_dir},
      state_dir / dictionary_cache_name, warnings);
  if (!dictionary) return fail(a, dictionary.error());
  for (const std::string& warning : warnings) std::fprintf(stderr, "srfs-ground: %s\n", warning.c_str());
  return verb({a, var_dir, state_dir, std::move(*dictionary)});
}

suite::LinkSettings link_of(const Arguments& a) {
  return deployment_of(a).link;
}

namespace {

/// In STATE: the address that the last server had, if it was not the file there.
constexpr std::string_view archive_address_name = "archive.address";

}  // namespace

std::string archive_of_server(const std::filesystem::path& state_dir) {
  std::string address = read_file(state_dir / archive_address_name).value_or("");
  while (address.ends_with('\n')) address.pop_back();
  return address.empty() ? (state_dir / archive_name).string() : address;
}

ArchivePlace archive_place(const Operation& operation) {
  const Arguments& a = operation.arguments;
  return archive_at(a, a.archive.empty() ? archive_of_server(operation.state_dir) : a.archive);
}

ArchivePlace archive_at(const Arguments& a, const std::string& address) {
  const ArchivePlace place(address, 0, a.station);
  // Files need no deployment.
  return is_shared(place) ? ArchivePlace(address, link_of(a).spacecraft_id, a.station) : place;
}

Archive::Outcome remember_archive(const Operation& operation) {
  const auto file = operation.state_dir / archive_address_name;
  std::string address = operation.arguments.archive;
  if (!address.empty() && !is_shared(ArchivePlace(address, 0, 0)))
    address = std::filesystem::absolute(address).string();
  const auto done = address.empty() ? remove_durably(file) : write_file_atomically(file, address + "\n");
  return done ? Archive::Outcome{} : Err(done.error().message);
}

wire::FopSettings fop_settings(const Arguments& a) {
  return {.window = static_cast<std::uint8_t>(a.window),
          .timer = milliseconds(static_cast<std::int64_t>(a.t1_s * 1000)),
          .transmission_limit = static_cast<std::uint8_t>(a.transmissions)};
}

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
  FrameTrustOptions trusting{
      .age_max = seconds(a.frame_age_s),
      .unverified = a.unverified == "mark" ? UnverifiedFrames::marked : UnverifiedFrames::dropped};
  if (!a.frames_from.empty()) {
    trusting.from = from_iso8601(a.frames_from);
    if (!trusting.from) return Err(std::string("--frames-from needs a time such as 2026-11-21T08:00:00Z"));
  }
  auto trust = open_frame_trust(link, operation.var_dir, operation.state_dir, trusting);
  if (!trust) return Err(trust.error());
  if (!trust->warning.empty()) warn(a, trust->warning);
  auto line = std::make_unique<DirectLink>(operation.dictionary, link, std::move(port), std::move(*uplink),
                                           fop_settings(a), std::move(*trust));
  if (!files) return line;
  auto transfers = open_files(operation.state_dir, system_utc_now(), monotonic_now());
  if (!transfers) return Err(transfers.error());
  if ((*transfers)->damaged())
    std::fprintf(stderr, "srfs-ground: unfinished file transfers start again: checkpoint %s\n",
                 std::string(cfdp::to_string(*(*transfers)->damaged())).c_str());
  line->carry_files(std::move(*transfers));
  return line;
}

Result<std::optional<ServerConnection>, std::string> server_of(const Operation& operation, bool files,
                                                               bool octets) {
  const Arguments& a = operation.arguments;
  return ServerConnection::open(
      operation.state_dir / serve::socket_name,
      {.verb = a.verb, .files = files, .octets = octets, .keys = key_set_of(a.keys)});
}

namespace {

constexpr milliseconds connection_patience{5000};  ///< for the other end of a TCP connection

Result<Port, std::string> open_port(const Operation& operation, const suite::LinkSettings& link) {
  auto opener = PortOpener::of(operation.arguments.port, link.baud);
  if (!opener) return Err(opener.error());
  return opener->open(connection_patience);
}

/// Whether the operator says which TM frames are taken.
bool says_which_frames(const Arguments& a) {
  return a.unverified != "drop" || !a.frames_from.empty() ||
         seconds(a.frame_age_s) != FrameTrustOptions{}.age_max;
}

}  // namespace

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
    if (says_which_frames(operation.arguments))
      warn(operation.arguments,
           "a server owns the line: its --unverified, --frame-age and --frames-from count");
    return std::make_unique<ServedLink>(std::move(**server), files);
  }
  auto port = open_port(operation, link);
  if (!port) return Err(port.error());
  // Counters and transfers of the folder are one process's, also while a server has not opened its port yet.
  auto lock = lock_state(operation.state_dir);
  if (!lock) return Err(lock.error());
  auto line = open_line(operation, link, std::move(*port), files);
  if (!line) return Err(line.error());
  (*line)->hold_state(std::move(*lock));
  return std::move(*line);
}

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

Result<std::unique_ptr<OctetLine>, std::string> open_octets(const Operation& operation,
                                                            const suite::LinkSettings& link) {
  auto server = server_of(operation, false, true);
  if (!server) return Err(server.error());
  if (*server) return std::make_unique<ServedLine>(std::move(**server));
  auto port = open_port(operation, link);
  if (!port) return Err(port.error());
  return std::make_unique<Port>(std::move(*port));
}

Result<std::optional<TimeTag>, std::string> release_time(const Arguments& a) {
  if (a.at.empty()) return std::optional<TimeTag>{};
  const auto at = parse_time_tag(a.at);
  if (!at) return Err("--at needs " + std::string(time_tag_forms));
  return at;
}

std::optional<std::string> wrong_telecommand(const Operation& operation,
                                             const std::vector<TelecommandText>& telecommands) {
  for (const TelecommandText& telecommand : telecommands) {
    const auto encoded = operation.dictionary.encode(telecommand.name, telecommand.arguments);
    if (!encoded) return explained(operation.dictionary, telecommand.name, encoded.error().message);
  }
  return std::nullopt;
}

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

void define_run(CLI::App& app, Arguments& a) {
  app.require_subcommand(1);
  app.set_version_flag("--version", version());
  app.add_option(
      "--port", a.port,
      "Serial port of the ground link, tcp:[HOST:]PORT or udp:[HOST:]PORT[,LOCAL_PORT] (default: $SRFS_PORT, "
      "$SRFS_VAR/rs422, var/rs422, or that of the simulation that runs)");
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
  app.add_option("--archive", a.archive,
                 "Archive: a file, or postgresql://[USER@]HOST[:PORT]/DATABASE, which several stations share "
                 "(default: that of the last server, else STATE/archive.sqlite)")
      ->envname("SRFS_ARCHIVE");
  app.add_option("--counters-from", a.counters_from,
                 "Security counters go on from this UTC time: for a spacecraft whose clock is ahead, which "
                 "takes telecommands for too old (strict link)");
  app.add_option(
         "--unverified", a.unverified,
         "What becomes of TM frames that are not authentic: drop, or mark (their packets are shown as "
         "UNVERIFIED, and nothing is done with them)")
      ->check(CLI::IsMember({"drop", "mark"}))
      ->capture_default_str();
  app.add_option("--frame-age", a.frame_age_s,
                 "Seconds after which an authentic TM frame is taken for a recording; 0: never")
      ->check(CLI::Range(0, 86400))
      ->capture_default_str();
  app.add_option(
      "--frames-from", a.frames_from,
      "TM frames are taken from this UTC time on, whatever was heard before: for a spacecraft that "
      "lost the numbers of its frames");
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

}  // namespace srfs::ground::program
