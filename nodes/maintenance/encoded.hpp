// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/octets.hpp"

namespace srfs {

/// A structure of the mission dictionary on request, encoded: a line of a list.
struct EncodedLine {
  std::uint16_t apid = 0;
  std::uint16_t structure_id = 0;
  Octets data;
};
template <class Structure>
[[nodiscard]] EncodedLine encode_line(const Structure& structure) {
  return {Structure::apid, Structure::structure_id, structure.encoded()};
}

}  // namespace srfs
