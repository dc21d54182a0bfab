// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/log.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <ctime>
#include <mutex>

#include <unistd.h>

#include "base/log_limit.hpp"
#include "base/log_output.hpp"
#include "base/time.hpp"

namespace srfs::log {
namespace {

// Leaked on purpose: threads of the middleware may log while static objects are destroyed.
struct State {
  std::string name = "srfs";
  std::atomic<Severity> lowest{Severity::info};
  std::mutex mutex;  // guards limit, output and told_lost
  RateLimit limit;
  Output output{STDERR_FILENO};
  std::uint64_t told_lost = 0;
  std::mutex sink_mutex;
  std::function<void(const Record&)> sink;
};

State& state() {
  static State& instance = *new State;
  return instance;
}

/// Five characters, so that the texts of a log stand below one another.
const char* label(Severity severity) {
  switch (severity) {
    case Severity::debug:
      return "DEBUG";
    case Severity::info:
      return "INFO ";
    case Severity::warn:
      return "WARN ";
    case Severity::error:
      return "ERROR";
    case Severity::fatal:
      return "FATAL";
  }
  return "?    ";
}

/// Level of syslog(3), which the journal reads from the front of a line.
int syslog_level(Severity severity) {
  switch (severity) {
    case Severity::debug:
      return 7;
    case Severity::info:
      return 6;
    case Severity::warn:
      return 4;
    case Severity::error:
      return 3;
    case Severity::fatal:
      return 2;
  }
  return 5;
}

/// "2026-11-21T08:00:00.123Z " without taking memory. @return end of what was written
char* put_time(char* out) {
  const auto now = std::chrono::duration_cast<milliseconds>(system_utc_now().since_epoch()).count();
  const std::time_t s = now / 1000;
  std::tm utc{};
  gmtime_r(&s, &utc);
  return fmt::format_to(out, "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:03}Z ", utc.tm_year + 1900,
                        utc.tm_mon + 1, utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec, now % 1000);
}

/// To stderr. Under the mutex.
void put_line(State& s, Severity severity, std::string_view text) {
  std::array<char, Output::longest_line> line;
  char* end = line.data();
  if (s.output.is_journal()) {
    end = fmt::format_to(end, "<{}>", syslog_level(severity));
  } else {
    end = put_time(end);
    end = fmt::format_to(end, "{} ", label(severity));
  }
  constexpr std::size_t longest_name = 64;
  end = fmt::format_to(end, "[{}] {}\n", std::string_view(s.name).substr(0, longest_name),
                       text.substr(0, longest_text));
  s.output.write({line.data(), static_cast<std::size_t>(end - line.data())});
}

void put(State& s, const Record& record) {
  {
    const std::lock_guard lock(s.mutex);
    if (const std::uint64_t lost = s.output.lost(); lost > s.told_lost) {
      std::array<char, 80> text;
      const auto end =
          fmt::format_to(text.data(), "{} log lines lost: stderr did not accept them", lost - s.told_lost);
      put_line(s, Severity::warn, {text.data(), static_cast<std::size_t>(end - text.data())});
      if (s.output.lost() == lost) s.told_lost = lost;
    }
    put_line(s, record.severity, record.text);
  }
  const std::lock_guard lock(s.sink_mutex);
  if (s.sink) s.sink(record);
}

void put_held_back(State& s, Severity severity, const std::source_location& where, std::uint32_t count) {
  std::array<char, 80> text;
  const auto end = fmt::format_to(text.data(), "{} lines of the following kind suppressed", count);
  put(s, {severity, {text.data(), static_cast<std::size_t>(end - text.data())}, where});
}

}  // namespace

std::string_view base_name(std::string_view file) {
  return file.substr(file.find_last_of('/') + 1);
}

std::string_view to_text(Severity severity) {
  switch (severity) {
    case Severity::debug:
      return "debug";
    case Severity::info:
      return "info";
    case Severity::warn:
      return "warn";
    case Severity::error:
      return "error";
    case Severity::fatal:
      return "fatal";
  }
  return "?";
}

std::optional<Severity> severity_of(std::string_view name) {
  for (const Severity s :
       {Severity::debug, Severity::info, Severity::warn, Severity::error, Severity::fatal}) {
    if (to_text(s) == name) return s;
  }
  return std::nullopt;
}

void set_name(std::string name) {
  state().name = std::move(name);
}

void set_level(Severity lowest) {
  state().lowest = lowest;
}

Severity level() {
  return state().lowest.load(std::memory_order_relaxed);
}

void set_sink(std::function<void(const Record&)> sink) {
  const std::lock_guard lock(state().sink_mutex);
  state().sink = std::move(sink);
}

Losses losses() {
  State& s = state();
  const std::lock_guard lock(s.mutex);
  return {.held_back = s.limit.held_back(), .lost = s.output.lost()};
}

void report_held_back() {
  State& s = state();
  while (true) {
    std::optional<RateLimit::Due> due;
    {
      const std::lock_guard lock(s.mutex);
      due = s.limit.take_due(monotonic_now());
    }
    if (!due) return;
    std::array<char, 160> text;
    const auto end = fmt::format_to_n(text.data(), text.size(), "{} lines of {}:{} suppressed",
                                      due->held_back, base_name(due->site.file), due->site.line);
    put(s, {Severity::warn, {text.data(), std::min(end.size, text.size())}, std::source_location::current()});
  }
}

void write(Severity severity, const std::source_location& where, fmt::string_view format,
           fmt::format_args arguments) {
  State& s = state();
  RateLimit::Verdict verdict{.write = true};
  if (severity != Severity::fatal) {
    const std::lock_guard lock(s.mutex);
    verdict = s.limit.on_line({where.file_name(), where.line()}, monotonic_now());
  }
  if (!verdict.write) return;
  if (verdict.held_back > 0) put_held_back(s, severity, where, verdict.held_back);
  std::array<char, longest_text> text;
  const auto end = fmt::vformat_to_n(text.data(), text.size(), format, arguments);
  put(s, {severity, {text.data(), std::min(end.size, text.size())}, where});
}

}  // namespace srfs::log
