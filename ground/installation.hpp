// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "ground/telemetry.hpp"

namespace srfs::ground {

/// What has a package that is up verified, built, tested and, with @p activate, started in its node.
/// @param file  its name below VAR/files
[[nodiscard]] TelecommandText install_telecommand(const std::string& file, bool activate);
/// Asks what has become of it: events may be lost on the way.
[[nodiscard]] TelecommandText installation_question();

/// How an installation ends on board.
enum class InstallationEnd : std::uint8_t {
  installed,  ///< its node runs it, on probation
  candidate,  ///< built and tested, not started
  failed,     ///< or cancelled
};

/// An event, or the structure update_status, that is about the installation of @p file.
[[nodiscard]] bool is_about_installation(const TelemetryReport& report, const std::string& file);
/// nullopt: @p report shows no end of the installation of @p file.
[[nodiscard]] std::optional<InstallationEnd> installation_end(const TelemetryReport& report,
                                                              const std::string& file);

}  // namespace srfs::ground
