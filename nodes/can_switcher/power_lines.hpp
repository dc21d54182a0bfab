// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.hpp"
#include "hw/gpio.hpp"
#include "suite/peripheral.hpp"

namespace srfs {

/// What the worker needs to switch a peripheral off.
struct PowerAccess {
  std::function<bool(std::string_view payload)> attended;                          ///< it has a process
  std::function<Result<std::unique_ptr<hw::GpioLines>, std::string>()> open_chip;  ///< or why not, for people
};

/// Switches the peripheral's power off and holds its line from then on. Blocks on the chip.
/// @param lines  of this peripheral; opened when they are not
/// @return nullopt: its payload came back meanwhile, nothing was done
[[nodiscard]] std::optional<Result<void, hw::GpioError>> cut_power(const suite::Peripheral& peripheral,
                                                                   std::unique_ptr<hw::GpioLines>& lines,
                                                                   const PowerAccess& access);

}  // namespace srfs
