#pragma once

#include <cstdint>

#include "base/octets.hpp"

namespace srfs {

/// One PUS report before it becomes a packet: who speaks, service type and subtype, source data.
struct Report {
  std::uint16_t apid = 0;
  std::uint8_t service = 0;
  std::uint8_t subtype = 0;
  std::uint16_t destination_id = 0;  ///< source id of the telecommand it answers; 0: everybody
  Octets data;
};

}  // namespace srfs
