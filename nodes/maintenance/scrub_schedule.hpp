// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/time.hpp"
#include "update/scrubber.hpp"

namespace srfs {

// What the schedule decides; carried out by the adapter in the given order.

/// Check the next slice. A wait that is under way is over. Answer with on_slice() or on_refused().
struct CheckSlice {
  std::optional<update::ScrubMode> begins;  ///< the slice is the first of a round
};
/// Call on_due() after this time.
struct AwaitSlice {
  nanoseconds wait{0};
};
struct ReportFinding {
  update::ScrubFinding finding;
};
/// Files are good as they are from now on.
struct ReportFilesTaken {
  std::uint32_t files = 0;
  std::string build;
};
struct ReportScrubRound {
  update::ScrubStatus status;
};

using ScrubAction = std::variant<CheckSlice, AwaitSlice, ReportFinding, ReportFilesTaken, ReportScrubRound>;

/// When a round of scrubbing begins, in which mode, and when its next slice is checked. What always holds: at
/// most one slice is checked at a time, and a retake that was asked for is done. Pure; one thread.
class ScrubSchedule {
 public:
  using Actions = std::vector<ScrubAction>;

  struct Pace {
    nanoseconds first_after{0};  ///< the first round, after the configuration
    nanoseconds interval{0};     ///< from the end of a round to the next; 0: rounds by telecommand only
    nanoseconds pause{0};        ///< between slices
  };
  /// What came of one slice.
  struct Slice {
    bool more = false;  ///< the round goes on
    update::ScrubStatus status;
    std::vector<update::ScrubFinding> findings;
  };
  /// The worker had no room for a slice: it is asked again after so long.
  static constexpr nanoseconds refused_pause = seconds(1);

  /// Once.
  [[nodiscard]] static Actions start(const Pace& pace);
  /// A telecommand: begins a round unless one is under way. A retake is done behind that one.
  [[nodiscard]] Actions run(bool retake);
  [[nodiscard]] Actions on_due();
  [[nodiscard]] Actions on_refused();
  [[nodiscard]] Actions on_slice(Slice slice, const Pace& pace);

  /// After the last slice.
  [[nodiscard]] const update::ScrubStatus& status() const { return status_; }

 private:
  [[nodiscard]] Actions next_slice();

  update::ScrubStatus status_;
  update::ScrubMode mode_ = update::ScrubMode::start;  ///< of the round under way, or of the last
  bool under_way_ = false;
  bool begins_ = false;  ///< with the slice that was asked for last
  bool first_ = true;
  bool retake_ = false;  ///< asked for
};

}  // namespace srfs
