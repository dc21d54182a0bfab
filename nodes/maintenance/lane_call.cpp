// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/lane_call.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace srfs {
namespace {

std::string text_of(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

double number_of(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? std::max(0.0, found->get<double>()) : 0.0;
}

/// Last: the option takes all words behind it.
void require_layers(std::vector<std::string>& command, const LaneFolders& folders) {
  if (folders.required.empty()) return;
  command.emplace_back("--require");
  command.insert(command.end(), folders.required.begin(), folders.required.end());
}

}  // namespace

std::vector<std::string> build_command(const LaneFolders& folders, const update::Manifest& manifest) {
  std::vector<std::string> command{folders.program, "build",       "--sources", folders.sources(),
                                   "--name",        manifest.node, "--prefix",  folders.prefix,
                                   "--work",        folders.lane,  "--out",     folders.built(manifest.node),
                                   "--log",         folders.log(), "--report",  folders.report()};
  for (const std::string& option : manifest.options) command.push_back("--option=" + option);
  if (!folders.structures.empty())
    command.insert(command.end(), {"--structures", folders.structures.string()});
  // It costs five builds of a payload and 400 MB, and saves a third of one.
  command.emplace_back("--no-precompiled-header");
  require_layers(command, folders);
  return command;
}

std::vector<std::string> self_test_command(const LaneFolders& folders, const update::Manifest& manifest,
                                           const std::filesystem::path& deployment) {
  std::vector<std::string> command{
      folders.program, "self-test",   "--program",    folders.built(manifest.node),
      "--name",        manifest.node, "--deployment", deployment,
      "--work",        folders.lane,  "--seconds",    std::to_string(manifest.self_test.count()),
      "--log",         folders.log(), "--report",     folders.report()};
  if (manifest.kind == update::PackageKind::add)
    command.push_back("--added-nodes=" + folders.added_nodes().string());
  require_layers(command, folders);
  return command;
}

LaneReport read_lane_report(std::string_view json, std::string_view end) {
  LaneReport report;
  const auto parsed = nlohmann::json::parse(json, nullptr, false);
  const std::string outcome = parsed.is_object() ? text_of(parsed, "outcome") : std::string();
  if (outcome.empty()) {
    report.reason = fmt::format("no report from the build lane ({})", end);
    return report;
  }
  report.good = outcome == "built" || outcome == "passed";
  const std::string detail = text_of(parsed, "reason");
  report.reason = detail.empty() ? outcome : fmt::format("{}: {}", outcome, detail);
  report.program_sha256 = text_of(parsed, "sha256");
  report.program_octets = static_cast<std::uint64_t>(number_of(parsed, "octets"));
  report.took_ms = static_cast<std::uint64_t>(number_of(parsed, "seconds") * 1000.0);
  return report;
}

}  // namespace srfs
