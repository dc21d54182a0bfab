// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/fault_injector.hpp"

namespace srfs::simulation {

using sim::PeripheralFault;

const std::array<FaultInjector::Kind, fault_count>& FaultInjector::kinds() {
  using F = FaultInjector;
  static const std::array<Kind, fault_count> all{{
      {Fault::kill, seconds(40), &F::kill},
      {Fault::kill_at_action, seconds(30), &F::kill_at_action},
      {Fault::stop, seconds(30), &F::stop},
      {Fault::stop_at_action, seconds(30), &F::stop_at_action},
      {Fault::starve, seconds(30), &F::starve},
      {Fault::late_messages, seconds(60), &F::late_messages},
      {Fault::slow_disk, seconds(60), &F::slow_disk},
      {Fault::failing_disk, seconds(90), &F::failing_disk},
      {Fault::power_cut, seconds(200), &F::power_cut},
      {Fault::silent_peripheral, seconds(45), &F::silent_peripheral},
      {Fault::late_peripheral, seconds(45), &F::late_peripheral},
      {Fault::garbled_peripheral, seconds(45), &F::garbled_peripheral},
      {Fault::babbling_peripheral, seconds(90), &F::babbling_peripheral},
      {Fault::stuck_power, seconds(60), &F::stuck_power},
      {Fault::bus_errors, seconds(40), &F::bus_errors},
      {Fault::bus_off, seconds(50), &F::bus_off},
      {Fault::line_noise, seconds(50), &F::line_noise},
      {Fault::line_cut, seconds(90), &F::line_cut},
      {Fault::gps, seconds(60), &F::gps},
  }};
  return all;
}

FaultInjector::FaultInjector(Kernel& kernel, Spacecraft& spacecraft, const FaultSet& faults)
    : kernel_(kernel), spacecraft_(spacecraft) {
  for (const Kind& kind : kinds())
    random_.push_back(kernel_.random(std::string("fault ") + to_text(kind.fault)));
  kernel_.later(seconds(5), [this, faults] {
    calm_ = false;
    for (std::size_t i = 0; i < fault_count; ++i) {
      if (faults[i]) schedule(i);
    }
    kernel_.later(storm, [this] { begin_calm(); });
  });
}

void FaultInjector::begin_calm() {
  calm_ = true;
  if (on_calm_) on_calm_(true);
  kernel_.later(calm, [this] {
    if (on_calm_) on_calm_(false);
    calm_ = false;
    kernel_.later(storm, [this] { begin_calm(); });
  });
}

void FaultInjector::schedule(std::size_t i) {
  const Kind& kind = kinds()[i];
  kernel_.later(random_[i].between(milliseconds(1), 2 * kind.mean), [this, i, &kind] {
    if (!calm_) {
      ++injected_[i];
      kernel_.trace(Lane::world, Lane::world, to_text(kind.fault));
      (this->*kind.inject)(random_[i]);
    }
    schedule(i);
  });
}

Host& FaultInjector::any_host(Random& random) {
  return spacecraft_.host(static_cast<Lane>(random.below(spacecraft_.node_count())));
}

Device& FaultInjector::any_device(Random& random) {
  return spacecraft_.device(random.below(Spacecraft::payload_count));
}

void FaultInjector::for_some_time(nanoseconds time, Kernel::Event end) {
  kernel_.later(time, std::move(end));
}

// ---------------------------------------------------------------- processes

void FaultInjector::kill(Random& random) {
  any_host(random).end("SIGKILL");
}

void FaultInjector::kill_at_action(Random& random) {
  Host& host = any_host(random);
  host.kill_at_action(static_cast<std::uint32_t>(random.below(40)));
}

void FaultInjector::stop(Random& random) {
  Host& host = any_host(random);
  const nanoseconds time = random.one_in(3) ? random.between(milliseconds(200), seconds(6))
                                            : random.between(milliseconds(1), milliseconds(200));
  host.stop(false);
  for_some_time(time, [&host, pid = host.pid()] {
    if (host.pid() == pid) host.go_on();
  });
}

void FaultInjector::stop_at_action(Random& random) {
  Host& host = any_host(random);
  const nanoseconds time = random.between(milliseconds(1), milliseconds(random.one_in(2) ? 300 : 3000));
  host.stop_at_action(static_cast<std::uint32_t>(random.below(40)), time);
}

void FaultInjector::starve(Random& random) {
  Host& host = any_host(random);
  const nanoseconds time =
      random.between(milliseconds(10), random.one_in(4) ? seconds(8) : milliseconds(400));
  host.stop(true);
  for_some_time(time, [&host, pid = host.pid()] {
    if (host.pid() == pid) host.go_on();
  });
}

void FaultInjector::power_cut(Random& /*random*/) {
  spacecraft_.cut_power("the power is cut", false);
}

// ---------------------------------------------------------------- messages and disk

void FaultInjector::late_messages(Random& random) {
  spacecraft_.network().set_longest_delay(random.between(milliseconds(5), milliseconds(400)));
  for_some_time(random.between(seconds(1), seconds(20)),
                [this] { spacecraft_.network().set_longest_delay(nanoseconds(0)); });
}

void FaultInjector::slow_disk(Random& random) {
  spacecraft_.disk().set_slow(random.between(milliseconds(50), seconds(4)));
  for_some_time(random.between(seconds(1), seconds(20)),
                [this] { spacecraft_.disk().set_slow(nanoseconds(0)); });
}

void FaultInjector::failing_disk(Random& random) {
  spacecraft_.disk().set_failing(true);
  for_some_time(random.between(milliseconds(50), seconds(20)),
                [this] { spacecraft_.disk().set_failing(false); });
}

// ---------------------------------------------------------------- peripherals and bus

void FaultInjector::disturb(Random& random, PeripheralFault fault) {
  Device& device = any_device(random);
  const milliseconds delay(fault == PeripheralFault::babble ? random.below(3) : 5 + random.below(80));
  static constexpr std::array cures{sim::FaultCure::never, sim::FaultCure::restart,
                                    sim::FaultCure::power_cycle};
  device.set_fault(fault, delay, cures[random.below(cures.size())]);
  for_some_time(random.between(milliseconds(50), seconds(20)), [&device] {
    device.set_fault(PeripheralFault::none, milliseconds(0), sim::FaultCure::never);
  });
}

void FaultInjector::silent_peripheral(Random& random) {
  disturb(random, PeripheralFault::silent);
}

void FaultInjector::late_peripheral(Random& random) {
  disturb(random, PeripheralFault::late);
}

void FaultInjector::garbled_peripheral(Random& random) {
  disturb(random, random.one_in(2) ? PeripheralFault::garbage : PeripheralFault::short_answer);
}

void FaultInjector::babbling_peripheral(Random& random) {
  disturb(random, PeripheralFault::babble);
}

void FaultInjector::stuck_power(Random& random) {
  Device& device = any_device(random);
  device.set_stuck(true);
  for_some_time(random.between(milliseconds(50), seconds(10)), [&device] { device.set_stuck(false); });
}

void FaultInjector::bus_errors(Random& random) {
  sim::BusFaults faults;
  const auto share = [&random] { return static_cast<double>(random.below(1000)) / 10000; };
  if (random.one_in(2)) faults.bit_error_probability = share();
  if (random.one_in(2)) faults.loss_probability = share();
  if (random.one_in(2)) faults.corruption_probability = share();
  spacecraft_.can().set_faults(faults);
  for_some_time(random.between(milliseconds(100), seconds(10)), [this] { spacecraft_.can().set_faults({}); });
}

void FaultInjector::bus_off(Random& /*random*/) {
  spacecraft_.can().force_bus_off();
}

// ---------------------------------------------------------------- line

void FaultInjector::line_noise(Random& random) {
  Station::Line line = spacecraft_.station().line();
  line.lost_per_1000 = random.below(300);
  line.spoiled_per_1000 = random.below(300);
  spacecraft_.station().set_line(line);
  for_some_time(random.between(seconds(1), seconds(40)), [this] {
    spacecraft_.station().set_line(
        {.lost_per_1000 = 0, .spoiled_per_1000 = 0, .cut = spacecraft_.station().line().cut});
  });
}

void FaultInjector::line_cut(Random& random) {
  Station::Line line = spacecraft_.station().line();
  line.cut = true;
  spacecraft_.station().set_line(line);
  for_some_time(random.between(milliseconds(100), seconds(random.one_in(4) ? 200 : 20)), [this] {
    Station::Line now = spacecraft_.station().line();
    now.cut = false;
    spacecraft_.station().set_line(now);
  });
}

// ---------------------------------------------------------------- time

void FaultInjector::gps(Random& random) {
  sim::GpsDisturbance disturbance;
  switch (random.below(6)) {
    case 0:
      disturbance.fault = sim::GpsFault::no_pulse;
      break;
    case 1:
      disturbance.fault = sim::GpsFault::no_fix;
      break;
    case 2:
      disturbance.false_pulses = 0.5;
      break;
    case 3:
      disturbance.time_step = seconds(random.below(100'000));
      break;
    case 4:
      disturbance.pulse_step = random.between(microseconds(0), milliseconds(400));
      break;
    default:
      disturbance.lost_pulses = 0.3;
      disturbance.bad_checksum = 0.3;
      break;
  }
  spacecraft_.gps().receiver.disturb(disturbance);
  for_some_time(random.between(seconds(2), seconds(120)), [this] { spacecraft_.gps().receiver.disturb({}); });
}

}  // namespace srfs::simulation
