// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/ring_commands.hpp"

#include <charconv>
#include <iostream>
#include <map>

#include <fmt/format.h>

#include "programs/srfs/answer.hpp"
#include "suite/ring/fault_ledger.hpp"
#include "suite/ring/node_record.hpp"

namespace srfs::tool {
namespace {

using suite::FaultRecord;
using suite::RestartDecision;

constexpr milliseconds longest_wait_for_lock{3000};

std::string milliseconds_text(const std::optional<nanoseconds>& d) {
  return d ? fmt::format("{:.1f}", static_cast<double>(d->count()) / 1e6) : "-";
}

std::string number_or_dash(std::uint32_t number) {
  return number == 0 ? "-" : std::to_string(number);
}

/// When a restarted incarnation was Active again, by (boot, node, incarnation).
using Recoveries = std::map<std::tuple<std::string, std::string, std::uint32_t>, nanoseconds>;

Recoveries recoveries_of(const std::vector<FaultRecord>& records) {
  Recoveries found;
  for (const FaultRecord& r : records) {
    if (r.kind == FaultRecord::Kind::active && r.active)
      found[{r.boot, r.subject, r.new_incarnation}] = *r.active;
  }
  return found;
}

void print_faults(const std::vector<const FaultRecord*>& faults, const Recoveries& recoveries) {
  fmt::print("{:>6} {:<23} {:<18} {:<18} {:<14} {:>11} {:<16} {:>9} {:>8} {:>8} {:>9}  {}\n", "SEQ", "UTC",
             "NODE", "OBSERVER", "FAULT", "INCARNATION", "OUTCOME", "JUDGED_MS", "KILL_MS", "START_MS",
             "ACTIVE_MS", "END AND WHY");
  for (const FaultRecord* r : faults) {
    std::optional<nanoseconds> active;
    if (const auto found = recoveries.find({r->boot, r->subject, r->new_incarnation});
        found != recoveries.end())
      active = found->second;
    std::string why = r->cause;
    for (const std::string& text : {r->detail, r->reason}) {
      if (!text.empty()) why += (why.empty() ? "" : "; ") + text;
    }
    fmt::print("{:>6} {:<23} {:<18} {:<18} {:<14} {:>11} {:<16} {:>9} {:>8} {:>8} {:>9}  {}\n", r->sequence,
               to_iso8601(r->utc), r->subject, r->observer, to_text(r->fault),
               fmt::format("{} > {}", number_or_dash(r->old_incarnation), number_or_dash(r->new_incarnation)),
               to_text(r->outcome), milliseconds_text(r->judged), milliseconds_text(r->killed),
               milliseconds_text(r->started), milliseconds_text(active), why);
  }
}

/// What the ring's memory says of a node.
std::string standing(const Target& target, const std::string& node, const suite::DeathHistory& history,
                     bool runs, MonotonicTime now) {
  if (const auto why = suite::held_because(target.var, target.deployment, node, now)) return "held: " + *why;
  if (runs) return "guarded";
  const RestartDecision decision = suite::decide(history, target.deployment.ring);
  if (!history.down || decision.step == RestartDecision::Step::start || decision.not_before <= now)
    return "to be started";
  return fmt::format("{} for {:.1f} s",
                     decision.step == RestartDecision::Step::quarantine ? "quarantine" : "back-off",
                     static_cast<double>((decision.not_before - now).count()) / 1e9);
}

}  // namespace

std::string end_of_order_text(const suite::Deployment& deployment, const std::string& node) {
  const MonotonicTime now = monotonic_now();
  const auto end = suite::end_of_order(deployment, node, now);
  if (!end) return "";
  return fmt::format("; for at most {} s and not across a reset: it is on the command path",
                     std::chrono::duration_cast<seconds>(*end - now).count());
}

std::optional<UtcTime> parse_since(const std::string& since, UtcTime now) {
  if (const auto time = from_iso8601(since)) return time;
  std::int64_t count = 0;
  const char* const end = since.data() + since.size();
  const auto [unit, error] = std::from_chars(since.data(), end, count);
  constexpr std::int64_t most = 1'000'000;
  if (error != std::errc() || unit + 1 != end || count < 0 || count > most) return std::nullopt;
  switch (*unit) {
    case 's':
      return now - seconds(count);
    case 'm':
      return now - std::chrono::minutes(count);
    case 'h':
      return now - std::chrono::hours(count);
    default:
      return std::nullopt;
  }
}

int show_faults(const Target& target, const std::string& since, const std::string& node, bool json) {
  std::optional<UtcTime> earliest;
  if (!since.empty()) {
    earliest = parse_since(since, system_utc_now());
    if (!earliest)
      return fail(CommandExit::usage,
                  fmt::format("--since: '{}': expected a time (2026-11-21T08:00:00Z) or 90s, 15m, 2h", since),
                  json);
  }
  const auto content = suite::FaultLedger(target.var).read();
  const Recoveries recoveries = recoveries_of(content.records);
  std::vector<const FaultRecord*> shown;
  for (const FaultRecord& r : content.records) {
    if ((earliest && r.utc < *earliest) || (!node.empty() && r.subject != node)) continue;
    if (json) {
      const std::string line = encode(r);
      std::cout << line.substr(0, line.find('\t')) << "\n";
    } else if (r.kind == FaultRecord::Kind::fault) {
      shown.push_back(&r);
    }
  }
  if (!json) {
    if (shown.empty()) {
      fmt::print("no faults\n");
    } else {
      print_faults(shown, recoveries);
    }
  }
  if (content.damaged > 0)
    fmt::print(stderr, "srfs faults: {} damaged lines were skipped\n", content.damaged);
  return static_cast<int>(CommandExit::done);
}

int show_ring(const Target& target, bool json) {
  const MonotonicTime now = monotonic_now();
  Json list = Json::array();
  if (!json)
    fmt::print("{:<18} {:>8} {:>12} {:>7} {:>12}  {}\n", "NODE", "PID", "INCARNATION", "DEATHS", "IN WINDOW",
               "STANDING");
  for (const auto& node : target.deployment.nodes) {
    const auto instance = suite::find_instance(target.var, node.name);
    const suite::DeathHistory history = suite::read_deaths(target.var, node.name);
    const std::string text = standing(target, node.name, history, instance.has_value(), now);
    if (json) {
      const auto why = suite::held_because(target.var, target.deployment, node.name, now);
      list.push_back({{"name", node.name},
                      {"pid", instance ? Json(instance->pid) : Json(nullptr)},
                      {"incarnation", instance ? Json(instance->incarnation) : Json(nullptr)},
                      {"deaths", history.total},
                      {"deaths_in_window", history.deaths.size()},
                      {"held", why ? Json(*why) : Json(nullptr)},
                      {"standing", text}});
    } else {
      fmt::print(
          "{:<18} {:>8} {:>12} {:>7} {:>12}  {}\n", node.name, instance ? std::to_string(instance->pid) : "-",
          instance ? std::to_string(instance->incarnation) : "-", history.total, history.deaths.size(), text);
    }
  }
  if (json) std::cout << list.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
  return static_cast<int>(CommandExit::done);
}

int hold_node(const Target& target, const std::string& node, const std::string& reason, bool json) {
  if (target.deployment.find(node) == nullptr) return no_node(node, json);
  const MonotonicTime now = monotonic_now();
  if (const auto held = suite::hold(target.var, target.deployment, node, reason, now); !held)
    return fail(CommandExit::refused, held.error(), json);
  return done(fmt::format("{} is held: it is not restarted, and `srfs up` does not start it{}", node,
                          end_of_order_text(target.deployment, node)),
              json);
}

int release_node(const Target& target, const std::string& node, const std::string& state, bool json) {
  if (target.deployment.find(node) == nullptr) return no_node(node, json);
  if (!state.empty()) {
    const auto wanted = ros::primary_state(state);
    if (!wanted || *wanted == ros::State::finalized)
      return fail(CommandExit::usage, fmt::format("'{}': not a state to start in", state), json);
    if (suite::find_instance(target.var, node))
      return fail(CommandExit::refused,
                  fmt::format("{} is running; use `srfs lifecycle {} ...` to change its state and keep it",
                              node, node),
                  json);
    if (const auto set =
            suite::set_desired_state(target.var, target.deployment, node, *wanted, monotonic_now());
        !set)
      return fail(CommandExit::refused, set.error(), json);
  }
  if (const auto released = suite::release(target.var, node, longest_wait_for_lock); !released)
    return fail(CommandExit::refused, released.error(), json);
  return done(
      fmt::format("{} is released: no hold, no back-off, no quarantine{}", node,
                  state.empty() ? ""
                                : "; its next start is in state " + state +
                                      (state == "active" ? "" : end_of_order_text(target.deployment, node))),
      json);
}

}  // namespace srfs::tool
