// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/report/report_queue.hpp"

namespace srfs {

void ReportQueue::success(const TelecommandOrigin& origin, Stage stage, std::uint8_t step) {
  if (stage == Stage::acceptance) ++counters_.accepted;
  if (stage == Stage::start) ++counters_.started;
  if (stage == Stage::completion) ++counters_.completed;
  const bool wanted = wants_success(origin, stage);
  remember(origin, {.id = origin.id, .stage = stage, .step = step, .silent = !wanted});
  if (!wanted) return;
  reports_.push_back(success_report(origin, stage, step));
  if (stage == Stage::completion) reports_.back().ends = origin.id;
}

void ReportQueue::failure(const TelecommandOrigin& origin, Stage stage, std::uint16_t failure_code,
                          OctetView data, std::uint8_t step) {
  ++(is_before_start(stage) ? counters_.rejected : counters_.failed);
  remember(origin, {.id = origin.id,
                    .stage = stage,
                    .success = false,
                    .failure_code = failure_code,
                    .step = step,
                    .data = {data.begin(), data.end()}});
  reports_.push_back(failure_report(origin, stage, failure_code, data, step));
  if (stage == Stage::start || stage == Stage::completion) reports_.back().ends = origin.id;
}

void ReportQueue::success_again(const TelecommandOrigin& origin, Stage stage, bool stored) {
  if (!wants_success(origin, stage)) return;
  reports_.push_back(success_report(origin, stage));
  reports_.back().stored = stored;
}

void ReportQueue::failure_again(const TelecommandOrigin& origin, Stage stage, std::uint16_t failure_code,
                                OctetView data, std::uint8_t step, bool stored) {
  reports_.push_back(failure_report(origin, stage, failure_code, data, step));
  reports_.back().stored = stored;
}

void ReportQueue::put(Report report) {
  report.stored = false;
  report.urgent = true;
  reports_.push_back(std::move(report));
}

void ReportQueue::remember(const TelecommandOrigin& origin, const StageReached& reached) {
  if (reached.id != 0) stages_.push_back(reached);
  if (!is_before_start(reached.stage) && (!last_ || last_->origin.request != origin.request)) return;
  last_ = LastTelecommand{.origin = origin, .reached = reached};
}

}  // namespace srfs
