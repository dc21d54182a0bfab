// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/octets.hpp"

namespace srfs {

/// An event of the mission dictionary, encoded.
struct EncodedEvent {
  std::uint16_t id = 0;
  std::uint8_t severity = 0;
  Octets data;
};
template <class Event>
[[nodiscard]] EncodedEvent encode_event(const Event& event) {
  return {Event::event_id, static_cast<std::uint8_t>(Event::severity), event.encoded()};
}

}  // namespace srfs
