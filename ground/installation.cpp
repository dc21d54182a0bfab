// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/installation.hpp"

#include <algorithm>

#include <fmt/format.h>

namespace srfs::ground {
namespace {

std::string_view text_of(const TelemetryReport& report, std::string_view field) {
  const auto found =
      std::ranges::find_if(report.fields, [&](const auto& decoded) { return decoded.name == field; });
  return found == report.fields.end() ? std::string_view() : std::string_view(found->text);
}

/// Live: playback reports the past.
bool is_live(const TelemetryReport& report, TelemetryKind kind) {
  return report.kind == kind && report.vc != tm_channel::playback;
}

bool is_status(const TelemetryReport& report) {
  return is_live(report, TelemetryKind::housekeeping) && report.name == "update_status";
}

}  // namespace

TelecommandText install_telecommand(const std::string& file, bool activate) {
  return {.name = "package.install", .arguments = {"file=" + file, fmt::format("activate={}", activate)}};
}

TelecommandText installation_question() {
  return {.name = "package.report", .arguments = {}};
}

bool is_about_installation(const TelemetryReport& report, const std::string& file) {
  if (is_status(report)) return text_of(report, "file") == file;
  if (!is_live(report, TelemetryKind::event) || !report.name.starts_with("update.")) return false;
  return text_of(report, "file") == file || report.name == "update.log_queued";
}

std::optional<InstallationEnd> installation_end(const TelemetryReport& report, const std::string& file) {
  if (!is_about_installation(report, file)) return std::nullopt;
  const std::string_view told =
      is_status(report) ? text_of(report, "step") : std::string_view(report.name).substr(7);
  if (told == "installed") return InstallationEnd::installed;
  if (told == "candidate") return InstallationEnd::candidate;
  if (told == "failed" || told == "cancelled") return InstallationEnd::failed;
  return std::nullopt;
}

}  // namespace srfs::ground
