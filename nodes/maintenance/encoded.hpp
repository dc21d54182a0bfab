// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <mission/structures.hpp>

#include "base/octets.hpp"

namespace srfs {

// Parts of the mission dictionary, encoded.

struct EncodedEvent {
  std::uint16_t id = 0;
  std::uint8_t severity = 0;
  Octets data;
};
template <class Event>
[[nodiscard]] EncodedEvent encode_event(const Event& event) {
  return {Event::event_id, static_cast<std::uint8_t>(Event::severity), event.encoded()};
}

/// A structure on request: a line of a list.
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
