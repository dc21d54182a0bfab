// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/settings.hpp"

#include <array>
#include <cmath>

#include <fmt/format.h>

#include "hw/open.hpp"

namespace srfs::sim {
namespace {

constexpr double degree = 0.017453292519943295;

std::optional<UtcTime> instant(const ConfigSection& section, const char* key) {
  if (!section.has(key)) return std::nullopt;
  const auto time = from_iso8601(section.text(key));
  if (!time) throw section.bad(key, "a UTC instant like 2026-11-21T08:00:00Z");
  return time;
}

milliseconds duration_ms(const ConfigSection& section, const char* key, std::int64_t lowest,
                         std::int64_t highest, milliseconds fallback) {
  return milliseconds(section.integer(key, lowest, highest, fallback.count()));
}

std::string device(const ConfigSection& section, const char* key, const std::vector<std::string>& schemes) {
  std::string uri = section.text(key);
  if (const auto parsed = hw::parse_device_uri(uri, schemes); !parsed)
    throw section.bad(key, "a device of the simulation (" + parsed.error().message + ")");
  return uri;
}

/// The camera where hw_sim plays it.
std::optional<std::string> own_camera(const ConfigSection& section) {
  if (!section.has("camera") || !section.text("camera").starts_with("sim:")) return std::nullopt;
  return device(section, "camera", {"sim"});
}

DeviceUris read_devices(const ConfigSection& deployment) {
  const ConfigSection section = deployment.section("devices");
  std::map<std::string, std::string> buses;
  buses["can"] = device(section, "can", {"sim", "socketcan"});
  for (const ConfigSection& bus : deployment.sections("buses")) {
    const std::string name = bus.text("name");
    buses[name] = device(section, name.c_str(), {"sim", "socketcan"});
  }
  return {std::move(buses),
          device(section, "rs422", {"serial"}),
          device(section, "gps_pulse", {"sim", "pps", "gpiochip"}),
          device(section, "gps_serial", {"serial"}),
          device(section, "gpio", {"sim", "gpiochip"}),
          device(section, "watchdog", {"sim", "dev"}),
          own_camera(section)};
}

void read_link(const ConfigSection& section, SimulationSettings& settings) {
  settings.baud = static_cast<std::uint32_t>(section.integer("baud", 1200, 4'000'000, settings.baud));
  for (const ConfigSection& channel : section.sections("tc_channels")) {
    if (channel.has("key_file")) settings.key_files.push_back(channel.text("key_file"));
  }
  const ConfigSection tm = section.section("tm");
  if (tm.has("key_file")) settings.key_files.push_back(tm.text("key_file"));
  for (const ConfigSection& key : section.sections("key_encryption_keys"))
    settings.key_files.push_back(key.text("key_file"));
}

void read_orbit(const ConfigSection& section, SimulationSettings& settings) {
  OrbitSettings& orbit = settings.world.orbit;
  orbit.altitude_m = section.number("altitude_km", 200, 2000, orbit.altitude_m / 1000) * 1000;
  orbit.inclination_rad = section.number("inclination_deg", 0, 180, orbit.inclination_rad / degree) * degree;
  orbit.local_time_of_ascending_node_h =
      section.number("local_time_of_ascending_node_h", 0, 24, orbit.local_time_of_ascending_node_h);
  orbit.argument_of_latitude_rad = section.number("argument_of_latitude_deg", 0, 360, 0) * degree;
  settings.orbit_start = instant(section, "start_utc");
  section.finish();
}

void read_gps(const ConfigSection& section, GpsSettings& gps) {
  gps.pulse_period = duration_ms(section, "pulse_period_ms", 20, 1000, gps.pulse_period);
  if (1000 % gps.pulse_period.count() != 0) throw section.bad("pulse_period_ms", "a divisor of 1000");
  gps.sentence_delay = duration_ms(section, "sentence_delay_ms", 0, 900, gps.sentence_delay);
  gps.start = instant(section, "start_utc");
  gps.drift_ppm = section.number("drift_ppm", -1000, 1000, gps.drift_ppm);
  if (gps.drift_ppm != 0 && !gps.start) throw section.bad("drift_ppm", "0 unless gps.start_utc is given");
  gps.jitter_us = section.number("jitter_us", 0, 1000, gps.jitter_us);
  gps.wander_ppm = section.number("wander_ppm", 0, 100, gps.wander_ppm);
  if (gps.wander_ppm != 0 && !gps.start) throw section.bad("wander_ppm", "0 unless gps.start_utc is given");
  gps.wander_period = seconds(section.integer("wander_period_s", 10, 1'000'000, gps.wander_period.count()));
  const std::string protocol = section.has("protocol") ? section.text("protocol") : "nmea";
  if (protocol != "nmea" && protocol != "ubx" && protocol != "both")
    throw section.bad("protocol", "nmea, ubx or both");
  gps.protocol = protocol == "nmea"  ? GpsProtocol::nmea
                 : protocol == "ubx" ? GpsProtocol::ubx
                                     : GpsProtocol::both;
  for (const ConfigSection& entry : section.sections("script")) {
    const nanoseconds at = milliseconds(std::llround(entry.number("at_s", 0, 1e6, 0) * 1000));
    if (!gps.script.empty() && at < gps.script.back().at)
      throw entry.bad("at_s", "a time not before the entry above");
    gps.script.push_back({at, read_disturbance(entry)});
    entry.finish();
  }
  section.finish();
}

void read_watchdog(const ConfigSection& section, WatchdogSettings& watchdog) {
  watchdog.timeout = duration_ms(section, "timeout_ms", 100, 3'600'000, watchdog.timeout);
  watchdog.restart_command = section.texts("restart_command");
  watchdog.restart_limit = duration_ms(section, "restart_limit_ms", 1000, 600'000, watchdog.restart_limit);
  section.finish();
}

void read_peripherals(const ConfigSection& section, SimulationSettings& settings) {
  PeripheralSettings& peripheral = settings.peripheral;
  settings.real_peripherals = section.texts("real");
  peripheral.boot_time = duration_ms(section, "boot_ms", 0, 60'000, peripheral.boot_time);
  peripheral.restart_time = duration_ms(section, "restart_ms", 0, 60'000, peripheral.restart_time);
  peripheral.answer_delay =
      microseconds(section.integer("answer_delay_us", 0, 1'000'000, peripheral.answer_delay.count()));
  section.finish();
}

void read_camera(const ConfigSection& section, SkyCameraSettings& camera) {
  camera.width = static_cast<int>(section.integer("width", 64, 4096, camera.width));
  camera.height = static_cast<int>(section.integer("height", 64, 4096, camera.height));
  camera.bits = static_cast<int>(section.integer("bits", 8, 16, camera.bits));
  camera.field_deg = section.number("field_deg", 0.5, 60, camera.field_deg);
  camera.fwhm_px = section.number("fwhm_px", 0.5, 6, camera.fwhm_px);
  camera.background_e_s = section.number("background_e_s", 0, 1e6, camera.background_e_s);
  camera.read_noise_e = section.number("read_noise_e", 0, 1000, camera.read_noise_e);
  camera.switched = section.boolean("switched", camera.switched);
  camera.warm_share = section.number("warm_share", 0, 1, camera.warm_share);
  camera.warm_e_s = section.number("warm_e_s", 0, 1e6, camera.warm_e_s);
  camera.hot_pixels = static_cast<int>(section.integer("hot_pixels", 0, 100'000, camera.hot_pixels));
  if (section.has("pointing")) {
    const ConfigSection pointing = section.section("pointing");
    camera.pointing = FixedPointing{pointing.number("ra_deg", 0, 360), pointing.number("dec_deg", -90, 90),
                                    pointing.number("roll_deg", -360, 360, 0),
                                    pointing.number("drift_arcsec_s", -36'000, 36'000, 0)};
    pointing.finish();
  }
  const ConfigSection debris = section.section("debris");
  camera.debris.interval_s = debris.number("interval_s", 0, 1e6, camera.debris.interval_s);
  camera.debris.rate_deg_s = debris.number("rate_deg_s", 0.01, 20, camera.debris.rate_deg_s);
  camera.debris.magnitude = debris.number("magnitude", -5, 12, camera.debris.magnitude);
  debris.finish();
  section.finish();
}

template <std::size_t size>
std::array<double, size> numbers(const ConfigSection& section, const char* key, double lowest, double highest,
                                 const std::array<double, size>& fallback) {
  if (!section.has(key)) return fallback;
  const std::string expected = fmt::format("a list of {} numbers from {} to {}", size, lowest, highest);
  const YAML::Node list = section.raw(key);
  if (!list.IsSequence() || list.size() != size) throw section.bad(key, expected);
  std::array<double, size> values{};
  for (std::size_t i = 0; i < size; ++i) {
    if (!YAML::convert<double>::decode(list[i], values[i]) || !(values[i] >= lowest && values[i] <= highest))
      throw section.bad(key, expected);
  }
  return values;
}

Eigen::Vector3d vector(const ConfigSection& section, const char* key, double most, double unit,
                       const Eigen::Vector3d& fallback) {
  const auto values =
      numbers<3>(section, key, -most, most, {fallback[0] / unit, fallback[1] / unit, fallback[2] / unit});
  return unit * Eigen::Vector3d(values[0], values[1], values[2]);
}

void read_power(const ConfigSection& section, PowerSettings& power) {
  power.capacity_a_h = section.number("capacity_a_h", 0.1, 1000, power.capacity_a_h);
  power.base_load_w = section.number("computer_w", 0, 100, power.base_load_w);
  power.load_w = numbers<load_count>(section, "loads_w", 0, 100, power.load_w);
  power.initial_switches =
      static_cast<std::uint8_t>(section.integer("initial_switches", 0, 15, power.initial_switches));
  power.undervoltage_charge = section.number("undervoltage_charge", 0, 1, power.undervoltage_charge);
  power.cut_out_charge = section.number("cut_out_charge", 0, 1, power.cut_out_charge);
  power.restore_charge = section.number("restore_charge", 0, 1, power.restore_charge);
  if (power.restore_charge < power.cut_out_charge)
    throw section.bad("restore_charge", "a charge not below cut_out_charge");
  section.finish();
}

void read_thermal(const ConfigSection& section, ThermalSettings& thermal) {
  const auto watts = numbers<heater_count>(section, "heaters_w", 0, 100,
                                           {thermal.heaters[0].power_w, thermal.heaters[1].power_w});
  for (std::size_t i = 0; i < heater_count; ++i) thermal.heaters[i].power_w = watts[i];
  section.finish();
}

void read_attitude(const ConfigSection& section, AttitudeSettings& attitude) {
  attitude.initial_rate_rad_s =
      vector(section, "initial_rate_deg_s", 360, degree, attitude.initial_rate_rad_s);
  attitude.initial_wheel_speed_rad_s = vector(section, "initial_wheel_speed_rad_s",
                                              attitude.wheel_max_speed_rad_s, 1, Eigen::Vector3d::Zero());
  attitude.disturbance_n_m = vector(section, "disturbance_n_m", 1, 1, Eigen::Vector3d::Zero());
  section.finish();
}

void read_simulation(const ConfigSection& section, SimulationSettings& settings) {
  WorldSettings& world = settings.world;
  world.seed = static_cast<std::uint64_t>(
      section.integer("seed", 0, INT64_MAX, static_cast<std::int64_t>(world.seed)));
  world.time_acceleration = section.number("time_acceleration", 0, 1000, world.time_acceleration);
  world.attitude_acceleration = section.number("acceleration_attitude", 0, 100, world.attitude_acceleration);
  world.power.initial_charge = section.number("initial_charge", 0, 1, world.power.initial_charge);
  read_power(section.section("power"), world.power);
  read_thermal(section.section("thermal"), world.thermal);
  read_attitude(section.section("attitude"), world.attitude);
  read_orbit(section.section("orbit"), settings);
  read_gps(section.section("gps"), settings.gps);
  read_watchdog(section.section("watchdog"), settings.watchdog);
  read_camera(section.section("camera"), settings.camera);
  read_peripherals(section.section("peripherals"), settings);
  const ConfigSection rs422 = section.section("rs422");
  settings.rs422_flip_probability = rs422.number("flip_probability", 0, 0.5, 0);
  settings.rs422_burst_probability = rs422.number("burst_probability", 0, 0.5, 0);
  rs422.finish();
  if (section.has("can_log")) settings.can_log = section.text("can_log");
  settings.can_log_limit = static_cast<std::size_t>(section.integer("can_log_limit_mib", 1, 1024, 16)) << 20U;
  section.finish();
  settings.gps.seed = world.seed + 1;
  settings.peripheral.seed = world.seed + 2;
  settings.camera.seed = world.seed + 5;
}

}  // namespace

SimulationSettings read_settings(const ConfigSection& deployment) {
  SimulationSettings settings;
  settings.devices = read_devices(deployment);
  read_link(deployment.section("link"), settings);
  read_simulation(deployment.section("simulation"), settings);
  return settings;
}

}  // namespace srfs::sim
