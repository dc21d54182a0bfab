// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::wire {

/// How often and why the computer started, as it stands on disk (DESIGN section 8): VAR/state/boot/record_a
/// and record_b, written by timing, read by ttc.
struct BootRecord {
  std::uint32_t count = 0;            ///< starts of the computer, this one included
  std::string boot_id = "-";          ///< of this start (no spaces)
  std::uint8_t reset_cause = 255;     ///< of this start: enumeration reset_cause of the mission dictionary
  bool healthy = false;               ///< all evidence for the watchdog held for long enough in this boot
  UtcTime healthy_since{};            ///< begin of that time; the epoch: unknown
  std::uint32_t unhealthy_boots = 0;  ///< boots in a row before this one that never became healthy
  bool withheld = false;              ///< the watchdog is not being fed
  bool ended = false;                 ///< timing was ended in order
  std::uint32_t revision = 0;         ///< counts the writes: of two copies the higher one is the newer

  bool operator==(const BootRecord&) const = default;
};

enum class BootRecordError : std::uint8_t { not_a_record, damaged };

/// Text with a checksum.
[[nodiscard]] std::string encode_boot_record(const BootRecord& record);
[[nodiscard]] Result<BootRecord, BootRecordError> decode_boot_record(const std::string& text);

}  // namespace srfs::wire
