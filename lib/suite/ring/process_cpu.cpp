// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/process_cpu.hpp"

#include <algorithm>
#include <array>
#include <charconv>

#include <fmt/format.h>
#include <unistd.h>

#include "base/background.hpp"
#include "base/file.hpp"
#include "base/process.hpp"

namespace srfs::suite {
namespace {

constexpr std::size_t most_threads = 64;  ///< of a node, which has about ten
constexpr seconds between_searches{1};
constexpr milliseconds longest_gap{500};  ///< between two readings in doubt
constexpr milliseconds computing{10};     ///< of CPU time without a pause; the work of a turn takes some 1 ms
constexpr std::size_t longest_name = 64;
constexpr std::size_t longest_status = 8192;

}  // namespace

std::optional<ProcessCpu> ProcessCpu::open(pid_t pid) {
  auto first = ThreadCpuFiles::open(pid, pid);
  if (!first) return std::nullopt;
  return ProcessCpu(pid, std::move(*first));
}

std::optional<ThreadCpu> ProcessCpu::read_thread(const ThreadCpuFiles& files, CpuWait& wait, bool doubt,
                                                 MonotonicTime now) {
  const auto cpu = files.read();
  if (!cpu) return std::nullopt;
  const bool runnable = (doubt || wait.equals_last(*cpu)) && files.state() == 'R';
  wait.on_reading(*cpu, runnable, now);
  return cpu;
}

std::optional<ThreadCpu> ProcessCpu::skip(Thread& thread, MonotonicTime now) {
  const auto cpu = thread.files.read();
  if (cpu) thread.wait.skip_to(*cpu, now);
  return cpu;
}

std::optional<CpuTotals> ProcessCpu::read(bool doubt, MonotonicTime now) {
  CpuTotals totals;
  // The calling thread runs: it is no sign of a wait that goes on.
  const auto cpu = read_thread(first_.files, first_.wait, doubt && pid_ != getpid(), now);
  if (!cpu) return std::nullopt;
  totals.ran = cpu->ran;
  totals.waited = first_.wait.total();
  if (doubt) middleware_waited_ += read_middleware(now);
  totals.any_waited = totals.waited + middleware_waited_;
  return totals;
}

/// The longest wait of a thread of the middleware since the call before. What the threads waited before the
/// doubt began excuses nothing.
nanoseconds ProcessCpu::read_middleware(MonotonicTime now) {
  if (now - found_ >= between_searches) find_threads(now);
  const bool goes_on = now - std::exchange(doubted_, now) <= longest_gap;
  nanoseconds most{0};
  for (auto entry = others_.begin(); entry != others_.end();) {
    Thread& thread = entry->second;
    const nanoseconds before = thread.wait.total();
    const bool lives =
        !thread.of_middleware ||
        (goes_on ? read_thread(thread.files, thread.wait, true, now) : skip(thread, now)).has_value();
    if (thread.of_middleware) most = std::max(most, thread.wait.total() - before);
    entry = lives ? std::next(entry) : others_.erase(entry);
  }
  return most;
}

bool ProcessCpu::is_runnable() const {
  return first_.files.state() == 'R' || std::any_of(others_.begin(), others_.end(), [](const auto& entry) {
           return entry.second.of_middleware && entry.second.files.state() == 'R';
         });
}

std::size_t ProcessCpu::count_busy_threads(MonotonicTime now) {
  find_threads(now);
  const auto before = std::exchange(counted_at_, now);
  std::size_t busy = 0;
  const auto count = [&](pid_t tid, Thread& thread) {
    const auto cpu = read_thread(thread.files, thread.counted_wait, false, now);
    if (!cpu) return false;
    busy += computes(tid, thread, *cpu, before ? now - *before : nanoseconds(0)) ? 1 : 0;
    return true;
  };
  count(pid_, first_);
  for (auto entry = others_.begin(); entry != others_.end();)
    entry = count(entry->first, entry->second) ? std::next(entry) : others_.erase(entry);
  return busy;
}

/// It is runnable all the time, and has run for a while without giving its CPU back of its own will: a thread
/// that only waited for a CPU to do a little does that at once. Without a CPU since the call before, it is
/// what it was then.
bool ProcessCpu::computes(pid_t tid, Thread& thread, const ThreadCpu& cpu, nanoseconds elapsed) const {
  constexpr double all_the_time = 0.5;  // a wait that goes on shows late: the kernel adds it when it ends
  const Counted counted{cpu, thread.counted_wait.total()};
  const auto then = std::exchange(thread.counted, counted);
  const nanoseconds ran = then ? cpu.ran - then->cpu.ran : nanoseconds(0);
  const auto wanted = then ? static_cast<double>((ran + counted.waited - then->waited).count()) : 0;
  const bool is_new = !then && thread.files.state() == 'R';
  const bool runnable = wanted >= all_the_time * static_cast<double>(elapsed.count());
  if (!is_new && (!runnable || is_behind_others(tid))) {
    thread.stint.reset();
    return false;
  }
  if (is_new || ran > nanoseconds(0)) {
    const auto yields = count_yields(tid);
    if (!yields)
      thread.stint.reset();
    else if (!thread.stint || thread.stint->yields != *yields)
      thread.stint = Stint{*yields, cpu.ran};
  }
  return thread.stint && cpu.ran - thread.stint->begin >= computing;
}

/// How often the thread gave its CPU back of its own will.
std::optional<std::uint64_t> ProcessCpu::count_yields(pid_t tid) const {
  constexpr std::string_view key = "\nvoluntary_ctxt_switches:\t";
  const auto status = read_file(fmt::format("/proc/{}/task/{}/status", pid_, tid), longest_status);
  const auto at = status ? status->find(key) : std::string::npos;
  if (at == std::string::npos) return std::nullopt;
  std::uint64_t count = 0;
  const char* const begin = status->data() + at + key.size();
  if (std::from_chars(begin, status->data() + status->size(), count).ec != std::errc()) return std::nullopt;
  return count;
}

void ProcessCpu::find_threads(MonotonicTime now) {
  found_ = now;
  const std::string tasks = fmt::format("/proc/{}/task", pid_);
  const auto name_of = [&](pid_t tid) {
    return read_file(fmt::format("{}/{}/comm", tasks, tid), longest_name).value_or("");
  };
  std::erase_if(others_, [](const auto& entry) { return !entry.second.files.read(); });  // they have ended
  std::string own;
  for_each_thread(pid_, [&](pid_t tid) {
    if (tid == pid_ || others_.contains(tid)) return true;
    if (own.empty()) own = name_of(pid_);
    if (auto files = ThreadCpuFiles::open(pid_, tid))
      others_.emplace(tid, Thread{std::move(*files), {}, name_of(tid) == own});
    return others_.size() < most_threads;
  });
}

}  // namespace srfs::suite
