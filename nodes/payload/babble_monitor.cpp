#include "nodes/payload/babble_monitor.hpp"

#include <algorithm>

namespace srfs {

BabbleMonitor::Verdict BabbleMonitor::on_unsolicited_frame(MonotonicTime now) {
  if (level_ == 0) leaked_ = now;
  const std::int64_t forgiven = std::max<std::int64_t>(0, (now - leaked_) / settings_.forgiven_every);
  leaked_ = leaked_ + settings_.forgiven_every * forgiven;
  level_ -= static_cast<std::uint32_t>(std::min<std::int64_t>(level_, forgiven));
  if (++level_ <= settings_.tolerated_frames) return Verdict::tolerable;

  level_ = 0;
  const bool again = judged_ && switched_on_ && now - *switched_on_ < settings_.at_once;
  in_a_row_ = again ? in_a_row_ + 1 : 0;
  judged_ = true;
  switched_on_.reset();
  return in_a_row_ >= settings_.power_cycles ? Verdict::keep_off : Verdict::power_cycle;
}

void BabbleMonitor::on_switched_on(MonotonicTime now) {
  level_ = 0;
  switched_on_ = now;
}

void BabbleMonitor::forgive() {
  level_ = 0;
  in_a_row_ = 0;
  judged_ = false;
}

}  // namespace srfs
