// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/cpu_wait.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <ctime>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

namespace srfs {
namespace {

/// The kernel's slowest tick is 10 ms (CONFIG_HZ=100).
constexpr milliseconds shortest_proof{20};
constexpr milliseconds user_tick{10};  ///< USER_HZ

std::optional<std::uint64_t> take_number(std::string_view& text) {
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return value;
}

Fd open_for_reading(const char* path) {
  return Fd(open(path, O_RDONLY | O_CLOEXEC));
}

template <std::size_t size>
std::string_view read_again(const Fd& file, std::array<char, size>& buffer) {
  const ssize_t n = pread(file.get(), buffer.data(), buffer.size(), 0);
  return {buffer.data(), n > 0 ? static_cast<std::size_t>(n) : 0};
}

/// Asked once: by a thread that runs. The kernel adds to a running thread's time at its own ticks only, and
/// when its clock is read: a young thread has zeros until then.
bool kernel_counts() {
  static const bool counts = [] {
    std::array<char, 96> buffer{};
    timespec used{};
    (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
    const Fd own = open_for_reading("/proc/thread-self/schedstat");
    const auto reading = own ? parse_schedstat(read_again(own, buffer)) : std::nullopt;
    return reading && is_counted(*reading);
  }();
  return counts;
}

}  // namespace

std::optional<ThreadCpu> parse_schedstat(std::string_view text) {
  const auto ran = take_number(text);
  const auto waited = take_number(text);
  const auto stints = take_number(text);
  if (!ran || !waited || !stints) return std::nullopt;
  return ThreadCpu{nanoseconds(*ran), nanoseconds(*waited), *stints};
}

// ---- ThreadCpuFiles

std::optional<ThreadCpuFiles> ThreadCpuFiles::open(pid_t pid, pid_t tid) {
  std::array<char, 64> path{};
  *fmt::format_to_n(path.data(), path.size() - 1, "/proc/{}/task/{}/schedstat", pid, tid).out = '\0';
  Fd schedstat = open_for_reading(path.data());
  *fmt::format_to_n(path.data(), path.size() - 1, "/proc/{}/task/{}/stat", pid, tid).out = '\0';
  Fd stat = open_for_reading(path.data());
  if (!schedstat || !stat) return std::nullopt;
  ThreadCpuFiles files(std::move(schedstat), std::move(stat));
  if (!files.read() || !kernel_counts()) return std::nullopt;
  return files;
}

std::optional<ThreadCpuFiles> ThreadCpuFiles::open_own() {
  return open(getpid(), gettid());
}

std::optional<ThreadCpu> ThreadCpuFiles::read() const {
  std::array<char, 96> buffer{};
  return parse_schedstat(read_again(schedstat_, buffer));
}

std::optional<char> ThreadCpuFiles::state() const {
  std::array<char, 128> buffer{};
  const std::string_view text = read_again(stat_, buffer);
  const auto name_end = text.rfind(')');  // the name may hold anything, also ')'
  if (name_end == std::string_view::npos || name_end + 2 >= text.size()) return std::nullopt;
  return text[name_end + 2];
}

// ---- CpuWait

void CpuWait::on_reading(const ThreadCpu& cpu, bool runnable, MonotonicTime now) {
  if (!last_) {
    last_ = cpu;
    last_at_ = now;
    return;
  }
  const bool moved = cpu != *last_;
  if (!moved && now - last_at_ < shortest_proof) return;
  if (moved) {
    // What was counted while it went on is a part of what the kernel added now.
    const nanoseconds added = std::max(cpu.waited - last_->waited - counted_, nanoseconds(0));
    // Runnable, it may have waited ever since it last ran.
    const nanoseconds neither = now - last_at_ - (cpu.ran - last_->ran) - added;
    counted_ = runnable && neither >= shortest_proof ? neither : nanoseconds(0);
    total_ += added + counted_;
  } else if (runnable) {
    total_ += now - last_at_;
    counted_ += now - last_at_;
  }
  last_ = cpu;
  last_at_ = now;
}

void CpuWait::skip_to(const ThreadCpu& cpu, MonotonicTime now) {
  last_ = cpu;
  last_at_ = now;
  counted_ = nanoseconds(0);
}

// ---- CpuHistory

void CpuHistory::add(MonotonicTime now, const CpuTotals& totals) {
  points_.push_back({now, totals});
  if (points_.size() <= most_points) return;
  // Every second one of the older half goes, never the first one.
  std::size_t kept = 0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (i < most_points / 2 && i % 2 == 1) continue;
    points_[kept++] = points_[i];
  }
  points_.resize(kept);
}

CpuTotals CpuHistory::since(MonotonicTime since) const {
  if (points_.empty()) return {};
  const auto after = std::upper_bound(points_.begin(), points_.end(), since,
                                      [](MonotonicTime t, const Point& p) { return t < p.at; });
  const CpuTotals& then = (after == points_.begin() ? after : after - 1)->totals;
  const Point& last = points_.back();
  const CpuTotals& next = (after == points_.end() ? last : *after).totals;
  const nanoseconds distance = std::max(last.at - since, nanoseconds(0));
  const auto waited = [&](nanoseconds CpuTotals::*of) {
    return std::clamp(last.totals.*of - then.*of, nanoseconds(0), distance);
  };
  return {waited(&CpuTotals::waited), last.totals.ran - next.ran, waited(&CpuTotals::any_waited)};
}

// ---- StolenTime

nanoseconds StolenTime::on_reading(std::string_view proc_stat) {
  constexpr int steal_field = 7;  // of user, nice, system, idle, iowait, irq, softirq, steal
  nanoseconds most{0};
  while (proc_stat.starts_with("cpu")) {
    const auto line_end = proc_stat.find('\n');
    if (line_end == std::string_view::npos) break;  // cut
    std::string_view line = proc_stat.substr(0, line_end);
    proc_stat.remove_prefix(line_end + 1);
    if (line.starts_with("cpu ")) continue;  // the sum of all
    line.remove_prefix(std::string_view("cpu").size());
    const auto cpu = take_number(line);
    std::optional<std::uint64_t> stolen;
    for (int field = 0; field <= steal_field; ++field) stolen = take_number(line);
    if (!cpu || !stolen || *cpu >= most_cpus) continue;
    if (*cpu >= last_.size()) last_.resize(*cpu + 1);
    std::optional<std::uint64_t>& last = last_[*cpu];
    if (last && *stolen > *last) most = std::max<nanoseconds>(most, (*stolen - *last) * user_tick);
    last = stolen;
  }
  total_ += most;
  return total_;
}

}  // namespace srfs
