// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/octets.hpp"

namespace srfs {

/// One PUS report before it becomes a packet: source, service type and subtype, source data, and how it
/// leaves.
struct Report {
  std::uint16_t apid = 0;
  std::uint8_t service = 0;
  std::uint8_t subtype = 0;
  std::uint16_t destination_id = 0;  ///< source id of the telecommand it answers; 0: all
  Octets data = {};
  std::uint64_t ends = 0;  ///< id of the accepted telecommand whose end it reports; 0: of none
  bool live = true;        ///< sent at once; false: only stored
  bool stored = true;      ///< also in the packet store of its service
  bool urgent = false;     ///< its frame does not wait for more packets
};

}  // namespace srfs
