// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "base/time.hpp"
#include "ground/commanding.hpp"
#include "ground/time_tag.hpp"

namespace srfs::ground {

/// How a telecommand of a script must end.
enum class Expectation : std::uint8_t { completed, accepted, rejected, failed, scheduled };
[[nodiscard]] std::string_view to_text(Expectation expectation);

/// One line of a script.
struct ScriptStep {
  enum class Kind : std::uint8_t { telecommand, wait, wait_until, ad_on, ad_off, unlock, set_vr };
  Kind kind = Kind::telecommand;
  std::uint64_t line = 0;  ///< of the file, from 1
  std::string text;
  // telecommand
  std::string name;
  std::vector<std::string> arguments;
  bool arms = false;  ///< not the telecommand itself is sent, but what arms it
  std::optional<milliseconds> timeout;
  std::optional<TimeTag> at;
  Expectation expectation = Expectation::completed;
  std::string failure;  ///< name of the failure code that is expected; empty: any
  // the others
  milliseconds duration{0};
  UtcTime until;
  std::uint8_t vr = 0;
};

struct ScriptError {
  std::uint64_t line = 0;
  std::string message;
};

inline constexpr std::size_t script_lines_max = 10000;
inline constexpr std::size_t script_octets_max = 1 << 20;

/// Reads a whole script before anything of it is sent.
/// @param check whether a telecommand can be encoded: its error, or nullopt
[[nodiscard]] Result<std::vector<ScriptStep>, ScriptError> parse_script(
    std::string_view text,
    const std::function<std::optional<std::string>(const std::string& name,
                                                   const std::vector<std::string>& arguments)>& check);

/// @return whether the telecommand ended as expected; nullopt: it has not ended yet
[[nodiscard]] std::optional<bool> judge(const ScriptStep& step, const StageReport& report);

}  // namespace srfs::ground
