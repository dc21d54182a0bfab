// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "ground/api/web_gateway.hpp"
#include "ground/archive/archive.hpp"
#include "ground/console.hpp"
#include "ground/direct_link.hpp"
#include "ground/program/package_arguments.hpp"
#include "ground/served_link.hpp"
#include "suite/deployment.hpp"

namespace srfs::ground::program {

/// What the command line says after `pass`.
struct PassArguments {
  std::string plan;
  std::string from;
  double hours = 24;
  bool wait = false;
  bool keep_going = false;
  bool rehearse = false;
  double scale = 10;
  bool set_time = false;
};

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
  std::string archive;
  unsigned master = 0;
  std::string counters_from;
  std::string unverified = "drop";
  std::int64_t frame_age_s = FrameTrustOptions{}.age_max.count();
  std::string frames_from;
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
  PassArguments pass;
  Exit exit = Exit::done;  // of the verb, which CLI11 runs when it has read all arguments
};

/// What a verb works with.
struct Operation {
  const Arguments& arguments;
  std::filesystem::path var_dir;
  std::filesystem::path state_dir;
  mission::Dictionary dictionary;
};

using Verb = Exit (*)(const Operation&);

struct Use {
  bool files = false;  ///< files are carried too
  bool json = false;   ///< even without --json
};

[[nodiscard]] std::optional<milliseconds> duration(double value_s);
Exit fail(const Arguments& a, const std::string& message);
/// What is no failure.
void warn(const Arguments& a, const std::string& message);
[[nodiscard]] Exit operate(Arguments& a, Verb verb);
/// @throws std::runtime_error  no such deployment, or one that cannot be read
[[nodiscard]] suite::LinkSettings link_of(const Arguments& a);
[[nodiscard]] wire::FopSettings fop_settings(const Arguments& a);
/// The archive: --archive, what the last server of STATE recorded in, or the file in STATE.
[[nodiscard]] ArchivePlace archive_place(const Operation& operation);
/// What the last server of this folder recorded in.
[[nodiscard]] std::string archive_of_server(const std::filesystem::path& state_dir);
/// @param address  a file, or of a PostgreSQL, where it is that of the deployment's spacecraft
[[nodiscard]] ArchivePlace archive_at(const Arguments& a, const std::string& address);
/// What verbs without --archive take from now on. The error is ready to print.
[[nodiscard]] Archive::Outcome remember_archive(const Operation& operation);
/// The line itself.
[[nodiscard]] Result<std::unique_ptr<DirectLink>, std::string> open_line(const Operation& operation,
                                                                         const suite::LinkSettings& link,
                                                                         Port port, bool files);
/// The way to the spacecraft: through the server if one runs, else the line itself.
[[nodiscard]] Result<std::unique_ptr<StationLink>, std::string> open_link(const Operation& operation,
                                                                          const suite::LinkSettings& link,
                                                                          bool files);
/// The server that owns the line. nullopt: none runs.
[[nodiscard]] Result<std::optional<ServerConnection>, std::string> server_of(const Operation& operation,
                                                                             bool files, bool octets);
/// Opens the link and does @p what with the spacecraft.
[[nodiscard]] Exit with_console(const Operation& operation, const suite::LinkSettings& link, Use use,
                                const std::function<Exit(Console&)>& what);
/// The octets of the line, through the server if one runs.
[[nodiscard]] Result<std::unique_ptr<OctetLine>, std::string> open_octets(const Operation& operation,
                                                                          const suite::LinkSettings& link);
/// The time of --at. nullopt: now.
[[nodiscard]] Result<std::optional<TimeTag>, std::string> release_time(const Arguments& a);
/// What is wrong with telecommands, before the port is opened. nullopt: nothing.
[[nodiscard]] std::optional<std::string> wrong_telecommand(const Operation& operation,
                                                           const std::vector<TelecommandText>& telecommands);
/// Adds a subcommand that runs @p verb.
CLI::App& add(CLI::App& app, Arguments& a, const std::string& name, const std::string& help, Verb verb);
void add_timeout(CLI::App& sub, Arguments& a);
void add_duration(CLI::App& sub, Arguments& a);

/// Options of the whole program.
void define_run(CLI::App& app, Arguments& a);

}  // namespace srfs::ground::program
