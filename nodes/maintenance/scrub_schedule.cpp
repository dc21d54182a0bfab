// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/scrub_schedule.hpp"

#include <utility>

namespace srfs {

using update::ScrubMode;

ScrubSchedule::Actions ScrubSchedule::start(const Pace& pace) {
  if (pace.interval <= nanoseconds(0)) return {};
  return {AwaitSlice{pace.first_after}};
}

ScrubSchedule::Actions ScrubSchedule::run(bool retake) {
  retake_ = retake_ || retake;
  return under_way_ ? Actions() : next_slice();
}

ScrubSchedule::Actions ScrubSchedule::on_due() {
  return next_slice();
}

ScrubSchedule::Actions ScrubSchedule::next_slice() {
  begins_ = !std::exchange(under_way_, true);
  if (!begins_) return {CheckSlice{}};
  mode_ = retake_ ? ScrubMode::retake : first_ ? ScrubMode::start : ScrubMode::watch;
  retake_ = false;
  first_ = false;
  return {CheckSlice{mode_}};
}

ScrubSchedule::Actions ScrubSchedule::on_refused() {
  if (begins_) {
    under_way_ = false;
    retake_ = retake_ || mode_ == ScrubMode::retake;
    first_ = mode_ == ScrubMode::start;
  }
  return {AwaitSlice{refused_pause}};
}

ScrubSchedule::Actions ScrubSchedule::on_slice(Slice slice, const Pace& pace) {
  status_ = std::move(slice.status);
  Actions actions;
  for (update::ScrubFinding& finding : slice.findings)
    actions.emplace_back(ReportFinding{std::move(finding)});
  if (slice.more) {
    actions.emplace_back(AwaitSlice{pace.pause});
    return actions;
  }
  under_way_ = false;
  if (status_.taken > 0 || mode_ == ScrubMode::retake)
    actions.emplace_back(ReportFilesTaken{status_.taken, status_.build});
  actions.emplace_back(ReportScrubRound{status_});
  if (retake_) {
    const Actions next = next_slice();
    actions.insert(actions.end(), next.begin(), next.end());
  } else if (pace.interval > nanoseconds(0)) {
    actions.emplace_back(AwaitSlice{pace.interval});
  }
  return actions;
}

}  // namespace srfs
