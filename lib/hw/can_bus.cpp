// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw/can_bus.hpp"

namespace srfs::hw {

bool LeasedCanBus::begin(std::uint64_t grant, MonotonicTime lease_end) {
  if (grant <= grant_) {
    ++refused_;
    return false;
  }
  grant_ = grant;
  lease_end_ = lease_end;
  open_ = true;
  return true;
}

Result<void, CanError> LeasedCanBus::send(const CanFrame& frame, std::uint64_t grant, MonotonicTime now) {
  if (!granted(now) || grant != grant_) {
    ++refused_;
    return Err(CanError::not_granted);
  }
  return bus_.send(frame);
}

}  // namespace srfs::hw
