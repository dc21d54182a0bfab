// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/boot_recorder.hpp"

#include <utility>

namespace srfs {

using mission::ResetCause;

BootRecorder::BootRecorder(const std::optional<wire::BootRecord>& before, const BootFacts& facts,
                           Settings settings)
    : settings_(settings),
      record_(before.value_or(wire::BootRecord{})),
      new_boot_(!before || before->boot_id != facts.boot_id) {
  if (new_boot_) {
    record_ = {.count = record_.count + 1,
               .boot_id = facts.boot_id,
               .reset_cause = static_cast<std::uint8_t>(cause_of(before, facts)),
               .unhealthy_boots = before && !before->healthy ? record_.unhealthy_boots + 1 : 0,
               .revision = record_.revision};
    change();
  } else if (record_.withheld || record_.ended) {
    record_.withheld = record_.ended = false;
    change();
  }
}

ResetCause BootRecorder::cause_of(const std::optional<wire::BootRecord>& before, const BootFacts& facts) {
  if (facts.reset_by_watchdog.value_or(false)) return ResetCause::watchdog;
  if (!before) return ResetCause::power_on;
  // Not every watchdog reports its reset. A watchdog that was not being fed is the likeliest cause.
  if (!facts.reset_by_watchdog && before->withheld) return ResetCause::watchdog;
  if (before->ended) return ResetCause::commanded;
  return facts.reset_by_watchdog ? ResetCause::power_on : ResetCause::unknown;
}

BootActions BootRecorder::begin() {
  BootActions actions;
  if (new_boot_) actions.emplace_back(ReportBoot{record_.count, cause()});
  for (BootAction& action : save()) actions.push_back(std::move(action));
  return actions;
}

BootActions BootRecorder::on_feeding(bool fed, MonotonicTime now, std::optional<UtcTime> utc) {
  note_feeding(fed, now, utc);
  BootActions actions = save();
  if (!healthy_here_ && fed && now - *fed_since_ >= settings_.healthy_after) {
    healthy_here_ = true;
    actions.emplace_back(NoteHealthySuite{});
  }
  return actions;
}

void BootRecorder::note_feeding(bool fed, MonotonicTime now, std::optional<UtcTime> utc) {
  if (!fed) {
    fed_since_.reset();
    if (!not_fed_since_) not_fed_since_ = now;
    if (!record_.withheld && now - *not_fed_since_ >= settings_.withheld_after) withhold();
    return;
  }
  not_fed_since_.reset();
  if (record_.withheld) {
    record_.withheld = false;
    change();
  }
  // A suite that was stopped and continued was not healthy meanwhile.
  constexpr nanoseconds longest_gap = seconds(5);
  if (!fed_since_ || now - last_fed_ > longest_gap) fed_since_ = now;
  last_fed_ = now;
  const nanoseconds fed_for = now - *fed_since_;
  if (record_.healthy || fed_for < settings_.healthy_after) return;
  record_.healthy = true;
  if (utc) record_.healthy_since = *utc - fed_for;
  change();
}

void BootRecorder::withhold() {
  if (record_.withheld) return;
  record_.withheld = true;
  change();
}

BootActions BootRecorder::on_feeding_ended() {
  withhold();
  return save();
}

BootActions BootRecorder::on_end() {
  record_.ended = true;
  record_.withheld = false;  // what happens to the watchdog from here on was asked for
  change();
  return save();
}

BootActions BootRecorder::save() {
  if (!std::exchange(unwritten_, false)) return {};
  return {SaveBootRecord{record_}};
}

void BootRecorder::change() {
  ++record_.revision;
  unwritten_ = true;
}

}  // namespace srfs
