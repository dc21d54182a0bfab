// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "nodes/ttc/command/telecommand.hpp"
#include "nodes/ttc/files/file_order.hpp"
#include "nodes/ttc/report/verification.hpp"

namespace srfs::rescue {

/// 17,1: are you alive?
struct Ping {};

/// 3,27: structures to be sent once.
using OneShot = std::vector<mission::HousekeepingOneShot>;

/// What a telecommand asks of srfs_rescue.
using Order =
    std::variant<Ping, OneShot, mission::TtcSelectKeys, mission::TtcTransmitterOn, mission::RescueReport,
                 mission::RescueStartSuite, mission::RescueReboot, mission::RescueReset, mission::RescueMend,
                 mission::RescueRestore, mission::RescueFetch, mission::RescueList, FileOrder>;

struct JudgedOrder {
  TelecommandOrigin origin = {};
  std::optional<Refusal> refusal = {};  ///< of the acceptance (1,2 or 1,10)
  Order order = Ping{};
};

/// Reads a packet of the uplink. srfs_rescue stands for ttc: it knows its ping, 3,27, its keys, its
/// transmitter, PUS 23 and rescue.*. Every other telecommand of the dictionary is refused. Pure.
[[nodiscard]] JudgedOrder judge(OctetView packet);

}  // namespace srfs::rescue
