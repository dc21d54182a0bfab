#include "ros/ring/node_record.hpp"

#include <cstdio>
#include <sstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include "base/file.hpp"
#include "ros/launcher.hpp"
#include "ros/node_versions.hpp"

namespace srfs::ros {
namespace {

std::filesystem::path deaths_file(const VarPaths& var, const std::string& node) {
  return var.memory() / (node + ".deaths");
}

std::filesystem::path hold_file(const VarPaths& var, const std::string& node) {
  return var.state(node) / "hold";
}

std::filesystem::path stand_in_file(const VarPaths& var, const std::string& node) {
  return var.memory() / (node + ".stand_in");
}

}  // namespace

DeathHistory read_deaths(const VarPaths& var, const std::string& node) {
  constexpr std::size_t largest = 32768;
  const auto text = read_file(deaths_file(var, node), largest);
  if (!text) return {};
  return decode_history(*text).value_or(DeathHistory{});
}

bool write_deaths(const VarPaths& var, const std::string& node, const DeathHistory& history) {
  return replace_in_memory(deaths_file(var, node), encode(history));
}

std::optional<StartingProcess> find_starting(const VarPaths& var, const std::string& node) {
  const auto started = last_started(var, node);
  if (!started) return std::nullopt;
  auto process = Process::open(started->pid);
  if (!process || process_start_ticks(started->pid) != started->start_ticks ||
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
  return ticks && replace_in_memory(stand_in_file(var, node),
                                    fmt::format("{} {} {} {}\n", getpid(), *ticks, until.ns(), by));
}

void end_stand_in(const VarPaths& var, const std::string& node) {
  std::error_code ec;
  std::filesystem::remove(stand_in_file(var, node), ec);
}

std::optional<StandIn> read_stand_in(const VarPaths& var, const std::string& node) {
  std::istringstream in(read_file(stand_in_file(var, node), 256).value_or(""));
  StandIn stand_in;
  std::int64_t until_ns = 0;
  if (!(in >> stand_in.pid >> stand_in.start_ticks >> until_ns >> stand_in.by)) return std::nullopt;
  stand_in.until = MonotonicTime(nanoseconds(until_ns));
  return stand_in;
}

std::optional<Process> find_overrun(const StandIn& stand_in, MonotonicTime now) {
  if (now < stand_in.until) return std::nullopt;
  auto process = Process::open(stand_in.pid);
  if (!process || process_start_ticks(stand_in.pid) != stand_in.start_ticks) return std::nullopt;
  return process;
}

std::optional<std::string> held_because(const VarPaths& var, const std::string& node) {
  const auto text = read_file(hold_file(var, node), 1024);
  if (text) return text->substr(0, text->find('\n'));
  std::error_code ec;
  if (std::filesystem::exists(hold_file(var, node), ec)) return "unreadable";
  return std::nullopt;
}

Result<void, std::string> hold(const VarPaths& var, const std::string& node, const std::string& reason) {
  const std::string line = reason.substr(0, reason.find('\n')).substr(0, 200);
  if (const auto written = write_file_atomically(hold_file(var, node), line + "\n"); !written)
    return Err(written.error().message);
  return {};
}

Result<void, std::string> set_desired_state(const VarPaths& var, const std::string& node, State state) {
  const auto written =
      write_file_atomically(var.state(node) / "desired_state", std::string(label(state)) + "\n");
  if (!written) return Err(written.error().message);
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
  DeathHistory history = read_deaths(var, node);
  history.deaths.clear();
  history.total = 0;
  if (!write_deaths(var, node, history))
    return Err("cannot write below " + var.memory().string() + ": quarantine is not lifted");
  return {};
}

}  // namespace srfs::ros
