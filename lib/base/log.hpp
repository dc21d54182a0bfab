// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <source_location>
#include <string>
#include <string_view>
#include <type_traits>

#include <fmt/format.h>

namespace srfs::log {

/// Severities with the values of rcl_interfaces/msg/Log.
enum class Severity : std::uint8_t { debug = 10, info = 20, warn = 30, error = 40, fatal = 50 };

/// "debug", "info", "warn", "error", "fatal".
[[nodiscard]] std::string_view to_text(Severity severity);
/// The severity of that name; nullopt for any other text.
[[nodiscard]] std::optional<Severity> severity_of(std::string_view name);

/// Longest text of a line, octets; the rest is cut.
inline constexpr std::size_t longest_text = 1000;

/// One line as the sink gets it.
struct Record {
  Severity severity;
  std::string_view text;
  std::source_location where;
};
/// A source file's name without its folders.
[[nodiscard]] std::string_view base_name(std::string_view file);

/// Name that stands in every line ("timing", "hw_sim"). Set once in main, before threads.
void set_name(std::string name);
/// Lines below are not written. Any thread; fatal always is.
void set_level(Severity lowest);
[[nodiscard]] Severity level();
/// Where lines also go (/rosout). Called on the logging thread; must not log. Empty function: nowhere.
void set_sink(std::function<void(const Record&)> sink);

/// Lines that were not written, since the start.
struct Losses {
  std::uint64_t held_back = 0;  ///< by the rate limit (log_limit.hpp)
  std::uint64_t lost = 0;       ///< stderr did not take them (log_output.hpp)
};
[[nodiscard]] Losses losses();
/// Writes how many lines were held back at call sites that have been quiet since. Now and then.
void report_held_back();

/// One line to stderr: "2026-11-21T08:00:00.123Z WARN  [ttc] text", or "<4>[ttc] text" when the journal reads
/// it, which has its own time stamps (sd-daemon(3)). Thread-safe. Never waits for a reader of stderr, takes
/// no memory, and obeys the rate limit except for fatal.
void write(Severity severity, const std::source_location& where, fmt::string_view format,
           fmt::format_args arguments);

/// A format string and the place it stands at.
template <class... A>
struct Format {
  fmt::format_string<A...> text;
  std::source_location where;
  template <class S>
  consteval Format(const S& literal,  // NOLINT(google-explicit-constructor): written as a plain literal
                   std::source_location here = std::source_location::current())
      : text(literal), where(here) {}
};
template <class... A>
using FormatOf = std::type_identity_t<Format<A...>>;

template <class... A>
void debug(FormatOf<A...> f, A&&... a) {
  if (level() <= Severity::debug) write(Severity::debug, f.where, f.text, fmt::make_format_args(a...));
}
template <class... A>
void info(FormatOf<A...> f, A&&... a) {
  if (level() <= Severity::info) write(Severity::info, f.where, f.text, fmt::make_format_args(a...));
}
template <class... A>
void warn(FormatOf<A...> f, A&&... a) {
  if (level() <= Severity::warn) write(Severity::warn, f.where, f.text, fmt::make_format_args(a...));
}
template <class... A>
void error(FormatOf<A...> f, A&&... a) {
  if (level() <= Severity::error) write(Severity::error, f.where, f.text, fmt::make_format_args(a...));
}
template <class... A>
void fatal(FormatOf<A...> f, A&&... a) {
  write(Severity::fatal, f.where, f.text, fmt::make_format_args(a...));
}

}  // namespace srfs::log
