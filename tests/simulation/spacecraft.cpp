// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/spacecraft.hpp"

#include "adcs_profile.hpp"
#include "eps_profile.hpp"
#include "thermal_profile.hpp"

namespace srfs::sim {
std::unique_ptr<PeripheralModel> make_payload_adcs_model(const ModelContext&);
std::unique_ptr<PeripheralModel> make_payload_eps_model(const ModelContext&);
std::unique_ptr<PeripheralModel> make_payload_thermal_model(const ModelContext&);
}  // namespace srfs::sim

namespace srfs::simulation {
namespace {

constexpr std::array<Lane, Spacecraft::payload_count> payload_lanes{Lane::payload_adcs, Lane::payload_eps,
                                                                    Lane::payload_thermal};
constexpr std::uint8_t first_can_address = 0x11;
constexpr std::size_t nodes = 9;
constexpr nanoseconds world_period = milliseconds(100);
const UtcTime start_utc{seconds(1'795'000'000)};

sim::WorldSettings world_settings(Kernel& kernel) {
  sim::WorldSettings settings;
  settings.time_acceleration = 1;
  settings.seed = kernel.random("world").next();
  settings.power.undervoltage_charge = 0;  // the power supply sheds nothing by itself
  settings.power.cut_out_charge = 0.037;   // launch_config/sim_mission.yaml
  return settings;
}

/// A node with its half of the ring, and of the mode. Payloads have that themselves.
class NodeProcess final : public Program {
 public:
  using OnMode = std::function<void(const suite::ModeReaction& reaction)>;
  NodeProcess(Host& host, Ring& ring, Topics& topics, const suite::ModeSettings& modes,
              std::unique_ptr<Program> logic, OnMode on_mode)
      : logic_(std::move(logic)),
        ring_(host, ring),
        mode_(host, topics, modes, [this, on_mode = std::move(on_mode)] {
          on_mode(mode_.reaction());
          mode_.report_obeyed(0);
        }) {}
  void start() override {
    if (logic_) logic_->start();
    if (payload() == nullptr) mode_.start();
    ring_.start();
  }
  [[nodiscard]] Program* logic() { return logic_.get(); }
  [[nodiscard]] const ModeFollowing& mode() {
    const Payload* const followed = payload();
    return followed != nullptr ? followed->mode() : mode_;
  }

 private:
  [[nodiscard]] const Payload* payload() const { return dynamic_cast<const Payload*>(logic_.get()); }

  std::unique_ptr<Program> logic_;
  Ring::Member ring_;
  ModeFollowing mode_;
};

template <class Profile>
std::unique_ptr<PayloadProfile> make_profile() {
  return std::make_unique<Profile>();
}

std::unique_ptr<sim::PeripheralModel> make_model(std::size_t payload, const sim::ModelContext& context) {
  switch (payload) {
    case 0:
      return sim::make_payload_adcs_model(context);
    case 1:
      return sim::make_payload_eps_model(context);
    default:
      return sim::make_payload_thermal_model(context);
  }
}

}  // namespace

// ---------------------------------------------------------------- a peripheral

Device::Device(Kernel& kernel, CanLine& can, std::uint8_t address,
               std::unique_ptr<sim::PeripheralModel> model)
    : kernel_(kernel),
      model_(std::move(model)),
      peripheral_({.seed = address}, *model_, now()),
      can_(can.open_device([this] { service(); })),
      endpoint_(address, *can_, std::make_unique<sim::IsoTpPeripheralChannel>(address), peripheral_),
      timer_(
          kernel,
          [&kernel](nanoseconds delay, Kernel::Event event) { kernel.later(delay, std::move(event)); },
          [this] { service(); }) {
  service();
}

void Device::service() {
  endpoint_.service(now());
  const auto& history = peripheral_.history();
  for (const std::uint64_t all = peripheral_.counters().executed; executed_ < all; ++executed_) {
    if (on_executed_) on_executed_(history[history.size() - (all - executed_)]);
  }
  const auto next = endpoint_.next_deadline(now());
  timer_.arm(next ? std::optional(MonotonicTime(next->since_epoch())) : std::nullopt);
}

bool Device::switch_power(bool on) {
  if (stuck_) return false;
  peripheral_.set_power(on, now());
  service();
  return true;
}

void Device::set_fault(sim::PeripheralFault fault, milliseconds delay, sim::FaultCure cure) {
  peripheral_.set_fault(fault, delay, cure);
  service();
}

// ---------------------------------------------------------------- the spacecraft

/// Read once: it takes as long as minutes of flight.
const mission::Dictionary& Spacecraft::dictionary() {
  static const mission::Dictionary read = mission::Dictionary::load(mission::Dictionary::default_folder());
  return read;
}

Spacecraft::Spacecraft(Kernel& kernel, const SpacecraftSettings& flown)
    : kernel_(kernel),
      settings_(flown),
      world_(world_settings(kernel), start_utc),
      gps_{sim::GpsReceiver([&kernel] {
             sim::GpsSettings settings;
             settings.start = start_utc;
             settings.jitter_us = 0.2;
             settings.seed = kernel.random("gps").next();
             return settings;
           }()),
           sim::TrueTime(kernel.now(), start_utc, 3.0, 0.2),
           nullptr,
           {},
           {}},
      key_(std::array<std::uint8_t, wire::sdls_key_octets>{7}),
      ttc_flash_(kernel, dictionary()),
      maintenance_flash_(kernel),
      commands_(kernel, link_, gps_.truth, ttc_flash_.stores) {
  for (std::size_t i = 0; i < payload_count; ++i) {
    slots_.push_back({.payload = to_text(payload_lanes[i]),
                      .allotted = milliseconds(60),
                      .overrun = milliseconds(20),
                      .reset = milliseconds(40)});
    const auto address = static_cast<std::uint8_t>(first_can_address + i);
    devices_.push_back(std::make_unique<Device>(
        kernel_, can_, address, make_model(i, {world_, kernel_.random(slots_[i].payload).next()})));
    devices_.back()->on_executed([this](std::uint32_t id) { commands_.on_executed(id); });
  }
  std::vector<Host*> members;
  for (std::size_t i = 0; i < nodes; ++i) {
    hosts_.push_back(std::make_unique<Host>(kernel_, static_cast<Lane>(i),
                                            [this](Host& host) { return make_program(host); }));
    hosts_.back()->set_observer([this](Host& host) { on_process(host); });
    members.push_back(hosts_.back().get());
  }
  versions_ = std::make_unique<Versions>(kernel_, disk_, members);
  ring_ = std::make_unique<Ring>(kernel_, network_, *versions_, members);
  can_.set_tap([this](Lane writer) { check_writer(writer); });
  station_ = std::make_unique<Station>(
      kernel_, dictionary(), link_, key_, commands_, ttc_flash_.files, gps_.truth,
      [this](const Octets& octets) {
        Host& ttc = host(Lane::ttc);
        if (!ttc.is_up()) return;  // nobody reads the line
        ttc.give([&ttc, octets] {
          static_cast<Ttc*>(static_cast<NodeProcess*>(ttc.program())->logic())->on_line(octets);
        });
      });
  boots_ = 1;
  boot_id_ = "boot1";
  powered_ = true;
  ring_->start_all();
  schedule_pulse();
  step_world();
  kernel_.later(seconds(20), [this] { work_on_packages(); });
  kernel_.later(seconds(60), [this] { work_on_versions(); });
}

/// Programs use all that is here.
Spacecraft::~Spacecraft() {
  for (const auto& host : hosts_) host->discard();
}

std::unique_ptr<Program> Spacecraft::make_program(Host& host) {
  const bool installs = host.lane() == Lane::maintenance;
  return std::make_unique<NodeProcess>(host, *ring_, topics_, settings_.modes, make_logic(host),
                                       [this, installs](const suite::ModeReaction& reaction) {
                                         if (installs) rest_maintenance(!reaction.work);
                                       });
}

std::unique_ptr<Program> Spacecraft::make_logic(Host& made_for) {
  switch (made_for.lane()) {
    case Lane::timing:
      return std::make_unique<Timing>(made_for,
                                      TimingSurroundings{topics_,
                                                         network_,
                                                         disk_,
                                                         gps_,
                                                         watchdog_,
                                                         {&host(Lane::can_switcher), &host(Lane::ttc)},
                                                         boot_id_,
                                                         newest_cycle_,
                                                         reserved_cycle_});
    case Lane::can_switcher:
      return std::make_unique<Switcher>(made_for,
                                        SwitcherSurroundings{topics_, can_, slots_,
                                                             [this](const std::string& name) -> Host* {
                                                               for (const auto& h : hosts_) {
                                                                 if (h->name() == name) return h.get();
                                                               }
                                                               return nullptr;
                                                             },
                                                             host(Lane::timing), holder_word_, ledger_});
    case Lane::payload_adcs:
    case Lane::payload_eps:
    case Lane::payload_thermal: {
      static constexpr std::array profiles{make_profile<AdcsProfile>, make_profile<EpsProfile>,
                                           make_profile<ThermalProfile>};
      const auto i = static_cast<std::size_t>(made_for.lane()) - static_cast<std::size_t>(Lane::payload_adcs);
      return std::make_unique<Payload>(
          made_for, PayloadSurroundings{topics_, network_, can_, disk_, *devices_[i], ids_lost_[i], opened_,
                                        slots_, host(Lane::can_switcher), host(Lane::ttc),
                                        static_cast<std::uint8_t>(first_can_address + i), boot_id_,
                                        profiles[i], dictionary(), settings_.modes});
    }
    case Lane::ttc:
      return std::make_unique<Ttc>(made_for, ttc_surroundings());
    case Lane::maintenance:
      return std::make_unique<Maintenance>(made_for, maintenance_surroundings());
    default:
      return nullptr;
  }
}

MaintenanceSurroundings Spacecraft::maintenance_surroundings() {
  std::vector<Host*> nodes_there;
  for (const auto& h : hosts_) nodes_there.push_back(h.get());
  return {disk_,
          maintenance_flash_,
          *versions_,
          std::move(nodes_there),
          powered_,
          maintenance_rests_,
          [this](const Host& node) { return ring_->is_locked(node); },
          [this](Host& node) { return ring_->restart_now(node); }};
}

/// The operator has new programs installed.
void Spacecraft::work_on_packages() {
  Random& random = packages_operator_;
  kernel_.later(random.between(seconds(10), seconds(90)), [this] { work_on_packages(); });
  Host& host = this->host(Lane::maintenance);
  if (!station_->works() || !host.is_up()) return;
  const bool cancels = random.one_in(8);
  // A package that has ended and comes again is stored again.
  const bool is_new = package_.empty() || packages().of(package_).ended;
  if (!random.one_in(4) || is_new) package_ = packages().make(hosts_.size());
  with_maintenance([cancels, file = package_](Maintenance& maintenance) {
    cancels ? maintenance.cancel() : maintenance.install(file);
  });
}

void Spacecraft::with_maintenance(std::function<void(Maintenance& maintenance)> work) {
  Host& host = this->host(Lane::maintenance);
  if (!host.is_up()) return;
  host.give([&host, work = std::move(work)] {
    work(*static_cast<Maintenance*>(static_cast<NodeProcess*>(host.program())->logic()));
  });
}

/// The operator has a node run another one of its versions, also one that failed.
void Spacecraft::work_on_versions() {
  Random& random = versions_operator_;
  kernel_.later(random.between(seconds(30), seconds(200)), [this] { work_on_versions(); });
  if (!station_->works()) return;
  std::vector<std::pair<std::string, update::VersionNumber>> all;
  for (const auto& host : hosts_) {
    const update::VersionTable table = versions_->read(*host);
    for (const update::Version& version : table.versions()) all.emplace_back(host->name(), version.number);
  }
  if (all.empty()) return;
  const auto& [node, version] = all[random.below(all.size())];
  const bool is_golden = random.one_in(8);
  with_maintenance([node = node, version = is_golden ? update::golden : version](Maintenance& maintenance) {
    maintenance.use_version(node, version);
  });
}

void Spacecraft::rest_maintenance(bool rests) {
  if (std::exchange(maintenance_rests_, rests) == rests) return;
  kernel_.later(nanoseconds(0), [this, rests] {
    with_maintenance([rests](Maintenance& maintenance) { maintenance.rest(rests); });
  });
}

std::optional<suite::ModeInForce> Spacecraft::mode_of(Lane lane) {
  auto* const process = static_cast<NodeProcess*>(host(lane).program());
  return process != nullptr && host(lane).runs() ? process->mode().in_force() : std::nullopt;
}

TtcSurroundings Spacecraft::ttc_surroundings() {
  UplinkConfig uplink;
  uplink.spacecraft_id = static_cast<std::uint16_t>(link_.spacecraft_id);
  uplink.strict = link_.tc_strict;
  uplink.cltu.randomized = link_.tc_randomizer;
  uplink.channels.push_back(UplinkChannel{.vc = 0, .associations = {}});
  uplink.channels.back().associations.push_back(UplinkAssociation{
      .spi = 1, .key = wire::SdlsKey(key_.octets()), .for_ad = true, .for_bd = true, .set = KeySet::a});
  DownlinkConfig downlink;
  downlink.spacecraft_id = static_cast<std::uint16_t>(link_.spacecraft_id);
  downlink.baud = static_cast<std::uint32_t>(link_.baud);
  std::vector<Host*> nodes_there;
  for (const auto& h : hosts_) nodes_there.push_back(h.get());
  return {topics_,
          disk_,
          ttc_flash_,
          dictionary(),
          std::move(uplink),
          downlink,
          boot_id_,
          boots_,
          network_,
          std::move(nodes_there),
          [this](const char* why) { kernel_.later(nanoseconds(0), [this, why] { cut_power(why, true); }); },
          settings_.modes,
          settings_.command_loss,
          commands_};
}

void Spacecraft::on_process(Host& host) {
  if (host.state() == Host::State::running) {
    network_.on_begin(host);
    return versions_->on_running(host);
  }
  disk_.on_end(host);
  ring_->on_process(host);
}

void Spacecraft::cut_power(const char* why, bool by_watchdog) {
  if (!powered_) return;
  powered_ = false;
  kernel_.trace(Lane::world, Lane::world, why, boots_);
  for (const auto& host : hosts_) host->end("power cut");
  can_.lose_computer();
  ttc_flash_.lose_power();
  versions_->lose_power();
  holder_word_.holder.reset();
  ids_lost_ = {};
  ring_->lose_power();
  watchdog_ = {.fed = std::nullopt, .bit = by_watchdog};
  kernel_.later(kernel_.random("boot" + std::to_string(boots_)).between(seconds(2), seconds(20)), [this] {
    powered_ = true;
    boot_id_ = "boot" + std::to_string(++boots_);
    for (const auto& host : hosts_) versions_->count_suite_start(*host);
    ring_->start_all();
  });
}

std::array<FileRecord::Names, 2> Spacecraft::files_under_way() {
  auto* const process = static_cast<NodeProcess*>(host(Lane::ttc).program());
  auto* const ttc = process == nullptr ? nullptr : static_cast<Ttc*>(process->logic());
  return {station_->files_under_way(), ttc == nullptr ? FileRecord::Names{} : ttc->files_under_way()};
}

Payload* Spacecraft::payload(std::size_t i) {
  auto* const process = static_cast<NodeProcess*>(host(payload_lanes[i]).program());
  return process != nullptr ? static_cast<Payload*>(process->logic()) : nullptr;
}

/// A payload writes to the bus: nobody else may write, and nothing of another one may wait.
void Spacecraft::check_writer(Lane writer) {
  // The switcher's marker goes behind what waits.
  if (std::find(payload_lanes.begin(), payload_lanes.end(), writer) == payload_lanes.end()) return;
  for (std::size_t i = 0; i < payload_count; ++i) {
    if (payload_lanes[i] == writer) continue;
    const Payload* const other = payload(i);
    if (other != nullptr && other->may_write())
      throw Violation{
          "S2", "two payloads have the bus: " + slots_[i].payload + " and the writer " + to_text(writer)};
    if (can_.waiting_of(payload_lanes[i]) != 0)
      throw Violation{"M5a", "a frame still waits while another payload writes: of " + slots_[i].payload};
  }
}

/// The charge changes by current and time, but for rounding, and stays from 0 to 1.
void Spacecraft::step_battery() {
  const sim::PowerState before = world_.power().state();
  world_.step(world_period);
  const sim::PowerState& after = world_.power().state();
  const double capacity_as = sim::PowerSettings{}.capacity_a_h * 3600;
  const double seconds_passed = std::chrono::duration<double>(world_period).count();
  const double change = after.charge - before.charge;
  // The current is followed at the begin and the end; loads that are switched within make it jump.
  const auto [least, most] = std::minmax(before.battery_a, after.battery_a);
  const double tolerance = 0.05 * seconds_passed / capacity_as;
  const bool follows = change >= least * seconds_passed / capacity_as - tolerance &&
                       change <= most * seconds_passed / capacity_as + tolerance;
  const bool is_full_or_empty = after.charge == 0 || after.charge == 1;
  if (!(after.charge >= 0 && after.charge <= 1) || (!follows && !is_full_or_empty))
    throw Violation{"hw_sim", "the charge does not follow the current: " + std::to_string(after.charge)};
}

void Spacecraft::step_world() {
  step_battery();
  for (const auto& device : devices_) device->step(world_period);
  if (!world_.power().state().computer_on)
    throw Violation{"L7b", "the battery takes the power from the computer"};
  if (powered_ && watchdog_.fed && kernel_.now() - *watchdog_.fed > WatchdogTimer::timeout)
    cut_power("the watchdog bites", true);
  kernel_.later(world_period, [this] { step_world(); });
}

void Spacecraft::schedule_pulse() {
  const sim::GpsPulse pulse = gps_.receiver.next_pulse(gps_.truth, kernel_.now());
  const auto send_edge = [this](MonotonicTime edge) {
    if (gps_.reader != nullptr) gps_.reader->give([this, edge] { gps_.on_pulse(edge); });
  };
  for (const auto& stray : pulse.strays) {
    if (stray && *stray > kernel_.now()) kernel_.at(*stray, [send_edge, at = *stray] { send_edge(at); });
  }
  kernel_.at(pulse.edge, [this, pulse, send_edge] {
    if (pulse.emitted && gps_.receiver.fault() == sim::GpsFault::none) send_edge(pulse.edge);
    if (pulse.utc.ns() % 1'000'000'000 == 0) {
      kernel_.later(gps_.receiver.settings().sentence_delay, [this, utc = pulse.utc] {
        const Octets sentences = gps_.receiver.messages(utc, {});
        if (sentences.empty() || gps_.reader == nullptr) return;
        gps_.reader->give([this, sentences] { gps_.on_sentences(sentences); });
      });
    }
    schedule_pulse();
  });
}

}  // namespace srfs::simulation
