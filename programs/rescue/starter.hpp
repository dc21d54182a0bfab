// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "programs/rescue/rescuer.hpp"

namespace srfs::rescue {

/// Starts the suite, a step lower after each row of starts that did not become healthy; at the last step it
/// is on the line itself, until it is told to start the suite, or heard nothing for long. Trusts no file, and
/// needs no disk that can be written: then the starts of this process count.
class Starter {
 public:
  explicit Starter(const suite::RescueSettings& settings);

  /// @return exit code of the process: 0: the suite runs. 75: the computer is to be restarted, and this
  /// process could not
  [[nodiscard]] int start();
  /// On the line at once, whatever the starts were.
  [[nodiscard]] int serve();
  /// On the line at once, where the suite's programs are not: at the end a restart of the computer starts it.
  [[nodiscard]] int answer();

  /// One more start: counted, then the measures that are due. The first half of start().
  void begin_start();
  /// What follows an order to start the suite, or none for long: measures, then their record.
  void end_rescue(const RescueEnd& end);
  [[nodiscard]] const suite::StepRecord& record() const { return record_; }

  static constexpr int restart_exit_code = 75;

 private:
  void count_start();
  void take_measures(suite::BootStep step);
  void save();
  /// The step in the fault ledger.
  void note_step() const;
  /// @return exit code; nullopt: the suite is to be started
  [[nodiscard]] std::optional<int> be_on_the_line();
  /// @return what went wrong
  [[nodiscard]] std::string start_suite() const;

  const suite::RescueSettings& settings_;
  suite::StepStore store_;
  suite::StepRecord record_;
};

}  // namespace srfs::rescue
