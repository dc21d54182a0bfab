// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "tests/simulation/faults.hpp"
#include "tests/simulation/spacecraft.hpp"

namespace srfs::simulation {

/// Makes the faults of a run. Each kind has its own random numbers, so a run without one of them has the
/// others at the same times. Storms of faults and quiet times take turns.
class FaultInjector {
 public:
  static constexpr nanoseconds storm = seconds(600);
  static constexpr nanoseconds calm =
      seconds(240);  ///< longer than any wait of the restart policy twice over

  FaultInjector(Kernel& kernel, Spacecraft& spacecraft, const FaultSet& faults);
  [[nodiscard]] bool is_calm() const { return calm_; }
  [[nodiscard]] std::uint64_t injected(Fault fault) const {
    return injected_[static_cast<std::size_t>(fault)];
  }
  /// Called where a quiet time begins, and before it ends.
  void on_calm(std::function<void(bool begins)> callback) { on_calm_ = std::move(callback); }

 private:
  struct Kind {
    Fault fault;
    nanoseconds mean;  ///< between two of them
    void (FaultInjector::*inject)(Random& random);
  };
  void schedule(std::size_t kind);
  void begin_calm();
  void for_some_time(nanoseconds time, Kernel::Event end);
  [[nodiscard]] Host& any_host(Random& random);
  [[nodiscard]] Device& any_device(Random& random);
  void disturb(Random& random, sim::PeripheralFault fault);

  void kill(Random& random);
  void kill_at_action(Random& random);
  void stop(Random& random);
  void stop_at_action(Random& random);
  void starve(Random& random);
  void late_messages(Random& random);
  void slow_disk(Random& random);
  void failing_disk(Random& random);
  void power_cut(Random& random);
  void silent_peripheral(Random& random);
  void late_peripheral(Random& random);
  void garbled_peripheral(Random& random);
  void babbling_peripheral(Random& random);
  void stuck_power(Random& random);
  void bus_errors(Random& random);
  void bus_off(Random& random);
  void line_noise(Random& random);
  void line_cut(Random& random);
  void gps(Random& random);
  [[nodiscard]] static const std::array<Kind, fault_count>& kinds();

  Kernel& kernel_;
  Spacecraft& spacecraft_;
  std::vector<Random> random_;
  std::function<void(bool begins)> on_calm_;
  bool calm_ = true;  ///< until the nodes are up
  std::array<std::uint64_t, fault_count> injected_{};
};

}  // namespace srfs::simulation
