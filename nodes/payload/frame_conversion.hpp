// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "hw/can_bus.hpp"
#include "wire/can_data_frame.hpp"

namespace srfs {

/// What a PeripheralLink hears of a frame: without its echo mark and its time.
[[nodiscard]] inline wire::CanDataFrame without_meta(const hw::CanFrame& frame) {
  return {.id = frame.id, .extended = frame.extended, .size = frame.size, .data = frame.data};
}
/// A frame of a PeripheralLink for the bus.
[[nodiscard]] inline hw::CanFrame to_can_frame(const wire::CanDataFrame& frame) {
  hw::CanFrame can;
  can.id = frame.id;
  can.extended = frame.extended;
  can.size = frame.size;
  can.data = frame.data;
  return can;
}

}  // namespace srfs
