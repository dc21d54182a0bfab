// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <mission/structures.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>
#include <srfs_msgs/srv/save_parameters.hpp>

#include "base/time.hpp"
#include "nodes/maintenance/encoded.hpp"
#include "nodes/maintenance/report_downlink.hpp"
#include "nodes/maintenance/update_transaction.hpp"
#include "suite/commanding/telecommand_journal.hpp"
#include "suite/deployment.hpp"

namespace srfs {

// What telecommands cause; carried out by the adapter in the given order. A telecommand that leaves nothing
// to decide is an action itself (mission::RingHold). suite_files.hpp carries out those that need a disk.

/// The report of a node's death goes down.
struct SendCrashReport {
  std::string node;
  std::optional<std::uint32_t> incarnation;  ///< nullopt: the newest
};
/// The node is restarted in this version of its program.
struct UseVersion {
  std::string node;
  std::optional<update::VersionNumber> version;  ///< nullopt: the previous one
  milliseconds probation{0};
};
struct ConfirmVersion {
  std::string node;
  update::VersionNumber version = update::golden;
  MonotonicTime accepted;  ///< the telecommand, by ttc
};
/// The parameter `log_level` of the node. Answer with on_log_level_set().
struct SetLogLevel {
  std::string node;
  std::string level;
};
/// A call of the node's ~/save_parameters. Answer with on_saved().
struct SaveNodeParameters {
  std::string node;
  srfs_msgs::srv::SaveParameters_Request request;
};
/// A round of scrubbing.
struct RunScrubbing {
  bool retake = false;
};
/// Structures on request, one after the other; then the telecommand has ended.
struct SendLines {
  std::vector<EncodedLine> lines;
};
struct ReportQueuedForDownlink {
  QueuedReport report;
};
/// A node refused what was asked of its parameters.
struct ReportParametersRefused {
  std::string node;
  std::string reason;
};
/// Why a telecommand failed, for the log.
struct LogFailure {
  std::string text;
};

using SuiteAction =
    std::variant<AnswerTelecommand, mission::RingHold, mission::RingRelease, mission::RingReleaseInactive,
                 mission::RingRestoreOrders, mission::BootStepUp, mission::RingReportFaults, SendCrashReport,
                 UseVersion, ConfirmVersion, mission::NodeRemoveVersion, mission::NodeReportVersions,
                 mission::NodeRemove, SetLogLevel, SaveNodeParameters, mission::PackageInstall,
                 mission::PackageCancel, mission::PackageReport, RunScrubbing, mission::ScrubReport,
                 SendLines, ReportQueuedForDownlink, ReportParametersRefused, LogFailure, EndOwnProcess>;
using SuiteActions = std::vector<SuiteAction>;

/// Why a telecommand is refused; mission::failure::none: it is not. Pure.
[[nodiscard]] FailureCode check_command(std::uint16_t function, OctetView arguments,
                                        const suite::Deployment& deployment);
/// What a telecommand causes. One that a process of another version stored, and that this one does not know,
/// is answered with why. Pure.
[[nodiscard]] SuiteActions actions_of(const StoredTelecommand& telecommand,
                                      const suite::Deployment& deployment);

/// @param answer  nullptr: there was none in time
[[nodiscard]] SuiteActions on_saved(const SaveNodeParameters& asked,
                                    const srfs_msgs::srv::SaveParameters_Response* answer);
[[nodiscard]] SuiteActions on_log_level_set(const rcl_interfaces::srv::SetParameters_Response* answer);

}  // namespace srfs
