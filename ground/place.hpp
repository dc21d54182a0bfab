// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace srfs::ground {

/// What says where the line is. Empty: nothing.
struct PlaceHints {
  std::string port_argument = {};     ///< --port
  std::string port_environment = {};  ///< SRFS_PORT
  std::string var_environment = {};   ///< SRFS_VAR
  bool var_here = false;              ///< var/rs422 exists in the present folder
  /// The VAR folders of this user's running simulations.
  std::vector<std::filesystem::path> running = {};
};

struct Place {
  std::string port;
  std::filesystem::path var;  ///< keys and, unless --state says otherwise, the folder of the counters
  friend bool operator==(const Place&, const Place&) = default;
};

/// Port and VAR: --port, SRFS_PORT, SRFS_VAR, the folder var here, the only simulation that runs. VAR is the
/// port's folder, but SRFS_VAR for a device of the computer (/dev/...), for an address (tcp:, udp:; without
/// SRFS_VAR: "var") and for a port of the environment. Pure.
[[nodiscard]] Place place_of(const PlaceHints& hints);

/// VAR in the command line of a simulator; nullopt: another program's.
[[nodiscard]] std::optional<std::filesystem::path> simulated_var(
    const std::vector<std::string>& command_line);

/// Of this user's processes. Reads /proc.
[[nodiscard]] std::vector<std::filesystem::path> running_simulations();

}  // namespace srfs::ground
