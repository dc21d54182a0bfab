// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>

#include "base/time.hpp"

namespace srfs::ground {

/// Packets of an application process that did not come.
struct Gap {
  std::uint16_t apid = 0;
  std::uint16_t first = 0;             ///< sequence count of the first
  std::optional<std::uint16_t> count;  ///< nullopt: the counter began anew, or half of its range is missing
  UtcTime from;                        ///< time of the packet before
  UtcTime to;                          ///< and of the one after
};

/// Finds gaps in the sequence counts of live packets. Pure; memory: one entry an application process.
class GapFinder {
 public:
  static constexpr std::uint16_t modulus = 0x4000;
  /// So far back, and not younger, a packet is a late one, or comes twice.
  static constexpr std::uint16_t late_max = 64;

  struct Last {
    std::uint16_t sequence = 0;
    UtcTime time;
  };
  /// What was seen before, of an earlier run.
  void restore(std::uint16_t apid, const Last& last) { last_[apid] = last; }
  [[nodiscard]] std::optional<Last> last(std::uint16_t apid) const;
  /// A live packet. @return the gap before it
  [[nodiscard]] std::optional<Gap> on_packet(std::uint16_t apid, std::uint16_t sequence, UtcTime time);

 private:
  std::map<std::uint16_t, Last> last_;
};

}  // namespace srfs::ground
