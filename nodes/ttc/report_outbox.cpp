#include "nodes/ttc/report_outbox.hpp"

namespace srfs {

void ReportOutbox::success(const TelecommandOrigin& origin, Stage stage, std::uint8_t step) {
  if (stage == Stage::acceptance) ++counters_.accepted;
  if (stage == Stage::start) ++counters_.started;
  if (stage == Stage::completion) ++counters_.completed;
  remember(origin, stage, true, 0);
  if (wants_success(origin, stage)) reports_.push_back(success_report(origin, stage, step));
}

void ReportOutbox::failure(const TelecommandOrigin& origin, Stage stage, std::uint16_t failure_code,
                           OctetView data, std::uint8_t step) {
  ++(stage == Stage::acceptance ? counters_.rejected : counters_.failed);
  remember(origin, stage, false, failure_code);
  reports_.push_back(failure_report(origin, stage, failure_code, data, step));
}

void ReportOutbox::remember(const TelecommandOrigin& origin, Stage stage, bool success,
                            std::uint16_t failure_code) {
  if (stage != Stage::acceptance && (!last_.any || last_.origin.request != origin.request)) return;
  last_ = LastTelecommand{
      .origin = origin, .stage = stage, .success = success, .failure_code = failure_code, .any = true};
}

}  // namespace srfs
