// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/time.hpp"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <cctype>
#include <cstdio>

namespace srfs {
namespace {

nanoseconds read_clock(clockid_t id) {
  timespec ts{};
  clock_gettime(id, &ts);
  return seconds(ts.tv_sec) + nanoseconds(ts.tv_nsec);
}

}  // namespace

MonotonicTime monotonic_now() {
  return MonotonicTime(read_clock(CLOCK_MONOTONIC));
}

UtcTime system_utc_now() {
  return UtcTime(read_clock(CLOCK_REALTIME));
}

std::string to_iso8601(UtcTime t, int decimals) {
  const std::int64_t whole = std::chrono::floor<seconds>(t.since_epoch()).count();
  const std::int64_t fraction_ns = t.ns() - whole * 1'000'000'000;
  const time_t posix = whole;
  tm parts{};
  gmtime_r(&posix, &parts);
  std::string text = fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}", parts.tm_year + 1900,
                                 parts.tm_mon + 1, parts.tm_mday, parts.tm_hour, parts.tm_min, parts.tm_sec);
  const int digits = std::clamp(decimals, 0, 9);
  if (digits > 0) text += "." + fmt::format("{:09}", fraction_ns).substr(0, static_cast<std::size_t>(digits));
  return text + "Z";
}

std::optional<UtcTime> from_iso8601(const std::string& text) {
  tm parts{};
  int consumed = 0;
  // NOLINTNEXTLINE(cert-err34-c): the count of fields is checked and ranges are checked below
  if (std::sscanf(text.c_str(), "%4d-%2d-%2dT%2d:%2d:%2d%n", &parts.tm_year, &parts.tm_mon, &parts.tm_mday,
                  &parts.tm_hour, &parts.tm_min, &parts.tm_sec, &consumed) != 6) {
    return std::nullopt;
  }
  constexpr int last_whole_year = 2261;  // of 64 bits of nanoseconds
  if (parts.tm_year < 1970 || parts.tm_year > last_whole_year || parts.tm_mon < 1 || parts.tm_mon > 12 ||
      parts.tm_mday < 1 || parts.tm_mday > 31 || parts.tm_hour < 0 || parts.tm_hour > 23 ||
      parts.tm_min < 0 || parts.tm_min > 59 || parts.tm_sec < 0 || parts.tm_sec > 60) {
    return std::nullopt;
  }
  auto rest = static_cast<std::size_t>(consumed);
  std::int64_t fraction_ns = 0;
  if (rest < text.size() && text[rest] == '.') {
    std::int64_t scale = 100'000'000;
    for (++rest; rest < text.size() && std::isdigit(static_cast<unsigned char>(text[rest])) != 0; ++rest) {
      fraction_ns += (text[rest] - '0') * scale;
      scale /= 10;
    }
  }
  if (rest < text.size() && text[rest] == 'Z') ++rest;
  if (rest != text.size()) return std::nullopt;
  parts.tm_year -= 1900;
  parts.tm_mon -= 1;
  // A day that the month does not have becomes one of the next month.
  tm day{};
  day.tm_year = parts.tm_year;
  day.tm_mon = parts.tm_mon;
  day.tm_mday = parts.tm_mday;
  if (timegm(&day) < 0 || day.tm_mon != parts.tm_mon || day.tm_mday != parts.tm_mday) return std::nullopt;
  return UtcTime(seconds(timegm(&parts)) + nanoseconds(fraction_ns));
}

}  // namespace srfs
