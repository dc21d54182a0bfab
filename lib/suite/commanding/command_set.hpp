// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <type_traits>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "suite/commanding/telecommand_journal.hpp"

namespace srfs {

[[nodiscard]] inline FailureCode failure_code(mission::ArgumentError error) {
  return error.parameter == 0 ? mission::failure::bad_arguments_length : mission::failure::bad_argument;
}

/// The telecommands (functions, PUS 8) that a node executes, by their structs of the mission dictionary.
/// Pure.
template <class... Commands>
class CommandSet {
 public:
  /// Why a telecommand is refused: unknown_function, bad_arguments_length or bad_argument. none: it is one of
  /// these, and its arguments are what the dictionary allows.
  [[nodiscard]] static FailureCode check(std::uint16_t function, OctetView arguments) {
    return visit(function, arguments, [](const auto& /*command*/) { return mission::failure::none; });
  }

  /// Decodes one and executes it. What check() refuses is not executed.
  /// @param executor  has `FailureCode execute(const Command&)` for each of the commands
  template <class Executor>
  [[nodiscard]] static FailureCode execute(Executor& executor, std::uint16_t function, OctetView arguments) {
    return visit(function, arguments, [&](const auto& command) { return executor.execute(command); });
  }

 private:
  template <class Visitor>
  static FailureCode visit(std::uint16_t function, OctetView arguments, const Visitor& visitor) {
    FailureCode outcome = mission::failure::unknown_function;
    const auto is_this = [&]<class Command>(std::type_identity<Command> /*tag*/) {
      if (function != Command::function_id) return false;
      const auto command = Command::decode(arguments);
      outcome = command ? visitor(*command) : failure_code(command.error());
      return true;
    };
    static_cast<void>((is_this(std::type_identity<Commands>{}) || ...));
    return outcome;
  }
};

}  // namespace srfs
