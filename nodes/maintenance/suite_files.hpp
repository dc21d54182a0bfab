// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <concepts>
#include <optional>
#include <string>

#include "nodes/maintenance/suite_commands.hpp"
#include "suite/deployment.hpp"
#include "suite/instance.hpp"
#include "update/version_table.hpp"

namespace srfs {

/// The suite on disk and in processes, where telecommands change it.
struct SuiteFiles {
  suite::VarPaths var;
  suite::Deployment deployment;
  std::string own_node;  ///< that this process is
};

// Each carries one action out and returns what follows: the end of its telecommand, at last. What is so
// already is no failure, since a telecommand may be repeated. Blocks on disks and locks, and on the end and
// the start of a process: up to 10 s, on a worker.
[[nodiscard]] SuiteActions perform(const mission::RingHold& order, const SuiteFiles& suite);
[[nodiscard]] SuiteActions perform(const mission::RingRelease& order, const SuiteFiles& suite);
[[nodiscard]] SuiteActions perform(const mission::RingReleaseInactive& order, const SuiteFiles& suite);
[[nodiscard]] SuiteActions perform(const mission::RingRestoreOrders& order, const SuiteFiles& suite);
[[nodiscard]] SuiteActions perform(const mission::BootStepUp& order, const SuiteFiles& suite);
[[nodiscard]] SuiteActions perform(const mission::RingReportFaults& order, const SuiteFiles& suite);
[[nodiscard]] SuiteActions perform(const SendCrashReport& order, const SuiteFiles& suite);
[[nodiscard]] SuiteActions perform(const UseVersion& order, const SuiteFiles& suite);
[[nodiscard]] SuiteActions perform(const ConfirmVersion& order, const SuiteFiles& suite);
[[nodiscard]] SuiteActions perform(const mission::NodeRemoveVersion& order, const SuiteFiles& suite);
[[nodiscard]] SuiteActions perform(const mission::NodeReportVersions& order, const SuiteFiles& suite);
[[nodiscard]] SuiteActions perform(const mission::NodeRemove& order, const SuiteFiles& suite);

template <class Order>
concept SuiteOrder = requires(const Order& order, const SuiteFiles& suite) {
  { perform(order, suite) } -> std::same_as<SuiteActions>;
};

}  // namespace srfs
