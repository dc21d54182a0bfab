// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "base/result.hpp"

namespace srfs::hw {

/// Numbers of the suite's lines (docs/reference/icd_can.md, section GPIO); a back-end maps them to the chip's
/// offsets.
inline constexpr std::uint8_t gpio_power_count =
    8;  ///< from 0; the deployment says which peripheral has which
inline constexpr std::uint8_t gpio_first_input = 8;
inline constexpr std::uint8_t gpio_input_count = 4;

enum class GpioError : std::uint8_t {
  gone,      ///< no chip or no simulator at present; it is opened again by later calls
  no_line,   ///< not a line of the suite, or the chip does not have it
  not_ours,  ///< another process holds the line
  refused,   ///< the driver or the simulator refused
  timeout,   ///< no answer within 20 ms
};
[[nodiscard]] const char* to_string(GpioError error);

struct GpioCounters {
  std::uint64_t reads = 0;
  std::uint64_t writes = 0;
  std::uint64_t errors = 0;
  std::uint64_t reopened = 0;
};

/// Power switches and digital inputs. Each call takes at most 20 ms (a memory access on the board, a question
/// to the simulator otherwise). Not thread-safe. A line is taken on its first use and keeps its level then,
/// so that a restarted node does not switch anything.
class GpioLines {
 public:
  virtual ~GpioLines() = default;

  /// Drives a power switch line (0-7). @p on true: power on.
  [[nodiscard]] virtual Result<void, GpioError> set_line(std::uint8_t line, bool on) = 0;
  /// The level of a power switch line as driven, or of an input line.
  [[nodiscard]] virtual Result<bool, GpioError> read_line(std::uint8_t line) = 0;
  /// The on-board sensor inputs: bit n is line 8 + n, n = 0-3.
  [[nodiscard]] virtual Result<std::uint8_t, GpioError> read_bank() = 0;
  [[nodiscard]] virtual const GpioCounters& counters() const = 0;
};

}  // namespace srfs::hw
