// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "hw/can_bus.hpp"

namespace srfs::hw {

/// What rtnetlink reports of an interface (linux/rtnetlink.h, linux/can/netlink.h). Nothing of a controller
/// where there is none: vcan.
struct CanLink {
  std::optional<CanBusState> state;  ///< of the controller; stopped or sleeping: down
  std::optional<bool> carrier;       ///< of the interface, of any kind; a controller that is bus-off has none
  std::optional<std::uint32_t> restart_ms;
  std::optional<std::uint32_t> bit_rate;
  std::optional<std::uint16_t> transmit_errors;
  std::optional<std::uint16_t> receive_errors;
};

// The messages, pure. Numbers in host order, as rtnetlink wants them.

[[nodiscard]] Octets encode_link_query(int interface, std::uint32_t sequence);
/// As `ip link set IF type can restart`: refused by the kernel with EINVAL while restart-ms is set or the
/// interface is down, with EBUSY while the controller is not bus-off.
[[nodiscard]] Octets encode_can_restart(int interface, std::uint32_t sequence);
/// As `ip link set IF up` or `down`.
[[nodiscard]] Octets encode_link_up(int interface, bool up, std::uint32_t sequence);
/// @return the errno the kernel answered with, EBADMSG for what is no answer to @p sequence
[[nodiscard]] Result<CanLink, int> decode_link(OctetView answer, std::uint32_t sequence);
[[nodiscard]] Result<void, int> decode_acknowledgement(OctetView answer, std::uint32_t sequence);

// The same as requests to the kernel. rtnetlink answers within the call; it may hold the caller for as long
// as another process holds the kernel's rtnl lock. All return an errno; the two that change something need
// CAP_NET_ADMIN (EPERM).

[[nodiscard]] Result<CanLink, int> query_can_link(int interface);
[[nodiscard]] Result<void, int> restart_can_controller(int interface);
[[nodiscard]] Result<void, int> set_can_link_up(int interface);
/// Down and up again is the only way to take queued frames back from interface and controller. Every socket
/// on the interface notices. Both go to the kernel in one system call: a process killed in between leaves no
/// interface down.
struct LinkCycle {
  Result<void, int> down;
  Result<void, int> up;
};
[[nodiscard]] LinkCycle cycle_can_link(int interface);

}  // namespace srfs::hw
