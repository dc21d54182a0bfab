// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/program/verbs.hpp"

#include <cstdio>

#include <fmt/format.h>
#include <unistd.h>

#include "ground/archive/recorder.hpp"
#include "ground/screen/operator_console.hpp"
#include "ground/station_status.hpp"

namespace srfs::ground::program {
namespace {

// One function for each subcommand. What can be checked is checked before the port is opened.
namespace verbs {

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

Exit station(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto archive = open_archive(archive_place(operation), ArchiveUse::read);
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
  const auto archive = open_archive(archive_place(operation), ArchiveUse::read);
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

Exit console(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto socket = operation.state_dir / serve::socket_name;
  auto server = ServerConnection::open(
      socket, {.verb = a.verb, .files = true, .telecommands = true, .keys = key_set_of(a.keys)});
  if (!server) return fail(a, server.error());
  if (!*server)
    return fail(a, fmt::format("no server runs at {}; start it: srfs-ground serve", socket.string()));
  const auto done = screen::run_operator_console(operation.dictionary, operation.state_dir,
                                                 archive_place(operation), std::move(**server));
  if (done) return Exit::done;
  fail(a, done.error().text);
  return done.error().began ? Exit::link_closed : Exit::unusable;
}

Exit watch(const Operation& operation) {
  const Arguments& a = operation.arguments;
  return with_console(operation, link_of(a), {}, [&](Console& console) {
    return console.watch(a.name, a.limits, duration(a.duration_s));
  });
}

}  // namespace verbs

}  // namespace

void define_telemetry(CLI::App& app, Arguments& a) {
  add_duration(add(app, a, "listen", "Show telemetry, events and the beacon", verbs::listen), a);
  CLI::App& retrieve = add(app, a, "retrieve", "Retrieve the stored packets of a period", verbs::retrieve);
  retrieve.add_option("--from", a.from, "UTC, like 2026-11-21T08:00:00Z")->required();
  retrieve.add_option("--to", a.to, "UTC")->required();
  retrieve.add_option("--store", a.store, "Packet store")->capture_default_str();
  add_timeout(retrieve, a);
}

void define_screens(CLI::App& app, Arguments& a) {
  add(app, a, "station", "The station at a glance: line, COP-1, mode, limits, last telecommand, gaps",
      verbs::station);
  add(app, a, "beacon", "The newest beacon that was recorded", verbs::beacon);
  add(app, a, "console",
      "Values, limits, events and a command line on one screen of a terminal, through the server that runs",
      verbs::console);
  CLI::App& watch = add(app, a, "watch", "Newest values, in place, until interrupted", verbs::watch);
  watch.add_option("filter", a.name, "A structure, or the beginning of STRUCTURE.FIELD (default: all)");
  watch.add_flag("--limits", a.limits, "Values outside their limits alone");
  add_duration(watch, a);
}

}  // namespace srfs::ground::program
