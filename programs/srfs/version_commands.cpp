// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/version_commands.hpp"

#include <iostream>

#include <fmt/format.h>

#include "base/text.hpp"
#include "programs/srfs/answer.hpp"
#include "suite/launcher.hpp"
#include "suite/node_versions.hpp"

namespace srfs::tool {
namespace {

using update::VersionNumber;
using update::VersionTable;

std::string name_of(VersionNumber version) {
  return version == update::golden ? "golden" : fmt::format("version {}", version);
}

/// What the command line calls a version. nullopt: none
std::optional<VersionNumber> parse_version(const std::string& text, const VersionTable& table) {
  if (text == "golden") return update::golden;
  if (text == "previous") return table.previous();
  return to_number<VersionNumber>(text);
}

/// The version that the node's living process runs.
std::optional<VersionNumber> running_version(const suite::VarPaths& var, const std::string& node) {
  const auto instance = suite::find_instance(var, node);
  const auto started = suite::last_started(var, node);
  if (!instance || !started || started->pid != instance->pid) return std::nullopt;
  return started->version;
}

/// Runs a change of a node's store and reports it.
int change(const Target& target, const std::string& node, const std::string& version, bool json,
           Result<void, std::string> (update::VersionStore::*operation)(VersionNumber),
           const std::string& what) {
  if (target.deployment.find(node) == nullptr) return no_node(node, json);
  const auto number = parse_version(version, suite::read_versions(target.var, node).table);
  if (!number)
    return fail(CommandExit::usage, fmt::format("'{}' is not a version of {}", version, node), json);
  const auto changed = suite::change_versions(
      target.var, node, [&](update::VersionStore& store) { return (store.*operation)(*number); });
  if (!changed)
    return fail(CommandExit::refused, fmt::format("{}: {}", name_of(*number), changed.error()), json);
  return done(fmt::format("{} of {} {}", name_of(*number), node, what), json, {{"version", *number}});
}

}  // namespace

int show_versions(const Target& target, const std::string& only, bool check, bool json) {
  if (!only.empty() && target.deployment.find(only) == nullptr) return no_node(only, json);
  bool whole = true;
  Json list = Json::array();
  if (!json)
    fmt::print("{:<18} {:>7} {:<10} {:<8} {:>10} {:<12} {:<23}  {}\n", "NODE", "VERSION", "STATE", "RUNS",
               "OCTETS", "SHA-256", "ADDED", "ORIGIN AND WHY");
  for (const auto& node : target.deployment.nodes) {
    if (!only.empty() && node.name != only) continue;
    const auto [table, problem] = suite::read_versions(target.var, node.name);
    const auto running = running_version(target.var, node.name);
    update::PosixVersionFiles files(suite::versions_folder(target.var, node.name));
    const update::VersionStore store(files, node.name);
    const auto mark = [&](VersionNumber number) {
      const bool runs = running == number;
      const bool active = table.active() == number;
      return std::string(runs && active ? "active"
                         : runs         ? "until now"
                         : active       ? "next"
                                        : "") +
             (table.last_good() == number && !active ? "last good" : "");
    };
    Json versions = Json::array();
    if (!json)
      fmt::print("{:<18} {:>7} {:<10} {:<8} {:>10} {:<12} {:<23}  {}\n", node.name, 0, "golden",
                 mark(update::golden), "-", "-", "-",
                 node.added ? "none, the node was added" : node.executable);
    for (const update::Version& v : table.versions()) {
      const auto damage = check ? store.damage(v) : std::nullopt;
      whole = whole && !damage;
      if (json) {
        versions.push_back({{"number", v.number},
                            {"state", to_text(v.state)},
                            {"sha256", v.sha256},
                            {"octets", v.octets},
                            {"origin", v.origin},
                            {"added", to_iso8601(v.added)},
                            {"probation_s", static_cast<double>(v.probation.count()) / 1000},
                            {"resets", v.resets},
                            {"reason", v.reason.empty() ? Json(nullptr) : Json(v.reason)},
                            {"damage", damage ? Json(*damage) : Json(nullptr)}});
      } else {
        std::string text = v.origin;
        if (!v.reason.empty()) text += "; " + v.reason;
        if (damage) text += "; DAMAGED: " + *damage;
        fmt::print("{:<18} {:>7} {:<10} {:<8} {:>10} {:<12} {:<23}  {}\n", "", v.number, to_text(v.state),
                   mark(v.number), v.octets, v.sha256.substr(0, 12), to_iso8601(v.added), text);
      }
    }
    if (json)
      list.push_back({{"node", node.name},
                      {"active", table.active()},
                      {"last_good", table.last_good()},
                      {"running", running ? Json(*running) : Json(nullptr)},
                      {"problem", problem.empty() ? Json(nullptr) : Json(problem)},
                      {"golden", node.added ? Json(nullptr) : Json(node.executable)},
                      {"versions", versions}});
    if (!json && !problem.empty()) fmt::print(stderr, "srfs versions: {}: {}\n", node.name, problem);
  }
  if (json) std::cout << list.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
  return static_cast<int>(whole ? CommandExit::done : CommandExit::refused);
}

int add_version(const Target& target, const std::string& node, const std::filesystem::path& program,
                const std::string& origin, bool json) {
  if (target.deployment.find(node) == nullptr) return no_node(node, json);
  VersionNumber number = 0;
  const auto added =
      suite::change_versions(target.var, node, [&](update::VersionStore& store) -> Result<void, std::string> {
        const auto done = store.add(program, origin.empty() ? program.string() : origin, system_utc_now());
        if (!done) return Err(done.error());
        number = *done;
        return {};
      });
  if (!added) return fail(CommandExit::refused, added.error(), json);
  return done(
      fmt::format("version {0} of {1} is stored; `srfs versions use {1} {0}` starts it", number, node), json,
      {{"version", number}});
}

int use_version(const Target& target, const std::string& node, const std::string& version,
                std::optional<seconds> wanted_probation, bool json) {
  const suite::NodeEntry* entry = target.deployment.find(node);
  if (entry == nullptr) return no_node(node, json);
  const auto number = parse_version(version, suite::read_versions(target.var, node).table);
  if (!number)
    return fail(CommandExit::usage, fmt::format("'{}' is not a version of {}", version, node), json);
  const auto& ring = target.deployment.ring;
  const milliseconds probation =
      wanted_probation ? milliseconds(*wanted_probation) : suite::default_probation(ring, node);
  const suite::LaunchRequest request{target.deployment, target.var, suite::suite_bin_folder(),
                                     fmt::format("{} by command", name_of(*number))};
  const auto used = suite::use_version(request, *entry, *number, probation);
  if (!used) return fail(CommandExit::refused, fmt::format("{}: {}", name_of(*number), used.error()), json);
  const auto& launched = *used;
  if (launched && launched->fallback)
    return fail(CommandExit::refused, fmt::format("{} runs {}", node, to_text(*launched->fallback)), json);
  const bool on_trial = suite::read_versions(target.var, node).table.on_trial() != nullptr;
  std::string what = fmt::format("{} {} {}", node, launched ? "runs" : "has", name_of(*number));
  if (on_trial) what += fmt::format(", on probation for {} s", probation / seconds(1));
  if (on_trial && suite::needs_confirmation(ring, node))
    what += fmt::format("\nit is rolled back unless `srfs versions confirm {} {}` comes within this time",
                        node, *number);
  return done(what, json,
              {{"version", *number},
               {"pid", launched ? Json(launched->pid) : Json(nullptr)},
               {"probation", on_trial}});
}

int confirm_version(const Target& target, const std::string& node, const std::string& version, bool json) {
  const auto number = parse_version(version, suite::read_versions(target.var, node).table);
  if (number && !suite::runs_since(target.var, node, *number))
    return fail(CommandExit::refused, fmt::format("{} does not run {}", node, name_of(*number)), json);
  return change(target, node, version, json, &update::VersionStore::commit, "is now the last good one");
}

int remove_version(const Target& target, const std::string& node, const std::string& version, bool json) {
  return change(target, node, version, json, &update::VersionStore::remove, "was removed");
}

}  // namespace srfs::tool
