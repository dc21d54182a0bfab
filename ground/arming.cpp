// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/arming.hpp"

#include <fmt/format.h>
#include <mission/structures.hpp>

#include "base/crc32c.hpp"

namespace srfs::ground {

TelecommandText arming_of(const mission::EncodedCommand& command) {
  return {.name = std::string(mission::TtcArm::name),
          .arguments = {fmt::format("of_apid={}", command.command->apid),
                        fmt::format("of_service={}", command.command->service),
                        fmt::format("of_subtype={}", command.command->subtype),
                        fmt::format("digest=0x{:08x}", crc32c(command.data))}};
}

}  // namespace srfs::ground
