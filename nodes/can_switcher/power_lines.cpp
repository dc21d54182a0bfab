// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/power_lines.hpp"

#include "base/log.hpp"

namespace srfs {

std::optional<Result<void, hw::GpioError>> cut_power(const suite::Peripheral& peripheral,
                                                     std::unique_ptr<hw::GpioLines>& lines,
                                                     const PowerAccess& access) {
  if (access.attended(peripheral.payload)) return std::nullopt;
  if (!lines) {
    auto opened = access.open_chip();
    if (!opened) {
      log::error("{}", opened.error());
      return Result<void, hw::GpioError>(Err(hw::GpioError::gone));
    }
    lines = std::move(*opened);
  }
  return lines->set_line(peripheral.power_line, false);
}

}  // namespace srfs
