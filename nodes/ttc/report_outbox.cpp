#include "nodes/ttc/report_outbox.hpp"

namespace srfs {

void ReportOutbox::success(const TelecommandOrigin& origin, Stage stage, std::uint8_t step) {
  if (stage == Stage::acceptance) ++counters_.accepted;
  if (stage == Stage::start) ++counters_.started;
  if (stage == Stage::completion) ++counters_.completed;
  remember(origin,
           {.id = origin.id, .stage = stage, .success = true, .failure_code = 0, .step = step, .data = {}});
  if (wants_success(origin, stage)) reports_.push_back(success_report(origin, stage, step));
}

void ReportOutbox::failure(const TelecommandOrigin& origin, Stage stage, std::uint16_t failure_code,
                           OctetView data, std::uint8_t step) {
  ++(stage == Stage::acceptance ? counters_.rejected : counters_.failed);
  remember(origin, {.id = origin.id,
                    .stage = stage,
                    .success = false,
                    .failure_code = failure_code,
                    .step = step,
                    .data = {data.begin(), data.end()}});
  reports_.push_back(failure_report(origin, stage, failure_code, data, step));
}

void ReportOutbox::success_again(const TelecommandOrigin& origin, Stage stage) {
  if (wants_success(origin, stage)) reports_.push_back(success_report(origin, stage));
}

void ReportOutbox::failure_again(const TelecommandOrigin& origin, Stage stage, std::uint16_t failure_code,
                                 OctetView data, std::uint8_t step) {
  reports_.push_back(failure_report(origin, stage, failure_code, data, step));
}

void ReportOutbox::remember(const TelecommandOrigin& origin, const StageReached& reached) {
  if (reached.id != 0) stages_.push_back(reached);
  if (reached.stage != Stage::acceptance && (!last_.any || last_.origin.request != origin.request)) return;
  last_ = LastTelecommand{.origin = origin,
                          .stage = reached.stage,
                          .success = reached.success,
                          .failure_code = reached.failure_code,
                          .any = true};
}

}  // namespace srfs
