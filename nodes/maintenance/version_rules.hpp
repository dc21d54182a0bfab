// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include <mission/structures.hpp>

#include "base/result.hpp"
#include "base/time.hpp"
#include "suite/commanding/telecommand_journal.hpp"
#include "suite/ring/restart_policy.hpp"
#include "update/version_table.hpp"

namespace srfs {

/// What may be done with the versions of a node. Pure.

/// @param wanted  nullopt: the previous one
/// @return nullopt: the node has no such version
[[nodiscard]] std::optional<update::VersionNumber> version_to_use(
    const update::VersionTable& table, std::optional<update::VersionNumber> wanted);

/// A version of a node that the operator has to confirm proves itself by the telecommand that came through
/// it: one that was on its way before the version ran proves nothing.
/// @param runs_since  of a living process of this version; nullopt: there is none
/// @return how the telecommand ends at once; nullopt: the version is to be committed
[[nodiscard]] std::optional<FailureCode> judge_confirmation(const update::VersionTable& table,
                                                            update::VersionNumber version,
                                                            std::optional<MonotonicTime> runs_since,
                                                            bool needs_confirmation, MonotonicTime accepted);

/// Why an added node leaves the suite again: it has no golden version, and its last one failed. nullopt: it
/// stays.
[[nodiscard]] std::optional<std::string> why_removed(const update::VersionTable& table);

/// A limit violation counts against the version: its probation goes on. @param trial  nullopt: none
[[nodiscard]] bool is_on_probation(const std::optional<suite::VersionTrial>& trial);

}  // namespace srfs
