// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/run.hpp"

#include <exception>

#include <fmt/format.h>

#include "tests/simulation/fault_injector.hpp"
#include "tests/simulation/plot.hpp"
#include "tests/simulation/spacecraft.hpp"

namespace srfs::simulation {
namespace {

constexpr nanoseconds settling = seconds(150);  ///< of a calm: longer than the longest wait before a restart
constexpr nanoseconds look = seconds(10);
constexpr int plot_samples = 1000;

/// What is to be true in a calm: the suite has come back by itself.
class CalmCheck {
 public:
  CalmCheck(Kernel& kernel, Spacecraft& spacecraft) : kernel_(kernel), spacecraft_(spacecraft) {}

  void on_calm(bool begins) {
    if (!begins) {
      spacecraft_.ring().set_quiet(false);
      spacecraft_.station().set_operator(true);
      return check();
    }
    spacecraft_.station().set_operator(false);
    begun_ = kernel_.now();
    kernel_.later(settling, [this] { spacecraft_.ring().set_quiet(true); });
    kernel_.later(FaultInjector::calm - look, [this] {
      cycle_ = spacecraft_.newest_cycle();
      granted_ = spacecraft_.ledger().granted;
      released_ = spacecraft_.ledger().released;
    });
  }

 private:
  void check() const {
    spacecraft_.commands().check_ends(begun_);
    spacecraft_.commands().check_mode();
    spacecraft_.ttc_flash().stores.check();
    spacecraft_.ttc_flash().files.check_ends(begun_, spacecraft_.files_under_way());
    spacecraft_.packages().check_ends(begun_);
    spacecraft_.versions().check();
    for (std::size_t i = 0; i < spacecraft_.node_count(); ++i) {
      const Host& host = spacecraft_.host(static_cast<Lane>(i));
      if (!host.runs()) throw Violation{"F4", "it does not run long after the last fault: " + host.name()};
      spacecraft_.packages().check_running(spacecraft_.versions().running_origin(host));
      const update::VersionTable table = spacecraft_.versions().read(host);
      for (const update::Version& version : table.versions())
        spacecraft_.packages().check_stored(version.origin);
    }
    constexpr std::uint64_t expected = look / milliseconds(100);
    if (spacecraft_.newest_cycle() < cycle_ + expected - 1)
      throw Violation{
          "F1", fmt::format("ticks: {} in {} s", spacecraft_.newest_cycle() - cycle_, look / seconds(1))};
    const auto& ledger = spacecraft_.ledger();
    if (ledger.granted < granted_ + expected - 2)
      throw Violation{"E4", fmt::format("slots: {} in {} s", ledger.granted - granted_, look / seconds(1))};
    if (ledger.released < released_ + expected / 2)
      throw Violation{
          "M3", fmt::format("released slots: {} in {} s", ledger.released - released_, look / seconds(1))};
  }

  Kernel& kernel_;
  Spacecraft& spacecraft_;
  MonotonicTime begun_;
  MissionCycle cycle_ = 0;
  std::uint64_t granted_ = 0;
  std::uint64_t released_ = 0;
};

/// In steps only where the plot looks at it: an event more would change what the seed gives.
void fly(Kernel& kernel, Spacecraft& spacecraft, const FaultInjector& faults, const RunSettings& settings) {
  const MonotonicTime begin = kernel.now();
  if (settings.plot == nullptr) return kernel.run_until(begin + settings.duration);
  Plot plot;
  for (int i = 0; i <= plot_samples; ++i) {
    const nanoseconds at = i == plot_samples ? settings.duration : settings.duration / plot_samples * i;
    kernel.run_until(begin + at);
    plot.sample(at, kernel, spacecraft, faults);
  }
  *settings.plot = plot.svg(fmt::format("Seed {}, {:.1f} h, faults {}", settings.seed,
                                        static_cast<double>(settings.duration.count()) / 3600e9,
                                        to_text(settings.faults)));
}

}  // namespace

RunOutcome run(const RunSettings& settings) {
  Kernel kernel(settings.seed);
  kernel.set_trace_file(settings.trace);
  const MonotonicTime begin = kernel.now();
  RunOutcome outcome;
  Spacecraft spacecraft(kernel);
  FaultInjector faults(kernel, spacecraft, settings.faults);
  CalmCheck calm(kernel, spacecraft);
  faults.on_calm([&calm](bool begins) { calm.on_calm(begins); });
  try {
    fly(kernel, spacecraft, faults, settings);
  } catch (const Violation& violation) {
    outcome.violation = violation;
    outcome.diagram = kernel.diagram();
  } catch (const std::exception& error) {  // of a class that is flown, or of the simulation
    outcome.violation = Violation{"no exception", std::string("it was thrown: ") + error.what()};
    outcome.diagram = kernel.diagram();
  }
  outcome.at = kernel.now() - begin;
  outcome.hash = kernel.hash();
  outcome.steps = kernel.steps();
  outcome.events = kernel.events();
  outcome.ticks = spacecraft.newest_cycle();
  outcome.slots = spacecraft.ledger().granted;
  outcome.transitions = kernel.coverage().counts();
  outcome.boots = spacecraft.boots();
  outcome.journal_cut = spacecraft.ttc_flash().cut;
  outcome.telecommands = spacecraft.commands().counters().sent;
  outcome.completed = spacecraft.commands().counters().completed;
  outcome.released = spacecraft.commands().counters().released;
  outcome.stored = spacecraft.ttc_flash().stores.counters().stored;
  outcome.retrieved = spacecraft.ttc_flash().stores.counters().retrieved;
  outcome.packages = spacecraft.packages().counters().made;
  outcome.installed = spacecraft.packages().counters().installed;
  outcome.files = spacecraft.ttc_flash().files.counters().arrived;
  for (std::size_t i = 0; i < spacecraft.node_count(); ++i)
    outcome.starts += spacecraft.host(static_cast<Lane>(i)).starts();
  for (std::size_t i = 0; i < fault_count; ++i) outcome.faults += faults.injected(static_cast<Fault>(i));
  return outcome;
}

FaultSet shrink(const RunSettings& settings, const RunOutcome& failed) {
  RunSettings smaller = settings;
  smaller.trace = nullptr;
  smaller.plot = nullptr;
  // Without some faults it may need longer.
  smaller.duration = std::min(settings.duration, 2 * failed.at + seconds(900));
  bool again = true;
  while (again) {
    again = false;
    for (std::size_t i = 0; i < fault_count; ++i) {
      if (!smaller.faults[i]) continue;
      smaller.faults.reset(i);
      const RunOutcome outcome = run(smaller);
      if (outcome.violation && outcome.violation->is_like(*failed.violation)) {
        again = true;
      } else {
        smaller.faults.set(i);
      }
    }
  }
  return smaller.faults;
}

}  // namespace srfs::simulation
