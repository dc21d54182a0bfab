// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "msgs/mission/encoded_event.hpp"
#include "nodes/payload/payload_cycle.hpp"

namespace srfs {

/// As the mission's dictionary has it. Pure.
[[nodiscard]] EncodedEvent to_event(const PayloadEvent& event);

}  // namespace srfs
