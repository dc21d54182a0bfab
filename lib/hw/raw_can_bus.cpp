#include "hw/raw_can_bus.hpp"

#include <algorithm>
#include <utility>

namespace srfs::hw {

int RawCanBus::socket() {
  const int fd = device_->device();
  counters_.reopened = device_->reopened();
  return fd;
}

Result<can_frame, CanError> RawCanBus::to_raw(const CanFrame& frame) {
  if (frame.size > CAN_MAX_DLEN || frame.id > (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK))
    return Err(CanError::invalid_frame);
  can_frame raw{};
  raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0U);
  raw.len = frame.size;
  std::copy_n(frame.data.begin(), frame.size, raw.data);
  return raw;
}

std::optional<CanFrame> RawCanBus::accept(const can_frame& raw, bool is_echo, MonotonicTime at) {
  const bool extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  CanFrame frame{.id = raw.can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK),
                 .extended = extended,
                 .size = raw.len,
                 .data = {},
                 .is_echo = is_echo,
                 .timestamp = at};
  std::copy_n(raw.data, raw.len, frame.data.begin());
  if (is_echo) {
    ++counters_.echoed;
    if (unconfirmed_ > 0) --unconfirmed_;
    return frame;
  }
  // A kernel's echo filters also let the same identifiers of others pass.
  if (!filters_.empty() && !(extended && passes(frame.id, filters_))) return std::nullopt;
  ++counters_.received;
  return frame;
}

void RawCanBus::note_sent() {
  ++counters_.sent;
  ++unconfirmed_;
}

tl::unexpected<CanError> RawCanBus::refuse_full() {
  ++counters_.refused_full;
  return Err(CanError::queue_full);
}

void RawCanBus::lost(std::string why) {
  device_->lost(std::move(why));
  drop_unconfirmed();
}

void RawCanBus::drop_unconfirmed() {
  counters_.lost_in_queue += std::exchange(unconfirmed_, 0);
}

}  // namespace srfs::hw
