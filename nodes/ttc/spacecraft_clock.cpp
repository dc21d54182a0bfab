#include "nodes/ttc/spacecraft_clock.hpp"

namespace srfs {

void SpacecraftClock::on_tick(UtcTime utc, MonotonicTime due, bool time_valid, std::uint8_t sync_state) {
  constexpr std::uint8_t locked = 2;  // srfs_msgs/TimeTick
  constexpr std::uint8_t holdover = 3;
  utc_ = utc;
  monotonic_ = due;
  if (!time_valid) {
    reference_ = TimeReference::invalid;
  } else if (sync_state == locked) {
    reference_ = TimeReference::locked;
  } else {
    reference_ = sync_state == holdover ? TimeReference::holdover : TimeReference::set_unlocked;
  }
}

}  // namespace srfs
