#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include <fmt/format.h>

namespace srfs::log {

/// Severities with the values of rcl_interfaces/msg/Log.
enum class Severity : std::uint8_t { debug = 10, info = 20, warn = 30, error = 40, fatal = 50 };

/// Name that stands in every line ("timing", "hw_sim"). Set once in main, before threads.
void set_name(std::string name);
void set_level(Severity lowest);
[[nodiscard]] Severity level();
/// Where lines also go (/rosout). Called on the logging thread; must not log. Empty function: nowhere.
void set_sink(std::function<void(Severity, std::string_view)> sink);

/// One line to stderr: "2026-11-21T08:00:00.123Z WARN  [ttc] text". Thread-safe; one write(2) a line, so
/// lines never mix.
void write(Severity severity, std::string_view text);

template <class... A>
void debug(fmt::format_string<A...> f, A&&... a) {
  if (level() <= Severity::debug) write(Severity::debug, fmt::format(f, std::forward<A>(a)...));
}
template <class... A>
void info(fmt::format_string<A...> f, A&&... a) {
  if (level() <= Severity::info) write(Severity::info, fmt::format(f, std::forward<A>(a)...));
}
template <class... A>
void warn(fmt::format_string<A...> f, A&&... a) {
  if (level() <= Severity::warn) write(Severity::warn, fmt::format(f, std::forward<A>(a)...));
}
template <class... A>
void error(fmt::format_string<A...> f, A&&... a) {
  write(Severity::error, fmt::format(f, std::forward<A>(a)...));
}
template <class... A>
void fatal(fmt::format_string<A...> f, A&&... a) {
  write(Severity::fatal, fmt::format(f, std::forward<A>(a)...));
}

}  // namespace srfs::log
