// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/config.hpp"
#include "hw_sim/gps_receiver.hpp"
#include "hw_sim/peripheral.hpp"
#include "hw_sim/sky_camera.hpp"
#include "hw_sim/spacecraft_world.hpp"
#include "suite/peripheral.hpp"

namespace srfs::sim {

/// URIs of the devices section. One that is no "sim:" (of a serial line: one of hardware) is real, and not
/// simulated; so are the pulse and the serial line of a GPS receiver together.
struct DeviceUris {
  std::map<std::string, std::string> can;  ///< by the name of the bus
  std::string rs422;
  std::string gps_pulse;
  std::string gps_serial;
  std::string gpio;
  std::string watchdog;
  std::optional<std::string> camera;  ///< none: another one's, or none
};

struct WatchdogSettings {
  milliseconds timeout{10'000};
  std::vector<std::string> restart_command;  ///< empty: `srfs restart` beside this program
  milliseconds restart_limit{300'000};       ///< a restart command that runs longer is killed
};

/// What hw_sim takes from a deployment file.
struct SimulationSettings {
  DeviceUris devices;
  std::uint32_t baud = 921'600;
  std::vector<std::string> key_files;  ///< of the link, relative to VAR
  WorldSettings world;
  std::optional<UtcTime> orbit_start;  ///< nullopt: true time at the start
  PeripheralSettings peripheral;
  std::vector<suite::Peripheral> peripherals;  ///< where they are
  std::vector<std::string> real_peripherals;   ///< payloads whose peripherals are on the bus themselves
  GpsSettings gps;
  WatchdogSettings watchdog;
  SkyCameraSettings camera;
  double rs422_flip_probability = 0;   ///< of each bit
  double rs422_burst_probability = 0;  ///< of each octet to begin 32 octets of noise
  std::optional<std::string> can_log;  ///< relative to VAR; of a further bus: NAME.log beside it
  std::size_t can_log_limit =
      16U << 20U;  ///< octets; at the limit the file becomes FILE.1 and a new one starts
};

/// Reads `devices` and `link` for what concerns the simulation, and `simulation` strictly; not where the
/// peripherals are. Throws ConfigError.
[[nodiscard]] SimulationSettings read_settings(const ConfigSection& deployment);

}  // namespace srfs::sim
