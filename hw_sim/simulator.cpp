// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/simulator.hpp"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>
#include <sys/epoll.h>
#include <nlohmann/json.hpp>

#include "base/log.hpp"
#include "base/text.hpp"
#include "hw/open.hpp"
#include "hw_sim/frame_peripheral_channel.hpp"
#include "hw_sim/isotp_peripheral_channel.hpp"
#include "suite/deployment.hpp"

namespace srfs::sim {
namespace {

constexpr nanoseconds world_step = milliseconds(20);
constexpr nanoseconds longest_step = seconds(1);
constexpr std::string_view first_bus = "can";
constexpr nanoseconds kill_period = milliseconds(200);  // without power nothing that is started runs on
constexpr std::int64_t default_restart_ms = 100;        // of a controller that goes bus-off
constexpr std::uint64_t seeds_of_peripherals = 16;      ///< from the world's seed on, by CAN address

/// The path of a device this program serves.
Result<std::filesystem::path, std::string> served(const std::string& uri, const char* scheme,
                                                  const std::filesystem::path& var) {
  const auto parsed = hw::parse_device_uri(uri, {scheme});
  if (!parsed) return Err(parsed.error().message);
  return hw::below_var(parsed->rest, var);
}

std::string text_of(OctetView octets) {
  return {octets.begin(), octets.end()};
}

std::int64_t whole_ms(nanoseconds t) {
  return std::chrono::duration_cast<milliseconds>(t).count();
}

GpsPosition position_of(const OrbitState& orbit) {
  constexpr double degree = 57.29577951308232;
  const Eigen::Vector3d east = Eigen::Vector3d::UnitZ().cross(orbit.position_m).normalized();
  const Eigen::Vector3d north = orbit.position_m.cross(east).normalized();
  const double course = std::atan2(orbit.velocity_m_s.dot(east), orbit.velocity_m_s.dot(north));
  return {orbit.latitude_rad * degree, orbit.longitude_rad * degree, orbit.velocity_m_s.norm(),
          course * degree};
}

double probability(const nlohmann::json& section, const char* key, double fallback) {
  if (!section.contains(key)) return fallback;
  const nlohmann::json& value = section.at(key);
  if (!value.is_number() || !(value.get<double>() >= 0 && value.get<double>() <= 1)) {
    throw std::invalid_argument(fmt::format("'{}': expected a probability from 0 to 1", key));
  }
  return value.get<double>();
}

std::int64_t integer(const nlohmann::json& section, const char* key, std::int64_t lowest,
                     std::int64_t highest, std::int64_t fallback) {
  if (!section.contains(key)) return fallback;
  const nlohmann::json& value = section.at(key);
  if (!value.is_number_integer() || value.get<std::int64_t>() < lowest ||
      value.get<std::int64_t>() > highest) {
    throw std::invalid_argument(fmt::format("'{}': expected an integer from {} to {}", key, lowest, highest));
  }
  return value.get<std::int64_t>();
}

void only_keys(const nlohmann::json& section, std::initializer_list<const char*> known);

/// {"id": 0, "extended": false, "pause_us": 0}: eight octets of zero, by default with the highest priority of
/// all.
std::optional<Babble> babble_of(const nlohmann::json& faults) {
  if (!faults.contains("babble")) return std::nullopt;
  const nlohmann::json& section = faults.at("babble");
  only_keys(section, {"id", "extended", "pause_us"});
  if (section.contains("extended") && !section.at("extended").is_boolean())
    throw std::invalid_argument("'extended': expected true or false");
  Babble babble;
  babble.frame.extended = section.value("extended", false);
  babble.frame.id =
      static_cast<std::uint32_t>(integer(section, "id", 0, babble.frame.extended ? 0x1FFFFFFF : 0x7FF, 0));
  babble.frame.size = 8;
  babble.pause = microseconds(integer(section, "pause_us", 0, 1'000'000, 0));
  return babble;
}

void only_keys(const nlohmann::json& section, std::initializer_list<const char*> known) {
  if (!section.is_object()) throw std::invalid_argument("expected a JSON object");
  for (const auto& [key, value] : section.items()) {
    if (std::find_if(known.begin(), known.end(), [&](const char* k) { return key == k; }) == known.end()) {
      throw std::invalid_argument(
          fmt::format("'{}': unknown key, expected one of {}", key, fmt::join(known, ", ")));
    }
  }
}

std::unique_ptr<PeripheralChannel> channel_of(const PeripheralModel& model, std::uint8_t address) {
  if (auto frames = model.make_frames(address))
    return std::make_unique<FramePeripheralChannel>(std::move(frames));
  return std::make_unique<IsoTpPeripheralChannel>(address);
}

nlohmann::json counters_of(const Peripheral& peripheral, const CanPeripheral& on_bus) {
  const PeripheralCounters& c = peripheral.counters();
  const PeripheralChannel::Counters t = on_bus.channel_counters();
  return {{"powered", peripheral.powered()},
          {"fault", to_string(peripheral.fault())},
          {"requests", c.requests},
          {"invalid_requests", c.invalid_requests},
          {"unheard_requests", c.unheard_requests},
          {"answers", c.answers},
          {"dropped_answers", c.dropped_answers},
          {"executed", c.executed},
          {"repeats", c.repeats},
          {"resets", c.resets},
          {"power_cycles", c.power_cycles},
          {"babbled", on_bus.babbled()},
          {"frames_sent", t.frames_sent},
          {"frames_received", t.frames_received},
          {"transport_timeouts", t.timeouts}};
}

nlohmann::json counters_of(const CanHub& hub) {
  const BusCounters& b = hub.bus_counters();
  const CanHubCounters& h = hub.counters();
  return {{"submitted", b.submitted},
          {"delivered", b.delivered},
          {"refused_full", b.refused_full},
          {"refused_invalid", b.refused_invalid},
          {"muted", b.muted},
          {"lost", b.lost},
          {"corrupted", b.corrupted},
          {"error_frames", b.error_frames},
          {"discarded", b.discarded},
          {"refused_bus_off", b.refused_bus_off},
          {"lost_in_bus_off", b.lost_in_bus_off},
          {"withdrawn", b.withdrawn},
          {"bus_off", b.bus_off},
          {"restarts", b.restarts},
          {"babbled", b.babbled},
          {"computer_tec", hub.computer().transmit_errors()},
          {"computer_rec", hub.computer().receive_errors()},
          {"busy_us", b.busy.count() / 1000},
          {"clients", hub.clients()},
          {"malformed", h.malformed},
          {"receive_overruns", h.receive_overruns}};
}

nlohmann::json counters_of(const SerialLineCounters& c) {
  return {{"sent", c.sent}, {"carried", c.carried}, {"dropped", c.dropped}, {"flipped_bits", c.flipped_bits}};
}

nlohmann::json counters_of(const GpsDevice& gps) {
  const GpsDeviceCounters& c = gps.counters();
  return {{"pulses", c.pulses},
          {"suppressed_pulses", c.suppressed_pulses},
          {"stray_pulses", c.stray_pulses},
          {"sentences", c.sentences},
          {"unread_sentences", c.unread_sentences},
          {"late_sentences", c.late_sentences},
          {"fault", to_string(gps.receiver().fault())}};
}

nlohmann::json counters_of(const WatchdogDevice& watchdog) {
  const WatchdogDeviceCounters& c = watchdog.counters();
  return {{"armed", watchdog.timer().deadline().has_value()},
          {"feeds", watchdog.timer().feeds()},
          {"bites", watchdog.timer().bite_count()},
          {"disarmed", c.disarmed},
          {"restarts_started", c.restarts_started},
          {"restarts_failed", c.restarts_failed},
          {"restarts_killed", c.restarts_killed}};
}

}  // namespace

Simulator::Simulator(EventLoop& loop, const SimulationSettings& settings, MonotonicTime now)
    : loop_(loop),
      world_(settings.world, settings.orbit_start.value_or(settings.gps.start.value_or(system_utc_now()))),
      gpio_([this] { return world_.sensor_inputs(); },
            [this](std::size_t line, bool on) { switch_power(line, on); }),
      step_timer_(loop.add_timer([this](MonotonicTime t) { step(t); })),
      stepped_(now),
      flushed_(now) {
  loop_.set_timer(step_timer_, now + world_step);
}

void Simulator::make_stations(const SimulationSettings& settings, const PeripheralModels& models) {
  constexpr std::string_view prefix = "payload_";
  const auto& real = settings.real_peripherals;
  for (const suite::Peripheral& place : settings.peripherals) {
    if (std::find(real.begin(), real.end(), place.payload) != real.end()) continue;
    const auto make = models.find(place.payload);
    if (make == models.end()) {
      log::warn("no model of the peripheral of {}: CAN address {:#04x} is silent", place.payload,
                place.can_address);
      continue;
    }
    const std::string& payload = place.payload;
    Station station{payload.starts_with(prefix) ? payload.substr(prefix.size()) : payload, place, nullptr,
                    nullptr, nullptr};
    PeripheralSettings own = settings.peripheral;
    own.seed += place.can_address;
    station.model = make->second({world_, settings.world.seed + seeds_of_peripherals + place.can_address});
    station.peripheral = std::make_unique<Peripheral>(own, *station.model, loop_.running_now());
    stations_.push_back(std::move(station));
  }
}

void Simulator::switch_power(std::size_t line, bool on) {
  for (Station& station : stations_) {
    if (station.place.power_line != line) continue;
    log::info("power of {} switched {}", station.name, on ? "on" : "off");
    const RunningTime at = loop_.running_now();
    station.peripheral->set_power(on, at);
    station.on_bus->service(at);
  }
}

std::string Simulator::station_names() const {
  std::string names;
  for (const Station& station : stations_) names += (names.empty() ? "" : ", ") + station.name;
  return names;
}

Simulator::~Simulator() {
  for (auto& [name, bus] : buses_) {
    if (bus.hub) loop_.unwatch(bus.hub->fd());
  }
  loop_.set_timer(step_timer_, std::nullopt);
}

Result<std::unique_ptr<Simulator>, std::string> Simulator::create(
    EventLoop& loop, const SimulationSettings& settings, const PeripheralModels& models,
    const std::filesystem::path& var, const std::vector<std::string>& restart_command,
    std::function<void()> kill_computer) {
  const MonotonicTime now = monotonic_now();
  std::unique_ptr<Simulator> simulator(new Simulator(loop, settings, now));
  simulator->kill_computer_ = std::move(kill_computer);
  simulator->make_stations(settings, models);
  if (auto opened = simulator->open_can(settings, var); !opened) return Err(opened.error());
  if (auto opened = simulator->open_gps(settings, var, now); !opened) return Err(opened.error());
  if (auto opened = simulator->open_camera(settings, var, now); !opened) return Err(opened.error());
  if (auto opened = simulator->open_others(settings, var, restart_command); !opened)
    return Err(opened.error());
  return simulator;
}

Result<void, std::string> Simulator::open_hub(const std::string& name, const SimulationSettings& settings,
                                              const std::filesystem::path& var) {
  SimulatedBus& bus = buses_[name];
  bus.uri = settings.devices.can.at(name);
  const auto uri = hw::parse_device_uri(bus.uri, {"sim", "socketcan"});
  if (!uri) return Err(uri.error().message);
  if (uri->scheme != "sim") {
    if (settings.can_log)
      log::warn("simulation.can_log records only the simulated bus; use candump for {}", bus.uri);
    return {};
  }
  const std::uint64_t seed = settings.world.seed + 2 + buses_.size();
  auto hub = CanHub::create(hw::below_var(uri->rest, var), BusArbiter(500'000, 64, seed));
  if (!hub) return Err(hub.error());
  bus.hub = std::move(*hub);
  bus.hub->set_automatic_restart(milliseconds(default_restart_ms));
  loop_.watch(bus.hub->fd(), EPOLLIN,
              [hub = bus.hub.get()](std::uint32_t, MonotonicTime t) { hub->on_readable(t); });
  if (!settings.can_log) return {};
  std::filesystem::path file = hw::below_var(*settings.can_log, var);
  if (name != first_bus) file.replace_filename(name + ".log");
  bus.log = std::make_unique<CanLog>(file, settings.can_log_limit);
  bus.hub->set_tap([log = bus.log.get()](const BusDelivery& delivery) { log->record(delivery); });
  return {};
}

Result<void, std::string> Simulator::open_can(const SimulationSettings& settings,
                                              const std::filesystem::path& var) {
  for (const auto& [name, uri] : settings.devices.can) {
    if (auto opened = open_hub(name, settings, var); !opened) return opened;
  }
  for (Station& station : stations_) {
    const auto bus = buses_.find(station.place.bus);
    if (bus == buses_.end()) return Err(fmt::format("no bus '{}' of {}", station.place.bus, station.name));
    const std::uint8_t address = station.place.can_address;
    std::unique_ptr<PeripheralChannel> channel = channel_of(*station.model, address);
    std::vector<hw::CanFilter> filters;
    for (const wire::CanIdentifierPair& pair : channel->identifiers())
      filters.push_back(hw::exactly(pair.request, pair.answer, pair.extended));
    auto handle = hw::open_can(bus->second.uri, var, std::move(filters));
    if (!handle) return Err(handle.error().message);
    station.on_bus = std::make_unique<CanPeripheral>(loop_, station.name, address, std::move(*handle),
                                                     std::move(channel), *station.peripheral);
  }
  return {};
}

Result<void, std::string> Simulator::open_gps(const SimulationSettings& settings,
                                              const std::filesystem::path& var, MonotonicTime now) {
  const bool pulse_is_real = !settings.devices.gps_pulse.starts_with("sim:");
  const bool line_is_real = suite::is_hardware_line(settings.devices.gps_serial, var);
  if (pulse_is_real != line_is_real)
    return Err(fmt::format("gps_pulse {} and gps_serial {}: a receiver is real or simulated as a whole",
                           settings.devices.gps_pulse, settings.devices.gps_serial));
  if (pulse_is_real) return {};
  const auto pulse_path = served(settings.devices.gps_pulse, "sim", var);
  if (!pulse_path) return Err(pulse_path.error());
  const auto port_path = served(settings.devices.gps_serial, "serial", var);
  if (!port_path) return Err(port_path.error());
  auto pulse_socket = SeqpacketServer::create(loop_, *pulse_path, [](int, OctetView, MonotonicTime) {});
  if (!pulse_socket) return Err(pulse_socket.error());
  auto port = Pty::create(*port_path);
  if (!port) return Err(port.error());
  gps_ = std::make_unique<GpsDevice>(
      loop_, settings.gps, std::move(*pulse_socket), std::move(*port), *port_path,
      [this] { return position_of(world_.orbit()); }, now);
  return {};
}

Result<void, std::string> Simulator::open_camera(const SimulationSettings& settings,
                                                 const std::filesystem::path& var, MonotonicTime now) {
  if (!settings.devices.camera) return {};
  const auto path = served(*settings.devices.camera, "sim", var);
  if (!path) return Err(path.error());
  auto camera = CameraDevice::create(*path, settings.camera);
  if (!camera) return Err(camera.error());
  camera_ = std::move(*camera);
  camera_switched_ = settings.camera.switched;
  point_camera(now);
  return {};
}

void Simulator::point_camera(MonotonicTime now) {
  if (!camera_) return;
  const AttitudeState& state = world_.attitude().state();
  camera_->set_pose({state.attitude, state.rate_rad_s}, now,
                    world_.thermal().temperature_k(ThermalNode::camera));
  if (camera_switched_) camera_->set_power(world_.power().is_on(Load::camera));
}

Result<void, std::string> Simulator::open_line(const SimulationSettings& settings,
                                               const std::filesystem::path& var) {
  if (suite::is_hardware_line(settings.devices.rs422, var)) return {};
  const auto computer_port = served(settings.devices.rs422, "serial", var);
  if (!computer_port) return Err(computer_port.error());
  auto rs422 =
      Rs422Device::create(loop_, var / "rs422", *computer_port, settings.baud, settings.world.seed + 4);
  if (!rs422) return Err(rs422.error());
  rs422_ = std::move(*rs422);
  rs422_->set_flip_probability(settings.rs422_flip_probability);
  rs422_->set_burst_probability(settings.rs422_burst_probability);
  return {};
}

Result<void, std::string> Simulator::open_gpio(const SimulationSettings& settings,
                                               const std::filesystem::path& var) {
  if (!settings.devices.gpio.starts_with("sim:")) return {};
  const auto gpio_path = served(settings.devices.gpio, "sim", var);
  if (!gpio_path) return Err(gpio_path.error());
  auto gpio_socket =
      SeqpacketServer::create(loop_, *gpio_path, [this](int client, OctetView request, MonotonicTime) {
        gpio_socket_->send(client, gpio_.on_request(request));
      });
  if (!gpio_socket) return Err(gpio_socket.error());
  gpio_socket_ = std::move(*gpio_socket);
  return {};
}

Result<void, std::string> Simulator::open_others(const SimulationSettings& settings,
                                                 const std::filesystem::path& var,
                                                 const std::vector<std::string>& restart_command) {
  if (auto line = open_line(settings, var); !line) return line;
  if (auto gpio = open_gpio(settings, var); !gpio) return gpio;
  if (auto watchdog = open_watchdog(settings, var, restart_command); !watchdog) return watchdog;

  auto control = SeqpacketServer::create(
      loop_, var / "run" / "sim_control.sock", [this](int client, OctetView request, MonotonicTime now) {
        control_socket_->send(client, as_octets(on_control(text_of(request), now)));
      });
  if (!control) return Err(control.error());
  control_socket_ = std::move(*control);
  return {};
}

Result<void, std::string> Simulator::open_watchdog(const SimulationSettings& settings,
                                                   const std::filesystem::path& var,
                                                   const std::vector<std::string>& restart_command) {
  if (!settings.devices.watchdog.starts_with("sim:")) return {};  // the computer has a real one
  const auto watchdog_path = served(settings.devices.watchdog, "sim", var);
  if (!watchdog_path) return Err(watchdog_path.error());
  const WatchdogSettings& watchdog = settings.watchdog;
  watchdog_ = std::make_unique<WatchdogDevice>(
      loop_, watchdog.timeout, watchdog.restart_command.empty() ? restart_command : watchdog.restart_command,
      watchdog.restart_limit, std::filesystem::path(*watchdog_path).replace_extension(".boot"));
  auto watchdog_socket = SeqpacketServer::create(
      loop_, *watchdog_path,
      [this](int, OctetView datagram, MonotonicTime) { watchdog_->on_datagram(datagram); });
  if (!watchdog_socket) return Err(watchdog_socket.error());
  watchdog_socket_ = std::move(*watchdog_socket);
  return {};
}

void Simulator::step(MonotonicTime now) {
  if (now - stepped_ > longest_step) {
    ++late_steps_;
    stepped_ = now - longest_step;
  }
  world_.step(now - stepped_);
  for (Station& station : stations_) station.model->step(now - stepped_);
  stepped_ = now;
  follow_computer_power(now);
  point_camera(now);
  if (rs422_) rs422_->release_exclusive_holds();
  if (gps_) gps_->release_exclusive_hold();
  if (now - flushed_ >= seconds(1)) {
    for (auto& [name, bus] : buses_) {
      if (bus.log) bus.log->flush();
    }
    flushed_ = now;
  }
  loop_.set_timer(step_timer_, now + world_step);
}

void Simulator::follow_computer_power(MonotonicTime now) {
  const bool on = world_.power().state().computer_on;
  if (on != std::exchange(computer_on_, on)) switch_computer(on);
  if (on || now - killed_ < kill_period) return;
  killed_ = now;
  kill_computer_();
}

void Simulator::switch_computer(bool on) {
  if (on) {
    log::warn("the battery is charged again: the computer is switched on");
  } else {
    log::error("the battery is empty: computer and peripherals lose their power");
  }
  for (Station& station : stations_)
    station.peripheral->set_power(on && gpio_.power(station.place.power_line), loop_.running_now());
  if (watchdog_) watchdog_->set_power(on);
}

void Simulator::set_peripheral_fault(const nlohmann::json& request) {
  only_keys(request, {"peripheral", "fault", "delay_ms", "cured_by"});
  const std::string name = request.at("peripheral").get<std::string>();
  const auto found = std::find_if(stations_.begin(), stations_.end(),
                                  [&](const Station& station) { return station.name == name; });
  if (found == stations_.end())
    throw std::invalid_argument(fmt::format("'peripheral': expected one of {}", station_names()));
  const std::string wanted = request.value("fault", std::string("none"));
  const auto fault = peripheral_fault(wanted);
  const bool own = found->model->set_fault(wanted);
  if (!fault && own) return;
  if (!fault)
    throw std::invalid_argument(
        "'fault': expected one of none, silent, late, short, garbage, babble, or one of its model");
  const std::string cured_by = request.value("cured_by", std::string("never"));
  if (cured_by != "never" && cured_by != "restart" && cured_by != "power_cycle") {
    throw std::invalid_argument("'cured_by': expected one of never, restart, power_cycle");
  }
  const FaultCure cure = cured_by == "never"     ? FaultCure::never
                         : cured_by == "restart" ? FaultCure::restart
                                                 : FaultCure::power_cycle;
  const std::int64_t fallback_ms = *fault == PeripheralFault::late ? 100 : 0;
  found->peripheral->set_fault(*fault, milliseconds(integer(request, "delay_ms", 0, 60'000, fallback_ms)),
                               cure);
  found->on_bus->service(loop_.running_now());
}

void Simulator::set_bus_faults(const std::string& bus, const nlohmann::json& faults, MonotonicTime now) {
  only_keys(faults, {"loss", "bit_error", "corruption", "extra_delay_us", "muted", "babble", "bus_off",
                     "restart_ms"});
  CanHub* const hub = buses_.at(bus).hub.get();
  if (hub == nullptr)
    throw std::invalid_argument(
        fmt::format("'{}': the bus is a real interface; only the simulated bus has faults", bus));
  BusFaults all;  // what is not named is off
  all.loss_probability = probability(faults, "loss", 0);
  all.bit_error_probability = probability(faults, "bit_error", 0);
  all.corruption_probability = probability(faults, "corruption", 0);
  all.extra_delay = microseconds(integer(faults, "extra_delay_us", 0, 1'000'000, 0));
  for (const nlohmann::json& address : faults.value("muted", nlohmann::json::array())) {
    if (!address.is_number_unsigned() || address.get<std::uint64_t>() > 255) {
      throw std::invalid_argument("'muted': expected a list of addresses from 0 to 255");
    }
    all.muted.insert(address.get<std::uint8_t>());
  }
  const std::optional<Babble> babble = babble_of(faults);
  const milliseconds restart(integer(faults, "restart_ms", 0, 60'000, default_restart_ms));
  hub->set_faults(std::move(all));
  hub->set_babble(babble, now);
  hub->set_automatic_restart(restart > milliseconds(0) ? std::optional<nanoseconds>(restart) : std::nullopt);
  if (faults.contains("bus_off")) force_bus_off(bus, faults.at("bus_off").get<std::string>(), now);
}

void Simulator::force_bus_off(const std::string& bus, const std::string& station, MonotonicTime now) {
  std::optional<std::uint8_t> address;
  if (station == "computer") address = CanPeripheral::computer_address;
  for (const Station& known : stations_) {
    if (station == known.name && known.place.bus == bus) address = known.place.can_address;
  }
  if (!address)
    throw std::invalid_argument(fmt::format("'bus_off': expected one of computer, {}", station_names()));
  if (!buses_.at(bus).hub->force_bus_off(*address, now))
    throw std::invalid_argument(fmt::format("'bus_off': {} has not sent a frame yet", station));
}

void Simulator::set_line_faults(const nlohmann::json& faults) {
  only_keys(faults, {"flip_probability", "burst_probability", "cut"});
  if (!rs422_) throw std::invalid_argument("'rs422': the line is real; only the simulated one has faults");
  if (faults.contains("cut") && !faults.at("cut").is_boolean())
    throw std::invalid_argument("'cut': expected true or false");
  rs422_->set_flip_probability(probability(faults, "flip_probability", 0));
  rs422_->set_burst_probability(probability(faults, "burst_probability", 0));
  rs422_->set_cut(faults.value("cut", false));
}

void Simulator::set_gpio_inputs(const nlohmann::json& bank) {
  only_keys(bank, {"inputs"});
  const std::int64_t bits = integer(bank, "inputs", -1, 15, -1);
  gpio_.force_inputs(bits < 0 ? std::nullopt : std::optional(static_cast<std::uint8_t>(bits)));
}

/// {"fault": "none", "frames": 1}, {"pass": true} or {"covered": true}
void Simulator::set_camera(const nlohmann::json& wanted) {
  only_keys(wanted, {"fault", "frames", "pass", "covered"});
  if (!camera_) throw std::invalid_argument("'camera': the deployment's camera is not simulated");
  if (wanted.value("pass", false)) camera_->pass_next();
  if (wanted.contains("covered")) camera_->set_covered(wanted.at("covered").get<bool>());
  if (!wanted.contains("fault")) return;
  const auto how = camera_misbehaviour(wanted.at("fault").get<std::string>());
  if (!how)
    throw std::invalid_argument("'fault': expected one of none, absent, silent, short, torn, repeated");
  camera_->misbehave(*how, static_cast<int>(integer(wanted, "frames", 1, 1'000'000, 1)));
}

nlohmann::json Simulator::counters() const {
  nlohmann::json out;
  for (const Station& station : stations_)
    out["peripherals"][station.name] = counters_of(*station.peripheral, *station.on_bus);
  for (const auto& [name, bus] : buses_) {
    if (bus.hub) out[name] = counters_of(*bus.hub);
    if (bus.log) out[name]["log_octets_lost"] = bus.log->lost();
  }
  if (rs422_)
    out["rs422"] = {{"uplink", counters_of(rs422_->uplink())}, {"downlink", counters_of(rs422_->downlink())}};
  if (gps_) out["gps"] = counters_of(*gps_);
  if (watchdog_) out["watchdog"] = counters_of(*watchdog_);
  out["gpio"] = {{"requests", gpio_.counters().requests}, {"refused", gpio_.counters().refused}};
  if (camera_) out["camera"] = camera_->counters();
  out["late_steps"] = late_steps_;
  out["cpu_wait_ms"] = whole_ms(loop_.running_clock().waited());
  out["lost_ms"] = whole_ms(loop_.running_clock().lost());
  return out;
}

nlohmann::json Simulator::executed() const {
  nlohmann::json out;
  for (const Station& station : stations_) {
    out["executed"][station.name] = {{"count", station.peripheral->counters().executed},
                                     {"last", station.peripheral->history()}};
  }
  return out;
}

nlohmann::json Simulator::query(const std::string& what) const {
  if (what == "truth") {
    nlohmann::json truth = world_.truth();
    truth["utc"] = to_iso8601(gps_ ? gps_->true_utc(monotonic_now()) : system_utc_now(), 6);
    return truth;
  }
  if (what == "counters") return counters();
  if (what == "executed") return executed();
  if (what == "camera") return {{"camera", camera_ ? camera_->truth() : nlohmann::json()}};
  throw std::invalid_argument("'query': expected truth, counters, executed or camera");
}

/// A fault by name, or an object with the keys of a disturbance.
void Simulator::set_gps(const nlohmann::json& wanted) {
  if (!gps_) throw std::invalid_argument("'gps': the receiver is real; only the simulated one has faults");
  const nlohmann::json keys = wanted.is_object() ? wanted : nlohmann::json{{"fault", wanted}};
  // JSON is YAML: the reader of the deployment's script serves here, too.
  const ConfigSection section = ConfigSection::parse(keys.dump(), "gps");
  const GpsDisturbance disturbance = read_disturbance(section);
  section.finish();
  if (const auto done = gps_->disturb(disturbance); !done) throw std::runtime_error(done.error());
}

nlohmann::json Simulator::apply(const nlohmann::json& request, MonotonicTime now) {
  if (!request.is_object() || request.empty()) throw std::invalid_argument("expected a JSON object");
  nlohmann::json reply;
  if (request.contains("peripheral")) {
    set_peripheral_fault(request);
    reply["ok"] = true;
    return reply;
  }
  nlohmann::json others = request;  // than the buses
  for (const auto& [name, bus] : buses_) others.erase(name);
  only_keys(others, {"peripheral", "gps", "rs422", "gpio", "camera", "query"});
  if (request.contains("gps")) {
    set_gps(request.at("gps"));
  }
  if (request.contains("rs422")) set_line_faults(request.at("rs422"));
  for (const auto& [name, bus] : buses_) {
    if (request.contains(name)) set_bus_faults(name, request.at(name), now);
  }
  if (request.contains("gpio")) set_gpio_inputs(request.at("gpio"));
  if (request.contains("camera")) set_camera(request.at("camera"));
  if (request.contains("query")) reply = query(request.at("query").get<std::string>());
  reply["ok"] = true;
  return reply;
}

std::string Simulator::on_control(const std::string& request, MonotonicTime now) {
  nlohmann::json reply;
  try {
    reply = apply(nlohmann::json::parse(request), now);
    if (request.find("\"query\"") == std::string::npos) log::info("control: {}", request);
  } catch (const std::exception& e) {  // JSON's parser and accessors throw; anybody may write to the socket
    reply = {{"ok", false}, {"error", e.what()}};
  }
  return reply.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace srfs::sim
