// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.hpp"
#include "cfdp/entity.hpp"
#include "ground/commanding.hpp"
#include "ground/time_tag.hpp"

namespace srfs::ground {

/// One line of an operator, as session and console read it.
struct CommandLine {
  enum class Kind : std::uint8_t {
    nothing,  ///< empty, or a comment
    telecommand,
    arming,  ///< not the telecommand itself is sent, but what arms it
    ad_on,
    ad_off,
    unlock,
    set_vr,
    clcw,
    put,
    files,
    suspend,
    resume,
    cancel,
    stats,
    quit,
  };
  Kind kind = Kind::nothing;
  TelecommandText telecommand;  ///< also of ping and retrieve
  std::optional<milliseconds> timeout;
  std::optional<TimeTag> at;
  std::uint8_t vr = 0;
  std::string file;              ///< of put
  std::string name;              ///< on board; of put
  cfdp::TransactionId transfer;  ///< of suspend, resume, cancel
};

inline constexpr std::string_view command_line_forms =
    "ping | tc NAME [key=value ...] [--at TIME] | arm NAME [key=value ...] [--at TIME] | "
    "retrieve FROM TO [STORE] | ad on|off | unlock | "
    "setvr N | clcw | put FILE [NAME] | files | suspend ID | resume ID | cancel ID | stats | quit";

/// Whether a telecommand can be encoded is not judged here. The error is ready to print. Pure.
[[nodiscard]] Result<CommandLine, std::string> parse_command_line(const std::string& line);

}  // namespace srfs::ground
