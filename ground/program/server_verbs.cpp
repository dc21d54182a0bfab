// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/program/verbs.hpp"

#include <chrono>
#include <csignal>
#include <cstdio>

#include <fmt/format.h>
#include <sys/prctl.h>
#include <unistd.h>

#include "ground/api/access.hpp"
#include "ground/archive/recorder.hpp"
#include "ground/bridge.hpp"
#include "ground/server.hpp"

namespace srfs::ground::program {
namespace {

/// For the other end of a TCP connection, each second: the clients wait meanwhile.
constexpr milliseconds connection_wait{50};

struct UdpAddresses {
  sockaddr_in tm;
  sockaddr_in tc;
};

Result<UdpAddresses, std::string> udp_addresses(const Arguments& a) {
  const auto tm = parse_internet_address(a.tm);
  const auto tc = parse_internet_address(a.tc);
  if (!tm || ntohs(tm->sin_port) == 0) return Err(a.tm + ": expected [HOST:]PORT, the host as a.b.c.d");
  if (!tc) return Err(a.tc + ": expected [HOST:]PORT, the host as a.b.c.d");
  return UdpAddresses{*tm, *tc};
}

// One function for each subcommand. What can be checked is checked before the port is opened.
namespace verbs {

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

/// Of --archive or STATE, and remembered for the other verbs.
ArchivePlace archive_place_of_server(const Operation& operation) {
  if (const auto kept = remember_archive(operation); !kept)
    log_of_server(kept.error() + "; other commands need --archive");
  return archive_place(operation);
}

/// With the patience of a command: the line is not served yet.
void remove_older(const ArchivePlace& place, double keep_days) {
  const auto kept = std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(keep_days * 86400));
  const auto archive = open_archive(place, ArchiveUse::care);
  if (!archive) return log_of_server("nothing older is removed: " + archive.error());
  for (const char* table : {"packets", "telecommands", "files", "passes", "gaps"}) {
    const auto pruned = (*archive)->prune(table, system_utc_now() - kept);
    if (!pruned) log_of_server(pruned.error());
  }
}

/// The archive of a server. nullptr: none; the station works without it.
std::unique_ptr<Recorder> open_recorder(const Operation& operation) {
  const Arguments& a = operation.arguments;
  if (a.no_archive) return nullptr;
  const ArchivePlace place = archive_place_of_server(operation);
  if (const auto schema = older_schema(place))
    log_of_server(
        fmt::format("the archive has schema {} and is brought up to date; the line is served when that is "
                    "done, which takes minutes for a big one",
                    *schema));
  if (a.keep_days > 0) remove_older(place, a.keep_days);
  auto archive = open_archive(place, ArchiveUse::write);
  if (!archive) {
    log_of_server(archive.error() + (is_shared(place) ? "; nothing is recorded"
                                                      : "; nothing is recorded until that is mended (a "
                                                        "damaged file: srfs-ground archive repair)"));
    return nullptr;
  }
  auto recorder = std::make_unique<Recorder>(std::move(*archive), operation.dictionary, log_of_server);
  if (const auto there = recorder->archive().newest_packet(); !there)
    log_of_server(there.error() + "; it is tried again every second");
  if (a.fill) recorder->fill_gaps();
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
  if (!a.archive.empty())
    command.insert(command.end(), {"--archive", a.archive, "--station", std::to_string(a.station)});
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
  if (const auto wrong = wrong_address(ArchivePlace(a.archive, 0, 0))) return fail(a, *wrong);
  const auto link = link_of(a);
  auto opener = PortOpener::of(a.port, link.baud);
  if (!opener) return fail(a, opener.error());
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
      **line, [&opener] { return opener->open(connection_wait); }, fop_settings(a), recorder.get(),
      [&web](MonotonicTime now) {
        if (web) web->on_time(now);
      });
  return Exit::done;
}

/// Serves until a signal; with its server's end it ends, too.
Exit web(const Operation& operation) {
  const Arguments& a = operation.arguments;
  Result<Fd, std::string> of_server = Fd();
  if (a.owner != 0) {
    static_cast<void>(::prctl(PR_SET_PDEATHSIG, SIGKILL));
    if (::getppid() != a.owner) return Exit::done;  // it ended before
    of_server = api::await_web_of_server(operation.state_dir);
    if (!of_server) return fail(a, of_server.error());
  }
  const auto done =
      api::run_web_gateway(operation.dictionary, operation.state_dir, archive_place(operation), a.web);
  return done ? Exit::done : fail(a, done.error());
}

}  // namespace verbs

void add_web(CLI::App& sub, Arguments& a) {
  sub.add_option("--web-certificate", a.web.certificate, "PEM: HTTPS, needed where others reach it")
      ->check(CLI::ExistingFile);
  sub.add_option("--web-key", a.web.key, "PEM: the certificate's key")->check(CLI::ExistingFile);
  sub.add_option("--web-root", a.web.root, "Folder of the page (default: that of the installation)")
      ->check(CLI::ExistingDirectory);
}

}  // namespace

void define_bridge(CLI::App& app, Arguments& a) {
  CLI::App& bridge = add(app, a, "bridge",
                         "Forward TM frames and CLTUs or TC frames between the port and UDP", verbs::bridge);
  bridge.add_option("--tm", a.tm, "Destination of TM frames, [HOST:]PORT")->capture_default_str();
  bridge.add_option("--tc", a.tc, "Where CLTUs or TC frames are received, [HOST:]PORT")
      ->capture_default_str();
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

}  // namespace srfs::ground::program
