// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <tuple>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "nodes/ttc/report/report.hpp"
#include "nodes/ttc/spacecraft_clock.hpp"

namespace srfs {

/// Finishes reports to TM packets: sequence count per APID, type counter per APID, destination, service and
/// subtype. Counters start at zero with the node, as PUS-C 7.4.3.1 allows.
class PacketMaker {
 public:
  [[nodiscard]] Octets make(const Report& report, TaiTime time, TimeReference reference);

 private:
  std::map<std::uint16_t, std::uint16_t> sequence_counts_;
  /// APID, destination, service, subtype.
  using Type = std::tuple<std::uint16_t, std::uint16_t, std::uint8_t, std::uint8_t>;
  /// Destinations are chosen by senders: past the bound the counter of another type starts anew.
  static constexpr std::size_t max_type_counters = 1024;
  std::map<Type, std::uint16_t> type_counters_;
};

}  // namespace srfs
