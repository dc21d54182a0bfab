// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/restart_policy.hpp"

#include <algorithm>
#include <sstream>

#include <fmt/format.h>

#include "base/crc32c.hpp"
#include "base/text.hpp"

namespace srfs::suite {
namespace {

constexpr std::size_t most_deaths = 1000;  // the largest quarantine_deaths there is

}  // namespace

void count_death(DeathHistory& history, const RingSettings& settings, MonotonicTime now) {
  if (history.down) return;
  history.down = true;
  ++history.total;
  history.lived += std::max(now - history.started, nanoseconds(0));
  history.deaths.push_back(history.lived);
  const auto kept = std::find_if(history.deaths.begin(), history.deaths.end(),
                                 [&](nanoseconds t) { return history.lived - t < settings.window; });
  history.deaths.erase(history.deaths.begin(), kept);
  if (history.deaths.size() > most_deaths) history.deaths.erase(history.deaths.begin());
}

void count_start(DeathHistory& history, MonotonicTime now) {
  history.down = false;
  history.started = now;
}

RestartDecision decide(const DeathHistory& history, const RingSettings& settings,
                       const std::optional<VersionTrial>& trial) {
  RestartDecision decision;
  decision.deaths = static_cast<int>(history.deaths.size());
  if (trial && (trial->to_confirm || trial->lived < trial->probation)) {
    decision.step = RestartDecision::Step::last_good;
    return decision;
  }
  if (decision.deaths < settings.restarts) return decision;
  nanoseconds wait = settings.longest_wait;
  if (decision.deaths >= settings.quarantine_deaths) {
    decision.step = RestartDecision::Step::quarantine;
  } else {
    decision.step = RestartDecision::Step::back_off;
    wait = settings.first_wait;
    for (int i = settings.restarts; i < decision.deaths && wait < settings.longest_wait; ++i) wait *= 2;
    wait = std::min<nanoseconds>(wait, settings.longest_wait);
  }
  decision.not_before = history.started + wait;
  return decision;
}

std::string encode(const DeathHistory& history) {
  std::string text = fmt::format("deaths1 {} {} {} {} {}", history.down ? 1 : 0, history.started.ns(),
                                 history.lived.count(), history.total, history.deaths.size());
  for (const nanoseconds t : history.deaths) text += fmt::format(" {}", t.count());
  return text + fmt::format("\n{:08x}\n", crc32c(as_octets(text)));
}

std::optional<DeathHistory> decode_history(std::string_view text) {
  const std::size_t end = text.find('\n');
  if (end == std::string_view::npos) return std::nullopt;
  const std::string_view line = text.substr(0, end);
  if (text.substr(end) != fmt::format("\n{:08x}\n", crc32c(as_octets(line)))) return std::nullopt;
  std::istringstream in{std::string(line)};
  std::string magic;
  int down = 0;
  std::int64_t started = 0;
  std::int64_t lived = 0;
  DeathHistory history;
  std::size_t count = 0;
  if (!(in >> magic >> down >> started >> lived >> history.total >> count)) return std::nullopt;
  if (magic != "deaths1" || count > most_deaths) return std::nullopt;
  history.down = down != 0;
  history.started = MonotonicTime(nanoseconds(started));
  history.lived = nanoseconds(lived);
  for (std::size_t i = 0; i < count; ++i) {
    std::int64_t t = 0;
    if (!(in >> t)) return std::nullopt;
    history.deaths.emplace_back(t);
  }
  return history;
}

}  // namespace srfs::suite
