// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/program/verbs.hpp"

#include <array>

#include <fmt/format.h>

#include "ground/archive/archive_report.hpp"
#include "ground/archive/recorder.hpp"
#include "ground/archive_commands.hpp"
#include "ground/server.hpp"

namespace srfs::ground::program {
namespace {

// One function for each subcommand. What can be checked is checked before the port is opened.
namespace verbs {

/// What the verbs about the archive share. The error is ready to print.
Result<ArchiveCommand, std::string> archive_command(const Operation& operation) {
  const Arguments& a = operation.arguments;
  ArchiveCommand command{.place = archive_place(operation),
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
  if (a.action == "copy") return command;  // its --to is no time
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

Exit copy_into(const Operation& operation, ArchiveCommand command) {
  const Arguments& a = operation.arguments;
  if (a.to.empty())
    return fail(a, "archive copy: --to is needed: the other archive, FILE or postgresql://...");
  command.target = archive_at(a, a.to);
  if (const auto wrong = wrong_address(command.target)) return fail(a, *wrong);
  const auto locks = is_shared(command.target) ? Result<std::vector<Fd>, std::string>()
                                               : lock_archive(command.target.address, operation.state_dir,
                                                              archive_of_server(operation.state_dir));
  return locks ? copy(command) : fail(a, locks.error());
}

Exit archive(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto command = archive_command(operation);
  if (!command) return fail(a, command.error());
  if (a.action == "check") return check_archive(*command);
  if (a.action == "copy") return copy_into(operation, *command);
  if (a.action == "prune") {
    if (a.table.empty() || !command->period.to)
      return fail(a, "archive prune: --table and --to are needed, for example --table packets --to 90d");
  }
  // One process writes a file: the server would have to wait.
  const auto lock = is_shared(command->place) ? Result<Fd, std::string>() : lock_state(operation.state_dir);
  if (!lock) return fail(a, lock.error());
  if (a.action == "rebuild") return rebuild(*command);
  return a.action == "prune" ? prune(*command) : repair(*command);
}

}  // namespace verbs

/// A verb that shows rows of the archive.
CLI::App& add_rows(CLI::App& app, Arguments& a, const std::string& name, const std::string& help, Verb verb) {
  CLI::App& sub = add(app, a, name, help, verb);
  sub.add_option("--from", a.from, "UTC, or how long ago: 10m, 2h, 3d");
  sub.add_option("--to", a.to, "Likewise; not included");
  sub.add_flag("--csv", a.csv, "Comma-separated values")->excludes(app.get_option("--json"));
  return sub;
}

}  // namespace

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
  archive.add_option("action", a.action, "check | copy | repair | rebuild | prune")
      ->required()
      ->check(CLI::IsMember({"check", "copy", "repair", "rebuild", "prune"}));
  archive.add_option("--table", a.table, "To prune: packets, telecommands, files, passes, gaps or minutes");
  archive.add_option(
      "--to", a.to,
      "To prune: what is older, UTC or 90d. To copy: the archive that gets what it does not have, "
      "FILE or postgresql://...");
}

}  // namespace srfs::ground::program
