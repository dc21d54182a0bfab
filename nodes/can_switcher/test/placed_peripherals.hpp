// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "suite/peripheral.hpp"

namespace srfs {

inline const suite::Peripheral adcs{"payload_adcs", 0x11, 0};
inline const suite::Peripheral eps{"payload_eps", 0x12, 1};
inline const suite::Peripheral thermal{"payload_thermal", 0x13, 2};

}  // namespace srfs
