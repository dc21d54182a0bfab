// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/process.hpp"
#include "tests/signal_child.hpp"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace srfs::bench {
namespace {

namespace fs = std::filesystem;

double quantile(const std::vector<double>& sorted, double q) {
  const auto at = static_cast<std::size_t>(q * static_cast<double>(sorted.size()));
  return sorted[std::min(sorted.size() - 1, at)];
}

std::vector<double> sorted_part(const std::vector<double>& values, std::size_t part, std::size_t parts) {
  const auto at = [&](std::size_t n) {
    return values.begin() + static_cast<std::ptrdiff_t>(values.size() * n / parts);
  };
  std::vector<double> out(at(part), at(part + 1));
  std::sort(out.begin(), out.end());
  return out;
}

std::size_t entries(const fs::path& folder) {
  std::error_code ec;
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(folder, ec), fs::directory_iterator{}));
}

}  // namespace

Json summary(std::vector<double> values) {
  if (values.empty())
    return {{"p50", nullptr}, {"p90", nullptr}, {"p99", nullptr}, {"max", nullptr}, {"samples", 0}};
  std::sort(values.begin(), values.end());
  return {{"p50", quantile(values, 0.50)},
          {"p90", quantile(values, 0.90)},
          {"p99", quantile(values, 0.99)},
          {"max", values.back()},
          {"samples", values.size()}};
}

Json ratio(const std::vector<double>& ours, const std::vector<double>& peer) {
  constexpr std::size_t parts = 10;
  Json out;
  for (const auto& [name, q] : {std::pair{"p50", 0.50}, std::pair{"p90", 0.90}, std::pair{"p99", 0.99}}) {
    if (ours.empty() || peer.empty()) continue;
    out[name] = quantile(sorted_part(ours, 0, 1), q) / quantile(sorted_part(peer, 0, 1), q);
    if (std::min(ours.size(), peer.size()) < parts * 10) continue;
    std::vector<double> of_parts;
    for (std::size_t i = 0; i < parts; ++i)
      of_parts.push_back(quantile(sorted_part(ours, i, parts), q) / quantile(sorted_part(peer, i, parts), q));
    std::sort(of_parts.begin(), of_parts.end());
    out[std::string(name) + "_of_tenths"] = {of_parts.front(), of_parts[parts / 2], of_parts.back()};
  }
  return out;
}

Child::Child(std::vector<std::string> command, const fs::path& log) {
  std::vector<char*> argv;
  for (std::string& word : command) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  posix_spawn_file_actions_adddup2(&files, STDOUT_FILENO, STDERR_FILENO);
  posix_spawn_file_actions_addclosefrom_np(&files, 3);
  started_ = monotonic_now();
  const int error = posix_spawn(&pid_, argv[0], &files, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  if (error != 0) throw std::runtime_error(fmt::format("{}: {}", command[0], std::strerror(error)));
}

Child::Child(Child&& other) noexcept : pid_(std::exchange(other.pid_, -1)), started_(other.started_) {}

Child& Child::operator=(Child&& other) noexcept {
  std::swap(pid_, other.pid_);
  std::swap(started_, other.started_);
  return *this;
}

Child::~Child() {
  if (pid_ > 0) end(SIGKILL);
}

void Child::end(int signal, milliseconds patience) {
  if (pid_ <= 0) return;
  testing_support::signal_child(pid_, signal);
  const MonotonicTime kill_at = monotonic_now() + patience;
  int status = 0;
  while (waitpid(pid_, &status, WNOHANG) == 0) {
    if (monotonic_now() > kill_at) testing_support::signal_child(pid_, SIGKILL);
    const timespec pause{0, 1'000'000};
    nanosleep(&pause, nullptr);
  }
  pid_ = -1;
}

Memory memory_of(pid_t pid) {
  std::ifstream in(fmt::format("/proc/{}/smaps_rollup", pid));
  Memory memory;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string key;
    double kb = 0;
    words >> key >> kb;
    if (key == "Pss:") memory.pss_kb = kb;
    if (key == "Private_Dirty:") memory.private_dirty_kb = kb;
  }
  return memory;
}

nanoseconds cpu_time_of(pid_t pid) {
  std::int64_t sum = 0;
  std::error_code ec;
  for (const auto& task : fs::directory_iterator(fmt::format("/proc/{}/task", pid), ec)) {
    std::ifstream in(task.path() / "schedstat");
    std::int64_t on_cpu_ns = 0;
    in >> on_cpu_ns;
    sum += on_cpu_ns;
  }
  return nanoseconds(sum);
}

std::size_t descriptors_of(pid_t pid) {
  return entries(fmt::format("/proc/{}/fd", pid));
}

std::size_t threads_of(pid_t pid) {
  return entries(fmt::format("/proc/{}/task", pid));
}

std::vector<std::string> files_below(const fs::path& folder, bool deep) {
  std::vector<std::string> found;
  std::error_code ec;
  const auto options = fs::directory_options::skip_permission_denied;
  if (deep) {
    for (const auto& entry : fs::recursive_directory_iterator(folder, options, ec))
      found.push_back(entry.path());
  } else {
    for (const auto& entry : fs::directory_iterator(folder, options, ec)) found.push_back(entry.path());
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::string set_fifo(int priority) {
  sched_param parameter{};
  parameter.sched_priority = priority;
  if (sched_setscheduler(0, SCHED_FIFO, &parameter) == 0) return {};
  return fmt::format("SCHED_FIFO {}: {}", priority, std::strerror(errno));
}

void pin(int cpu) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(static_cast<unsigned>(cpu), &set);
  sched_setaffinity(0, sizeof set, &set);
}

}  // namespace srfs::bench
