// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "base/result.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/command/telecommand.hpp"
#include "wire/pus.hpp"

namespace srfs {

/// Makes telecommands from space packets: whose it is, what the dictionary has for it, its arguments. Pure.
class TelecommandParser {
 public:
  /// @param dictionary  outlives it, and every telecommand points into it
  /// @param own_apid  of ttc, which answers for application processes that do not exist
  TelecommandParser(const mission::Dictionary& dictionary, std::uint16_t own_apid)
      : dictionary_(dictionary), own_apid_(own_apid) {}

  /// @return refused: it is no telecommand packet, or the dictionary has no such telecommand. The arguments
  /// are not checked.
  [[nodiscard]] JudgedTelecommand parse(OctetView packet) const;
  /// Against the dictionary: their length and their values.
  [[nodiscard]] std::optional<Refusal> check_arguments(const Telecommand& telecommand) const;

 private:
  [[nodiscard]] Result<const mission::Command*, Refusal> find_command(const wire::TcPacket& packet) const;

  const mission::Dictionary& dictionary_;
  std::uint16_t own_apid_;
};

}  // namespace srfs
