// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <linux/can.h>
#include <linux/can/error.h>

namespace srfs::hw {

// What a handle asks of the hub of hw_sim (docs/reference/icd_can.md, section 5), as an error frame without
// data.

inline constexpr canid_t can_hub_restart = CAN_ERR_FLAG | CAN_ERR_RESTARTED;
/// Answered by the same identifier; data 0: frames that are on the wire already.
inline constexpr canid_t can_hub_withdraw = CAN_ERR_FLAG | CAN_ERR_TX_TIMEOUT;

}  // namespace srfs::hw
