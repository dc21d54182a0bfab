// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/node_record.hpp"

#include <cstdio>
#include <sstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include "base/file.hpp"
#include "suite/launcher.hpp"
#include "suite/node_versions.hpp"

namespace srfs::suite {
namespace {

std::string deaths_file(const std::string& node) {
  return node + ".deaths";
}

std::filesystem::path hold_file(const VarPaths& var, const std::string& node) {
  return var.state(node) / "hold";
}

std::string stand_in_file(const std::string& node) {
  return node + ".stand_in";
}

std::filesystem::path desired_file(const VarPaths& var, const std::string& node) {
  return var.state(node) / "desired_state";
}

// Of the command path, in var.memory().
constexpr const char* hold_suffix = ".hold";
constexpr const char* desired_suffix = ".desired_state";

struct Order {
  MonotonicTime until;
  std::string text;
};

std::optional<Order> order_in_memory(const VarPaths& var, const std::string& name, MonotonicTime now) {
  std::istringstream in(read_from_memory(var, name, 1024));
  std::int64_t until_ns = 0;
  Order order;
  if (!(in >> until_ns) || !std::getline(in >> std::ws, order.text)) return std::nullopt;
  order.until = MonotonicTime(nanoseconds(until_ns));
  return now < order.until ? std::optional(order) : std::nullopt;
}

Result<void, std::string> keep_in_memory(const VarPaths& var, const std::string& name, const Order& order) {
  const std::string text = order.text.empty() ? "-" : order.text;
  if (replace_in_memory(var, name, fmt::format("{} {}\n", order.until.ns(), text))) return {};
  return Err("cannot write below " + var.memory().string());
}

Result<void, std::string> remove_from_memory(const VarPaths& var, const std::string& name) {
  std::error_code ec;
  std::filesystem::remove(var.memory() / name, ec);
  if (ec) return Err(fmt::format("{}: cannot remove: {}", (var.memory() / name).string(), ec.message()));
  return {};
}

}  // namespace

DeathHistory read_deaths(const VarPaths& var, const std::string& node) {
  constexpr std::size_t largest = 32768;
  return decode_history(read_from_memory(var, deaths_file(node), largest)).value_or(DeathHistory{});
}

bool write_deaths(const VarPaths& var, const std::string& node, const DeathHistory& history) {
  return replace_in_memory(var, deaths_file(node), encode(history));
}

std::optional<StartingProcess> find_starting(const VarPaths& var, const std::string& node) {
  const auto started = last_started(var, node);
  if (!started) return std::nullopt;
  auto process = Process::open(started->pid);
  if (!process || process_start_ticks(started->pid) != started->start_ticks || !var.may_name(started->pid) ||
      process->wait_for_exit(nanoseconds(0)))
    return std::nullopt;
  // Its pid in the lock's text: it has held the lock, so it is not on the way to it but ending, files first.
  pid_t holder = 0;
  std::istringstream lock_text(read_file(var.instance_lock(node), 256).value_or(""));
  if (lock_text >> holder && holder == started->pid) return std::nullopt;
  return StartingProcess{std::move(*process), started->since};
}

bool write_stand_in(const VarPaths& var, const std::string& node, const std::string& by,
                    MonotonicTime until) {
  const auto ticks = process_start_ticks(getpid());
  return ticks && replace_in_memory(var, stand_in_file(node),
                                    fmt::format("{} {} {} {}\n", getpid(), *ticks, until.ns(), by));
}

void end_stand_in(const VarPaths& var, const std::string& node) {
  std::error_code ec;
  std::filesystem::remove(var.memory() / stand_in_file(node), ec);
}

std::optional<StandIn> read_stand_in(const VarPaths& var, const std::string& node) {
  std::istringstream in(read_from_memory(var, stand_in_file(node), 256));
  StandIn stand_in;
  std::int64_t until_ns = 0;
  if (!(in >> stand_in.pid >> stand_in.start_ticks >> until_ns >> stand_in.by)) return std::nullopt;
  stand_in.until = MonotonicTime(nanoseconds(until_ns));
  return stand_in;
}

std::optional<Process> find_overrun(const VarPaths& var, const StandIn& stand_in, MonotonicTime now) {
  if (now < stand_in.until) return std::nullopt;
  auto process = Process::open(stand_in.pid);
  if (!process || process_start_ticks(stand_in.pid) != stand_in.start_ticks || !var.may_name(stand_in.pid))
    return std::nullopt;
  return process;
}

std::optional<MonotonicTime> end_of_order(const Deployment& deployment, const std::string& node,
                                          MonotonicTime now) {
  if (!deployment.on_command_path(node)) return std::nullopt;
  return now + deployment.ring.command_path_limit;
}

std::optional<std::string> held_because(const VarPaths& var, const Deployment& deployment,
                                        const std::string& node, MonotonicTime now) {
  if (deployment.on_command_path(node)) {
    const auto order = order_in_memory(var, node + hold_suffix, now);
    return order ? std::optional(order->text) : std::nullopt;
  }
  const auto text = read_file(hold_file(var, node), 1024);
  if (text) return text->substr(0, text->find('\n'));
  std::error_code ec;
  if (std::filesystem::exists(hold_file(var, node), ec)) return "unreadable";
  return std::nullopt;
}

Result<void, std::string> hold(const VarPaths& var, const Deployment& deployment, const std::string& node,
                               const std::string& reason, MonotonicTime now) {
  const std::string line = reason.substr(0, reason.find('\n')).substr(0, 200);
  if (const auto end = end_of_order(deployment, node, now))
    return keep_in_memory(var, node + hold_suffix, {*end, line});
  if (const auto written = write_file_atomically(hold_file(var, node), line + "\n"); !written)
    return Err(written.error().message);
  return {};
}

DesiredState desired_state(const VarPaths& var, const Deployment& deployment, const std::string& node,
                           MonotonicTime now) {
  DesiredState desired;
  std::string text;
  if (deployment.on_command_path(node)) {
    if (auto order = order_in_memory(var, node + desired_suffix, now)) {
      text = std::move(order->text);
      desired.until = order->until;
    }
  } else {
    text = read_file(desired_file(var, node), 64).value_or("");
  }
  const auto state = ros::primary_state(text.substr(0, text.find('\n')));
  if (!state || *state == ros::State::finalized || *state == ros::State::active) return {};
  desired.state = *state;
  return desired;
}

Result<void, std::string> set_desired_state(const VarPaths& var, const Deployment& deployment,
                                            const std::string& node, ros::State state, MonotonicTime now) {
  const std::string text(label(state));
  if (const auto end = end_of_order(deployment, node, now)) {
    if (state == ros::State::active) return remove_from_memory(var, node + desired_suffix);
    return keep_in_memory(var, node + desired_suffix, {*end, text});
  }
  if (const auto written = write_file_atomically(desired_file(var, node), text + "\n"); !written)
    return Err(written.error().message);
  return {};
}

Result<void, std::string> release(const VarPaths& var, const std::string& node, milliseconds patience) {
  const MonotonicTime deadline = monotonic_now() + patience;
  auto lock = RestartLock::take(var, node);
  while (!lock && lock.error().held && monotonic_now() < deadline) {
    poll(nullptr, 0, 5);
    lock = RestartLock::take(var, node);
  }
  if (!lock) return Err(lock.error().text);
  if (const auto removed = remove_durably(hold_file(var, node));
      !removed && std::filesystem::exists(hold_file(var, node)))
    return Err(removed.error().message);
  if (const auto removed = remove_from_memory(var, node + hold_suffix); !removed) return removed;
  DeathHistory history = read_deaths(var, node);
  history.deaths.clear();
  history.total = 0;
  if (!write_deaths(var, node, history))
    return Err("cannot write below " + var.memory().string() + ": quarantine is not lifted");
  return {};
}

}  // namespace srfs::suite
