// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/version_rules.hpp"

namespace srfs {

std::optional<update::VersionNumber> version_to_use(const update::VersionTable& table,
                                                    std::optional<update::VersionNumber> wanted) {
  const auto version = wanted ? wanted : table.previous();
  if (!version || (*version != update::golden && table.find(*version) == nullptr)) return std::nullopt;
  return version;
}

std::optional<FailureCode> judge_confirmation(const update::VersionTable& table,
                                              update::VersionNumber version,
                                              std::optional<MonotonicTime> runs_since,
                                              bool needs_confirmation, MonotonicTime accepted) {
  if (table.find(version) == nullptr) return mission::failure::no_version;
  if (table.last_good() == version) return mission::failure::none;
  if (!runs_since) return mission::failure::version_not_running;
  if (needs_confirmation && accepted < *runs_since) return mission::failure::confirmed_too_early;
  return std::nullopt;
}

std::optional<std::string> why_removed(const update::VersionTable& table) {
  if (table.active() != update::golden) return std::nullopt;
  return table.versions().empty() ? "no version left" : "rolled back: " + table.versions().back().reason;
}

bool is_on_probation(const std::optional<suite::VersionTrial>& trial) {
  return trial && (trial->lived < trial->probation || trial->to_confirm);
}

}  // namespace srfs
