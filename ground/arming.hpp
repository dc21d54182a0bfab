// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ground/commanding.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

/// What must be completed before the hazardous @p command, with exactly these arguments, is taken. Pure.
[[nodiscard]] TelecommandText arming_of(const mission::EncodedCommand& command);

}  // namespace srfs::ground
